# vkt write: formats by name, whole files or none, nothing overwritten unasked.
load helper

setup_more() {
    for i in $(seq 0 104); do printf '%b' "$(printf '\\x%02x\\x00' "$i")"; done >ramp_7x5x3_int16.raw
    vkt read ramp_7x5x3_int16.raw --spacing 0.5,1,2 -o ramp.vkt
}

voxels() { vkt write - --format raw; }
count_files() { find . -mindepth 1 | wc -l; }

@test "every format gives the voxels and the geometry back" {
    for name in a.nrrd a.nhdr a.mha a.mhd a.vkt; do
        for flag in "" --compress; do
            if [ "$name$flag" = a.vkt--compress ]; then continue; fi
            # shellcheck disable=SC2086
            vkt write ramp.vkt "$name" --force $flag
            vkt read "$name" | voxels | cmp - ramp_7x5x3_int16.raw
            vkt info "$name" --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["dims"] == [7, 5, 3] and info["dtype"] == "int16" and info["spacing"] == [0.5, 1, 2], info'
        done
    done
    vkt write ramp.vkt b_7x5x3_int16.raw
    cmp b_7x5x3_int16.raw ramp_7x5x3_int16.raw
    vkt write ramp.vkt b_7x5x3_int16.raw.gz
    gzip -dc b_7x5x3_int16.raw.gz | cmp - ramp_7x5x3_int16.raw
}

@test "standard output takes a named format" {
    vkt write ramp.vkt - --format nrrd | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write ramp.vkt - --format metaimage | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write ramp.vkt - --format vkt | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    vkt write ramp.vkt - --format nrrd --compress | vkt read | voxels | cmp - ramp_7x5x3_int16.raw
    fails_with 2 "cannot tell the format" vkt write ramp.vkt -
    fails_with 2 "its size comes first" vkt write ramp.vkt - --format metaimage --compress
}

@test "the value map, units and history survive NRRD and MetaImage" {
    printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nsample units: "HU"\nvkt slope:=0.5\nvkt intercept:=-1000\nnote:=kept\n\nabcdefgh' >in.nrrd
    for name in a.nrrd a.mha; do
        vkt read in.nrrd | vkt write $name
        vkt info $name --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["slope"] == 0.5 and info["intercept"] == -1000 and info["units"] == "HU", info
assert info["attributes"]["note"] == "kept", info
assert info["history"]["command"][0] == "read", info'
    done
}

@test "an existing file is kept, unless --force says otherwise" {
    echo precious >a.nrrd
    fails_with 4 "--force" vkt write ramp.vkt a.nrrd
    [ "$(cat a.nrrd)" = precious ]
    vkt write ramp.vkt a.nrrd --force
    vkt read a.nrrd | voxels | cmp - ramp_7x5x3_int16.raw
    # A file that appears meanwhile is kept as well.
    mkfifo slow
    vkt write slow b.nrrd 2>err &
    writer=$!
    { sleep 0.3; echo precious >b.nrrd; cat ramp.vkt; } >slow
    status=0
    wait $writer || status=$?
    [ $status -eq 4 ]
    [ "$(cat b.nrrd)" = precious ]
    grep -q -e --force err
    # Overwriting the input is safe: it is replaced when it has been read.
    vkt read a.nrrd | vkt write a.nrrd --force
    vkt read a.nrrd | voxels | cmp - ramp_7x5x3_int16.raw
}

@test "the input comes first, and is not what is overwritten" {
    vkt flip x ramp.vkt -o first.nrrd
    cp first.nrrd kept.nrrd
    vkt flip y ramp.vkt -o second.nrrd
    vkt write first.nrrd second.nrrd --force
    cmp first.nrrd kept.nrrd
    vkt diff first.nrrd second.nrrd
    vkt write first.nrrd -o third.nrrd
    vkt diff first.nrrd third.nrrd
    # Whoever is used to the other order is told, and nothing is touched.
    fails_with 4 "vkt write IN OUT" vkt write new.nrrd first.nrrd --force
    cmp first.nrrd kept.nrrd
    [ ! -e new.nrrd ]
    fails_with 2 "two outputs" vkt write first.nrrd a.nrrd -o b.nrrd
    fails_with 2 "unexpected argument" vkt write first.nrrd a.nrrd b.nrrd
    vkt pipe 'read ramp.vkt | write one.nrrd'
    vkt read one.nrrd | voxels | cmp - ramp_7x5x3_int16.raw
    fails_with 2 "does not read what the stage before it writes" vkt pipe 'read ramp.vkt | write one.nrrd two.nrrd'
}

