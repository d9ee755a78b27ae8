# Files that foreign libraries read: whatever is in them, vkt says one line, keeps its limits and leaves nothing.
# VKT_FAULT_COPIES sets how many damaged copies of each are read (200 by default).
load ../helper

# In a session of its own some leave a process that is about to end.
soon() {
    for _ in $(seq 100); do "$@" 2>/dev/null && return; sleep 0.05; done
    "$@"
}
gone() { [ ! -e "/proc/$1" ] || grep -q '^State:.Z' "/proc/$1/status"; }

# child_of PID: its process that parses.
child_of() { pgrep -P "$1" vkt_parser; }

make_vdb() {
    vkt make sphere --dims 24 20 16 --dtype float32 --radius 6 -o ball.nrrd
    vkt write ball.nrrd ball.vdb 2>err || { grep -q 'OpenVDB' err && skip 'built without OpenVDB'; cat err >&2; false; }
}

mutate() { /usr/bin/python3 "$VKT_ROOT/tests/faults/mutate.py" "$1" "${VKT_FAULT_COPIES:-200}" "${@:2}" >&3; }

@test "damaged OpenVDB files" {
    make_vdb
    mutate ball.vdb
}

@test "damaged FLASH files" {
    for name in amr/flash/laminartest_hdf5_plt_cnt_0000 amr/flash/blast2_hdf5_chk_0018; do
        needs_data $name
        cp "$VKT_DATA/$name" "${name##*/}.flash"
        vkt info "${name##*/}.flash" >info 2>err || { grep -q HDF5 err && skip 'built without HDF5'; cat err >&2; false; }
        mutate "${name##*/}.flash" --variable dens
    done
}

@test "a file that asks for more memory than there may be is refused in one line" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers map terabytes, so their builds have no limit"
    make_vdb
    # The length of the grid's type name, a word of 32 bits before it.
    /usr/bin/python3 -c "
b = bytearray(open('ball.vdb', 'rb').read())
at = b.index(b'Tree_float_5_4_3') - 4
b[at:at + 4] = (0xFFFFFFF0).to_bytes(4, 'little')
open('greedy.vdb', 'wb').write(b)"
    fails_with 3 "asks for more than 320.0 MiB of memory" vkt read greedy.vdb --memory 64M
    [ "$(grep -vc 'hint:' <<<"$stderr")" -eq 1 ]
}

@test "the child ends with the command, also when that is killed" {
    make_vdb
    vkt make noise --dims 128 128 128 --dtype float32 | vkt write noise.vdb
    for signal in KILL TERM; do
        mkfifo pipe.$signal
        vkt read noise.vdb >pipe.$signal 2>/dev/null 3>&- &
        local reader=$!
        exec 9<pipe.$signal # nobody reads, so it waits with its child
        soon child_of $reader >/dev/null
        local child
        child=$(child_of $reader)
        kill -$signal $reader
        wait $reader || true
        soon gone "$child"
        exec 9<&-
    done
}

@test "a child that dies is exit 3 and one line with its hint, at any time" {
    make_vdb
    vkt make noise --dims 128 128 128 --dtype float32 | vkt write noise.vdb
    for signal in SEGV ABRT; do
        mkfifo pipe.$signal
        vkt read noise.vdb >pipe.$signal 2>err 3>&- &
        local reader=$!
        exec 9<pipe.$signal
        soon child_of $reader >/dev/null
        head -c 2000000 <&9 >/dev/null # it is amid the cells
        kill -$signal "$(child_of $reader)"
        cat <&9 >/dev/null
        exec 9<&-
        status=0
        wait $reader || status=$?
        cat err
        [ $status -eq 3 ]
        [ "$(grep -vc hint: err)" -eq 1 ]
        grep -q "noise.vdb.*crashed (SIG$signal)" err
    done
}

@test "what is typed at the terminal is not for the child" {
    make_vdb
    vkt make noise --dims 128 128 128 --dtype float32 | vkt write noise.vdb
    mkfifo pipe
    vkt read noise.vdb >pipe 3>&- &
    local reader=$!
    exec 9<pipe
    soon child_of $reader >/dev/null
    [ "$(ps -o pgid= -p "$(child_of $reader)")" -ne "$(ps -o pgid= -p $reader)" ]
    # Nor does it hold any descriptor that others wait for.
    for fd in "/proc/$(child_of $reader)/fd"/*; do [[ "$(readlink "$fd")" != pipe:* && "$(readlink "$fd")" != */pipe ]]; done
    exec 9<&-
    wait $reader || true
}

@test "a file on standard input is read by the child, too" {
    make_vdb
    vkt read ball.vdb -o expected.vkt
    vkt read - <ball.vdb | cmp - expected.vkt
    head -c 300 ball.vdb >cut.vdb
    fails_with 3 "standard input" vkt read - <cut.vdb
}

@test "a patience that is no number is refused" {
    make_vdb
    VKT_PARSER_PATIENCE=soon fails_with 2 "soon" vkt read ball.vdb
    VKT_PARSER_PATIENCE=0 fails_with 2 "VKT_PARSER_PATIENCE" vkt read ball.vdb
}
