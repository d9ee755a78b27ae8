# Errors that travel: what stages say of their results is true, adds up, and is lost aloud.
load helper

# error_of FILE: its error as JSON.
error_of() { vkt info "$1" --json | /usr/bin/python3 -c 'import json, sys; print(json.dumps(json.load(sys.stdin)["error"], sort_keys=True))'; }

setup_more() {
    python_with numpy scipy
    /usr/bin/python3 -c "
import numpy as np
r = np.random.default_rng(3)
r.integers(0, 256, (6, 7, 8), np.uint8).tofile('b_8x7x6_uint8.raw')
r.random((6, 7, 8), np.float32).tofile('f_8x7x6_float32.raw')"
}

@test "500 random pipelines: no error is larger than the header says, half of them are within 10x" {
    library=$(find "$VKT_BUILD" -name libvkt.so | head -1)
    [ -n "$library" ] || skip "a static library has no C API to load"
    /usr/bin/python3 "$VKT_ROOT/tests/travelling_errors.py" "$library" 500 >report || { cat report >&2; false; }
    cat report >&3
}

@test "a file is given; filters add their bound, in the file's units, and info says it" {
    [ "$(error_of b_8x7x6_uint8.raw)" = '{"kind": "exact"}' ]
    vkt set b_8x7x6_uint8.raw --slope 2 --units HU | vkt filter box --radius 1 | vkt info >info
    grep -qx 'error      within 1 HU of exact' info
    vkt convert b_8x7x6_uint8.raw --dtype float32 -o exact.nrrd
    vkt info exact.nrrd | grep -qx 'error      exact'
}

@test "powers and logarithms pass errors on where their slope is limited, and say why where it is not" {
    through() { vkt filter box b_8x7x6_uint8.raw --radius 1 | vkt "$@" | vkt info; }
    # Values up to 255, known to half a unit: squares to 2 * 255.5 * 0.5, and what float32 rounds.
    through arith pow - 2 | grep -q '^error      about 2.6e+02 from exact'
    through arith pow - 0.5 | grep -q 'unknown: arith: a power is limited'
    vkt make noise --dims 8 7 6 --dtype int16 --low 1 --high 100 | vkt filter box --radius 1 | vkt arith exp - --dtype float64 | vkt info |
        grep -q 'unknown: arith: values of its type may be too large for exp'
    through arith log - | grep -q 'unknown: arith: values may be 0 or less'
    vkt filter box b_8x7x6_uint8.raw --radius 1 | vkt arith clamp - 10 20 | vkt arith log - | vkt info | grep -q '^error      about 0.05'
}

@test "NRRD, MetaImage, NIfTI, streams and shared memory keep it, and another stage goes on from there" {
    vkt filter box b_8x7x6_uint8.raw --radius 1 -o a.vkt
    error_of a.vkt >want
    grep -q '"at_most": 0.5' want
    for name in a.nrrd a.nhdr a.mha a.nii; do
        vkt write a.vkt $name
        error_of $name | diff want -
        vkt flip x $name | vkt filter box --radius 1 -o twice.vkt --force
        error_of twice.vkt | grep -q '"at_most": 1.0'
    done
    vkt write a.vkt shm:errors-$$
    error_of shm:errors-$$ >there
    vkt shm remove shm:errors-$$
    diff want there
}

@test "the same through pipes and in one process" {
    vkt filter gaussian b_8x7x6_uint8.raw --sigma 1 | vkt arith mul - 0.3 | vkt convert --dtype float32 -o pipes.vkt
    vkt pipe 'read b_8x7x6_uint8.raw | filter gaussian --sigma 1 | arith mul - 0.3 | convert --dtype float32 | write one.vkt'
    diff <(error_of pipes.vkt) <(error_of one.vkt)
}

