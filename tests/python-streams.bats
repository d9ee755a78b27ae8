# Python: streams over files, pipes of subprocesses and other objects, against the command.
load helper
load python

@test "from a command, and to one, through pipes" {
    python <<'EOF2'
import subprocess
with subprocess.Popen(["vkt", "filter", "gaussian", "volume.nrrd", "--sigma", "1"], stdout=subprocess.PIPE) as process:
    smooth, = vkt.read_stream(process.stdout)
assert process.returncode == 0
want = vkt.filter.gaussian(volume, sigma=1)
assert np.array_equal(smooth.array, want.array) and smooth.spacing == want.spacing
assert smooth.header["history"]["command"][:2] == ["filter", "gaussian"]
for options in {}, {"transport": "shm"}, {"no_checksum": True}:
    with subprocess.Popen(["vkt", "stats", "--json"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        vkt.write_stream(process.stdin, smooth, **options)
        process.stdin.close()
        assert __import__("json").load(process.stdout) == smooth.stats()
    assert process.returncode == 0
# Both ends, more than a pipe holds.
big = vkt.make.noise(dims=(128, 128, 128))
with subprocess.Popen(["vkt", "flip", "x"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
    import threading
    def feed():
        vkt.write_stream(process.stdin, big)
        process.stdin.close()
    thread = threading.Thread(target=feed)
    thread.start()
    back, = vkt.read_stream(process.stdout)
    thread.join()
assert np.array_equal(back.array, big.array[:, :, ::-1])
EOF2
}

@test "files of the command, at the place where Python reads; several volumes; adaptive meshes" {
    vkt refine volume.nrrd --tolerance 50 -o tree.vkt
    vkt make ramp --dims 4 5 6 -o a.vkt
    cat a.vkt a.vkt >two.vkt
    python <<'EOF2'
import io
ramp = vkt.make.ramp(dims=(4, 5, 6))
assert [np.array_equal(v.array, ramp.array) for v in vkt.read_stream(open("a.vkt", "rb"))] == [True]
tree, = vkt.read_stream(open("tree.vkt", "rb"))
assert tree.hierarchical and tree.stats() == vkt.refine(volume, tolerance=50).stats()
with open("mixed", "w+b") as file:
    file.write(b"a header of one's own\n")
    vkt.write_stream(file, (vkt.make.ramp(dims=(2, 2, n)) for n in (1, 2, 3)))
    file.seek(0)
    assert file.readline() == b"a header of one's own\n"
    assert [v.dims[2] for v in vkt.read_stream(file)] == [1, 2, 3]
# Objects that have no descriptor.
memory = io.BytesIO()
vkt.write_stream(memory, [volume, tree, volume])
memory.seek(0)
first, second, third = vkt.read_stream(memory)
assert np.array_equal(first.array, volume.array) and second.hierarchical and third.header == volume.header
memory.seek(0)
for one in vkt.read_stream(memory):  # not to its end
    break
import gzip
with gzip.open("a.vkt.gz", "wb") as file:
    vkt.write_stream(file, ramp)
assert np.array_equal(next(vkt.read_stream(gzip.open("a.vkt.gz"))).array, ramp.array)
EOF2
    tail -c +23 mixed | vkt info | grep -q 'dims'
}

@test "what is damaged, breaks off, or failed at the other end is an error; so is a reader that goes away" {
    vkt make noise --dims 64 64 64 -o a.vkt
    head -c 300000 a.vkt >cut.vkt
    python <<'EOF2'
import io, subprocess
def read(name):
    with open(name, "rb") as file:
        return list(vkt.read_stream(file))
def bytes_of(name):
    with open(name, "rb") as file:
        return bytearray(file.read())
def refused(code, text, call):
    try:
        call()
    except vkt.Error as e:
        assert e.exit_code == code and text in str(e), (e.exit_code, str(e))
    else:
        assert False, text
refused(3, "ended early", lambda: read("cut.vkt"))
refused(3, "", lambda: list(vkt.read_stream(io.BytesIO(bytes_of("a.vkt")[:1000]))))
refused(3, "", lambda: list(vkt.read_stream(io.BytesIO(b"no stream at all"))))
data = bytes_of("a.vkt")
data[len(data) // 2] ^= 1
refused(3, "checksum", lambda: list(vkt.read_stream(io.BytesIO(data))))
with subprocess.Popen(["vkt", "read", "nowhere.nrrd"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
    refused(3, "nowhere.nrrd", lambda: list(vkt.read_stream(process.stdout)))
# What goes wrong in Python is told to the command.
def volumes():
    yield volume
    raise RuntimeError("no more of that")
with subprocess.Popen(["vkt", "write", "-", "--format", "raw"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                      stderr=subprocess.PIPE, text=False) as process:
    try:
        vkt.write_stream(process.stdin, volumes())
        raise SystemExit("nothing was raised")
    except RuntimeError:
        pass
    process.stdin.close()
    said = process.stderr.read().decode()
assert process.returncode == 3, said  # what is wrong is said where it went wrong, in Python
big = vkt.make.noise(dims=(128, 128, 128))
with subprocess.Popen(["head", "-c", "100"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
    refused(4, "", lambda: vkt.write_stream(process.stdin, big))
    try:
        process.stdin.close()
    except BrokenPipeError:
        pass
EOF2
    [ -z "$(names_in_shm)" ]
}

@test "files that take or give bytes by and by, that fail, and what is no file" {
    python <<'EOF2'
import gzip, io
def stream(volumes):
    memory = io.BytesIO()
    vkt.write_stream(memory, volumes)
    return memory.getvalue()
class Slow(io.RawIOBase):
    """Takes at most 1000 bytes at a time, as a raw file may."""
    def __init__(self):
        self.data = bytearray()
    def writable(self):
        return True
    def write(self, data):
        self.data += bytes(data[:1000])
        return min(len(data), 1000)
slow = Slow()
vkt.write_stream(slow, volume)
assert bytes(slow.data) == stream(volume)
class Silent:
    """No file of Python's: all is taken, and nothing said."""
    data = b""
    def write(self, data):
        self.data += data
silent = Silent()
vkt.write_stream(silent, volume)
assert silent.data == stream(volume)
def raises(kind, text, call):
    try:
        call()
    except kind as error:
        assert text in str(error), error
    else:
        assert False, text
class Full(Slow):
    def write(self, data):
        return None if self.data else super().write(data)
class Stuck(Slow):
    def write(self, data):
        return 0
class Broken(Slow):
    def write(self, data):
        raise BrokenPipeError("the other end has gone")
raises(BlockingIOError, "blocking", lambda: vkt.write_stream(Full(), volume))
raises(OSError, "took 0 of", lambda: vkt.write_stream(Stuck(), volume))
raises(BrokenPipeError, "has gone", lambda: vkt.write_stream(Broken(), vkt.make.ramp(dims=(2, 2, 2))))

# What reading raises is what comes out, after what came before.
class Fails:
    def __init__(self, data, error):
        self.file, self.error = io.BytesIO(data), error
    def read(self, size=-1):
        data = self.file.read(1000)
        if not data:
            raise self.error
        return data
raises(OSError, "disk on fire", lambda: list(vkt.read_stream(Fails(b"", OSError("disk on fire")))))
raises(KeyError, "no", lambda: list(vkt.read_stream(Fails(stream(volume)[:70000], KeyError("no")))))
raises(OSError, "gzip", lambda: list(vkt.read_stream(gzip.GzipFile(fileobj=io.BytesIO(b"no gzip at all")))))
class Gives:
    def __init__(self, what):
        self.what = what
    def read(self, size=-1):
        return self.what
raises(BlockingIOError, "blocking", lambda: list(vkt.read_stream(Gives(None))))
raises(TypeError, "gave str", lambda: list(vkt.read_stream(Gives("text"))))
# What is no file of bytes is refused at once, not when the first volume is asked for.
for wrong, text in (None, "NoneType is no file"), (io.StringIO("text"), "text"), ("a.vkt", "str is no file"), (volume, "Volume is no file"):
    raises(TypeError, text, lambda: vkt.read_stream(wrong))
    if wrong is not volume:
        raises(TypeError, text, lambda: vkt.write_stream(wrong, volume))

# Arrays are volumes; what else there is, is not.
array = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
assert np.array_equal(next(vkt.read_stream(io.BytesIO(stream(array)))).array, array)
assert [v.dims for v in vkt.read_stream(io.BytesIO(stream([volume, array])))] == [volume.dims, (4, 3, 2)]
for wrong in None, 3, "volume.nrrd", [[1, 2], [3, 4]]:
    raises(TypeError, "a stream is of volumes", lambda: stream(wrong))
EOF2
}

@test "a series: counted, read one after another, by number and by slices" {
    python_with nibabel
    python <<'EOF2'
import nibabel
data = np.random.default_rng(1).integers(-500, 500, (7, 6, 5, 6)).astype(np.int16)
for name in "series.nii", "series.nii.gz":
    nibabel.save(nibabel.Nifti1Image(data, np.diag([2, 3, 4, 1])), name)
    series = vkt.read_series(name)
    assert len(series) == 6
    for t, one in enumerate(series):
        assert np.array_equal(one.array, data[..., t].T) and one.spacing == (2, 3, 4), (name, t)
    assert t == 5 and np.array_equal(series[3].array, data[..., 3].T) and np.array_equal(series[-1].array, data[..., 5].T)
    for part in np.s_[1:5:2], np.s_[::-2], np.s_[2:], np.s_[:-4], np.s_[4:4], np.s_[3:4]:
        want = data.T[part]
        assert len(series[part]) == len(want), part
        assert all(np.array_equal(a.array, b) for a, b in zip(series[part], want, strict=True)), part
    assert np.array_equal(series[1:5][::2][1].array, data[..., 3].T)
    assert [v.dims for v in vkt.read_series(name, roi="1:3,:,:")] == [(2, 6, 5)] * 6
    two = series[2]
    assert two.header["history"]["command"] == ["read", name, "--index", "2"]
    assert next(iter(series[2:5:2])).header["history"]["command"] == ["read", name, "--index", "2"]
    assert [v.header["history"]["command"][-1] for v in series] == list("012345")
assert len(vkt.read_series("volume.nrrd")) == 1 and np.array_equal(vkt.read_series("volume.nrrd")[0].array, volume.array)
for wrong, error, text in (
        (lambda: series[6], IndexError, "there are 6"), (lambda: series[-7], IndexError, "there are 6"),
        (lambda: vkt.read("series.nii"), vkt.Error, "index=N, counted from 0; vkt.read_series() reads all"),
        (lambda: vkt.read_series("series.nii", index=2), vkt.Error, "[2:10]"),
        (lambda: len(vkt.read_series("nowhere.nii")), vkt.Error, "nowhere.nii"),
        (lambda: iter(vkt.read_series("nowhere.nii")), vkt.Error, "nowhere.nii")):
    try:
        wrong()
        raise SystemExit("taken: " + text)
    except error as e:
        assert text in str(e), e
# Damage is told where it is met, and what comes before it is read.
whole = open("series.nii", "rb").read()
open("short.nii.gz", "wb").write(__import__("gzip").compress(whole)[:-900])
got = []
try:
    for one in vkt.read_series("short.nii.gz"):
        got.append(one)
    raise SystemExit("taken")
except vkt.Error as e:
    assert e.exit_code == 3 and all(np.array_equal(one.array, data[..., t].T) for t, one in enumerate(got))
EOF2
}

@test "a series is written into one file, or into numbered ones, whole or not at all" {
    python <<'EOF2'
import os
parts = [vkt.crop(volume, roi=f"{x}:{x + 5},:,:") for x in (0, 5, 10)]
times = [volume, vkt.flip(volume, "x"), vkt.filter.median(volume, radius=1)]
times[1] = vkt.Volume(times[1].array, like=volume)
for name in "out.nii.gz", "out.nrrd":
    vkt.write_series(iter(times), name)
    assert all(np.array_equal(a.array, b.array) for a, b in zip(vkt.read_series(name), times, strict=True)), name
for name in "unlike.vkt",:
    vkt.write_series(iter(parts), name)
    assert all(np.array_equal(a.array, b.array) for a, b in zip(vkt.read_series(name), parts, strict=True)), name
vkt.write_series([part.array for part in parts], "a%02d.mha")
assert sorted(f for f in os.listdir() if f.startswith("a0")) == ["a00.mha", "a01.mha", "a02.mha"]
assert [v.dims for v in vkt.read_series("a*.mha")] == [p.dims for p in parts]
def broken():
    yield parts[0]
    raise RuntimeError("no more")
for what, kind, text in (
        (broken(), RuntimeError, "no more"), ([parts[0], volume], vkt.Error, "one NIfTI file cannot hold"), ([parts[0], 3], TypeError, "int"),
        (volume, TypeError, "several"), ("text", TypeError, "several")):
    try:
        vkt.write_series(what, "broken.nii.gz")
        raise SystemExit("taken")
    except kind as e:
        assert text in str(e), e
    assert not [f for f in os.listdir() if "broken" in f], os.listdir()
try:
    vkt.write_series(times, "out.nrrd")
    raise SystemExit("taken")
except vkt.Error as e:
    assert "force=True" in str(e)
vkt.write_series(times[:1], "out.nrrd", force=True)
assert len(vkt.read_series("out.nrrd")) == 1
os.mkfifo("pipe")
try:
    len(vkt.read_series("pipe"))
    raise SystemExit("taken")
except TypeError as e:
    assert "once" in str(e)
EOF2
}
