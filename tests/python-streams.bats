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
