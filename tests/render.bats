# vkt render: pictures, options that exclude each other, files, streams.
load helper

setup_more() {
    # 24x18x30 uint8: a block of 200 in zeros.
    /usr/bin/python3 -c "
v = bytearray(24 * 18 * 30)
for z in range(10, 20):
    for y in range(5, 13):
        for x in range(8, 16): v[(z * 18 + y) * 24 + x] = 200
open('block_24x18x30_uint8.raw', 'wb').write(v)"
}

# size_of PNG: "W H bits colour-type" from its header.
size_of() { /usr/bin/python3 -c "
import struct, sys
b = open(sys.argv[1], 'rb').read()
assert b[:8] == b'\x89PNG\r\n\x1a\n' and b[-8:-4] == b'IEND', 'not a whole PNG'
print(*struct.unpack('>IIBB', b[16:26]))" "$1"; }

# pixel PNG X Y: its channels, read by VTK.
pixel() { /usr/bin/python3 -c "
import sys, vtk
r = vtk.vtkPNGReader(); r.SetFileName(sys.argv[1]); r.Update(); i = r.GetOutput()
w, h, _ = i.GetDimensions()
x, y = int(sys.argv[2]), h - 1 - int(sys.argv[3])
print(*[int(i.GetScalarComponentAsDouble(x, y, 0, c)) for c in range(i.GetNumberOfScalarComponents())])" "$@"; }

@test "a picture from a file and from a pipe is the same" {
    vkt render block_24x18x30_uint8.raw --size 64x48 -o a.png
    [ "$(size_of a.png)" = "64 48 8 2" ]
    vkt render block_24x18x30_uint8.raw --size 64x48 -o - >b.png
    [ "$(size_of b.png)" = "64 48 8 2" ]
    vkt render block_24x18x30_uint8.raw --size 64x48 --threads 1 -o c.png
    vkt render block_24x18x30_uint8.raw --size 64x48 --threads 3 -o d.png --force
    cmp a.png b.png
    cmp a.png c.png
    cmp a.png d.png
}

@test "every algorithm draws the block and not the rest" {
    python_with vtk
    for algorithm in ray-marching implicit-iso multi-scattering; do
        vkt render block_24x18x30_uint8.raw --render-algo $algorithm --size 64 --background 0,0,1 -o "$algorithm.png"
        [ "$(pixel "$algorithm.png" 0 0)" = "0 0 255" ]
        [ "$(pixel "$algorithm.png" 32 32)" != "0 0 255" ]
    done
}

@test "volkit's command lines run" {
    vkt render block_24x18x30_uint8.raw >a.png
    [ "$(size_of a.png)" = "512 512 8 2" ]
    vkt render block_24x18x30_uint8.raw --render-algo multi-scattering --rgba-lookup-table 1 1 1 0  0.2 0.0 0.2 0.2  0.0 0.8 0.8 0.8  1 1 0 1 --spp 2 >b.png
    [ "$(size_of b.png)" = "512 512 8 2" ]
    vkt render block_24x18x30_uint8.raw -ra ray-marching -lut 1 1 1 0 1 1 1 1 >c.png
    [ "$(size_of c.png)" = "512 512 8 2" ]
}

@test "an opaque value shows its colour, a clear one the background" {
    python_with vtk
    vkt render block_24x18x30_uint8.raw --lut 0 0 0 0  1 0.5 0.25 1 --domain 0:200 --view x --size 65 --projection orthographic \
        --background 0.2,0.4,0.6 -o a.png
    read -r r g b <<<"$(pixel a.png 32 32)"
    # The outermost voxel of the block is interpolated with zero, so that nearly all light is the block's.
    [ "$r" -ge 253 ] && [ "$g" -ge 124 ] && [ "$g" -le 130 ] && [ "$b" -ge 60 ] && [ "$b" -le 67 ]
    [ "$(pixel a.png 0 0)" = "51 102 153" ]
    vkt render block_24x18x30_uint8.raw --background 0,0,0,0 --size 32 -o clear.png
    [ "$(size_of clear.png)" = "32 32 8 6" ]
    [ "$(pixel clear.png 0 0)" = "0 0 0 0" ]
}

@test "skipping empty space changes no pixel" {
    vkt render block_24x18x30_uint8.raw --size 100 -o a.png
    vkt render block_24x18x30_uint8.raw --size 100 --no-skip -o b.png
    /usr/bin/python3 - <<'PY'
import re
chunks = lambda name: [c for c in re.findall(rb'IDAT.*', open(name, 'rb').read(), re.S)]
assert chunks('a.png') == chunks('b.png')
PY
}

@test "transfer function files" {
    echo '{"points": [[0, 0,0,0, 0], [100, 1,0,0, 0], [200, 0,1,0, 1]], "unit": 1}' >t.json
    vkt render block_24x18x30_uint8.raw --transfer t.json --size 32 -o a.png
    echo '{"points": [[0, 0]]}' >bad.json
    fails_with 3 "transfer function" vkt render block_24x18x30_uint8.raw --transfer bad.json -o b.png
    fails_with 4 "none.json" vkt render block_24x18x30_uint8.raw --transfer none.json -o b.png
    [ ! -e b.png ]
}

@test "options that do not apply are refused" {
    f=block_24x18x30_uint8.raw
    fails_with 2 "--iso does not apply" vkt render $f --iso 3 -o a.png
    fails_with 2 "--step does not apply" vkt render $f -ra implicit-iso --step 1 -o a.png
    fails_with 2 "--opacity does not apply" vkt render $f -ra implicit-iso --opacity 0,1 -o a.png
    fails_with 2 "--spp does not apply" vkt render $f --spp 3 -o a.png
    fails_with 2 "--shade does not apply" vkt render $f -ra multi-scattering --shade none -o a.png
    fails_with 2 "exclude" vkt render $f --lut 1 1 1 1 --colormap bone -o a.png
    fails_with 2 "multiple of 4" vkt render $f --lut 1 1 1 -o a.png
    fails_with 2 "did you mean 'viridis'" vkt render $f --colormap virids -o a.png
    fails_with 2 "step" vkt render $f --step 0 -o a.png
    fails_with 2 "step" vkt render $f --step nan -o a.png
    fails_with 2 "size" vkt render $f --size 0x5 -o a.png
    fails_with 2 "view" vkt render $f --view left -o a.png
    fails_with 2 "unit" vkt render $f --unit -1 -o a.png
    fails_with 2 "background" vkt render $f --background red -o a.png
    [ ! -e a.png ]
}

@test "options that no volume suits are refused before anything is read" {
    # Nothing ever comes from this pipe.
    mkfifo silent
    exec 5<>silent
    while read -r option value said; do
        fails_with 2 "$option" timeout 20 vkt render silent -o a.png "$option=$value"
        [[ "$stderr" == *"$said"* ]] || { echo "$option $value: no '$said' in: $stderr" >&2; false; }
        fails_with 2 "$option" vkt render block_24x18x30_uint8.raw -o a.png -n "$option=$value"
    done <<'EOF'
--view foo not one of
--azimuth inf finite
--elevation 100 -90
--fov 200 180
--zoom 0 positive
--opacity garbage 'garbage' is not a number
--opacity 2 outside 0 to 1
--opacity 1:0.5,0.5 neither
--unit x 'x' is not a number
--unit -3 positive
--domain foo pA:pB
--domain 3:2 LO:HI
--colormap virids did you mean
--step 5 1/256
--opacity-scale -1 0 or greater
--up 0,0,0 no length
EOF
    f=block_24x18x30_uint8.raw
    fails_with 2 "--eye: " vkt render $f -n -o a.png --eye 1,2,3 --target 1,2,3
    fails_with 2 "--span: " vkt render $f -n -o a.png --projection orthographic --span 0
    fails_with 2 "--iso: " vkt render $f -n -o a.png -ra implicit-iso --iso nan
    fails_with 2 "--albedo: " vkt render $f -n -o a.png -ra multi-scattering --albedo 2
    fails_with 2 "--spp: " vkt render $f -n -o a.png -ra multi-scattering --spp 0
    fails_with 2 "--rgba-lookup-table" vkt render $f -n -o a.png --lut 1 1 1 2
    # What suits some volume is not refused: the middle of this one is elsewhere.
    vkt render $f -n -o a.png --eye 0,0,0 --domain 7:7 --opacity 5:0,6:1 --unit auto
    vkt render $f -n -o a.png --eye 0.5,0.5,0.5 --domain p1:p99 --opacity 0,1 --up 0,1,0
    [ ! -e a.png ]
}

@test "a picture that cannot be written is not drawn" {
    mkfifo silent
    exec 5<>silent
    echo precious >a.png
    for mode in '' -n; do
        fails_with 4 "a.png" timeout 20 vkt render silent -o a.png $mode
        fails_with 4 "nowhere" timeout 20 vkt render silent -o nowhere/b.png $mode
        [[ "$stderr" == *"make the directory 'nowhere' first"* ]]
        fails_with 4 "directory" timeout 20 vkt render silent -o . $mode
    done
    cp a.png c0.png
    fails_with 4 "c0.png" timeout 20 vkt render silent -o c%d.png
    vkt render block_24x18x30_uint8.raw -o a.png -n --force
    [ "$(cat a.png)" = precious ]
}

@test "--strict refuses voxels that cannot be shown as they are, and leaves no file" {
    /usr/bin/python3 -c "
import struct
v = [0.5] * 512
v[7] = float('nan'); open('nan_8x8x8_float32.raw', 'wb').write(struct.pack('<512f', *v))
v[7] = float('inf'); open('inf_8x8x8_float32.raw', 'wb').write(struct.pack('<512f', *v))"
    for kind in nan inf; do
        fails_with 3 "--strict: 1 voxels" vkt render ${kind}_8x8x8_float32.raw --size 8 -o $kind.png --strict
        [ ! -e $kind.png ]
        vkt render ${kind}_8x8x8_float32.raw --size 8 -o $kind.png 2>err
        grep -q "1 voxels are" err
        [ -s $kind.png ]
    done
    vkt render block_24x18x30_uint8.raw --size 8 -o fine.png --strict
}

@test "--explain says method, step and cost before it draws" {
    vkt render block_24x18x30_uint8.raw --size 20x10 --step 0.25 --explain -o a.png 2>err
    cat err
    grep -q "vkt render:   method ray marching, step 0.25 voxel" err
    grep -q "at most 170 steps on each of 200 rays, 33.1 KiB of memory" err # 24 * 18 * 30 + 28 * 22 * 34 bytes
    [ -s a.png ]
    vkt render block_24x18x30_uint8.raw --size 8 -n -ra multi-scattering --spp 3 -o b.png 2>err
    grep -q "192 paths" err
    vkt render block_24x18x30_uint8.raw --size 8 -ra implicit-iso --iso 100 --explain -o c.png 2>err
    grep -q "at most 72 voxels on each of 64 rays" err
}

@test "--memory counts the volume and the copy that rays sample" {
    fails_with 5 "33.1 KiB" vkt render block_24x18x30_uint8.raw --size 8 -o a.png --memory 33000
    fails_with 5 "budget" vkt render block_24x18x30_uint8.raw --size 8 -o a.png --memory 1k
    [ ! -e a.png ]
    vkt render block_24x18x30_uint8.raw --size 8 -o a.png --memory 34000
}

@test "a tree's rays that find no memory end the picture with an error" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers have an allocator of their own"
    command -v cc >/dev/null || skip "no C compiler"
    # The first elements of a list are 256.
    cat >none.c <<'C'
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
void *realloc(void *old, size_t size) {
    static void *(*next)(void *, size_t);
    if (next == NULL) *(void **)&next = dlsym(RTLD_NEXT, "realloc");
    return old == NULL && size >= 1024 && size % 256 == 0 ? NULL : next(old, size);
}
C
    cc -shared -fPIC none.c -o none.so -ldl
    vkt refine block_24x18x30_uint8.raw --tolerance 1 -o tree.vkt
    vkt render tree.vkt --size 16 -o a.png
    fails_with 5 "out of memory" env LD_PRELOAD="$PWD/none.so" vkt render tree.vkt --size 16 --threads 2 -o b.png
    [ ! -e b.png ]
}

@test "existing files are kept, broken input leaves none" {
    echo precious >a.png
    fails_with 4 "a.png" vkt render block_24x18x30_uint8.raw --size 16 -o a.png
    [ "$(cat a.png)" = precious ]
    vkt render block_24x18x30_uint8.raw --size 16 -o a.png --force
    [ "$(size_of a.png)" = "16 16 8 2" ]
    head -c 5000 block_24x18x30_uint8.raw >short_24x18x30_uint8.raw
    fails_with 3 "" vkt render short_24x18x30_uint8.raw -o b.png
    [ ! -e b.png ]
    [ -z "$(ls -A | grep -F .vkt- || true)" ]
}

@test "pictures of a series appear one by one, and stay if a later volume is bad" {
    for i in 0 1; do vkt make sphere --dims 12 12 12 --dtype uint8 -o v_$i.nrrd; done
    echo NRRD0004 >v_2.nrrd
    fails_with 3 "v_2.nrrd" vkt render 'v_?.nrrd' --size 16 -o 'q%%-%02d.png'
    [ "$(size_of q%-00.png)" = "16 16 8 2" ]
    [ "$(size_of q%-01.png)" = "16 16 8 2" ]
    [ ! -e q%-02.png ]
    # A picture does not wait for the volume after it.
    rm v_2.nrrd
    mkfifo v_2.nrrd
    vkt render 'v_?.nrrd' --size 16 -o p-%d.png 3>&- &
    for _ in $(seq 200); do [ ! -e p-1.png ] || break; sleep 0.1; done
    ls >before
    cat v_0.nrrd >v_2.nrrd
    wait $!
    grep -qx p-1.png before
    [ "$(size_of p-2.png)" = "16 16 8 2" ]
}

@test "one name takes one picture" {
    for i in 0 1; do vkt make sphere --dims 12 12 12 --dtype uint8 -o v_$i.nrrd; done
    fails_with 2 "several volumes" vkt render 'v_?.nrrd' --size 16 -o a.png
    fails_with 2 "several volumes" vkt render 'v_?.nrrd' --size 16 -o -
    fails_with 2 "no number's place" vkt render v_0.nrrd --size 16 -o 50%.png
    [ -z "$(ls ./*.png 2>/dev/null)" ]
    vkt render v_0.nrrd --size 16 -o 100%%.png
    [ -e 100%.png ]
}

@test "the picture tells how it was made, and neither when nor where" {
    vkt render block_24x18x30_uint8.raw --view x --size 16 -o a.png
    grep -aq "History" a.png
    grep -aq -- "--view x" a.png
    grep -aq "Transfer function" a.png
    run ! grep -aq "tIME" a.png
    ! grep -aqF "$(hostname)" a.png || [ "$(hostname)" = localhost ]
    sleep 1
    vkt render block_24x18x30_uint8.raw --view x --size 16 -o b.png
    cmp a.png b.png
}

@test "the stent shows without options" {
    needs_data raw/stent_128x128x256_int16.raw
    python_with vtk numpy
    vkt render "$VKT_DATA/raw/stent_128x128x256_int16.raw" -o stent.png
    # Bright wires on a dark ground: some pixels are nearly white, most are background.
    /usr/bin/python3 - <<'PY'
import vtk, numpy
from vtk.util.numpy_support import vtk_to_numpy
r = vtk.vtkPNGReader(); r.SetFileName('stent.png'); r.Update()
p = vtk_to_numpy(r.GetOutput().GetPointData().GetScalars()).astype(int)
bright, dark = (p.min(1) > 150).mean(), (p.max(1) < 40).mean()
print(bright, dark)
assert 0.002 < bright < 0.2 and 0.5 < dark < 0.97
PY
}
