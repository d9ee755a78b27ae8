# Volumes in named segments of shared memory: whole or not at all, their owner's alone, read without a copy.
# shellcheck disable=SC2086,SC2154,SC2094  # $seg is one word of letters, digits and dots
load helper

# Names of this test alone: other tests, and people, have segments of their own.
setup_more() {
    seg=test.$$.$BATS_TEST_NUMBER
    folder=/dev/shm
    mine=$folder/vkt.$(id -u).$seg
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
    vkt make noise --dims 40 30 20 --dtype uint16 --seed 3 -o noise.nrrd
    vkt set noise.nrrd --spacing 0.5,1,2 --origin -3,4,5.5 --no-history -o in.nrrd
}
teardown() { if [ -n "$seg" ]; then rm -rf $folder/*".$seg"*; fi; }

# The compressed levels of a PNG, without the recipe that stands beside them.
picture() { /usr/bin/python3 -c '
import struct, sys
data, at = open(sys.argv[1], "rb").read(), 8
while at < len(data):
    n, kind = struct.unpack(">I4s", data[at:at + 8])
    if kind in (b"IHDR", b"IDAT"): sys.stdout.buffer.write(data[at:at + n + 12])
    at += n + 12' "$1"; }
voxels() { vkt write "$1" - --format raw; }
# What is below /dev/shm of this test, also under names that are hidden.
left() { find $folder -mindepth 1 -name "*$seg*"; }
# A private /dev/shm of so many KiB for a command, with which nothing of anybody else's can be harmed.
in_small_memory() {
    local size="$1"
    shift
    unshare -m sh -c 'mount -t tmpfs -o size='"$size"'k small /dev/shm && exec "$@"' sh "$@"
}
needs_private_memory() { in_small_memory 64 true 2>/dev/null || skip "no private /dev/shm (unshare and mount need root)"; }

@test "a volume comes back from memory as it went in: every type, geometry, values, history" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt convert in.nrrd --dtype $type --range 0:65535 -o a.vkt --force 2>/dev/null
        vkt write a.vkt shm:$seg --force
        voxels shm:$seg | cmp - <(voxels a.vkt)
        diff <(vkt info shm:$seg --json | grep -v '"format"') <(vkt info a.vkt --json | grep -v '"format"')
    done
    printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nsample units: "HU"\nvkt slope:=0.5\nvkt intercept:=-1000\nnote:=kept\n\nabcdefgh' >b.nrrd
    vkt read b.nrrd | vkt write shm:$seg --force
    [ "$(voxels shm:$seg)" = abcdefgh ]
    vkt info shm:$seg --json | /usr/bin/python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["format"] == "shm" and info["slope"] == 0.5 and info["intercept"] == -1000 and info["units"] == "HU", info
assert info["attributes"]["note"] == "kept" and info["history"]["command"][0] == "read", info'
}

@test "shm:NAME stands wherever the name of a file does" {
    vkt flip x in.nrrd -o shm:$seg
    vkt flip x in.nrrd -o flipped.nrrd
    vkt diff shm:$seg flipped.nrrd --geometry
    vkt diff flipped.nrrd shm:$seg --geometry
    diff <(vkt stats shm:$seg --json) <(vkt stats flipped.nrrd --json)
    vkt info shm:$seg | grep -qx 'format *shm'
    vkt history shm:$seg | diff - <(vkt history flipped.nrrd)
    vkt crop shm:$seg --roi 3:20,5:,:-2 -o part.nrrd
    vkt crop flipped.nrrd --roi 3:20,5:,:-2 | vkt diff - part.nrrd --geometry
    vkt read shm:$seg --roi 3:20,5:,:-2 | vkt diff - part.nrrd --geometry
    vkt crop in.nrrd --like part.nrrd -o shm:$seg.part
    vkt crop in.nrrd --like shm:$seg.part | vkt diff - shm:$seg.part --geometry
    vkt arith sub shm:$seg shm:$seg | vkt stats | grep -q '^max  *0$'
    for stage in 'flip z' 'filter gaussian --sigma 1' 'resample --scale 0.5' 'convert --dtype uint8 --range minmax'; do
        # shellcheck disable=SC2086
        vkt $stage shm:$seg --slab 3 -o shm:$seg.out --force
        # shellcheck disable=SC2086
        vkt $stage flipped.nrrd | vkt diff - shm:$seg.out --geometry
    done
    vkt pipe "read shm:$seg | flip x | write shm:$seg.out --force"
    vkt diff shm:$seg.out in.nrrd --geometry
    vkt read shm:$seg | vkt flip x | vkt diff - in.nrrd
    vkt read shm:$seg --transport shm | vkt flip x | vkt diff - in.nrrd
    vkt write volume.nrrd shm:$seg --force
    vkt render shm:$seg --size 40 -o a.png
    vkt render volume.nrrd --size 40 -o b.png
    cmp <(picture a.png) <(picture b.png)
    # A segment may be replaced by what is made of it.
    vkt write in.nrrd shm:$seg --force
    vkt flip x shm:$seg -o shm:$seg --force
    vkt diff shm:$seg flipped.nrrd
    vkt write shm:$seg part.nrrd --force
    vkt diff part.nrrd flipped.nrrd
}

@test "names that end like those of files are names of segments all the same" {
    for end in .vkt .vdb .mhd .nrrd; do
        vkt write in.nrrd shm:$seg$end
        vkt flip x shm:$seg$end -o shm:$seg$end --force
        [ "$(vkt info shm:$seg$end | head -1)" = 'format     shm' ]
        vkt flip x shm:$seg$end | vkt diff - in.nrrd
    done
    [ "$(left | wc -l)" -eq 4 ]
    [ "$(find . -name '*shm*' | wc -l)" -eq 0 ]
    # A file may be called so, below a folder.
    vkt write in.nrrd ./shm:file.nrrd
    vkt diff ./shm:file.nrrd in.nrrd
}

@test "an existing segment is kept, unless --force says otherwise" {
    vkt write in.nrrd shm:$seg
    fails_with 4 "the segment exists" vkt write volume.nrrd shm:$seg
    fails_with 4 "the segment exists" vkt flip x volume.nrrd -o shm:$seg
    vkt diff shm:$seg in.nrrd
    vkt write volume.nrrd shm:$seg --force
    vkt diff shm:$seg volume.nrrd
    # One that appears meanwhile is kept as well.
    vkt shm remove -- $seg
    mkfifo slow
    vkt write slow shm:$seg 2>err 3>&- &
    writer=$!
    vkt read in.nrrd >in.vkt
    exec 9>slow
    head -c 2000 in.vkt >&9
    vkt write volume.nrrd shm:$seg
    tail -c +2001 in.vkt >&9
    exec 9>&-
    status=0
    wait $writer || status=$?
    [ $status -eq 4 ]
    grep -q 'the segment exists' err
    vkt diff shm:$seg volume.nrrd
    [ "$(left)" = "$mine" ]
}

@test "a segment is its owner's alone, whatever the umask and what it replaces" {
    for mask in 000 022 777; do
        (umask $mask && vkt write in.nrrd shm:$seg --force)
        [ "$(stat -c '%a %u' "$mine")" = "600 $(id -u)" ]
    done
    chmod 644 "$mine"
    vkt write in.nrrd shm:$seg --force
    [ "$(stat -c %a "$mine")" = 600 ]
}

@test "what is not this user's is neither read nor replaced" {
    vkt write in.nrrd shm:$seg
    ln -s "$mine" "$mine.link"
    fails_with 4 "cannot open" vkt stats shm:$seg.link
    fails_with 4 "not a segment of this user" vkt write in.nrrd shm:$seg.link --force
    mkdir "$mine.folder"
    fails_with 4 "cannot open" vkt stats shm:$seg.folder
    fails_with 4 "not a segment of this user" vkt write in.nrrd shm:$seg.folder --force
    if [ "$(id -u)" -eq 0 ]; then
        chown 12345 "$mine"
        fails_with 4 "not a segment of this user" vkt stats shm:$seg
        fails_with 4 "not a segment of this user" vkt write in.nrrd shm:$seg --force
        chown 0 "$mine"
    fi
    vkt diff shm:$seg in.nrrd
}

@test "names that cannot be are refused, and so is what is no volume" {
    for name in '' a/b ../a 'a b' 'ä' "$(printf 'x%.0s' {1..201})"; do
        fails_with 2 "names of segments" vkt write in.nrrd "shm:$name"
        fails_with 2 "names of segments" vkt stats "shm:$name"
        fails_with 2 "names of segments" vkt shm remove "shm:$name"
    done
    long=$seg.$(printf 'x%.0s' {1..200})
    vkt write in.nrrd "shm:${long:0:200}"
    vkt write in.nrrd "shm:${long:0:200}" --force
    vkt diff in.nrrd "shm:${long:0:200}"
    fails_with 4 "no such segment" vkt stats shm:$seg
    fails_with 2 "volumes and nothing else" vkt render volume.nrrd --size 8 -o shm:$seg.png
    for format in nrrd raw vkt; do fails_with 2 "shared memory and no file" vkt flip x in.nrrd -o shm:$seg --format $format; done
    fails_with 2 "shared memory and no file" vkt write in.nrrd shm:$seg --format vkt
    fails_with 2 "not compressed" vkt write in.nrrd shm:$seg --compress
    fails_with 2 "is no segment" vkt write in.nrrd out.nrrd --format shm
    fails_with 2 "is no segment" vkt read in.nrrd --format shm
    fails_with 2 "OpenVDB" vkt write in.nrrd shm:$seg.vdb --prune 1
    vkt write in.nrrd shm:$seg --format shm
    fails_with 2 "says itself" vkt read shm:$seg --dims 1 1 1 --dtype uint8
    fails_with 2 "says itself" vkt read shm:$seg --format raw
    fails_with 2 "variable" vkt read shm:$seg --variable a
    [ ! -e "shm:$seg" ] && [ ! -e "shm:$seg.png" ] && [ ! -e out.nrrd ]
}

@test "trees lie in memory too" {
    vkt make amr --blocks 60 --levels 4 -o tree.vkt
    vkt write tree.vkt shm:$seg
    diff <(vkt info shm:$seg --json | grep -v '"format"') <(vkt info tree.vkt --json | grep -v '"format"')
    vkt resample shm:$seg --cells 20k -o a.nrrd
    vkt resample tree.vkt --cells 20k | vkt diff - a.nrrd --geometry
    vkt read shm:$seg | vkt write shm:$seg.again
    vkt convert shm:$seg --dtype float32 | vkt write shm:$seg.f
    vkt stats shm:$seg.again | diff - <(vkt stats tree.vkt)
    vkt read shm:$seg --roi 25%:75%,:,: -o b.vkt
    vkt read tree.vkt --roi 25%:75%,:,: -o c.vkt
    diff <(vkt stats b.vkt) <(vkt stats c.vkt)
    cmp "$mine" "$mine.again"
}

@test "a segment holds one volume, a numbered name one for each" {
    vkt flip x in.nrrd -o flipped.nrrd
    mkdir series
    cp in.nrrd series/0.nrrd
    cp flipped.nrrd series/1.nrrd
    fails_with 2 "a segment holds one volume" vkt read 'series/*.nrrd' -o shm:$seg
    [ -z "$(left)" ]
    vkt read 'series/*.nrrd' -o shm:$seg.%d
    vkt diff shm:$seg.0 in.nrrd
    vkt diff shm:$seg.1 flipped.nrrd
    vkt diff "shm:$seg.*" <(vkt read 'series/*.nrrd')
    [ "$(vkt info "shm:$seg.*" --json | grep -c '"format": "shm"')" -eq 2 ]
    fails_with 4 "no segment matches" vkt stats "shm:$seg.x*"
    fails_with 2 "one file after the other" vkt flip x "shm:$seg.*" -o shm:$seg.%d --force
}

@test "unfinished segments are refused, shown as such and freed" {
    vkt write in.nrrd shm:$seg
    # The state stands behind magic and version.
    printf '\0\0\0\0' | dd of="$mine" bs=1 seek=12 conv=notrunc status=none
    fails_with 3 "unfinished" vkt stats shm:$seg
    [ "$(wc -l <<<"$stderr")" -eq 2 ] # and a hint
    fails_with 3 "unfinished" vkt flip x shm:$seg -o out.nrrd
    [ ! -e out.nrrd ]
    vkt shm list | grep -E "^shm:$seg .* unfinished$"
    vkt shm remove $seg
    [ -z "$(left)" ]
    fails_with 4 "no such segment" vkt stats shm:$seg
}

@test "forged segments are refused, whatever they claim" {
    vkt write in.nrrd shm:$seg
    vkt make amr --blocks 20 --levels 3 -o shm:$seg.tree
    # Turned, the short bricks come first, which no packed table has.
    vkt make sphere --dims 20 12 12 | vkt refine --tolerance 0.1 | vkt flip x -o shm:$seg.records
    cat >forge.py <<'EOF'
import os, random, struct, subprocess, sys
seg = sys.argv[1]
mine = f"/dev/shm/vkt.{os.getuid()}.{seg}"
HEAD = struct.Struct("<8sII6Q")
NAMES = ["magic", "version", "state", "text", "bricks", "offset", "voxels", "total", "reserved"]
whole = {name: open(mine + end, "rb").read() for name, end in (("grid", ""), ("tree", ".tree"), ("records", ".records"))}
cases = 0

def put(data, size=None, sparse=False):
    target = mine + ".forged"
    if os.path.exists(target):
        os.unlink(target)
    with open(target, "wb") as file:
        file.write(data)
        if size is not None:
            file.truncate(size)
    os.chmod(target, 0o600)

def refused(what):
    global cases
    cases += 1
    for command in (["stats"], ["info"], ["flip", "x", "-o", "out.nrrd"]):
        run = subprocess.run(["vkt", command[0], *command[1:2], f"shm:{seg}.forged", *command[2:]], capture_output=True,
                             text=True, stdin=subprocess.DEVNULL)
        lines = [line for line in run.stderr.splitlines() if "hint:" not in line]
        assert run.returncode == 3 and len(lines) == 1 and not run.stdout, (what, command, run)
        assert not os.path.exists("out.nrrd"), what

def with_fields(data, **fields):
    values = dict(zip(NAMES, HEAD.unpack(data[:64])))
    values.update(fields)
    return HEAD.pack(*values.values()) + data[64:]

for kind, data in whole.items():
    head = dict(zip(NAMES, HEAD.unpack(data[:64])))
    assert head["total"] == len(data) and head["offset"] + head["voxels"] == len(data) and head["offset"] % 4096 == 0
    for length in (0, 1, 63, 64, 65, 4096, len(data) - 1):
        put(data[:length])
        refused((kind, "cut to", length))
    put(data + b"x")
    refused((kind, "longer"))
    put(with_fields(data, magic=b"VKTSHM\n\n"))
    refused((kind, "magic"))
    for version in (0, 1 if kind == "tree" else 2, 3):
        put(with_fields(data, version=version))
        refused((kind, "version", version))
    for field in ("text", "bricks", "offset", "voxels", "total"):
        for value in (0, 1, head[field] - 1 if head[field] else 7, head[field] + 1, head[field] + 4096, 2**31, 2**32,
                      2**40, 2**62, 2**63, 2**64 - 4096, 2**64 - 1):
            # A byte of JSON's white space or padding more or less is none.
            if abs(value - head[field]) > (field == "text"):
                put(with_fields(data, **{field: value}))
                refused((kind, field, value))
    # All agrees, but the pages are not there: to read them could fail, and that is a fault.
    put(data[:head["offset"]], size=len(data) if kind == "grid" else None)
    refused((kind, "sparse"))
    text = data[64:64 + head["text"]]
    for a, b in ((b'"dims"', b'"dimz"'), (b"40", b"41"), (b"uint16", b"uint64"), (b"uint16", b"uint99"), (b"{", b"["),
                 (b"hierarchical", b"structured  "), (b"structured", b"hierarchic"), (b"float32", b"float64"),
                 (b'"cell_count": ', b'"cell_count":1'), (b'"brick_count": ', b'"brick_count":9')):
        if a in text:
            assert len(a) == len(b)
            put(data[:64] + text.replace(a, b, 1) + data[64 + head["text"]:])
            if a != b'"dims"':
                refused((kind, a, b))
# The records of bricks: lower corner, dims, level. Packed: the block, words a brick, numbers: out of range, the same
# brick twice, the coarser one around it.
for kind, changes in (("records", ((24, 0), (24, -1), (24, 2**31 - 1), (28, 2**31 - 1), (36, -1), (36, 99))),
                      ("tree", ((0, 0), (0, -1), (0, 4), (4, 2**31 - 1), (12, 0), (12, 2), (12, 3), (16, -1), (16, 3),
                                (20, "first"), (20, "around")))):
    tree = whole[kind]
    head = dict(zip(NAMES, HEAD.unpack(tree[:64])))
    assert head["version"] == (2 if kind == "tree" else 1), head
    at = (64 + head["text"] + 63) // 64 * 64
    first = struct.unpack_from("<i", tree, at + 16)[0]
    for place, value in changes:
        changed = bytearray(tree)
        number = first if value == "first" else first + 1 if value == "around" else value
        struct.pack_into("<i", changed, at + place, number)
        put(bytes(changed))
        refused((kind, "brick", place, value))
# Anything at all may lie there, and nothing crashes.
random.seed(5)
for _ in range(60):
    data = bytearray(random.choice(list(whole.values())))
    for _ in range(random.randint(1, 8)):
        data[random.randrange(min(len(data), 1500))] = random.randrange(256)
    put(bytes(data))
    run = subprocess.run(["vkt", "info", f"shm:{seg}.forged"], capture_output=True, stdin=subprocess.DEVNULL)
    assert run.returncode in (0, 3), run
    run = subprocess.run(["vkt", "stats", f"shm:{seg}.forged", "--memory", "64M"], capture_output=True, stdin=subprocess.DEVNULL)
    assert run.returncode in (0, 3, 5), run
    listing = subprocess.run(["vkt", "shm", "list"], capture_output=True, text=True, check=True).stdout
    assert f"shm:{seg}.forged" in listing
print(cases, "forged segments refused")
EOF
    /usr/bin/python3 forge.py $seg
    vkt diff shm:$seg in.nrrd
}

@test "a writer that is killed or fails leaves nothing, and the old segment where there was one" {
    vkt read in.nrrd >in.vkt
    mkfifo slow
    for present in no yes; do
        force=()
        if [ $present = yes ]; then
            vkt write volume.nrrd shm:$seg
            force=(--force)
        fi
        left >before
        for signal in KILL TERM; do
            vkt write slow shm:$seg "${force[@]}" 2>/dev/null 3>&- &
            writer=$!
            exec 9>slow
            head -c 5000 in.vkt >&9
            # It has its memory, and no name.
            for _ in $(seq 200); do
                grep -q '/dev/shm/#\|/dev/shm.*(deleted)' /proc/$writer/maps && break
                sleep 0.02
            done
            grep -q '/dev/shm/#\|/dev/shm.*(deleted)' /proc/$writer/maps
            left | diff before -
            kill -s $signal $writer
            status=0
            wait $writer || status=$?
            exec 9>&-
            [ $status -gt 128 ]
            left | diff before -
        done
        status=0
        head -c 5000 in.vkt | vkt write shm:$seg "${force[@]}" 2>/dev/null || status=$?
        [ $status -eq 3 ]
        left | diff before -
    done
    vkt diff shm:$seg volume.nrrd
}

@test "what is left under a temporary name is swept away" {
    vkt write in.nrrd shm:$seg
    # As temporary names are made: PID, nonce, and the check that proves whose they are.
    name=$(/usr/bin/python3 -c '
import sys
name, hash = f".{sys.argv[1]}.vkt-99999-12345678", 2166136261
for c in name.encode():
    hash = (hash ^ c) * 16777619 % 2**32
print(f"{name}{hash:08x}")' "$(basename "$mine")")
    cp "$mine" "$folder/$name"
    vkt shm list >/dev/null
    [ "$(left)" = "$mine" ]
    cp "$mine" "$folder/$name"
    vkt write volume.nrrd shm:$seg --force
    [ "$(left)" = "$mine" ]
}

@test "too little shared memory is an error at once, and leaves nothing" {
    needs_private_memory
    # shellcheck disable=SC2016
    in_small_memory 256 bash -c '
        status=0
        vkt make noise --dims 100 100 100 --dtype uint8 -o shm:a 2>err || status=$?
        [ $status -eq 5 ] && [ -z "$(ls -A /dev/shm)" ] && grep -q "vkt shm remove" err || exit 1
        vkt make noise --dims 50 50 50 --dtype uint8 -o shm:a && vkt stats shm:a >/dev/null || exit 2
        # Both at a time do not fit, so the old one stays.
        status=0
        vkt make noise --dims 60 50 50 --dtype uint8 -o shm:a --force 2>err || status=$?
        [ $status -eq 5 ] && [ "$(vkt info shm:a | sed -n s/^dims\ *//p)" = "50 50 50" ] || exit 3
        [ "$(vkt shm list | wc -l)" -eq 2 ] && vkt shm remove a && [ -z "$(ls -A /dev/shm)" ]'
}