@test "a file may become what is made of it, in one step or not at all" {
    vkt read ramp.vkt -o a.nrrd
    vkt flip x ramp.vkt -o flipped.nrrd
    for name in a.nrrd ./a.nrrd "$PWD/a.nrrd"; do
        vkt read ramp.vkt -o a.nrrd --force
        vkt flip x a.nrrd -o "$name" --force
        vkt diff a.nrrd flipped.nrrd
    done
    vkt write a.nrrd a.nrrd --force
    vkt diff a.nrrd flipped.nrrd
    # What fails on the way leaves the input as it was.
    vkt read ramp.vkt -o a.mha
    head -c -7 a.mha >cut.mha
    cp cut.mha kept.mha
    fails_with 3 "" vkt flip x cut.mha -o cut.mha --force
    cmp cut.mha kept.mha
}

@test "a volume that is read is not replaced by a report or a picture" {
    vkt threshold ramp.vkt --range 10:40 -o mask.nrrd
    cp mask.nrrd kept.nrrd
    fails_with 2 "by what is no volume" vkt label mask.nrrd --report ./mask.nrrd -o labels.nrrd --force
    fails_with 2 "by what is no volume" vkt pipe 'read mask.nrrd | label --report mask.nrrd --force | write labels.nrrd'
    fails_with 2 "by what is no volume" vkt watershed ramp.vkt --mask mask.nrrd --report mask.nrrd -o labels.nrrd --force
    fails_with 2 "by what is no volume" vkt histogram mask.nrrd -o mask.nrrd --force
    cp mask.nrrd mask.png # a volume, whatever it is called
    fails_with 2 "by what is no volume" vkt render mask.png -o mask.png --force
    cmp mask.nrrd kept.nrrd
    cmp mask.png kept.nrrd
    [ ! -e labels.nrrd ]
    vkt label mask.nrrd --report report.json -o labels.nrrd
    vkt label mask.nrrd --report report.json -o labels.nrrd --force
}