@test "what nobody knows is said to be unknown, and stays so" {
    vkt filter gaussian b_8x7x6_uint8.raw --sigma 1 | vkt threshold --above 100 -o mask.nrrd
    error_of mask.nrrd | grep -q '"kind": "unknown"'
    error_of mask.nrrd | grep -q 'threshold jumps'
    vkt flip x mask.nrrd | vkt info | grep -q '^error *unknown: threshold jumps'
    # Of exact voxels a mask is exact.
    vkt threshold b_8x7x6_uint8.raw --above 100 | vkt info | grep -qx 'error      exact'
    # Whatever has a past and says nothing of errors, as files of older versions.
    printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nvkt history:={"command":["filter","box"]}\n\nabcdefgh' >old.nrrd
    vkt info old.nrrd | grep -qx 'error      unknown'
    vkt flip x old.nrrd | vkt info | grep -q '^error *unknown'
    # Floats may be anything.
    vkt filter gaussian f_8x7x6_float32.raw --sigma 1 | vkt info | grep -q '^error *unknown: .*float volume'
    vkt arith clamp f_8x7x6_float32.raw 0 1 | vkt filter gaussian --sigma 1 | vkt info | grep -q '^error *within .* of exact'
    # An expression says nothing of how it passes errors on.
    vkt transform 'v / 3' b_8x7x6_uint8.raw | vkt info | grep -q '^error *unknown: how transform passes errors on'
}

@test "cells that are chosen keep their error, of floats as well" {
    vkt make noise --dims 16 16 16 --dtype float32 --low -3 --high 5 -o v.nrrd
    vkt refine v.nrrd --tolerance 0.25 --method nearest -q -o t.vkt
    vkt resample t.vkt --scale 1 --method nearest -o back.nrrd
    for volume in t.vkt back.nrrd; do vkt info $volume --json | grep -q '"kind":"bound","at_most":0.2500000000'; done
    vkt diff v.nrrd back.nrrd --tolerance 0.25
    vkt resample t.vkt --scale 1 | vkt info --json | grep -q '"kind":"unknown"' # sums of values that nobody knows
    # A background that the type has to round is none of them.
    vkt refine v.nrrd --tolerance 0.25 --method nearest -q | vkt resample --scale 1 --method nearest --background 0.1 | vkt info --json |
        grep -q '"kind":"unknown"'
}

@test "an estimate stays one" {
    vkt filter bilateral b_8x7x6_uint8.raw --sigma 1 --range-sigma 20 -o e.vkt
    error_of e.vkt | grep -q '"kind": "estimate"'
    vkt filter box e.vkt --radius 1 | vkt info | grep -q '^error *about .* from exact'
}

@test "a header with an error that is none is refused, one of a later kind unknown" {
    vkt flip x b_8x7x6_uint8.raw -o good.vkt
    /usr/bin/python3 - <<'END'
import subprocess
line = 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nvkt error:=%s\n\nabcdefgh'
for i, text in enumerate(['{"kind": "bound", "at_most": -1}', '{"kind": "bound"}', '[]', 'x', '{"kind": "certain"}',
                          '{"kind": "bound", "at_most": 1e999}', '{"kind": "exact", "values": [2, 1]}']):
    open(f"{i}.nrrd", "w").write(line % text)
    said = subprocess.run(["vkt", "info", f"{i}.nrrd"], capture_output=True, text=True, check=True).stdout
    assert "\nerror      unknown" in said, (text, said)
END
}

@test "series of volumes that differ in it do not keep the first one's" {
    vkt filter box b_8x7x6_uint8.raw --radius 1 -o s_0.vkt
    vkt filter box s_0.vkt --radius 1 -o s_1.vkt
    vkt read 's_*.vkt' | vkt write - both.nrrd
    vkt info both.nrrd | grep -c '^error *unknown' | grep -qx 2
}

