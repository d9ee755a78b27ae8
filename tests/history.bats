# vkt history: what it prints makes the same volume again.
load helper

@test "as a pipeline that runs" {
    vkt make noise --dims 9 8 7 --seed 5 | vkt resample --scale 0.5 | vkt arith sub - <(vkt make ramp --dims 5 4 4 | vkt set --spacing 1.8,2,1.75 --origin 0.4,0.5,0.375) -o d.vkt
    vkt history d.vkt --as-shell >line
    bash -c "$(cat line)" | vkt diff d.vkt
}

# again FILE: what its history prints makes it again.
again() {
    vkt history "$1" --as-shell >line
    bash -c "$(cat line)" | vkt diff "$1" - || { cat line >&2; false; }
}

@test "an input stands before options that take all words" {
    vkt make noise --dims 8 8 8 --dtype uint8 | vkt write - --format raw >r_8x8x8_uint8.raw
    vkt set r_8x8x8_uint8.raw --attribute a=1 b=2 -o set.vkt
    again set.vkt
    vkt flip x r_8x8x8_uint8.raw --roi 0:4,:,: -o flipped.vkt
    again flipped.vkt
}

@test "both operands are recorded, also an unsaid one" {
    vkt make ramp --dims 4 4 4 | vkt arith sub <(vkt make noise --dims 4 4 4) -o d.vkt
    again d.vkt
    vkt make ramp --dims 4 4 4 | vkt arith add 5 | vkt arith sub 7 - -o n.vkt
    again n.vkt
}

@test "operands are recorded by their position, whatever they are called" {
    vkt make ramp --dims 4 4 4 -o r.vkt
    vkt make ramp --dims 4 4 4 --no-history --format vkt -o add
    vkt arith add add 5 -o sum.vkt
    again sum.vkt
    vkt arith sub add add -o zero.vkt
    again zero.vkt
    cp r.vkt mul
    vkt arith mul mul 2 -o product.vkt
    again product.vkt
}

@test "as a tree and as JSON" {
    vkt make ramp --dims 4 4 4 | vkt resample --scale 2 >r.vkt
    [ "$(vkt history r.vkt | wc -l)" = 2 ]
    vkt history r.vkt --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h["command"][0] == "resample" and h["inputs"][0]["command"][:2] == ["make", "ramp"], h'
}

@test "of several volumes: one list, and one form" {
    vkt make ramp --dims 4 4 4 -o a.nrrd
    vkt make noise --dims 4 4 4 --no-history -o b.vkt
    vkt read a.nrrd -o c.vkt
    vkt history '[ac].*' --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert [v["command"][:2] for v in h] == [["make", "ramp"]] * 2, h'
    vkt history '[bc].vkt' --json 2>note | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h[0] is None and h[1]["command"][0] == "make", h'
    [ "$(vkt history '[ac].*' | wc -l)" = 2 ]
    fails_with 2 "exclude each other" vkt history a.nrrd --as-shell --json
}

@test "a volume without one" {
    vkt make ramp --dims 4 4 4 --no-history | vkt history >out 2>note
    [ ! -s out ]
    grep -q 'no history' note
}

# flips N: a pipeline of as many steps, in one process.
flips() { printf 'make ramp --dims 4 3 2'; printf ' | flip x%.0s' $(seq 2 "$1"); }

@test "a history of more than 400 steps is folded, and costs no voxel" {
    vkt make ramp --dims 4 3 2 --no-history -o ramp.vkt
    vkt pipe "$(flips 401) | write long.vkt"
    vkt history long.vkt >all
    [ "$(wc -l <all)" -eq 401 ]
    vkt pipe "$(flips 400) | write kept.vkt"
    vkt history kept.vkt --as-shell | grep -o flip | wc -l | grep -qx 399
    for i in 1 2; do
        vkt flip x long.vkt -o longer.vkt
        mv longer.vkt long.vkt
    done
    vkt history long.vkt >folded
    [ "$(wc -l <folded)" -eq 401 ]
    [ "$(tail -1 folded | sed 's/^ *//')" = "… 3 earlier steps" ]
    vkt diff ramp.vkt long.vkt # 400 flips and two
    vkt info long.vkt | grep -q '^history    … 3 earlier steps | vkt flip x | '
    vkt history long.vkt --json | /usr/bin/python3 -c '
import json, sys
h, n = json.load(sys.stdin), 0
while h.get("inputs"): h, n = h["inputs"][0], n + 1
assert h == {"command": [], "earlier": 3} and n == 400, (h, n)'
    # What is left makes no volume, and says so.
    fails_with 1 "3 earlier steps are only counted" vkt history long.vkt --as-shell
    for format in nrrd mha; do
        vkt read long.vkt | vkt write out.$format
        vkt diff out.$format long.vkt
    done
    vkt history out.nrrd | diff - folded
    vkt history out.mha | diff - folded
}