@test "an input that lies in several files is not overwritten" {
    vkt read ramp.vkt -o a.nhdr
    vkt read ramp.vkt -o c.mhd
    mkdir kept
    cp a.* c.* kept
    ln a.nhdr other.nhdr
    fails_with 2 "not in one step" vkt convert a.nhdr --dtype uint8 -o a.nhdr --force
    fails_with 2 "not in one step" vkt convert a.nhdr --dtype uint8 -o other.nhdr --force
    fails_with 2 "a.raw" vkt convert a.nhdr --dtype uint8 -o a.mhd --force -q
    fails_with 2 "not in one step" vkt write c.mhd c.mhd --force
    fails_with 2 "not in one step" vkt pipe 'read c.mhd | convert --dtype uint8 | write c.mhd --force'
    for file in kept/*; do cmp "$file" "${file#kept/}"; done
    vkt write a.nhdr b.nhdr
    vkt write a.nhdr b.nhdr --force
    vkt diff a.nhdr b.nhdr
    # Series: files that are read would go one after the other.
    for i in 0 1 2; do vkt read ramp.vkt -o s_$i.nrrd; done
    fails_with 2 "one file after the other" vkt flip x 's_*.nrrd' -o 's_%d.nrrd' --force
    vkt flip x 's_*.nrrd' -o 't_%d.nrrd'
    [ -e t_2.nrrd ]
}

@test "--force removes nobody's files, only what killed writers left" {
    vkt write ramp.vkt a.nrrd
    echo mine | tee .a.nrrd.vkt-notes .a.nrrd.vkt-1-0123456789abcdef .a.nrrd.vkt- .a.nrrd.vkt-12-01234567.bak >/dev/null
    vkt write ramp.vkt a.nrrd --force
    for name in .a.nrrd.vkt-notes .a.nrrd.vkt-1-0123456789abcdef .a.nrrd.vkt- .a.nrrd.vkt-12-01234567.bak; do
        [ "$(cat $name)" = mine ]
    done
    # What FNV-1a says of the rest of the name is the proof: here computed by somebody else.
    leftover=$(python3 -c '
name = ".a.nrrd.vkt-4194303-89abcdef"
h = 2166136261
for c in name.encode(): h = (h ^ c) * 16777619 % 2**32
print(f"{name}{h:08x}")')
    echo dead >"$leftover"
    exec 9<"$leftover"
    flock -x 9 # a living writer
    vkt write ramp.vkt a.nrrd --force
    [ -e "$leftover" ]
    exec 9<&-
    vkt write ramp.vkt a.nrrd --force
    [ ! -e "$leftover" ]
}

@test "a file that is replaced keeps its mode" {
    umask 022
    for mode in 600 640 664 400 755; do
        vkt write ramp.vkt a.nrrd --force
        chmod $mode a.nrrd
        vkt flip x ramp.vkt -o a.nrrd --force
        [ "$(stat -c %a a.nrrd)" = $mode ]
        vkt write ramp.vkt b.mhd --force
        chmod $mode b.mhd b.raw
        vkt write ramp.vkt b.mhd --force
        [ "$(stat -c %a b.mhd)$(stat -c %a b.raw)" = $mode$mode ]
        chmod 600 a.nrrd
    done
    rm a.nrrd
    vkt write ramp.vkt a.nrrd
    [ "$(stat -c %a a.nrrd)" = 644 ]
    library="$VKT_BUILD/tests/vkt_named_files.so"
    chmod 600 a.nrrd
    if [ -z "${VKT_SANITIZED:-}" ] && [ -e "$library" ]; then # where the file system has no unnamed files
        LD_PRELOAD="$library" vkt flip x ramp.vkt -o a.nrrd --force
        [ "$(stat -c %a a.nrrd)" = 600 ]
    fi
    if [ "$(id -u)" -eq 0 ]; then # who may give files away does so
        chown 65534:65533 a.nrrd
        vkt flip x ramp.vkt -o a.nrrd --force
        [ "$(stat -c %u:%g:%a a.nrrd)" = 65534:65533:600 ]
    fi
}

@test "a link stays, and what it leads to is replaced" {
    mkdir there
    vkt write ramp.vkt there/real.nrrd
    ln -s there/real.nrrd link.nrrd
    ln -s link.nrrd again.nrrd
    fails_with 4 "--force" vkt flip x ramp.vkt -o again.nrrd
    vkt flip x ramp.vkt -o again.nrrd --force
    [ -L link.nrrd ]
    [ -L again.nrrd ]
    [ ! -L there/real.nrrd ]
    vkt flip x ramp.vkt | vkt diff - there/real.nrrd
    # To nothing yet; with the voxels beside the header, where readers look for them.
    ln -s there/new.mhd new.mhd
    vkt write ramp.vkt new.mhd
    [ -L new.mhd ]
    [ -e there/new.raw ]
    [ ! -e new.raw ]
    vkt diff there/new.mhd ramp.vkt
    # Under another name: what lies beside the header that the link leads to is what counts.
    for end in nhdr hdr pvti pvd mhd; do
        rm -rf there/other*
        vkt write ramp.vkt there/other.$end
        ln -s there/other.$end alias.$end
        vkt flip x ramp.vkt -o alias.$end --force
        [ -L alias.$end ]
        [ -z "$(find . -maxdepth 1 -name 'other*')" ]
        vkt diff there/other.$end alias.$end
        vkt flip x ramp.vkt | vkt diff - alias.$end
    done
    # Not what happens to have that name beside the link, but that if there is nothing else.
    cp there/other.raw kept.raw
    head -c "$(stat -c %s kept.raw)" /dev/zero >other.raw
    vkt flip x ramp.vkt | vkt diff - alias.mhd
    cp kept.raw other.raw
    rm there/other.raw
    vkt flip x ramp.vkt | vkt diff - alias.mhd
    ln -s round.nrrd round.nrrd
    fails_with 4 "round.nrrd" vkt write ramp.vkt round.nrrd --force
    [ "$(find . there -name '.*vkt-*' | wc -l)" -eq 0 ]
}

@test "what goes wrong leaves nothing" {
    mkdir d
    cd d
    for n in 0 10 100 300 $(($(stat -c %s ../ramp.vkt) - 1)); do
        for name in a.nrrd a.nhdr a.mha a.mhd a.raw a.vkt a.raw.gz; do
            head -c "$n" ../ramp.vkt >../cut
            fails_with 3 "" vkt write - $name <../cut
        done
    done
    [ "$(count_files)" -eq 0 ]
    fails_with 4 "no such file or directory" vkt write ../ramp.vkt no/such/directory/a.nrrd
    fails_with 4 "is a directory" vkt write ../ramp.vkt . --format raw
    fails_with 4 "no space left" vkt write ../ramp.vkt /dev/full --format raw
    fails_with 2 "--format" vkt write ../ramp.vkt a.unknown
    fails_with 2 "did you mean 'nrrd'" vkt write ../ramp.vkt a.x --format nrdd
    fails_with 2 "missing OUT" vkt write
    [ "$(count_files)" -eq 0 ]
}

@test "a disk that is full leaves nothing" {
    mkdir small
    mount -t tmpfs -o size=64k tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    truncate -s 1M big_128x128x64_uint8.raw
    failed=0
    for name in a.nrrd a.nhdr a.mha a.mhd a.raw a.vkt; do
        fails_with 4 "space left" vkt write big_128x128x64_uint8.raw small/$name || failed=1
        [ -z "$(ls -A small)" ] || failed=1
    done
    umount small
    [ $failed -eq 0 ]
}

@test "kill -9 leaves nothing" {
    mkdir d
    mkfifo slow
    for name in a.nrrd a.mhd a.raw; do
        vkt write slow d/$name &
        writer=$!
        { head -c 400 ramp.vkt; sleep 0.2; kill -9 $writer; } >slow || true
        wait $writer || true
        [ -z "$(ls -A d)" ] || { ls -A d >&2; false; }
    done
}

@test "devices and pipes are written as they are" {
    vkt write ramp.vkt /dev/null --format raw
    vkt write ramp.vkt /dev/stdout --format raw | cmp - ramp_7x5x3_int16.raw
    vkt write ramp.vkt >(cat >copy) --format raw
    for _ in $(seq 50); do
        if cmp -s copy ramp_7x5x3_int16.raw; then break; fi
        sleep 0.1
    done
    cmp copy ramp_7x5x3_int16.raw
}

@test "several volumes become a fourth axis" {
    printf 'NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 1 3\nkinds: domain domain domain time\nencoding: raw\n\nabcdefghijkl' >series.nrrd
    [ "$(vkt read series.nrrd | voxels)" = abcdefghijkl ]
    for name in a.nrrd a.nhdr a.mha b.mhd; do
        vkt read series.nrrd | vkt write $name
        [ "$(vkt read $name | voxels)" = abcdefghijkl ]
        vkt info $name --json | python3 -c 'import json, sys; assert len(json.load(sys.stdin)) == 3'
        vkt read series.nrrd | vkt write $name --force --compress
        [ "$(vkt read $name | voxels)" = abcdefghijkl ]
    done
    run -2 bash -o pipefail -c 'vkt read series.nrrd | vkt write - --format nrrd | cat >/dev/null'
    [[ "$output" == *"cannot hold several volumes"* ]]
}

@test "types that a format cannot hold are named" {
    head -c 210 /dev/zero >half_7x5x3_float16.raw
    fails_with 2 "NRRD cannot hold float16" vkt write half_7x5x3_float16.raw a.nrrd
    fails_with 2 "MetaImage cannot hold float16" vkt write half_7x5x3_float16.raw a.mha
    [ ! -e a.nrrd ] && [ ! -e a.mha ]
}

@test "files carry neither a date nor anything random" {
    vkt make noise --dims 12 10 8 -o v.nrrd
    for turn in 1 2; do
        mkdir $turn
        for name in a.nrrd a.mha a.vkt a.raw a.raw.gz; do vkt write v.nrrd $turn/$name; done
        vkt write v.nrrd $turn/b.nrrd --compress
        vkt render v.nrrd --size 8 -o $turn/a.png
        sleep 1.1
    done
    diff -r 1 2
}

@test "voxels that a detached header names are not replaced under it" {
    vkt make ramp --dims 4 3 2 --dtype uint16 -o ramp.nrrd
    vkt write ramp.nrrd e.nhdr
    sed -i 's/^data file: .*/data file: other.raw/' e.nhdr
    mv e.raw other.raw
    cp other.raw before.raw
    fails_with 2 "'other.raw' holds the voxels of an input" vkt write e.nhdr other.raw --force
    fails_with 2 "holds the voxels of an input" vkt convert e.nhdr --dtype float32 -o other.raw --force
    cmp other.raw before.raw
    vkt write e.nhdr third.raw
    cmp third.raw before.raw
}