@test "voxels are used where they lie, written and read" {
    command -v strace >/dev/null || skip "strace is absent"
    strace -f -qq -o /dev/null true 2>/dev/null || skip "processes cannot be traced here"
    export OMP_WAIT_POLICY=passive
    vkt make noise --dims 128 128 128 --dtype uint16 -o big.nrrd # 4 MiB
    # Neither written nor read but mapped: what passes by a descriptor of the segment is its header.
    export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}detect_leaks=0" # LeakSanitizer does not work where it is traced
    strace -f -y -qq -e trace=write,pwrite64,writev -o trace vkt flip x big.nrrd -o shm:$seg
    run ! grep '/dev/shm' trace
    for command in stats 'flip x -o f.nrrd' 'filter gaussian --sigma 1 -o g.nrrd' 'render --size 20 -o p.png'; do
        # shellcheck disable=SC2086
        strace -f -y -qq -e trace=read,pread64,readv -o trace vkt $command shm:$seg >/dev/null
        awk '/\/dev\/shm/ { sum += $NF } END { exit sum > 32768 }' trace || { cat trace >&2; false; }
    done
    vkt flip x big.nrrd | vkt diff - shm:$seg
}

@test "who has opened a segment keeps the volume" {
    mkfifo out
    vkt make noise --dims 100 100 100 --dtype uint16 -o shm:$seg # more than a pipe holds
    voxels shm:$seg >expected.raw
    for how in remove replace; do
        vkt read shm:$seg >out 3>&- &
        reader=$!
        exec 9<out
        head -c 1000 <&9 >got.vkt
        if [ $how = replace ]; then
            vkt write in.nrrd shm:$seg --force
        else
            vkt shm remove $seg
        fi
        cat <&9 >>got.vkt
        exec 9<&-
        wait $reader
        voxels got.vkt | cmp - expected.raw
        vkt make noise --dims 100 100 100 --dtype uint16 -o shm:$seg --force
    done
}

