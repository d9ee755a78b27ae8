# NumPy's .npz, both ways, against NumPy and Python's zipfile.
load helper

setup_more() { python_with numpy; }

@test "what NumPy saved, stored and deflated, by name and alone" {
    /usr/bin/python3 - <<'END'
import json, numpy, subprocess
rng = numpy.random.default_rng(1)
def run(line): return subprocess.run(line, shell=True, check=True, capture_output=True).stdout
a, b = (rng.normal(size=(6, 5, 4)) * 50).astype("i2"), numpy.asfortranarray(rng.normal(size=(3, 4, 5)))
for save in (numpy.savez, numpy.savez_compressed):
    save("two.npz", first=a, second=b)
    save("one.npz", a)
    for name, option in (("two.npz:first", ""), ("two.npz", "--variable first"), ("one.npz", ""), ("one.npz:arr_0", "")):
        assert run(f"vkt read {name} {option} | vkt write - --format raw") == a.tobytes(), name
        assert run(f"vkt read {name} {option} --roi 1:3,2:,::2 | vkt write - --format raw") == a[::2, 2:, 1:3].tobytes(), name
    assert run("vkt write two.npz:second - --format raw") == b.tobytes("F")
    assert run("cat one.npz | vkt write - - --format raw") == a.tobytes()
    assert json.loads(run("vkt info two.npz:first --json"))["format"] == "npz"
END
    fails_with 2 'holds several arrays: first, second' vkt stats two.npz
    fails_with 2 'holds several arrays: first, second' vkt read two.npz -o x.raw
    fails_with 2 "did you mean 'first'" vkt info two.npz:fist
    fails_with 2 'and --variable another one' vkt read two.npz:first --variable second
    fails_with 4 "cannot open 'absent.npz:a'" vkt info absent.npz:a
}

@test "info lists the arrays of an archive; what cannot be a volume is no choice" {
    /usr/bin/python3 - <<'END'
import json, numpy, subprocess
a = numpy.arange(60, dtype="i2").reshape(3, 4, 5)
info = lambda name: json.loads(subprocess.check_output(["vkt", "info", name, "--json"]))
for save in (numpy.savez, numpy.savez_compressed):
    save("two.npz", first=a, second=numpy.zeros((2, 3, 4, 5)), words=numpy.array(["a"]), spacing=numpy.ones(3))
    i = info("two.npz")
    assert i["dims"] == [5, 4, 3] and i["attributes"]["variables"] == "first second", i
    assert i["attributes"]["variable first"] == "int16, 5 x 4 x 3", i
    assert i["attributes"]["variable second"] == "float64, 5 x 4 x 3 x 2", i
    assert "array 'words'" in subprocess.check_output(["vkt", "info", "two.npz"], text=True)
    save("one.npz", words=numpy.array(["a"]), spacing=numpy.ones(3), volume=a)
    assert subprocess.check_output("vkt read one.npz | vkt write - --format raw", shell=True) == a.tobytes()
    assert info("one.npz")["attributes"]["variable"] == "volume" and "variables" not in info("one.npz")["attributes"]
    save("words.npz", a=numpy.array(["a"]), b=numpy.array(["b"]))
    assert subprocess.run(["vkt", "info", "words.npz"], capture_output=True).returncode == 3
END
}

