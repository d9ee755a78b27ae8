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
    [ "$(completes convert --device g)" = $'gpu\ngpu:all' ]
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
    sed -i "s/^words=.*/words=(vkt pipe \"'read v.nrrd | cro\") CURRENT=3/" session.zsh
    run zsh -f session.zsh
    [ "$output" = "read v.nrrd | crop" ]
}

@test "fish completes a verb" {
    command -v fish >/dev/null || skip "fish is not installed"
    export XDG_CONFIG_HOME="$BATS_TEST_TMPDIR" XDG_DATA_HOME="$BATS_TEST_TMPDIR"
    run fish --no-config -c "source $VKT_ROOT/shell/completion/vkt.fish; complete -C 'vkt filter ga'"
    [[ "$output" == gaussian* ]]
    run fish --no-config -c "source $VKT_ROOT/shell/completion/vkt.fish; complete -C \"vkt pipe 'read v.nrrd | cro\""
    [[ "$output" == *"read v.nrrd | crop"* ]]
}

@test "views and the variables of the file on the line are completed" {
    completes render v.nrrd --view '' | sort >offered
    printf '%s\n' oblique x -x y -y z -z | sort | diff - offered
    [ "$(completes render --view ob)" = oblique ]
    needs_data amr
    completes read "$VKT_DATA/amr/plt_eb_3d" --variable '' | sort >offered
    printf '%s\n' density volFrac | diff - offered
    [ "$(completes read --roi :,:,: "$VKT_DATA/amr/plt_eb_3d" --variable de)" = density ]
    vkt make ramp --dims 2 2 2 -o ramp.nrrd
    [ -z "$(vkt completion --words read ramp.nrrd --variable '')" ]
    [ -z "$(vkt completion --words read nowhere --variable '')" ]
}

@test "the inside of vkt pipe is completed as the commands are" {
    touch volume.nrrd
    [ "$(completes pipe "'rea")" = read ]
    [ "$(completes pipe "'read volume.nrrd | cr")" = "read volume.nrrd | crop" ]
    [ "$(completes pipe "'read volume.nrrd|cr")" = "read volume.nrrd|crop" ]
    [ "$(completes pipe '"read volume.nrrd | vkt filter ga')" = "read volume.nrrd | vkt filter gaussian" ]
    [ "$(completes pipe "'read volume.nrrd | filter gaussian --bou")" = "read volume.nrrd | filter gaussian --boundary" ]
    [ "$(completes pipe "'read volume.nrrd | filter gaussian --boundary mi")" = "read volume.nrrd | filter gaussian --boundary mirror" ]
    [ "$(completes pipe "'read vol")" = "read volume.nrrd" ]
    [ "$(completes pipe -n "'read volume.nrrd | convert --device gpu:")" = "read volume.nrrd | convert --device gpu:all" ]
    [ "$(completes pipe --thr)" = --threads ]
    # What cannot be part of a pipeline is no candidate.
    completes pipe "'" >offered
    grep -qx crop offered
    run ! grep -x 'pipe\|help\|completion\|shm' offered
    # A word in quotes of its own within the pipeline goes on as it is.
    [ -z "$(vkt completion --words pipe "'read \"vol")" ]
}

@test "an interactive bash completes within the quotes" {
    python3 - "$VKT_ROOT/shell/completion/vkt.bash" <<'END'
import os, pty, select, sys, time
pid, terminal = pty.fork()
if pid == 0: os.execvp("bash", ["bash", "--norc", "--noprofile", "-i"])
seen = b""
def until(text):
    global seen
    end = time.time() + 60
    while text not in seen and time.time() < end:
        if select.select([terminal], [], [], 1)[0]: seen += os.read(terminal, 65536)
    assert text in seen, seen
os.write(terminal, b"PS1='ready''> '; source '" + sys.argv[1].encode() + b"'\n")
until(b"ready> ")
os.write(terminal, b"vkt pipe 'read v.nrrd | cro\t")
until(b"| crop")
os.write(terminal, b"\x15vkt render --view obl\t")
until(b"oblique")
os.close(terminal)
END
}

@test "stress and chart complete a pipeline, stress the names of volumes and damages" {
    [ "$(vkt completion --words stress 'filter gau')" = "filter gaussian" ]
    [ "$(vkt completion --words chart 'filter gaussian --si')" = "filter gaussian --sigma" ]
    [ "$(vkt completion --words slim v.nrrd --for 'filter gaussian --si')" = "filter gaussian --sigma" ]
    [ "$(vkt completion --words stress --volume nan-float | sort | tr '\n' ' ')" = "nan-float16 nan-float32 nan-float64 " ]
    [ "$(vkt completion --words stress --volume single --damage slab-t)" = slab-twice ]
}
