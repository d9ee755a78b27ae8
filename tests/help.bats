# vkt help: lists, explains and finds commands; every way to ask gives the same text.
load helper

@test "lists every command" {
    vkt help --list >list
    for page in "$VKT_ROOT"/man/vkt-*.1; do
        verb=$(basename "$page" .1)
        grep -Eqx "${verb#vkt-}( .*)?" list
    done
    diff <(vkt help | sed -n 's/^  \([a-z-]*\)  *[A-Z].*/\1/p' | sort) <(cut -d' ' -f1 list | sort -u)
}

@test "help COMMAND is COMMAND --help" {
    for verb in $(vkt help --list); do diff <(vkt help "$verb") <(vkt "$verb" --help); done
    diff <(vkt help) <(vkt --help)
}

@test "the usage names each input once" {
    for verb in stats write chart; do
        vkt help $verb | grep '^Usage: ' >usage
        run ! grep -E '(\[IN\].*\[IN\]|\[VOLUME\].*\[IN\])' usage
    done
    vkt help diff | grep -q '^Usage: vkt diff \[IN\] \[IN\] \[options\]$'
}

@test "help reads no input and leaves none" {
    vkt crop --help </dev/null >/dev/null
    run vkt stats --help
    [ "$status" -eq 0 ]
    [ -z "$(vkt --version 2>&1 >/dev/null)" ]
}

@test "finds by a word" {
    vkt help --search mirror | grep -q '^ *flip'
    run -1 vkt help --search threshold-of-nothing
    [ "$(vkt help --search MIRROR)" = "$(vkt help --search mirror)" ]
}

@test "finds by what others call it" {
    vkt help --search blur | grep -q '^ *filter gaussian'
    vkt help --search downsample | grep -q '^ *resample'
    vkt help --search thumbnail | grep -q '^ *render'
    vkt help --search binarize | grep -q '^ *threshold'
}

@test "an unknown command is corrected" {
    fails_with 2 "crop" vkt help corp
    fails_with 2 "crop" vkt corp
    fails_with 2 "" vkt
}

@test "common options are listed" { vkt help --common | grep -q -- '--transport'; }

@test "help is wrapped to the terminal, its commands are not" {
    for columns in 40 44 50 70; do
        script -qec "stty cols $columns; vkt render --help" /dev/null </dev/null | tr -d '\r' >out
        # A word may be longer than a line.
        [ "$(grep -v '^  vkt\|^  #' out | awk -v most=$columns 'length($0) > most' | sed 's/^ *//' | grep -c ' ' || true)" -eq 0 ]
    done
    grep -q '^  vkt render volume.nrrd --render-algo multi-scattering --spp 16 --size 256 -o picture.png$' out
    # Elsewhere lines are as long as they are.
    vkt render --help | awk 'length($0) > 100' | grep -q .
}
