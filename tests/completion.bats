# Completion: candidates that vkt prints, and the thin files that hand them to bash, zsh and fish.
load helper

# completes WORDS…: what the bash function offers for the last word.
completes() {
    local COMP_WORDS=(vkt "$@") COMP_CWORD=$#
    local COMPREPLY=()
    # shellcheck source=/dev/null
    source "$VKT_ROOT/shell/completion/vkt.bash"
    _vkt
    printf '%s\n' "${COMPREPLY[@]}"
}

@test "verbs are completed" {
    run completes cr
    [ "$output" = crop ]
}

@test "every verb is offered for an empty word" {
    completes '' | sort >offered
    vkt help --list | cut -d' ' -f1 | sort -u >verbs
    diff verbs offered
}

@test "sub-verbs are completed" {
    run completes filter ga
    [ "$output" = gaussian ]
}

@test "options of a verb are completed, its own and common ones" {
    run completes crop --ro
    [[ "$output" == *--roi* ]]
    run completes crop --th
    [ "$output" = --threads ]
    for verb in info read "flip x" diff; do
        # shellcheck disable=SC2086
        [ "$(completes $verb --tru)" = --trust-paths ]
    done
}

@test "options of a sub-verb are completed" {
    run completes filter gaussian --sig
    [ "$output" = --sigma ]
}

@test "values of an option are completed" {
    run completes filter gaussian --boundary mi
    [ "$output" = mirror ]
}

@test "positional values are completed" {
    completes flip '' | sort >offered
    printf '%s\n' x y z | diff - offered
}

@test "values known to the program are completed" {
    [ "$(completes convert --device g)" = gpu ]
    completes flip x --format n | grep -qx nrrd
    completes write --format v | grep -qx vkt
    completes read --format r | grep -qx raw
    [ -z "$(completes read --format vk)" ]
    completes render --colormap v | grep -qx viridis
    [ "$(completes convert --range m)" = minmax ]
    [ "$(completes flip --ax)" = --axis ]
}

@test "help and completion complete what they take" {
    [ "$(completes help cr)" = crop ]
    [ "$(completes help filter ga)" = gaussian ]
    [ "$(completes completion z)" = zsh ]
}

@test "files are offered where no candidate is" {
    touch 'one file.nrrd'
    run completes info one
    [ "$output" = 'one file.nrrd' ]
}

@test "no candidates for nonsense, and no message" {
    run --separate-stderr vkt completion --words crop --no-such-opt
    [ "$status" -eq 0 ]
    [ -z "$output" ] && [ -z "$stderr" ]
}

@test "vkt completion SHELL prints the file that is installed" {
    vkt completion bash | diff - "$VKT_ROOT/shell/completion/vkt.bash"
    vkt completion zsh | diff - "$VKT_ROOT/shell/completion/_vkt"
    vkt completion fish | diff - "$VKT_ROOT/shell/completion/vkt.fish"
    fails_with 2 "tcsh" vkt completion tcsh
}

@test "bash takes the file" {
    bash -n "$VKT_ROOT/shell/completion/vkt.bash"
}

@test "zsh completes a verb" {
    command -v zsh >/dev/null || skip "zsh is not installed"
    cat >session.zsh <<EOF
fpath=($VKT_ROOT/shell/completion \$fpath)
autoload -Uz compinit && compinit -u -D
words=(vkt filter ga) CURRENT=3
compadd() { shift; print -l -- "\$@" }
_files() { print files }
autoload -Uz _vkt && _vkt
EOF
    run zsh -f session.zsh
    [[ "$output" == *gaussian* ]]
}

@test "fish completes a verb" {
    command -v fish >/dev/null || skip "fish is not installed"
    export XDG_CONFIG_HOME="$BATS_TEST_TMPDIR" XDG_DATA_HOME="$BATS_TEST_TMPDIR"
    run fish --no-config -c "source $VKT_ROOT/shell/completion/vkt.fish; complete -C 'vkt filter ga'"
    [[ "$output" == gaussian* ]]
}