@test "a budget is divided among the stages, the result keeps to it, and more of it costs less" {
    vkt make noise --seed 4 --dims 30 30 30 --dtype uint8 -o in.nrrd
    pipeline='convert in.nrrd --dtype float32 | filter gaussian --sigma 2 | filter gaussian --sigma 4 --boundary clamp'
    vkt write in.nrrd in.vkt.gz
    vkt pipe "read in.vkt.gz | ${pipeline/in.nrrd/-} | convert --dtype float64" -o loose.nrrd --tolerance 5 2>loose
    vkt pipe "$pipeline" -o tight.nrrd --tolerance 0.001 -v 2>tight
    grep -q 'filter gaussian --tolerance' tight
    grep -q 'the result is within' tight
    /usr/bin/python3 - <<'END'
import json, re, subprocess
import numpy as np
from scipy.ndimage import gaussian_filter
def volume(name):
    info = json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
    subprocess.run(["vkt", "write", name, "x.npy", "--force"], check=True)
    return info, np.load("x.npy").astype(np.float64)
given = volume("in.nrrd")[1]
want = gaussian_filter(gaussian_filter(given, 2, mode="reflect", truncate=12), 4, mode="nearest", truncate=12)
for name, budget in (("loose.nrrd", 5), ("tight.nrrd", 0.001)):
    info, got = volume(name)
    stated = info["error"]["at_most"]
    assert stated <= budget, (stated, budget)
    assert np.abs(got - want).max() <= stated, (name, np.abs(got - want).max(), stated)
# What was chosen stands in the history, and the looser budget chose looser.
def shares(name):
    steps = subprocess.check_output(["vkt", "history", name], text=True)
    return [float(s) for s in re.findall(r"--tolerance ([0-9.e+-]+)%", steps)]
loose, tight = shares("loose.nrrd"), shares("tight.nrrd")
assert len(loose) == len(tight) == 2 and max(tight) < min(loose), (loose, tight)
END
}

@test "a budget that cannot be kept, or of an error that nobody knows, is refused" {
    fails_with 2 "at best" vkt pipe --tolerance 0.1 'filter gaussian b_8x7x6_uint8.raw --sigma 1 | flip x'
    fails_with 2 "float volume" vkt pipe --tolerance 0.1 'filter gaussian f_8x7x6_float32.raw --sigma 1 | flip x'
    fails_with 2 "begins with no file" vkt pipe --tolerance 0.1 'flip x | flip y' <b_8x7x6_uint8.raw
    fails_with 2 "begins with no file" vkt pipe --tolerance 0.1 'read - | flip y' <b_8x7x6_uint8.raw
    fails_with 4 "absent" vkt pipe --tolerance 0.1 'read absent.nrrd | flip y'
    fails_with 2 "at best" vkt pipe --tolerance 0.1 'filter gaussian b_8x7x6_uint8.raw --sigma 1 --tolerance 1% | flip x'
}

@test "the median of an even number of voxels lies halfway between two, which the error counts" {
    vkt make noise --dims 5 6 8 --dtype uint8 --high 255 -o even.nrrd
    vkt project median even.nrrd --axis z | vkt info | grep -qx 'error      within 0.5 of exact'
    vkt project median even.nrrd --axis x | vkt info | grep -qx 'error      exact'
    vkt project max even.nrrd --axis z | vkt info | grep -qx 'error      exact'
    vkt convert even.nrrd --dtype float64 | vkt project median --axis z -o exact.nrrd
    vkt project median even.nrrd --axis z | vkt convert --dtype float64 | vkt diff - exact.nrrd --tolerance 0.5
    run vkt diff <(vkt project median even.nrrd --axis z | vkt convert --dtype float64) exact.nrrd --tolerance 0.4
    [ "$status" -eq 1 ]
}

