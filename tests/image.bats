# vkt image: means, parts, and differences against NumPy, scikit-image's formula and the authors' FLIP evaluator.
load helper

setup_more() {
    python_with numpy
    vkt make noise --dims 16 14 12 -o v.nrrd
}

has_exr() {
    vkt doctor >doctor
    grep -q '^ *openexr *there' doctor
}

# Writes 8-bit RGB PNG files: png(NAME, array).
writer='
import numpy as np, struct, zlib
def png(name, a):
    chunk = lambda k, d: struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d))
    h, w, c = a.shape
    rows = b"".join(b"\0" + r.tobytes() for r in a.astype(np.uint8))
    open(name, "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, {1: 0, 3: 2, 4: 6}[c], 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
def pfm(name, a):
    open(name, "wb").write(b"PF\n%d %d\n-1.0\n" % (a.shape[1], a.shape[0]) + a[::-1].astype("<f4").tobytes())
def read_pfm(name):
    head, size, scale, pixels = open(name, "rb").read().split(b"\n", 3)
    w, h = map(int, size.split())
    return np.frombuffer(pixels, "<f4").reshape(h, w, 3)[::-1]
y, x = np.mgrid[0:48, 0:64]
a = np.stack([3 * x + y, 255 - 2 * x - y, (x * y) % 256], -1) % 256
b = np.stack([3 * x + y + 9 * ((x // 8 + y // 8) % 2), 255 - 2 * x - y, (x * y + 20 * (x > 40)) % 256], -1) % 256
'

@test "the mean of paths weighs them, and is the picture of all of them" {
    ext=png; depth=16; bound=2e-5
    if has_exr; then ext=exr; depth=32; bound=2e-7; fi
    common=(v.nrrd -ra multi-scattering --size 40x37 --seed 9 --depth "$depth")
    vkt render "${common[@]}" --spp 3 -o a.$ext
    vkt render "${common[@]}" --spp 5 --first-sample 3 -o b.$ext
    vkt render "${common[@]}" --spp 8 -o whole.$ext
    vkt image mean a.$ext b.$ext --depth "$depth" -o mean.$ext
    vkt image diff whole.$ext mean.$ext --tolerance $bound
    vkt image diff a.$ext mean.$ext --tolerance 0.01 >out || code=$?
    [ "$code" = 1 ]
    # The mean of means weighs as all of its paths.
    vkt render "${common[@]}" --spp 2 --first-sample 8 -o c.$ext
    vkt render "${common[@]}" --spp 10 -o ten.$ext
    vkt image mean mean.$ext c.$ext --depth "$depth" -o mean10.$ext
    vkt image diff ten.$ext mean10.$ext --tolerance $bound
    vkt history mean.$ext >out
    head -1 out | grep -q '^vkt image mean'
    [ "$(grep -c '^  vkt render' out)" = 2 ]
    vkt history mean.$ext --as-shell >line
    bash -c "set -o pipefail; $(cat line) -o again.png"
    vkt image diff mean.$ext again.png --tolerance 0.01 >out
}

@test "means of PNG and PFM, by NumPy" {
    /usr/bin/python3 -c "$writer
png('a.png', a); png('b.png', b)
rng = np.random.default_rng(1)
p, q, r = (rng.normal(1, 2, (9, 7, 3)).astype('f4') for i in range(3))
pfm('p.pfm', p); pfm('q.pfm', q); pfm('r.pfm', r)"
    vkt image mean a.png b.png -o ab.pfm
    vkt image mean p.pfm q.pfm r.pfm -o pqr.pfm
    vkt image mean a.png b.png -o ab.png
    cat a.png | vkt image mean - -o aa.png
    vkt image diff a.png aa.png
    /usr/bin/python3 -c "$writer
linear = lambda v: np.where(v <= 10.31475, v / 255 / 12.92, ((v / 255 + 0.055) / 1.055) ** 2.4)
assert np.abs(read_pfm('ab.pfm') - (linear(a) + linear(b)) / 2).max() < 1e-7
rng = np.random.default_rng(1)
p, q, r = (rng.normal(1, 2, (9, 7, 3)).astype('f4') for i in range(3))
assert np.abs(read_pfm('pqr.pfm') - (p.astype(float) + q + r) / 3).max() < 1e-6"
    vkt image diff ab.pfm ab.png --tolerance 0.005
}

@test "differences: NumPy, and the values that scikit-image 0.19 and FLIP's evaluator 1.7 give" {
    /usr/bin/python3 -c "$writer
png('a.png', a); png('b.png', b)"
    vkt image diff a.png b.png --json >report || code=$?
    [ "$code" = 1 ]
    /usr/bin/python3 -c "$writer
import json
r = json.load(open('report'))
linear = lambda v: np.where(v <= 10.31475, v / 255 / 12.92, ((v / 255 + 0.055) / 1.055) ** 2.4)
u, v = linear(a), linear(b)
assert abs(r['max_abs'] - np.abs(u - v).max()) < 1e-6
assert abs(r['rmse'] - np.sqrt(((u - v) ** 2).mean())) < 1e-7
assert abs(r['relmse'] - ((u - v) ** 2 / (u ** 2 + 0.01)).mean()) < 1e-6
assert abs(r['levels'] - np.abs(a - b).max()) < 1e-3
ssim, flip = 0.914316617, 0.083612747
assert abs(r['ssim'] - ssim) < 1e-6, r
assert abs(r['flip'] - flip) < 2e-6, r
try:
    from skimage.metrics import structural_similarity
    assert abs(ssim - structural_similarity(a / 255, b / 255, channel_axis=2, data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)) < 1e-6
except ImportError: pass
try:
    import flip_evaluator
    p, q = (np.ascontiguousarray(i.astype('f4') / 255) for i in (a, b))
    assert abs(flip - flip_evaluator.evaluate(p, q, 'LDR', applyMagma=False)[1]) < 2e-6
except ImportError: pass"
    vkt image diff a.png a.png >out
    grep -qx 'flip  *0' out
    grep -qx 'ssim  *1' out
    vkt image diff a.png b.png --tolerance 1 >out
}

@test "pictures that cannot be compared, averaged or joined" {
    /usr/bin/python3 -c "$writer
png('a.png', a); png('small.png', a[:20]); pfm('p.pfm', a / 255)
png('grey.png', a[:, :, :1]); open('no.png', 'wb').write(b'P6 1 1 255 abc')
b = open('a.png', 'rb').read(); open('cut.png', 'wb').write(b[:-40])"
    run vkt image diff a.png small.png
    [ "$status" = 1 ]
    [[ "$output" == *"same_size  no"* ]]
    fails_with 2 "two pictures" vkt image diff a.png
    fails_with 2 "negative" vkt image diff a.png a.png --tolerance -1
    fails_with 2 "differ in size" vkt image mean a.png small.png -o m.png
    fails_with 3 "no.png" vkt image mean a.png no.png -o m.png
    fails_with 3 "cut.png" vkt image mean a.png cut.png -o m.png
    fails_with 4 "none.png" vkt image mean a.png none.png -o m.png
    fails_with 2 "no part of another" vkt image join a.png -o m.png
    fails_with 2 "end the name in" vkt image mean a.png -o m.jpg
    vkt render v.nrrd -ra multi-scattering --spp 1 --size 64x48 -o s.png
    fails_with 2 "only some" vkt image mean s.png a.png -o m.png
    vkt render v.nrrd -ra multi-scattering --spp 1 --first-sample 1 --size 64x48 -o t.png
    fails_with 2 "pictures 1 and 3 are made of the same paths" vkt image mean s.png t.png s.png -o m.png
    vkt render v.nrrd -ra multi-scattering --spp 3 --size 64x48 -o u.png
    fails_with 2 "paths 0 to 0 of seed 0 are in both" vkt image mean s.png u.png -o m.png
    vkt image mean s.png t.png -o st.png
    fails_with 2 "paths 1 to 1 of seed 0 are in both" vkt image mean u.png t.png -o m.png
    fails_with 2 "same paths" vkt image mean st.png u.png -o m.png
    fails_with 2 "same paths" vkt image mean st.png st.png -o m.png
    [ ! -e m.png ]
    vkt image mean a.png -o m.png -n 2>err
    [ ! -e m.png ]
    vkt image mean a.png grey.png -o m.png
    fails_with 4 "m.png" vkt image mean a.png -o m.png
}

@test "parts drawn one by one are the whole picture, byte for byte" {
    suffixes=png
    if has_exr; then suffixes="png exr"; fi
    for algorithm in ray-marching implicit-iso maximum; do
        for suffix in $suffixes; do
            vkt render v.nrrd -ra $algorithm --size 50x100 -o whole.$suffix --force
            for i in 1 2 3; do
                vkt render v.nrrd -ra $algorithm --size 50x100 --tiles $i/3 --threads $i -o part-$i.$suffix --force
            done
            vkt image join part-3.$suffix 'part-[12].'$suffix -o joined.$suffix --force
            cmp whole.$suffix joined.$suffix
        done
    done
    # Of paths the texts differ, which tell the noise of a part.
    for options in "--spp 4" "--noise 30"; do
        # shellcheck disable=SC2086  # an option and its value
        vkt render v.nrrd -ra multi-scattering $options --size 50x100 -o whole.png --force -q
        for i in 1 2 3 4 5 6 7; do
            # shellcheck disable=SC2086
            vkt render v.nrrd -ra multi-scattering $options --size 50x100 --tiles $i/7 -o part-$i.png --force -q
        done
        vkt image join 'part-?.png' -o joined.png --force
        vkt image diff whole.png joined.png
    done
    fails_with 2 "pixel 0, 0 is in none of the parts" vkt image join part-2.png part-3.png -o no.png
    fails_with 2 "is in two of the parts" vkt image join part-2.png part-2.png -o no.png
    fails_with 2 "parts of one whole" vkt image join part-2.png whole.png -o no.png
    [ ! -e no.png ]
}

@test "a part holds its own rows only, and the count, the budget and the process say so" {
    vkt render v.nrrd --size 2048x4096 --opacity 0.3 -n -o whole.png 2>plan
    grep -q ", 176.0 MiB for the picture, " plan
    vkt render v.nrrd --size 2048x4096 --opacity 0.3 --tiles 2/8 -n -o part.png 2>plan
    cat plan
    # A ray and 22 bytes a pixel, of an eighth of the rows.
    grep -q "on each of 1048576 rays, 22.0 MiB for the picture, " plan
    fails_with 5 ", 176.0 MiB of it for the picture" vkt render v.nrrd --size 2048x4096 --memory 24M -o whole.png
    # With fewer rays the rows around a part decide about it, 12 each way.
    vkt render v.nrrd --size 2048x4096 --tiles 2/8 --leave-out 1 -n -o part.png 2>plan
    grep -q ", 35.6 MiB for the picture, " plan
    [ -z "${VKT_SANITIZED:-}" ] || return 0
    small=$(peak_kib vkt render v.nrrd --size 16 -o small.png)
    for options in "--leave-out 0" "--leave-out 1"; do
        # shellcheck disable=SC2086  # an option and its value
        vkt render v.nrrd --size 1024x4096 -ra ray-marching $options -o whole.png --force
        for part in 1 2 3 4 5 6 7 8; do
            # shellcheck disable=SC2086
            peak=$(peak_kib vkt render v.nrrd --size 1024x4096 -ra ray-marching $options --tiles $part/8 --memory 24M -o part-$part.png --force)
            echo "part $part: $peak KiB, a small picture $small KiB"
            [ "$peak" -le $((small + 24 * 1024)) ]
        done
        vkt image join 'part-?.png' -o joined.png --force
        # The text of a part tells how much was left out of it.
        if [ "$options" = "--leave-out 0" ]; then cmp whole.png joined.png; else vkt image diff whole.png joined.png; fi
    done
}

@test "parts that cannot be" {
    # Parts keep their depth, and a part may be all of it.
    vkt render v.nrrd --size 40x40 --depth 16 -o deep.png
    for i in 1 2; do vkt render v.nrrd --size 40x40 --depth 16 --tiles $i/2 -o deep-$i.png; done
    vkt image join deep-1.png deep-2.png -o joined-deep.png
    cmp deep.png joined-deep.png
    for suffix in png exr; do
        vkt render v.nrrd --size 40x20 -o whole-small.$suffix
        vkt render v.nrrd --size 40x20 --tiles 1/1 -o all.$suffix
        vkt image join all.$suffix -o joined-all.$suffix
        cmp whole-small.$suffix joined-all.$suffix
    done
    fails_with 2 "is not I/N" vkt render v.nrrd --tiles 3 -o a.png
    fails_with 2 "is not I/N" vkt render v.nrrd --tiles -1/3 -o a.png
    fails_with 2 "no part 4 of 3" vkt render v.nrrd --tiles 4/3 -o a.png
    fails_with 2 "no part 0 of 3" vkt render v.nrrd --tiles 0/3 -o a.png
    fails_with 2 "at most 2 parts" vkt render v.nrrd --size 20 --tiles 1/3 -o a.png
    fails_with 2 "have to do with each other" vkt render v.nrrd --tolerance 1 --tiles 1/3 -o a.png
    fails_with 2 "do not say which part" vkt render v.nrrd --tiles 1/3 -o a.pfm
    [ ! -e a.png ]
}

@test "damaged OpenEXR pictures end in an error, one line, and little memory" {
    has_exr || skip "built without OpenEXR"
    vkt make sphere --dims 16 16 16 | vkt render --size 40x30 -o a.exr
    /usr/bin/python3 - <<'END'
import os, random, subprocess
good = open("a.exr", "rb").read()
rng, codes, most = random.Random(3), [], 0
for i in range(200):
    b = bytearray(good); head = min(len(b), rng.choice((64, 400, len(b))))
    if i % 4 == 0: at = rng.randrange(8, head - 4); b[at:at + 4] = rng.choice((b"\xff\xff\xff\x7f", b"\0\0\0\x40", b"\xff\xff\xff\xff", b"\0\0\x10\0"))
    elif i % 4 == 1: b = b[:rng.randrange(len(b))]
    else:
        for _ in range(rng.randint(1, 6)): b[rng.randrange(head)] = rng.randrange(256)
    open("b.exr", "wb").write(b)
    run = subprocess.Popen(["vkt", "image", "diff", "b.exr", "a.exr"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = run.stderr.read()
    _, status, used = os.wait4(run.pid, 0)
    run.returncode = code = os.waitstatus_to_exitcode(status)
    codes.append(code); most = max(most, used.ru_maxrss)
    assert code in (0, 1, 2, 3, 4) and len(said.splitlines()) <= 2, (i, code, said)
assert codes.count(3) > 60 and most < 400 << 10, (codes.count(3), most)
END
}
