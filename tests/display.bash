# A display of our own, for tests of windows.

# starts_display COMMAND: COMMAND opens a window. Starts a server, or skips with the reason.
starts_display() {
    local what
    for what in Xvfb xdotool; do
        command -v $what >/dev/null || skip "$what is not installed"
    done
    (unset DISPLAY WAYLAND_DISPLAY && "$@") >nowhere 2>&1 || true
    if grep -q 'without the viewer' nowhere; then skip 'this vkt was built without the viewer'; fi
    # The server takes a number that is free and says which; its screen is a file that can be read. It must not start anew
    # when its last client leaves: xdotool comes and goes, and a viewer that comes just then is turned away.
    mkdir screen
    Xvfb -displayfd 7 -screen 0 800x700x24 -nolisten tcp -noreset -fbdir screen 7>number >server.log 2>&1 3>&- &
    server=$!
    for _ in {1..100}; do
        [ ! -s number ] || break
        sleep 0.1
    done
    [ -s number ] || skip "Xvfb does not start: $(tail -n 1 server.log)"
    export DISPLAY=":$(cat number)"
    unset WAYLAND_DISPLAY
}

# finds_window [PATTERN]: waits for a window whose title holds the pattern and gives it the keyboard, as $window. It has a
# name before it can be typed at.
finds_window() {
    for _ in {1..150}; do
        window=$(xdotool search --name "^vkt .*${1:-}" 2>/dev/null | head -n 1)
        if [ -n "$window" ] && xdotool windowfocus "$window" 2>/dev/null; then return; fi
        sleep 0.1
    done
    echo "no window with '${1:-}' in its title; the command said: $(cat log)" >&2
    return 1
}

teardown() {
    for process in "${command:-}" "${server:-}"; do
        [ -z "$process" ] || kill "$process" 2>/dev/null || true
    done
    # A server that ends takes its socket along: by then the next one must not have the same number.
    [ -z "${server:-}" ] || wait "$server" || true
}