@test "what cannot fit is refused before the first byte, wherever the size is known" {
    mkdir small
    mount -t tmpfs -o size=1m tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    truncate -s 2M big_128x128x128_uint8.raw
    failed=0
    said="no space left on device: 2.0 MiB are needed, 1.0 MiB are free"
    for name in a.nrrd a.nhdr a.mha a.mhd a.raw a.vkt; do
        fails_with 4 "$said" vkt write big_128x128x128_uint8.raw small/$name || failed=1
        fails_with 4 "$said" vkt flip x big_128x128x128_uint8.raw -o small/$name || failed=1
        [ -z "$(ls -A small)" ] || failed=1
    done
    fails_with 4 "$said" bash -c 'vkt flip x big_128x128x128_uint8.raw >small/c.vkt' || failed=1
    # What may become small is refused only if it cannot: deflate makes no more than 1032 bytes of one.
    vkt write big_128x128x128_uint8.raw small/d.nrrd --compress || failed=1
    fails_with 4 "no space left on device: 3.7 MiB are needed" timeout 20 vkt make constant --dims 1000000 1000 4 --dtype uint8 --compress -o small/e.mha || failed=1
    # Nor do pipes and devices have an end.
    vkt write big_128x128x128_uint8.raw /dev/null --format raw || failed=1
    vkt write big_128x128x128_uint8.raw - --format raw | cmp - big_128x128x128_uint8.raw || failed=1
    umount small
    [ $failed -eq 0 ]
}

