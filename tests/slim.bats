# vkt slim: the smallest model whose picture, or result, stays within a bound; checked with vkt diff and NumPy.
load helper

# ball: a soft ball off the middle in an empty float volume, ball.nrrd. The camera stands still.
ball() {
    vkt make sphere --dims 48 48 48 --center 20,24,26 --radius 8 --edge coverage | vkt filter gaussian --sigma 2 | vkt arith mul - 1000 | vkt convert --dtype float32 -o ball.nrrd
}
look="render --size 96 --domain 100:1000 --opacity 0,0.3 --unit-distance 1 --eye 24,-90,30 --target 24,24,24"

bytes_of() { vkt info "$1" --json | /usr/bin/python3 -c '
import json, sys, numpy as np
i = json.load(sys.stdin); n = i.get("cells") or int(np.prod(i["dims"]))
print(n * np.dtype(i["dtype"]).itemsize)'; }

# levels_apart A B: largest difference of two pictures, in levels.
levels_apart() {
    # shellcheck disable=SC2086
    vkt $look "$1" -o a.png --force -q
    # shellcheck disable=SC2086
    vkt $look "$2" -o b.png --force -q
    /usr/bin/python3 -c '
import struct, zlib
def levels(name):
    data = open(name, "rb").read(); at = 8; idat = b""
    while at < len(data):
        n, kind = struct.unpack(">I4s", data[at:at + 8]); body = data[at + 8:at + 8 + n]; at += 12 + n
        if kind == b"IHDR": w, h, depth, color = struct.unpack(">IIBB", body[:10])
        if kind == b"IDAT": idat += body
    assert depth == 8
    c = {2: 3, 6: 4}[color]; raw = zlib.decompress(idat); rows = []; before = bytes(w * c)
    for y in range(h):
        f = raw[y * (w * c + 1)]; line = bytearray(raw[y * (w * c + 1) + 1:(y + 1) * (w * c + 1)])
        for i in range(w * c):
            a = line[i - c] if i >= c else 0; b = before[i]; d = before[i - c] if i >= c else 0
            p = a + b - d; nearest = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - d), 2, d))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, nearest)[f]) & 255
        rows.append(line); before = line
    return b"".join(rows)
print(max(abs(x - y) for x, y in zip(levels("a.png"), levels("b.png"))))'
}

@test "for a picture: smaller, and within the bound" {
    ball
    vkt slim ball.nrrd --for "$look" --within 2 -o slim.vkt 2>said
    cat said >&3
    grep -q 'times smaller), drawn in .* ms instead of .* ms' said
    grep -q 'differs by .* display levels at most' said
    [ "$(bytes_of slim.vkt)" -lt $((48 * 48 * 48 * 4 / 4)) ]
    [ "$(levels_apart ball.nrrd slim.vkt)" -le 3 ] # levels are rounded in files
    # The history is what was done.
    vkt history slim.vkt --as-shell | grep -q 'crop --roi .* | vkt convert --dtype auto'
}

# valley.nrrd: int16, 8000 at both ends of x and -8000 in the middle, in steps of 32; 8 bits over all of them are steps
# of 63.
valley() {
    vkt make ramp --dims 1001 12 12 --axis x --from -500 --to 500 --dtype int16 | vkt transform 'abs(v) * 32 - 8000' --dtype int16 -o valley.nrrd
}

@test "both ends of the values are cut off where a picture does not show them" {
    valley
    local narrow="render --size 800x40 --fov 2 --domain 100:200 --opacity 0,0.5 --unit-distance 1 --eye 500,-1500,6 --target 500,6,6"
    vkt slim valley.nrrd --for "$narrow" --within 0.5 -o slim.vkt 2>said
    cat said >&3
    grep -q 'values below .* (.* % of the voxels) and above .* (.* % of the voxels) are cut off' said
    vkt history slim.vkt --as-shell | grep -q 'convert --dtype uint8 --range'
    look="$narrow" levels_apart valley.nrrd slim.vkt >apart
    [ "$(cat apart)" -le 1 ] # levels are rounded in files
}