@test "what vkt wrote is what NumPy loads: types, names, series, compressed" {
    for type in uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64; do
        vkt make noise --dims 5 4 3 --dtype $type --seed 1 -o $type.npz
        vkt make noise --dims 50 40 30 --dtype $type --seed 1 -o packed_$type.npz --compress
        vkt write $type.npz $type.raw
        vkt write packed_$type.npz packed_$type.raw
    done
    vkt make noise --dims 5 4 3 -o n.npz:density
    for i in 0 1 2; do vkt make noise --dims 5 4 3 --dtype int16 --seed $i -o v$i.nrrd; done
    vkt stack v0.nrrd v1.nrrd v2.nrrd -o s.npz
    vkt stack v0.nrrd v1.nrrd v2.nrrd -o c.npz --compress
    vkt stack v0.nrrd v1.nrrd v2.nrrd | vkt diff - s.npz
    vkt diff s.npz c.npz
    /usr/bin/python3 - <<'END'
import numpy, zipfile
for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float16", "float32", "float64"):
    for prefix, shape in (("", (3, 4, 5)), ("packed_", (30, 40, 50))):
        assert zipfile.ZipFile(f"{prefix}{name}.npz").testzip() is None
        with numpy.load(f"{prefix}{name}.npz") as f:
            assert f.files == ["arr_0"] and f["arr_0"].shape == shape and f["arr_0"].dtype == name
            assert f["arr_0"].tobytes() == open(f"{prefix}{name}.raw", "rb").read(), name
assert numpy.load("n.npz").files == ["density"]
s, c = numpy.load("s.npz")["arr_0"], numpy.load("c.npz")["arr_0"]
assert s.shape == c.shape == (3, 3, 4, 5) and (s == c).all()
assert zipfile.ZipFile("s.npz").testzip() is None and zipfile.ZipFile("c.npz").testzip() is None
assert zipfile.ZipFile("c.npz").infolist()[0].compress_type == 8
END
    fails_with 2 'cannot be written to a pipe' bash -c 'set -o pipefail; vkt read v0.nrrd | vkt write - --format npz | cat'
    fails_with 4 'the file exists' vkt read v0.nrrd -o s.npz
}

@test "damage is told, whatever byte it is in" {
    /usr/bin/python3 - <<'END'
import numpy, random, subprocess
a = numpy.arange(600, dtype="<i2").reshape(10, 6, 10)
random.seed(5)
numpy.savez("a.npz", a=a); numpy.savez_compressed("b.npz", b=a)
for name in ("a.npz", "b.npz"):
    good = open(name, "rb").read()
    for i in range(150):
        bad = bytearray(good)
        for _ in range(random.randint(1, 4)): bad[random.randrange(len(bad))] = random.randrange(256)
        if i % 4 == 0: bad = bad[:random.randrange(1, len(bad))]
        open("bad.npz", "wb").write(bad)
        run = subprocess.run(["vkt", "write", "bad.npz", "-", "--format", "raw"], capture_output=True, timeout=60)
        assert run.returncode in (0, 2, 3), (name, i, run)
good = open("b.npz", "rb").read()
at = good.index(b"b.npy") + 200
open("flip.npz", "wb").write(good[:at] + bytes([good[at] ^ 16]) + good[at + 1:])
open("no.npz", "wb").write(good[:-30])
END
    fails_with 3 "'flip.npz'" vkt stats flip.npz
    fails_with 3 'ended early' vkt stats no.npz
    : >empty.npz
    fails_with 3 'ended early' bash -c 'set -o pipefail; vkt read empty.npz --format npz | cat >rest'
    printf 'PK\3\4' >x.zip
    fails_with 3 'is a ZIP archive' vkt info x.zip
}