@test "segments are listed and removed" {
    vkt write in.nrrd shm:$seg.b
    vkt make amr --blocks 20 --levels 3 -o shm:$seg.a
    vkt shm list >list
    head -1 list | grep -qE '^NAME +SIZE +TYPE +DIMS +AGE +STATE$'
    grep -qE "^shm:$seg.b +5[0-9]\.0 KiB +uint16 +40 30 20 +[0-9]+ s +whole$" list
    [ "$(grep -c "^shm:$seg\." list)" -eq 2 ]
    grep "^shm:$seg\." list | sort -c
    vkt shm list --json | /usr/bin/python3 -c '
import json, os, sys
mine = [s for s in json.load(sys.stdin) if s["name"].startswith("shm:" + sys.argv[1])]
a, b = mine
assert a["kind"] == "hierarchical" and a["state"] == "whole" and a["age"] >= 0, a
assert b["dtype"] == "uint16" and b["dims"] == [40, 30, 20] and b["kind"] == "structured", b
assert b["bytes"] == os.stat(sys.argv[2]).st_blocks * 512, b' $seg "$mine.b"
    fails_with 4 "there is no segment" vkt shm remove $seg.c
    fails_with 2 "missing NAME" vkt shm remove
    fails_with 2 "nothing to name" vkt shm remove --all $seg.a
    fails_with 2 "names of segments" vkt shm remove $seg.a a/b
    fails_with 2 "" vkt shm list $seg.a
    fails_with 2 "list, remove" vkt shm
    [ "$(left | wc -l)" -eq 2 ]
    vkt shm remove shm:$seg.a $seg.b
    [ -z "$(left)" ]
    run vkt shm list --json
    [[ "$output" == '['* && "$output" == *']' ]]
}