@test "a volume that no disk holds is refused at once" {
    for out in big.nrrd big.vkt big.raw big.zarr 'big%04d.pgm' 'big%04d.pfm'; do
        needed="3638.0 TiB"
        type=(--dtype float32)
        case $out in *.pgm) needed="909.5 TiB" type=(--dtype uint8) ;; esac
        fails_with 4 "no space left on device: $needed are needed" timeout 20 vkt make noise --dims 1000000 1000000 1000 "${type[@]}" -o "$out"
        [ -z "$(find . -name '*big*')" ]
    done
    # What may become small is not.
    vkt make constant --dims 2000 2000 3 --dtype uint8 -o 'small%d.png'
}

@test "what goes wrong in a directory that has no name yet is said of the name that it will have" {
    mkdir small
    mount -t tmpfs -o size=1m tmpfs small 2>/dev/null || skip "a tmpfs cannot be mounted here"
    truncate -s 2M big_128x128x128_uint8.raw
    failed=0
    for out in small/dicom/ small/store.zarr; do
        run timeout 20 vkt write big_128x128x128_uint8.raw $out
        [[ "$status" -eq 4 && "$output" == *"'small/"*"no space left"* && "$output" != *.vkt-* ]] || failed=1
        [ -z "$(ls -A small)" ] || failed=1
    done
    umount small
    [ $failed -eq 0 ]
}

