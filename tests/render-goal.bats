# vkt render: pictures that stop when they are good enough, or when they are told to.
load helper

setup_more() {
    /usr/bin/python3 -c "
v = bytearray(24 * 18 * 30)
for z in range(10, 20):
    for y in range(5, 13):
        for x in range(8, 16): v[(z * 18 + y) * 24 + x] = 200
open('block_24x18x30_uint8.raw', 'wb').write(v)"
    f=block_24x18x30_uint8.raw
    cloud="-ra multi-scattering --opacity 0,0.3"
}

quality_of() { /usr/bin/python3 -c "
import re, sys
print(re.search(rb'iTXtQuality\0\0\0\0\0(.*?).{4}\0\0', open(sys.argv[1], 'rb').read(), re.S)[1].decode('latin1'))" "$1"; }

@test "errors, rays and seconds are told by the picture and on standard error" {
    vkt render $f --size 24 --tolerance 2 -o a.png 2>err
    quality_of a.png | grep -Eq '^error [0-9.]+ of 255 levels, in the worst pixel [0-9.]+ \(asked 2\), [0-9.]+ rays a pixel, [0-9.e-]+ s'
    grep -q "(asked 2)" err
    vkt render $f --size 24 -ra implicit-iso --tolerance 4 -o b.png 2>err
    quality_of b.png | grep -q "(asked 4)"
    vkt render $f --size 24 $cloud --noise 8 -o c.png 2>err
    quality_of c.png | grep -Eq '^noise [0-9.]+ of 255 levels, in the worst tile [0-9.]+ \(asked 8\), [0-9.]+ paths a pixel'
    # What was not asked for is told where it is known, and nothing that changes from run to run.
    vkt render $f --size 24 $cloud --spp 8 -o d.png 2>err
    quality_of d.png | grep -Eq '^noise [0-9.]+ of 255 levels, in the worst tile [0-9.]+$'
    [ ! -s err ]
    vkt history c.png | grep -q -- "--noise 8"
}

@test "pixels of surfaces within a tolerance: fewer than 2% are not, and none by five times" {
    vkt make noise --dims 32 32 32 --dtype float32 --seed 4 | vkt filter gaussian --sigma 2 -o blobs.nrrd
    vkt render blobs.nrrd -ra implicit-iso --iso 0.5 --spp 1 --size 1536 -o fine.pfm
    for tolerance in 2 4 8; do
        vkt render blobs.nrrd -ra implicit-iso --iso 0.5 --size 48 --tolerance $tolerance -o at.pfm --force
        /usr/bin/python3 -c "
import numpy as np
def light(name):
    f = open(name, 'rb')
    f.readline()
    w, h = map(int, f.readline().split())
    f.readline()
    return np.frombuffer(f.read(), '<f4').reshape(h, w, 3).astype(float)
def levels(l):
    l = np.clip(l, 0, 1)
    return 255 * np.where(l > 0.0031308, 1.055 * l ** (1 / 2.4) - 0.055, 12.92 * l)
fine = light('fine.pfm').reshape(48, 32, 48, 32, 3).mean((1, 3))
error = np.abs(levels(light('at.pfm')) - levels(fine)).max(-1)
print($tolerance, error.max(), (error > $tolerance).mean())
assert error.max() < 5 * $tolerance and (error > $tolerance).mean() < 0.02"
    done
}

@test "more is asked for than paths allow: said, and refused by --strict" {
    vkt render $f --size 16 $cloud --noise 0.5 --spp 20 -o a.png 2>err
    grep -q "not as good as asked for" err
    fails_with 3 "not as good as asked for" vkt render $f --size 16 $cloud --noise 0.5 --spp 20 --strict -o b.png
    [ ! -e b.png ]
}

@test "goals that do not apply or make no sense are refused" {
    fails_with 2 "--noise does not apply" vkt render $f --noise 1 -o a.png
    fails_with 2 "--tolerance does not apply" vkt render $f -ra multi-scattering --tolerance 1 -o a.png
    fails_with 2 "--tolerance must be greater than 0" vkt render $f --tolerance 0 -o a.png
    fails_with 2 "--noise must be greater than 0" vkt render $f -ra multi-scattering --noise -1 -o a.png
    fails_with 2 "--time must be greater than 0" vkt render $f --time 0 -o a.png
    [ ! -e a.png ]
}

@test "time ends a picture" {
    timeout 60 vkt render $f --size 64 $cloud --time 0.3 -o a.png 2>err
    grep -q "the time was up" err
    timeout 60 vkt render $f --size 32 --time 0.3 -o b.png
}

# interrupt_after_work PROCESS HUNDREDTHS: an interrupt once the process has worked for so many hundredths of a second (it
# draws; before, the signal would end it), and its exit code as $code.
interrupt_after_work() {
    for _ in $(seq 500); do
        read -r -a stat </proc/$1/stat
        [ "${stat[13]}" -lt "$2" ] || break
        sleep 0.1
    done
    kill -INT "$1"
    timeout 60 tail --pid="$1" -f /dev/null || kill -KILL "$1"
    code=0
    wait "$1" || code=$?
}

@test "an interrupt ends the largest picture, whether all of its memory is there or not" {
    for reached in 200000 2200000; do # of 2 GiB, in KiB
        env --default-signal=INT vkt render $f --size 16384x8192 --shade gradient --opacity 0,0.02 --step 0.01 -o a.png --force 2>err 3>&- &
        pid=$!
        for _ in $(seq 100); do
            resident=$(awk '/^VmRSS/ { print $2 }' /proc/$pid/status)
            [ "${resident:-0}" -lt $reached ] || break
            sleep 0.1
        done
        kill -INT $pid
        code=0
        wait $pid || code=$?
        [ "$code" = 130 ]
        if grep -q 'no picture is written' err; then
            [ ! -e a.png ]
        else
            # How much was left says that it was soon, not the seconds: machines are loaded.
            left=$(sed -n 's/.*interrupted: .*, \([0-9]*\)[0-9.]*% of the pixels not drawn.*/\1/p' err)
            [ "$left" -ge 10 ]
            grep -q 'was: [0-9.]* s, stopped' err
            [ "$(/usr/bin/python3 -c "import struct; print(*struct.unpack('>II', open('a.png', 'rb').read(24)[16:]))")" = "16384 8192" ]
            rm a.png
        fi
    done
}

@test "an interrupt saves what there is and says so" {
    # What a script starts behind it ignores interrupts, unless it is told not to.
    env --default-signal=INT vkt render $f --size 64 $cloud --spp 10000000 -o a.png 2>err 3>&- &
    interrupt_after_work $! 50
    [ "$code" = 130 ]
    grep -q "interrupted: the picture is what there was" err
    quality_of a.png | grep -q "stopped before it was finished"
}

@test "--explain names the model and why nothing heavier" {
    vkt render $f --size 8 --explain -o a.png 2>err
    grep -q "model absorption and emission" err
    grep -q "no heavier model: .*multi-scattering" err
    grep -q "refinement one ray a pixel" err
    vkt render $f --size 8 $cloud --noise 100 --explain -o b.png 2>err
    grep -q "model multiple scattering" err
    grep -q "refinement paths until the noise is below 100 levels in every tile" err
}

@test "paths go on where the pilot found too little noise" {
    needs_data raw/fuel_64x64x64_uint8.raw
    f=$VKT_DATA/raw/fuel_64x64x64_uint8.raw
    vkt render $f --size 96 --view x -ra multi-scattering --noise 4 --strict -o a.png
    vkt render $f --size 96 --view x -ra multi-scattering --noise 3 --strict -o b.png
}