@test "all segments can be removed at once, and none is no error" {
    needs_private_memory
    # shellcheck disable=SC2016
    in_small_memory 1024 bash -c '
        [ -z "$(vkt shm list)" ] && [ "$(vkt shm list --json)" = "[]" ] && vkt shm remove --all || exit 1
        vkt write in.nrrd shm:a && vkt write in.nrrd shm:b && echo else >/dev/shm/other || exit 2
        vkt shm remove --all && [ "$(ls -A /dev/shm)" = other ]'
}

@test "names of segments are completed" {
    vkt write in.nrrd shm:$seg
    [ "$(vkt completion --words shm re)" = remove ]
    [ "$(vkt completion --words shm list --)" = --json ]
    vkt completion --words shm remove '' | grep -qxF $seg
    [ "$(vkt completion --words shm remove $seg)" = $seg ]
    [ "$(vkt completion --words stats shm:$seg)" = shm:$seg ]
    [ "$(vkt completion --words flip x a.nrrd -o shm:$seg)" = shm:$seg ]
    # bash takes the colon for the end of a word.
    # shellcheck source=/dev/null
    source "$VKT_ROOT/shell/completion/vkt.bash"
    COMP_WORDS=(vkt stats shm : "${seg:0:5}") COMP_CWORD=4
    _vkt
    printf '%s\n' "${COMPREPLY[@]}" | grep -qxF $seg
    COMP_WORDS=(vkt stats shm :) COMP_CWORD=3
    _vkt
    printf '%s\n' "${COMPREPLY[@]}" | grep -qxF $seg
}