@test "MetaImage keeps as much of a long history as foreign readers can take" {
    python_with vtk
    vkt pipe "make ramp --dims 4 3 2 --dtype uint8 $(printf "| set --attribute note=$(printf 'x%.0s' $(seq 150)) %.0s" $(seq 300)) | write long.vkt"
    vkt read long.vkt | vkt write long.mha
    vkt diff long.vkt long.mha
    [ "$(vkt history long.vkt | wc -l)" -eq 301 ]
    kept=$(vkt history long.mha | grep -c 'set --attribute')
    [ "$kept" -gt 50 ]
    [ "$kept" -lt 200 ]
    [ "$(vkt history long.mha | sed -n '$s/^ *//p')" = "… $((301 - kept)) earlier steps" ]
    /usr/bin/python3 -c '
import vtk
r = vtk.vtkMetaImageReader(); r.SetFileName("long.mha"); r.Update()
assert r.GetOutput().GetDimensions() == (4, 3, 2) and r.GetOutput().GetScalarRange()[1] > 0'
}

@test "a stream or file with more steps than are kept is read" {
    /usr/bin/python3 - <<'PY'
history = '{"command":["flip","x"],"inputs":[' * 4999 + '{"command":["make","ramp"]}' + ']}' * 4999
head = 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nvkt history:=%s\n\n' % history
open('deep.nrrd', 'wb').write(head.encode() + bytes(range(8)))
head = ('ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nVktHistory = %s\nElementType = MET_UCHAR\n'
        'ElementDataFile = LOCAL\n' % history)
open('deep.mha', 'wb').write(head.encode() + bytes(range(8)))
PY
    for file in deep.nrrd deep.mha; do
        vkt read $file | vkt flip x | vkt flip x | vkt history >steps
        [ "$(wc -l <steps)" -eq 401 ]
        [ "$(tail -1 steps | sed 's/^ *//')" = "… 4602 earlier steps" ]
        run ! grep -q attribute <(vkt info $file)
    done
}

@test "a volume that is combined with itself again and again keeps a short history" {
    vkt make ramp --dims 2 2 2 --dtype float64 -o a.vkt
    for i in $(seq 40); do
        timeout 30 vkt arith sub a.vkt a.vkt -o b.vkt
        mv b.vkt a.vkt
    done
    [ "$(stat -c %s a.vkt)" -lt 200000 ]
    vkt history a.vkt | grep -q 'earlier steps$'
    vkt stats a.vkt | grep -q '^max *0$'
}

@test "words that a terminal would act on are quoted, on one line, and still run" {
    vkt make ramp --dims 2 2 2 | vkt set --attribute "note=$(printf 'a\nb\t\033[31mred\302\233m it'"'"'s')" -o n.vkt
    again n.vkt
    vkt history n.vkt --as-shell >line
    for form in '' --as-shell --json; do
        vkt history n.vkt $form >out
        only_shown out
    done
    [ "$(wc -l <line)" -eq 1 ]
    vkt history n.vkt --json | /usr/bin/python3 -c '
import json, sys
assert json.load(sys.stdin)["command"][-1] == "note=a\nb\t\x1b[31mred\x9bm it\x27s"'
    vkt pipe "$(sed 's/vkt //g' line) | diff - n.vkt"
}

@test "pictures of slices, projections, histograms and charts tell their history" {
    vkt make sphere --dims 20 18 16 --edge coverage -o ball.vkt
    vkt slice ball.vkt --z 8 --range 0:1 -o slice.png 2>said
    grep -qx "vkt slice: png files do not hold the place, the map of values, the error: not kept" said
    vkt flip x ball.vkt | vkt slice --z 8 --range 0:1 -o 'several%d.png'
    vkt project max ball.vkt --axis z | vkt convert --dtype uint8 --range 0:1 -o project.png
    vkt histogram ball.vkt --bins 8 -o histogram.png
    made="vkt make sphere --dims 20 18 16 --edge coverage"
    [ "$(vkt history slice.png --as-shell)" = "$made | vkt slice --z 8 --range 0:1" ]
    [ "$(vkt history several0.png --as-shell)" = "$made | vkt flip x | vkt slice --z 8 --range 0:1" ]
    [ "$(vkt history project.png --as-shell)" = "$made | vkt project max --axis z | vkt convert --dtype uint8 --range 0:1" ]
    [ "$(vkt history histogram.png --as-shell)" = "$made | vkt histogram --bins 8" ]
    # It is the same picture to others, and without a history, that of another program.
    vkt slice ball.vkt --z 8 --range 0:1 --no-history -o bare.png
    vkt diff slice.png bare.png
    strings slice.png | grep -q "Software"
    if command -v gnuplot >/dev/null; then
        vkt chart 'filter gaussian --sigma 1' ball.vkt --budget 0.5 -o chart.png >/dev/null
        [ "$(vkt history chart.png --as-shell)" = "$made | vkt chart 'filter gaussian --sigma 1' - --budget 0.5" ]
        vkt image diff chart.png chart.png >/dev/null # its checksums hold
    fi
    # PFM has no place, and says so where something else is lost, too.
    vkt slice ball.vkt --z 8 | vkt set --spacing 2,2,2 -o slice.pfm 2>said
    grep -q 'pfm files do not hold .*the history: not kept' said
    fails_with 1 "no history" vkt history slice.pfm --as-shell
}

