# vkt view: vkt render in a window, with its options; viewer.bats looks into the window.
load helper

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
    local what
    for what in Xvfb xdotool; do command -v $what >/dev/null || skip "$what is not installed"; done
    (unset DISPLAY WAYLAND_DISPLAY && vkt view v.nrrd) 2>&1 | grep -q 'without the viewer' && skip 'built without the viewer'
    Xvfb -displayfd 7 -screen 0 400x300x24 -nolisten tcp -noreset 7>number >server.log 2>&1 3>&- &
    server=$!
    for _ in {1..100}; do [ -s number ] && break; sleep 0.1; done
    [ -s number ] || skip "Xvfb does not start: $(tail -n 1 server.log)"
    export DISPLAY=":$(cat number)"
    for line in 'vkt view v.nrrd --size 64x48' 'vkt flip x v.nrrd | vkt view --size 64x48'; do
        bash -o pipefail -c "$line" >out 2>log 3>&- &
        command=$!
        window=
        for _ in {1..150}; do
            window=$(xdotool search --name '^vkt ' 2>/dev/null | head -n 1)
            # It has a name before it can be typed at.
            [ -n "$window" ] && xdotool windowfocus "$window" 2>/dev/null && break
            sleep 0.1
        done
        [ -n "$window" ] || { cat log >&2; false; }
        xdotool key q
        wait "$command"
        [ ! -s out ]
    done
}

teardown() {
    [ -z "${server:-}" ] || { kill "$server" 2>/dev/null && wait "$server"; } || true
}
