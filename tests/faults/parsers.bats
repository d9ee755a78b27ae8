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

# A FLASH file of 15 blocks on two levels, as h5py writes it: chunked and compressed, or as it comes.
make_flash() {
    python_with h5py numpy
    /usr/bin/python3 - "$@" <<'P'
import h5py, numpy as np, sys
levels, lower, size, kind = [], [], [], []
def add(level, at, leaf):
    levels.append(level); size.append([1.0 / 2 ** (level - 1)] * 3); lower.append(at); kind.append(1 if leaf else 2)
add(1, (0, 0, 0), False)
for i in range(8):
    at = (i % 2 / 2, i // 2 % 2 / 2, i // 4 / 2)
    add(2, at, i != 3)
    if i == 3:
        for k in range(8):
            add(3, (at[0] + k % 2 / 4, at[1] + k // 2 % 2 / 4, at[2] + k // 4 / 4), True)
n, size, lower = len(levels), np.array(size), np.array(lower)
with h5py.File("tree.flash", "w") as f:
    f["refine level"] = np.array(levels, np.int32)
    f["node type"] = np.array(kind, np.int32)
    f["gid"] = np.zeros((n, 15), np.int32)
    f["block size"] = size
    f["bounding box"] = np.stack([lower, lower + size], axis=2)
    f["sim info"] = np.array([(9,)], dtype=[("file format version", np.int32)])
    scalars = [(name.ljust(80).encode(), value) for name, value in (("nxb", 4), ("nyb", 4), ("nzb", 4), ("globalnumblocks", n))]
    f["integer scalars"] = np.array(scalars, dtype=[("name", "S80"), ("value", np.int32)])
    f["unknown names"] = np.array([[b"dens"]], dtype="S4")
    cells = np.random.default_rng(1).random((n, 4, 4, 4))
    options = dict(chunks=(4, 4, 4, 4), compression="gzip") if "packed" in sys.argv else {}
    f.create_dataset("dens", data=cells, **options)
P
    vkt info tree.flash --variable dens >/dev/null 2>&1 || vkt info tree.flash >/dev/null
}

mutate() { /usr/bin/python3 "$VKT_ROOT/tests/faults/mutate.py" "$1" "${VKT_FAULT_COPIES:-200}" >&3; }

@test "damaged OpenVDB files" {
    make_vdb
    mutate ball.vdb
}

@test "damaged FLASH files" {
    make_flash
    mutate tree.flash
}

@test "damaged FLASH files with compressed cells" {
    make_flash packed
    mutate tree.flash
}

@test "what h5py writes is read: compressed cells come through the child, others from the file" {
    make_flash packed
    vkt read tree.flash | vkt resample --method nearest --scale 1 -o packed.nrrd
    make_flash
    vkt read tree.flash | vkt resample --method nearest --scale 1 | vkt diff - packed.nrrd
    /usr/bin/python3 -c "
import numpy as np
print(np.random.default_rng(1).random((17, 4, 4, 4))[[k for k in range(1, 17) if k != 4]].max())" >largest
    vkt stats packed.nrrd --json | /usr/bin/python3 -c "
import json, sys
assert json.load(sys.stdin)['max'] == float(open('largest').read())"
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

@test "a child that dies is exit 3 and one line, at any time" {
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
        [ "$(wc -l <err)" -eq 1 ]
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
    vkt read - <ball.vdb | vkt diff - <(vkt read ball.vdb)
    head -c 300 ball.vdb >cut.vdb
    fails_with 3 "standard input" vkt read - <cut.vdb
}

@test "a patience that is no number is refused" {
    make_vdb
    VKT_PARSER_PATIENCE=soon fails_with 2 "soon" vkt read ball.vdb
    VKT_PARSER_PATIENCE=0 fails_with 2 "VKT_PARSER_PATIENCE" vkt read ball.vdb
}