@test "a picture tells its history, and its recipe makes it again" {
    vkt make sphere --dims 24 20 16 --edge coverage | vkt filter gaussian --sigma 1 | vkt render --size 20x16 --view x -o p.png
    vkt history p.png >tree
    diff - tree <<'END'
vkt render --size 20x16 --view x
  vkt filter gaussian --sigma 1,1,1
    vkt make sphere --dims 24 20 16 --edge coverage
END
    vkt history <p.png | diff tree -
    vkt history p.png --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h["command"][0] == "render" and h["inputs"][0]["inputs"][0]["command"][:2] == ["make", "sphere"], h'
    vkt history p.png --as-shell >line
    bash -c "$(cat line)" >again.png
    cmp p.png again.png
    # Pictures of others have none; damaged ones are bad data, and they are no volumes.
    /usr/bin/python3 -c '
import struct, zlib
def chunk(kind, data): return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
head, end = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)), chunk(b"IEND", b"")
body = chunk(b"IDAT", zlib.compress(b"\0\0"))
open("foreign.png", "wb").write(head + chunk(b"tEXt", b"vkt history\0{}") + body + end)
open("none.png", "wb").write(head + chunk(b"iTXt", b"vkt history\0\0\0\0\0no JSON") + body + end)
open("long.png", "wb").write(head + b"\xff\xff\xff\xffiTXt" + end)
data = open("p.png", "rb").read()
at = data.index(b"vkt history")
open("damaged.png", "wb").write(data[:at + 20] + b"X" + data[at + 21:])
open("cut.png", "wb").write(data[:-5])'
    for name in foreign none; do
        vkt history $name.png 2>&1 | grep -q 'has no history'
    done
    fails_with 3 "a checksum does not match" vkt history damaged.png
    fails_with 3 "ended early" vkt history cut.png
    fails_with 3 "impossible chunk" vkt history long.png
    fails_with 3 "a volume has one number in each voxel" vkt stats p.png
}

@test "--as-shell says what the pipeline would miss" {
    quiet() { vkt history "$1" --as-shell 2>said >/dev/null && [ ! -s said ]; }
    vkt make ramp --dims 4 4 4 --no-history -o r.nrrd
    vkt flip x r.nrrd -o f.vkt
    quiet f.vkt
    vkt make ramp --dims 4 4 4 | vkt resample --like r.nrrd | vkt arith sub - r.nrrd -o like.vkt
    quiet like.vkt
    mv r.nrrd elsewhere.nrrd
    vkt history f.vkt --as-shell 2>said | grep -qx 'vkt flip x r.nrrd'
    grep -qx "vkt history: what it reads is not here: 'r.nrrd'" said
    vkt history like.vkt --as-shell 2>&1 | grep -q "not here: 'r.nrrd'"
    vkt flip x <elsewhere.nrrd | vkt history --as-shell 2>&1 | grep -q "reads standard input"
    vkt read - <elsewhere.nrrd | vkt flip x | vkt history --as-shell 2>&1 | grep -q "reads standard input"
    vkt arith sub elsewhere.nrrd <(cat elsewhere.nrrd) -o s.vkt
    vkt history s.vkt --as-shell 2>&1 | grep -q "not here: '/dev/fd/"
    # Without any history there is nothing to run.
    fails_with 1 "it has no history" vkt history elsewhere.nrrd --as-shell
    # Words that this version does not take.
    printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 1\nencoding: raw\nvkt history:={"command":["frobnicate","x"]}\n\na' >new.nrrd
    vkt history new.nrrd --as-shell 2>&1 | grep -q "cannot be run here: 'frobnicate' is not a command"
}