@test "names of arrays are no way out of an archive, neither written nor read" {
    vkt make constant --value 3 --dims 2 2 2 -o small.npy
    fails_with 2 "archives hold names of at most 65535" vkt write small.npy -o "long.npz:$(printf 'x%.0s' $(seq 65532))"
    [ ! -e long.npz ]
    vkt make ramp --dims 5 4 3 --dtype uint8 -o a.nrrd
    for name in '' / a/ ../; do
        fails_with 2 "'x.npz:$name' names no array: its name is missing" vkt convert a.nrrd -o x.npz:$name
    done
    for name in .. ../a a/../b . a/./b; do
        fails_with 2 "is no name" vkt convert a.nrrd -o x.npz:$name --force
        [[ "$stderr" == *"e.g. -o x.npz:name"* ]]
    done
    for name in /a a//b; do fails_with 2 "a name in it is empty" vkt convert a.nrrd -o x.npz:$name; done
    [ -z "$(find . -name "x*" -o -name evil)" ]
    vkt convert a.nrrd -o x.npz:g/..a
    vkt diff a.nrrd x.npz:g/..a
    # Another program's archive with such names is read, and what is made of it lies where it is to.
    mkdir -p in/side
    /usr/bin/python3 -c '
import io, numpy, zipfile
with zipfile.ZipFile("in/side/bad.npz", "w") as z:
    for name in ("../../evil", "/tmp/vkt-evil", "good"):
        b = io.BytesIO(); numpy.save(b, numpy.arange(60, dtype="u1").reshape(3, 4, 5)); z.writestr(name + ".npy", b.getvalue())'
    cd in/side
    for name in ../../evil /tmp/vkt-evil; do
        vkt split bad.npz:$name -o 's%d.nrrd' --force
        vkt convert bad.npz:$name v.h5 --force
        vkt read bad.npz --variable $name | vkt write - v.vtk --force
        vkt stack s0.nrrd s1.nrrd -o 'n%d.vti' --force
    done 2>/dev/null
    [ "$(ls | tr '\n' ' ')" = "bad.npz n0.vti s0.nrrd s1.nrrd s2.nrrd v.h5 v.vtk " ]
    [ -z "$(find ../.. -name '*evil*')" ]
    [ ! -e /tmp/vkt-evil ]
}

@test "an array that is named leaves the others of its archive, which is replaced whole, or not at all" {
    vkt make noise --dims 12 11 10 --dtype uint16 --seed 1 -o a.nrrd
    vkt make noise --dims 9 8 7 --dtype float32 --seed 2 -o b.nrrd
    vkt stack b.nrrd b.nrrd -o s.nrrd
    for save in savez savez_compressed; do
        /usr/bin/python3 -c "
import numpy
numpy.$save('k.npz', first=numpy.arange(60.).reshape(3, 4, 5), text=numpy.array(['words']), old=numpy.arange(8))"
        fails_with 4 'the file exists' vkt convert a.nrrd k.npz:new
        vkt convert a.nrrd k.npz:new --force
        vkt convert s.nrrd k.npz:series --force --compress
        vkt convert b.nrrd k.npz:old --force
        vkt flip x k.npz:new -o k.npz:flipped --force
        vkt convert s.nrrd k.npz:plain --force
        cp k.npz kept.npz
        vkt diff a.nrrd k.npz:new
        vkt diff b.nrrd k.npz:old
        vkt diff s.nrrd k.npz:series
        /usr/bin/python3 - <<'END'
import numpy, zipfile
assert zipfile.ZipFile("k.npz").testzip() is None
k = numpy.load("k.npz")
assert sorted(k.files) == ["first", "flipped", "new", "old", "plain", "series", "text"], k.files
assert (k["first"] == numpy.arange(60.).reshape(3, 4, 5)).all() and k["text"][0] == "words" and k["old"].shape == (7, 8, 9)
assert (k["flipped"] == k["new"][..., ::-1]).all() and k["series"].shape == (2, 7, 8, 9) and (k["series"] == k["plain"]).all()
END
        vkt read a.nrrd | head -c 2000 >cut.vkt
        fails_with 3 'ended early' vkt read cut.vkt -o k.npz:new --force
        cmp k.npz kept.npz
        # Without a name the archive is meant.
        vkt convert a.nrrd k.npz --force
        /usr/bin/python3 -c 'import numpy; assert numpy.load("k.npz").files == ["arr_0"]'
    done
    echo words >words.npz
    fails_with 3 'cannot be kept' vkt convert a.nrrd words.npz:a --force
    [ "$(cat words.npz)" = words ]
    vkt convert a.nrrd absent.npz:a --force
    vkt diff a.nrrd absent.npz:a
    [ -z "$(find . -name '.*vkt-*')" ]
}