@test "every format keeps each item of a header or names it, and names nothing that it keeps" {
    vkt make noise --dims 8 7 1 --dtype uint16 --low 1 --high 9 | vkt filter gaussian --sigma 0.8 | vkt set --spacing 0.5,0.75,2 --origin 1.3,-2,3 \
        --direction 0,1,0,-1,0,0,0,0,1 --units HU --slope 2 --intercept -1000 --attribute space=RAS --attribute 'space units="um" "um" "um"' \
        --attribute Segment0_LabelValue=3 --attribute Segment0_Name=liver --attribute note=hello --attribute 'sidecar={"EchoTime":0.03}' -o rich.vkt
    cat >table.py <<'END'
import json, subprocess, sys
def info(name):
    run = subprocess.run(["vkt", "info", name, "--json"], capture_output=True, text=True)
    return json.loads(run.stdout) if run.returncode == 0 else None
def history(name): return subprocess.run(["vkt", "history", name], check=True, capture_output=True).stdout
def placed(i): # in one frame and unit, where they are known
    a = i.get("attributes", {})
    space = {"LPS": "left-posterior-superior", "RAS": "right-anterior-superior"}.get(a.get("space"), a.get("space"))
    sign = [-1, -1, 1] if space == "right-anterior-superior" else [1, 1, 1]
    unit = {'"um"': 1e-3, '"angstrom"': 1e-7}.get(a.get("space units", "").split(" ")[0], 1)
    turn = lambda v, f: [round(x * s * f, 9) + 0.0 for x, s in zip(v, sign)]
    lengths = [round(x * unit, 9) for x in i["spacing"]]
    return {"the place": (lengths, turn(i["origin"], unit)), "the directions": [turn(v, 1) for v in i["direction"]],
            "the frame": space is not None, "the unit of lengths": "space units" in a}
def items(i):
    a = i.get("attributes", {})
    return placed(i) | {"the map of values": (i["slope"], i["intercept"]), "units": i.get("units"),
        "labels": (a.get("Segment0_LabelValue"), a.get("Segment0_Name")), "note": a.get("note"),
        "what stood in the JSON file beside": a.get("sidecar"), "the error": i.get("error"), "the history": i.get("history")}
want = items(info("rich.vkt"))
failed = []
for name in sys.argv[1:]:
    options = ["--format", "analyze"] if name.startswith("analyze") else []
    write = subprocess.run(["vkt", "write", "rich.vkt", name, *options], capture_output=True, text=True)
    if write.returncode != 0:
        if "this build has no" not in write.stderr: failed.append((name, write.stderr)) # without that library
        continue
    got = None if name.endswith((".raw", ".pgm", ".pfm", ".exr", ".png")) else info(name.split("%")[0])
    got = items(got) if got else dict.fromkeys(want)
    if name.endswith((".exr", ".png")) and history(name) == history("rich.vkt"): got["the history"] = want["the history"]
    if options: got["the unit of lengths"] = False # Analyze says mm, whatever there was
    if not got["the frame"] or not got["the unit of lengths"]: # what their numbers mean nobody knows: as numbers
        rich = info("rich.vkt")
        known = {"space": got["the frame"], "space units": got["the unit of lengths"]}
        plain = items(rich | {"attributes": {k: v for k, v in rich["attributes"].items() if known.get(k)}})
    else: plain = want
    lost = {k for k in want if got[k] != (plain[k] if k in ("the place", "the directions") else want[k])}
    lines = write.stderr.splitlines()
    # A map of values that is kept, but that others do not look for, is said apart.
    apart = [l for l in lines if "other programs take the values of" in l and "2 * stored + -1000 is meant" in l]
    if len(apart) != name.startswith(("a.", "b.", "c.", "e.", "i.", "j.", "k.", "x.")): failed.append((name, "the values", apart))
    lines = [l for l in lines if l not in apart]
    said = {k for k in want if lines and (", units," if k == "units" else k) in lines[0]}
    if lost != said or len(lines) != bool(lost): failed.append((name, "lost", lost - said, "kept", said - lost, write.stderr))
sys.exit("\n".join(map(str, failed)) or 0)
END
    /usr/bin/python3 table.py a.nrrd b.nhdr c.mha d.nii e.mrc f.npy g.npz h.raw i.tif j.vti j.pvd k.pvti l.vtk m.vdb n.dcm o/ p.h5 q.zarr r.zarr.zip analyze.hdr \
        s.png t.pgm u.pfm v.exr w.vkt x.nrrd.gz y.seg.nrrd
    vkt write rich.vkt 'z%02d.png' --strict 2>err
    [ "$(wc -l <err)" -eq 1 ] # one line for many files, and no loss of a picture
    fails_with 3 "numpy files do not hold the place" vkt read rich.vkt -o strict.npy --strict
    run --separate-stderr vkt make ramp --dims 4 4 4 -o plain.npy
    [ -z "$stderr" ]
}

@test "a raw file's name does not contradict the volume" {
    vkt make ramp --dims 6 5 4 --dtype int32 -o v.nrrd
    for name in v_4x5x6_int32.raw v_6x5x4_float32.raw v_int16.raw v_6x5x5.raw; do
        fails_with 2 "the volume is 6x5x4_int32" vkt write v.nrrd $name
        [ ! -e $name ]
    done
    for name in v_6x5x4_int32.raw v_int32be.raw v.raw; do vkt write v.nrrd $name; done
    vkt diff v.nrrd v_6x5x4_int32.raw
    fails_with 2 "raw files are compressed as a whole, and named so" vkt write v.nrrd c_6x5x4_int32.raw --compress
    [ ! -e c_6x5x4_int32.raw ]
    vkt write v.nrrd c_6x5x4_int32.raw.gz
    vkt diff v.nrrd c_6x5x4_int32.raw.gz
}