@test "both ends of the values are cut off where a result is not made of them, and the integers between are kept" {
    valley
    while read -r work; do
        vkt slim valley.nrrd --for "$work" --within 0 -o slim.vkt --force 2>said
        vkt info slim.vkt | grep -q uint8
        cat said >&3
        grep -q 'values below .* cut off' said
        vkt pipe -q "read valley.nrrd | $work | write a.vkt" --force
        vkt pipe -q "read slim.vkt | $work | write b.vkt" --force
        vkt convert --dtype int32 a.vkt a32.vkt --force
        vkt convert --dtype int32 b.vkt b32.vkt --force
        vkt diff a32.vkt b32.vkt
        # What is told of the ends is what NumPy counts.
        vkt convert valley.nrrd --dtype int16 -o valley.npy --force -q
        /usr/bin/python3 -c '
import re, numpy as np
values = np.load("valley.npy").astype(float)
said = open("said").read()

def end(where):
    value, share = map(float, re.search(where + r" (\S+) \((\S+) %", said).groups())
    far = values < value if where == "below" else values > value
    assert abs(100 * far.mean() - share) < 0.1, said
    return value
assert end("above") == end("below") + 255, said'
    done <<'END'
arith clamp - 104 300
filter median --radius 1 | arith clamp - 500 700
END
    # Where every value counts nothing is cut off.
    vkt slim valley.nrrd --for 'flip x' --within 0 -o all.vkt 2>said
    vkt diff valley.nrrd all.vkt
    run ! grep 'cut off' said
}

@test "FLIP is told, as vkt image diff finds it in the pictures" {
    ball
    vkt slim ball.nrrd --for "$look" --within 30 -o slim.vkt 2>said
    levels_apart ball.nrrd slim.vkt
    vkt image diff a.png b.png --json >diff || true
    /usr/bin/python3 -c '
import json, re
told = float(re.search(", root mean square [0-9.]*, FLIP ([0-9.e-]+);", open("said").read()).group(1))
found = json.load(open("diff"))["flip"]
assert found > 0.002 and abs(told - found) < 0.05 * found, (told, found)' # levels are rounded in files
}

# A ball that a wall hides from the first of four cameras, and from no other.
@test "of an orbit every picture stays within the bound" {
    vkt make sphere --dims 32 32 32 --center 16,22,16 --radius 3 | vkt arith mul - 400 | vkt fill --value 900 --roi 4:28,6:9,4:28 -o hidden.nrrd
    orbit="render --size 48 --domain 100:1000 --opacity 0,0.99 --unit-distance 0.5 --view=-y --orbit 4"
    vkt slim hidden.nrrd --for "$orbit" --within 1 -o slim.vkt 2>said
    cat said >&3
    grep -q 'times smaller), 4 pictures drawn in' said
    grep -q 'at most, root mean square .*, FLIP [0-9.e-]*; the smallest of' said
    # shellcheck disable=SC2086
    vkt $orbit hidden.nrrd -o a-%d.png -q
    # shellcheck disable=SC2086
    vkt $orbit slim.vkt -o b-%d.png -q
    for i in 0 1 2 3; do
        vkt image diff a-$i.png b-$i.png --json >diff || true
        /usr/bin/python3 -c 'import json; found = json.load(open("diff")); assert found["levels"] <= 2.01, found'
    done
    fails_with 5 '400 pictures take' vkt slim hidden.nrrd --for 'render --orbit 400' --within 1 --memory 64M -o x.vkt
}

@test "a bound of 0 is met by an equal picture, and nothing that misses a bound is written" {
    ball
    vkt convert ball.nrrd --dtype uint8 --range minmax -q -o bytes.nrrd
    vkt slim bytes.nrrd --for "$look" --within 0 -o slim.vkt 2>said
    [ "$(levels_apart bytes.nrrd slim.vkt)" -eq 0 ]
    # Noise that a picture shows in full leaves nothing to save.
    vkt make noise --dims 12 12 12 --dtype uint8 --high 255 -o noise.nrrd
    vkt slim noise.nrrd --for 'flip x' --within 0 -o same.nrrd 2>said
    grep -q 'nothing smaller stays within 0' said
    vkt diff noise.nrrd same.nrrd
}

@test "for a pipeline: the result stays within the tolerance" {
    vkt make noise --dims 30 31 32 --low 0 --high 500 --dtype float32 -o v.nrrd
    for within in 3 0.2 0.001; do
        vkt slim v.nrrd --for 'filter gaussian --sigma 1' --within $within -o s.vkt --force -q
        vkt filter gaussian s.vkt --sigma 1 -q | vkt convert --dtype float64 -q >s
        vkt filter gaussian v.nrrd --sigma 1 -q | vkt convert --dtype float64 -q >v
        vkt diff v s --tolerance "$(awk "BEGIN { print $within * 1.0001 }")"
    done
    vkt slim v.nrrd --for 'filter gaussian --sigma 1' --within 3 2>said | vkt info | grep -q 'uint8'
    grep -q 'root mean square' said
    run ! grep FLIP said
}

