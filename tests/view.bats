# vkt view: vkt render in a window, with its options; viewer.bats looks into the window.
load helper
load display

setup_more() { vkt make noise --dims 9 7 5 --dtype uint8 -o v.nrrd; }

@test "without a display it says what render says, and plans without one" {
    (unset DISPLAY WAYLAND_DISPLAY && vkt render --window v.nrrd) 2>want || code=$?
    run --separate-stderr env -u DISPLAY -u WAYLAND_DISPLAY vkt view v.nrrd
    [ "$status" -eq "$code" ]
    [ "${stderr//vkt view/vkt render}" = "$(cat want)" ]
    [ -z "$output" ]
    [[ "$stderr" == *"hint: vkt render -o FILE"* ]] # view itself has no -o
    env -u DISPLAY -u WAYLAND_DISPLAY vkt view v.nrrd --iso 100 --ra implicit-iso -n 2>plan
    grep -q '^vkt view: ' plan
    for words in '-o picture.png' '--window' '--format png'; do
        # shellcheck disable=SC2086
        fails_with 2 'unknown option' vkt view v.nrrd $words
    done
    fails_with 2 '--step' vkt view v.nrrd --step -1
}

@test "the window opens on a file and at the end of a pipeline, and q ends it with 0" {
    starts_display vkt view v.nrrd
    for line in 'vkt view v.nrrd --size 64x48' 'vkt flip x v.nrrd | vkt view --size 64x48'; do
        bash -o pipefail -c "$line" >out 2>log 3>&- &
        command=$!
        finds_window
        xdotool key q
        wait "$command"
        [ ! -s out ]
    done
}

@test "options of pictures in files are none of a window's" {
    vkt make ramp --dims 4 4 4 -o a.nrrd
    for option in "--tolerance 1" "--annotate" "--orbit 4" "--tiles 1/2" "--depth 16"; do
        fails_with 2 "unknown option" vkt view $option a.nrrd
    done
}