@test "bounds of splines count the taps that they leave out: against splines in rational numbers" {
    cat >splines.py <<'END'
import random, struct, subprocess, sys
from fractions import Fraction as F
from json import loads

random.seed(5)
beyond = 60  # the filter's pole is 0.27
formats = {"int": ("i", lambda: random.choice((0, 2**31 - 1, -2**31))), "uchar": ("B", lambda: random.choice((0, 255))),
           "double": ("d", lambda: random.choice((-4.0, 0.0, 4.0)))}
for trial in range(12):
    name = list(formats)[trial % 3]
    letter, value = formats[name]
    n, m = random.randint(5, 12), random.randint(13, 29)
    v = [value() for _ in range(n)]
    with open("v.nrrd", "wb") as file:
        file.write(f"NRRD0004\ntype: {name}\ndimension: 3\nsizes: {n} 1 1\nencoding: raw\nendian: little\n\n".encode())
        file.write(struct.pack(f"<{n}{letter}", *v))
    limits = f"arith clamp v.nrrd {min(v)} {max(v) or 1}"  # without them nothing is known of the values of floats
    subprocess.run(f"vkt {limits} | vkt resample --dims {m} 1 1 --method bspline3 --dtype float64 -o r.vkt --force", shell=True, check=True)
    said = loads(subprocess.run(["vkt", "info", "r.vkt", "--json"], capture_output=True, check=True).stdout)["error"]["at_most"]
    subprocess.run("vkt write r.vkt r.raw --force -q", shell=True, check=True)
    got = struct.unpack(f"<{m}d", open("r.raw", "rb").read())
    # (1 4 1)/6 c = v, with the last voxels going on.
    size = n + 2 * beyond
    d = [F(v[min(max(i - beyond, 0), n - 1)]) for i in range(size)]
    b = [F(5, 6)] + [F(4, 6)] * (size - 2) + [F(5, 6)]
    for i in range(1, size):
        w = F(1, 6) / b[i - 1]
        b[i] -= w / 6
        d[i] -= w * d[i - 1]
    c = [F(0)] * size
    c[-1] = d[-1] / b[-1]
    for i in range(size - 2, -1, -1):
        c[i] = (d[i] - c[i + 1] / 6) / b[i]
    worst = 0
    for k in range(m):
        place = F((2 * k + 1) * n - m, 2 * m)
        i, f = place.__floor__(), place - place.__floor__()
        w = [(1 - f)**3 / 6, (3 * f**3 - 6 * f**2 + 4) / 6, (-3 * f**3 + 3 * f**2 + 3 * f + 1) / 6, f**3 / 6]
        exact = sum(w[q] * c[i - 1 + q + beyond] for q in range(4))
        worst = max(worst, abs(F(got[k]) - exact))
    assert worst <= F(said), (name, v, m, float(worst), said)
    assert said < 1e-13 * (max(v) - min(v) + 1), (said, v)
END
    /usr/bin/python3 splines.py
}

@test "clamp under a value map counts how numbers are stored" {
    vkt make constant --dims 2 2 2 --dtype int64 --value 200000000000000000 | vkt set --slope 0.1 --intercept 3.3 |
        vkt arith clamp - -1e16 1e16 -o kept.vkt
    vkt info kept.vkt --json >said.json
    # The whole number next to (1e16 - 3.3) / slope, and what is stored, 16 apart in double, are 0.9 apart as values.
    /usr/bin/python3 -c '
from json import load
said = load(open("said.json"))["error"]
assert 0.9 < said["at_most"] < 1000, said'
}

@test "hints lead to what works" {
    vkt make ramp --dims 4 4 4 -o a.nrrd
    fails_with 2 "vkt write and vkt convert take others with --format" vkt read a.nrrd -o b.foo
    vkt convert a.nrrd b.foo --format nrrd
    fails_with 2 "did you mean 'numpy'?" vkt convert a.nrrd -o x.bin --format npy
    fails_with 2 "did you mean 'hdf5'?" vkt convert a.nrrd -o x.bin --format h5
    fails_with 4 "cannot open 'nofile.nrrd'" vkt split nofile.nrrd -o 'a%d.nrrd'
    for option in "--endian big" "--skip 5" "--dtype uint8"; do
        fails_with 2 "'a.nrrd' is nrrd, which says itself what it holds" vkt read a.nrrd $option -o i.nrrd
    done
    fails_with 2 "it does to --render-algo implicit-iso" vkt render a.nrrd --iso 3 -o d.png
}