# dims_of FILE
dims_of() { vkt info "$1" --json | /usr/bin/python3 -c 'import json, sys; print(*json.load(sys.stdin)["dims"])'; }

# within PIPELINE E A B: what the pipeline makes of B is within E of what it makes of A.
within() {
    vkt pipe -q "read $3 | $1 | convert --dtype float64 | write whole.vkt" --force
    vkt pipe -q "read $4 | $1 | convert --dtype float64 | write part.vkt" --force
    vkt diff whole.vkt part.vkt --tolerance "$2"
}

@test "operations keep of the volume what they read, with their margins" {
    vkt make noise --dims 64 48 56 --low 0 --high 500 --dtype float32 -o v.nrrd
    while read -r dims work; do
        vkt slim v.nrrd --for "$work" --within 0.5 -o s.vkt --force -q
        [ "$(dims_of s.vkt)" = "${dims//x/ }" ] || { echo "$work: $(dims_of s.vkt)" >&2; return 1; }
        within "$work" 0.5 v.nrrd s.vkt
    done <<'END'
40x40x40 crop --roi 0:40,0:40,0:40 | filter gaussian --sigma 1
40x30x48 crop --roi 10:40,0:30,40:48
64x48x13 filter median --radius 3 | crop --roi :,:,0:10
16x18x5 filter box --radius 2 | crop --roi-world 10:21,20:33,7:7
64x48x9 slice --z 8
64x48x56 filter box --radius 2 --boundary wrap | crop --roi :,:,0:10
64x48x56 transform 'v * 2'
END
}

@test "operations that name the lattice of their result are given a lower resolution, if it suffices" {
    vkt make noise --dims 64 48 56 --low 0 --high 500 --dtype float32 | vkt filter gaussian --sigma 4 -o smooth.nrrd
    work='resample --dims 16 12 14 | filter gaussian --sigma 1'
    vkt slim smooth.nrrd --for "$work" --within 2 -o s.vkt
    vkt history s.vkt --as-shell | grep -q 'resample --scale'
    [ "$(dims_of s.vkt)" = "16 12 14" ]
    within "$work" 2 smooth.nrrd s.vkt
    # What has as many voxels as the volume cannot be compared with less.
    vkt slim smooth.nrrd --for 'flip x' --within 2 -o t.vkt
    [ "$(dims_of t.vkt)" = "64 48 56" ]
}

@test "pipes, vkt pipe, dry runs, refusals" {
    vkt make noise --dims 20 21 22 --low 0 --high 500 --dtype float32 -o v.nrrd
    vkt read v.nrrd | vkt slim --for 'flip x' --within 2 -q | vkt write a.nrrd
    vkt pipe -q "read v.nrrd | slim --for 'flip x' --within 2 | write b.nrrd"
    vkt diff a.nrrd b.nrrd
    vkt diff v.nrrd a.nrrd --tolerance 2
    vkt slim v.nrrd --for 'flip x' --within 2 -n -o c.nrrd 2>plan
    grep -q 'vkt slim: -> 20x21x22 float32' plan
    [ ! -e c.nrrd ]
    fails_with 2 'missing --for' vkt slim v.nrrd --within 1 -o x.vkt
    fails_with 2 'no operation on voxels' vkt slim v.nrrd --for 'help' --within 1 -o x.vkt
    fails_with 2 'finite number' vkt slim v.nrrd --for 'flip x' --within -1 -o x.vkt
    [ ! -e x.vkt ]
}

@test "where nothing depends on the values, some of them are left" {
    vkt make noise --dims 16 16 16 --dtype float32 --low -100 --high -90 --seed 1 -o below.vkt
    vkt make noise --dims 16 16 16 --dtype float64 --low 300 --high 900 --seed 3 -o above.vkt
    for pipeline in 'threshold --range 0:50' 'arith clamp - 0 50'; do
        for volume in below above; do
            vkt slim $volume.vkt --for "$pipeline" --within 0.1 --force -o small.vkt
            vkt pipe "read small.vkt | $pipeline" | vkt diff - <(vkt pipe "read $volume.vkt | $pipeline") --tolerance 0.1
        done
    done
    vkt slim below.vkt --for 'render --domain 0:20 --opacity 0,1 --size 32' --within 1.5 --force -o small.vkt
    vkt slim above.vkt --for 'render --render-algo mean --domain 0:20 --size 32' --within 1.5 --force -o small.vkt
}