@test "Python and C map a segment" {
    [ -e "${VKT_BUILD:-}/python/vkt/_vkt.so" ] || skip "this build has no Python package"
    python_with numpy
    vkt write in.nrrd shm:$seg
    cat >test.py <<'EOF'
import os, re, sys
import numpy as np
import vkt
seg = sys.argv[1]
path = f"/dev/shm/vkt.{os.getuid()}.{seg}"
volume, expected = vkt.read(f"shm:{seg}"), vkt.read("in.nrrd")
array = volume.array
address = array.ctypes.data

def mapped_at(address):
    for line in open("/proc/self/maps"):
        begin, end = (int(x, 16) for x in line.split()[0].split("-"))
        if begin <= address < end:
            return line
assert path in mapped_at(address), mapped_at(address)
assert path in mapped_at(address + array.nbytes - 1)
assert np.array_equal(array, expected.array) and volume.spacing == expected.spacing and volume.origin == expected.origin
assert not array.flags.writeable and not array.flags.owndata
before = open(path, "rb").read()
flipped = volume.apply("flip x")
assert np.array_equal(flipped.array, expected.array[:, :, ::-1])
assert open(path, "rb").read() == before
# What was mapped stays, also when the name is freed or given away.
flipped.write(f"shm:{seg}", force=True)
assert np.array_equal(array, expected.array)
again = vkt.read(f"shm:{seg}").array
assert np.array_equal(again, flipped.array)
os.unlink(path)
assert np.array_equal(array, expected.array) and np.array_equal(again, flipped.array)
del volume
assert np.array_equal(array, expected.array)
part = vkt.Volume(array, like=expected)
part.write(f"shm:{seg}")
assert np.array_equal(vkt.read(f"shm:{seg}", roi="3:9,:,2:4").array, expected.array[2:4, :, 3:9])
try:
    part.write(f"shm:{seg}")
    raise SystemExit("it was replaced")
except vkt.Error as e:
    assert e.exit_code == 4, e
try:
    vkt.read("shm:not/there")
    raise SystemExit("it was read")
except vkt.Error as e:
    assert e.exit_code == 2, e
assert (os.stat(path).st_mode & 0o777) == 0o600
EOF
    PYTHONPATH="$VKT_BUILD/python" /usr/bin/python3 -W error test.py $seg
    vkt diff shm:$seg in.nrrd
}

@test "a segment is no part of --memory but where a whole volume is held" {
    vkt make noise --dims 256 256 64 --dtype uint16 -o big.nrrd # 8 MiB
    vkt read big.nrrd | vkt flip x --memory 2M -o shm:$seg
    vkt flip x shm:$seg --memory 2M | vkt diff - big.nrrd
    vkt stats shm:$seg --memory 2M >/dev/null
    fails_with 5 "the budget is 2.0 MiB" vkt render shm:$seg --memory 2M --size 8 -o p.png
    fails_with 5 "the budget is 2.0 MiB" vkt render big.nrrd --memory 2M --size 8 -o p.png
}

@test "a segment is split into slices as a file is" {
    vkt make ramp --dims 5 4 3 --axis z -o v.nrrd
    vkt write v.nrrd shm:$seg
    vkt split shm:$seg -o s_%d.nrrd
    vkt shm remove $seg
    [ "$(ls s_*.nrrd | wc -l)" -eq 3 ]
}
