# Python: volumes to and from NumPy, DLPack, xarray and pickle.
load helper
load python

@test "NumPy and DLPack show the voxels in place, read-only, and keep them alive" {
    python <<'EOF2'
a = np.asarray(volume)
assert a.ctypes.data == volume.array.ctypes.data and not a.flags.writeable
assert volume.__array_interface__["shape"] == volume.dims[::-1]
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    v = vkt.Volume(np.arange(60).reshape(3, 4, 5).astype(dtype))
    assert v.__dlpack_device__() == (1, 0)
    b = np.from_dlpack(v)
    assert b.ctypes.data == v.array.ctypes.data and np.array_equal(b, v.array) and b.dtype == v.dtype
    assert not b.flags.writeable
    del v
    assert b.sum() == 1770
c = np.array(volume, copy=True)
assert c.flags.writeable and np.array_equal(c, a)
assert np.asarray(volume, dtype=np.float32).dtype == np.float32 and np.add(volume, 1).dtype == a.dtype
import gc, sys
from vkt import _dlpack
gc.collect()
held = len(_dlpack._handed_out)
volume.__dlpack__()  # nobody takes it
volume.__dlpack__(max_version=(1, 1))
gc.collect()
assert len(_dlpack._handed_out) == held
for wrong in dict(stream=1), dict(dl_device=(2, 0)):
    try:
        volume.__dlpack__(**wrong)
        raise SystemExit(f"{wrong} was taken")
    except BufferError:
        pass
EOF2
}

@test "without a GPU volumes are on the host, and arrays of GPUs are refused" {
    python <<'EOF2'
import ctypes
try:
    volume.migrate("gpu")
    print("there is a GPU: tests/gpu.sh looks at this")
    raise SystemExit
except vkt.Error as e:
    assert e.exit_code == 5, e
assert volume.devices == ("cpu",) and not hasattr(volume, "__cuda_array_interface__")
assert volume.migrate("cpu") is volume and np.asarray(volume).shape == volume.dims[::-1]
for wrong in "moon", "cpu:1":
    try:
        volume.migrate(wrong)
        raise SystemExit(f"{wrong} was taken")
    except vkt.Error as e:
        assert e.exit_code == 2, e
class Foreign:
    def __init__(self, array, strides=None):
        self.array = array
        self.__cuda_array_interface__ = {"version": 3, "shape": array.shape, "typestr": array.dtype.str,
                                         "data": (array.ctypes.data, False), "strides": strides, "stream": 1}
a = np.zeros((2, 3, 4), np.float32)
for array, code in (Foreign(a), 5), (Foreign(a, (48, 4, 16)), 2), (Foreign(a.astype(complex)), 2), (Foreign(np.array(1, np.float32)), 2):
    for copy in True, False:
        try:
            vkt.Volume(array, copy=copy)
            raise SystemExit("a pointer of the host passed for one of a GPU")
        except vkt.Error as e:
            assert e.exit_code == code, (e, e.exit_code)
from vkt import _volume
assert not _volume._kept
EOF2
}

@test "arrays of GPUs, with a stand-in: in place or copied, both ways, kept alive and let go" {
    [ -e "$VKT_BUILD/tests/vkt_host_gpu.so" ] || skip "this build has no stand-in for a GPU"
    LD_PRELOAD=$VKT_BUILD/tests/vkt_host_gpu.so python <<'EOF2'
import ctypes, gc, threading
from vkt import _dlpack, _volume
gpu = ctypes.CDLL(None)
gpu.host_gpu_allocate.restype, gpu.host_gpu_allocate.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
gpu.host_gpu_free.argtypes, gpu.host_gpu_blocks.restype = [ctypes.c_void_p], ctypes.c_size_t
class Array:  # another package's
    def __init__(self, array, offset=0):
        self.shape, self.dtype = array.shape, array.dtype
        self.memory = gpu.host_gpu_allocate(array.nbytes + offset)
        self.pointer = self.memory + offset
        ctypes.memmove(self.pointer, array.ctypes.data, array.nbytes)
    def __del__(self):
        gpu.host_gpu_free(self.memory)
    @property
    def __cuda_array_interface__(self):
        return {"version": 3, "shape": self.shape, "typestr": self.dtype.str, "data": (self.pointer, False), "stream": 1}
rng = np.random.default_rng(1)
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    a = rng.integers(0, 100, (5, 6, 7)).astype(dtype)
    v = vkt.Volume(a, spacing=(1, 2, 3))
    assert v.devices == ("cpu",) and not hasattr(v, "__cuda_array_interface__")
    assert v.migrate("gpu") is v and v.devices == ("cpu", "gpu:0") and v.__dlpack_device__() == (1, 0)
    array = Array(a)
    w = vkt.Volume(array, like=v, copy=False)
    assert w.devices == ("gpu:0",) and w.spacing == (1, 2, 3) and w.dtype == a.dtype and w.__dlpack_device__() == (2, 0)
    interface = w.__cuda_array_interface__
    assert interface["data"] == (array.pointer, True) and interface["shape"] == a.shape and interface["typestr"] == a.dtype.str
    u = vkt.Volume(array)
    assert u.__cuda_array_interface__["data"][0] != array.pointer
    x = vkt.from_dlpack(vkt.Volume(array))  # the other way by DLPack, and back
    assert x.devices == ("gpu:0",) and x.dtype == a.dtype
    del array
    gc.collect()
    for y in w, u, x:
        assert np.array_equal(y, a) and y.devices == ("cpu", "gpu:0")  # brought here, still there
    assert np.array_equal(np.from_dlpack(w), a)
    seen = []
    many = vkt.Volume(Array(np.broadcast_to(a, (40, 5, 6, 7)).reshape(200, 6, 7).copy()), copy=False)
    threads = [threading.Thread(target=lambda: seen.append(np.asarray(many).tobytes())) for _ in range(8)]
    [t.start() for t in threads], [t.join() for t in threads]
    assert set(seen) == {seen[0]} and len(seen) == 8
    del u, v, w, x, y, many
    gc.collect()
    assert not _volume._kept and not _dlpack._handed_out and gpu.host_gpu_blocks() == 0, dtype
unaligned = Array(np.ones((2, 3, 4), np.float32), 16)
try:
    vkt.Volume(unaligned, copy=False)
    raise SystemExit("memory that kernels cannot use was used in place")
except vkt.Error as e:
    assert e.exit_code == 2 and "256" in str(e), e
assert np.all(np.asarray(vkt.Volume(unaligned)) == 1)
capsule = vkt.Volume(unaligned).__dlpack__(stream=2, max_version=(1, 1))
assert "dltensor_versioned" in repr(capsule)
try:
    vkt.Volume(unaligned).__dlpack__(dl_device=(2, 5))
    raise SystemExit("memory of another GPU was promised")
except BufferError:
    pass
EOF2
}

@test "the policy of a thread: nested, put back, of no other thread" {
    python <<'EOF2'
import threading
before = vkt.policy().threads
with vkt.policy(threads=3, memory=1 << 26) as outer:
    assert (outer.threads, outer.memory, outer.device) == (3, 1 << 26, "auto")
    with vkt.policy(device="cpu", threads=2) as inner:
        assert (inner.threads, inner.memory, inner.device) == (2, 1 << 26, "cpu")
        seen = []
        t = threading.Thread(target=lambda: seen.append(vkt.policy().threads))
        t.start(), t.join()
        assert seen == [before]
    assert outer.threads == 3
    for wrong, code in (dict(device="moon"), 2), (dict(device="gpu:99"), 5), (dict(threads=-1), 2):
        try:
            vkt.policy(**wrong)
            raise SystemExit(f"{wrong} was taken")
        except vkt.Error as e:
            assert e.exit_code == code, e
    assert outer.threads == 3
    try:
        with vkt.policy(memory=1 << 10):
            vkt.filter.gaussian(volume, sigma=2)
        raise SystemExit("a volume beyond the memory passed")
    except vkt.Error as e:
        assert e.exit_code == 5, e
assert vkt.policy().threads == before
EOF2
}

@test "the memory of others is used in place if that is asked for" {
    python <<'EOF2'
import gc
a = np.arange(2 * 3 * 4, dtype=np.int16).reshape(2, 3, 4)
v = vkt.Volume(a, copy=False, spacing=(1, 2, 3))
assert v.array.ctypes.data == a.ctypes.data and v.spacing == (1, 2, 3)
assert vkt.Volume(a).array.ctypes.data != a.ctypes.data
w = vkt.from_dlpack(a, units="HU")
assert w.array.ctypes.data == a.ctypes.data and w.units == "HU"
from vkt import _volume
total = a.sum()
del a, v
gc.collect()
assert w.array.sum() == total and len(_volume._kept) == 1
moved = vkt.set(w, spacing=2)  # may have the voxels of the other
view = w.array
del w
gc.collect()
assert moved.array.sum() == total and view.sum() == total
del moved, view
gc.collect()
vkt.trim()
assert not _volume._kept  # nobody needs the array any more
for wrong in dict(spacing=np.nan), dict(slope=0), dict(origin=(0, np.inf, 0)), dict(spacing=-1):
    try:
        vkt.Volume(np.zeros((2, 2, 2)), **wrong)
        raise SystemExit(f"{wrong} was taken")
    except vkt.Error:
        pass
for wrong in np.zeros((4, 4, 4))[:, ::2], np.zeros((2, 2), ">f8"):
    assert vkt.Volume(wrong).array.sum() == 0
    try:
        vkt.Volume(wrong, copy=False)
        raise SystemExit("used in place")
    except vkt.Error as e:
        assert e.exit_code == 2 and "in place" in str(e)
EOF2
}

@test "copies are taken in any order of elements, and masks are not lost" {
    python <<'EOF2'
a = np.arange(60, dtype=np.int16).reshape(3, 4, 5)
f = np.asfortranarray(a)
v = vkt.from_dlpack(f, copy=True, spacing=2)
assert np.array_equal(v.array, a) and v.spacing == (2, 2, 2)
copied = vkt.from_dlpack(a, copy=True)
a[0, 0, 0] = 99
assert copied.array[0, 0, 0] == 0
try:
    vkt.from_dlpack(f)
    raise SystemExit("in place?")
except vkt.Error as e:
    assert "copy=True" in e.hint
masked = np.ma.masked_greater(a, 30)
for call in lambda: vkt.Volume(masked), lambda: vkt.Volume(masked, copy=False), lambda: vkt.filter.kernel(volume, masked[:, :3, :3]):
    try:
        call()
        raise SystemExit("the mask is lost")
    except vkt.Error as e:
        assert e.exit_code == 2 and "filled" in e.hint, e
assert vkt.Volume(masked.filled(0)).stats()["max"] == 30
assert np.array_equal(vkt.Volume(np.ma.array(a)).array, a)  # nothing is masked
EOF2
}

@test "a pickled volume is the volume: voxels, geometry, units, value map, attributes, history, report" {
    python <<'EOF2'
import copy, pickle
turned = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
v = vkt.Volume(volume.array, spacing=(1, 2, 1 / 3), origin=(0.1, 5, 6.5), direction=turned, slope=2, intercept=-1.5, units="HU")
v = vkt.filter.gaussian(vkt.set(v, attribute=["space=left-posterior-superior", "who=ünïcode\nlines"]), sigma=1)
def same(a, b):
    return a.header == b.header and a.array.tobytes() == b.array.tobytes() and a.array.dtype == b.array.dtype
for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
    back = pickle.loads(pickle.dumps([v, volume], protocol))
    assert same(back[0], v) and same(back[1], volume), protocol
    assert back[0].header["history"]["command"][:2] == ["filter", "gaussian"] and back[0].space == v.space
for dtype in "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split():
    one = vkt.Volume(np.arange(24).reshape(2, 3, 4).astype(dtype))
    assert same(pickle.loads(pickle.dumps(one)), one)
buffers = []
data = pickle.dumps(v, 5, buffer_callback=buffers.append)
assert len(data) < 4000 and len(buffers) == 1 and buffers[0].raw().nbytes == v.array.nbytes
back = pickle.loads(data, buffers=buffers)
assert same(back, v) and back.array.ctypes.data == v.array.ctypes.data  # no copy
assert same(vkt.flip(vkt.flip(back, "x"), "x"), vkt.flip(vkt.flip(v, "x"), "x"))
assert copy.copy(v) is v and copy.deepcopy({"a": v})["a"] is v
labels = vkt.label(vkt.threshold(volume, otsu=True))
assert labels.report["components"] > 0
for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
    back = pickle.loads(pickle.dumps(labels, protocol))
    assert back.report == labels.report and pickle.loads(pickle.dumps(back, protocol)).report == labels.report
    assert pickle.loads(pickle.dumps(v, protocol)).report is None
error = pickle.loads(pickle.dumps(vkt.Error("no", 3, "try")))
assert str(error) == "no (try)" and error.exit_code == 3 and error.hint == "try"
EOF2
}

@test "an adaptive mesh is pickled, too" {
    python <<'EOF2'
import pickle
tree = vkt.refine(volume, tolerance=50)
back = pickle.loads(pickle.dumps(tree))
assert tree.hierarchical and back.hierarchical and back.header == tree.header
assert back.stats() == tree.stats()
EOF2
}

@test "volumes go to other processes and come back" {
    python <<'EOF2'
import concurrent.futures, multiprocessing
with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:
    back = pool.submit(vkt.flip, volume, "x").result(60)
assert np.array_equal(back.array, volume.array[:, :, ::-1])
EOF2
}

@test "xarray: dimensions, coordinates in the world, attributes, and the same volume back" {
    /usr/bin/python3 -c "import xarray" 2>/dev/null || with_peer xarray
    python <<'EOF2'
import json, xarray
rng = np.random.default_rng(0)
a = rng.integers(-100, 100, (4, 5, 6)).astype(np.int16)
v = vkt.set(vkt.Volume(a, spacing=(0.1, 2, 3.3), origin=(-4, 5, 6.5), slope=2, intercept=-1, units="HU"), attribute="space=RAS")
x = vkt.to_xarray(v, stored=True)
assert x.dims == ("z", "y", "x") and x.values.ctypes.data == v.array.ctypes.data  # in place
assert np.allclose(x.x, -4 + 0.1 * np.arange(6)) and np.allclose(x.z, 6.5 + 3.3 * np.arange(4))
assert float(x.sel(z=13.1, y=7, x=-3.8, method="nearest")) == a[2, 1, 2]
assert x.attrs["units"] == "HU" and x.attrs["scale_factor"] == 2
assert json.loads(x.attrs["vkt_history"])["command"][0] == "set"
def same(p, q):
    return (np.array_equal(p.array, q.array) and p.spacing == q.spacing and p.origin == q.origin and p.space == q.space and
            np.array_equal(p.direction, q.direction) and (p.slope, p.intercept, p.units) == (q.slope, q.intercept, q.units))
assert same(vkt.from_xarray(x), v) and same(vkt.from_xarray(v.to_xarray(stored=True)), v)
assert same(vkt.from_xarray(x.transpose("x", "z", "y")), v)
part = vkt.from_xarray(x.isel(z=slice(1, 4, 2), x=slice(2, 5)))
want = vkt.crop(v, roi="2:5,:,1:4")
assert np.array_equal(part.array, want.array[::2]) and np.allclose(part.spacing, (0.1, 2, 6.6)) and np.allclose(part.origin, want.origin)
slice_ = vkt.from_xarray(x.isel(z=2))  # keeps its place, which the scalar coordinate says
assert slice_.dims == (6, 5, 1) and np.array_equal(slice_.array[0], a[2])
# Falling coordinates are a reversed axis: voxels stay where they are.
flipped = vkt.from_xarray(x.isel(y=slice(None, None, -1)))
assert np.array_equal(flipped.array, a[:, ::-1]) and flipped.direction[1, 1] == -1 and flipped.spacing == v.spacing
assert np.allclose(flipped.origin, (-4, 13, 6.5))
assert same(vkt.from_xarray(vkt.flip(v, "y").to_xarray(stored=True)), vkt.flip(v, "y"))
# Oblique axes: distances along them, and attributes.
angle = 0.3
turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
o = vkt.Volume(a, spacing=(1, 2, 3), origin=(4, 5, 6), direction=turn)
y = o.to_xarray()
assert np.allclose(y.y, 2 * np.arange(5)) and same(vkt.from_xarray(y), o)
cut = vkt.from_xarray(y.isel(x=slice(2, None)))
assert np.allclose(cut.origin, vkt.crop(o, roi="2:,:,:").origin) and np.allclose(cut.direction, turn)
plain = vkt.from_xarray(xarray.DataArray(a.astype(float), dims=("time", "row", "column")))
assert plain.dims == (6, 5, 4) and plain.spacing == (1, 1, 1) and plain.origin == (0, 0, 0)
for wrong in (xarray.DataArray(np.zeros((2, 2, 2, 2))), xarray.DataArray(np.zeros(3), coords={"x": [0, 1, 5]}, dims="x"),
              xarray.DataArray(np.zeros(2), coords={"x": ["a", "b"]}, dims="x")):
    try:
        vkt.from_xarray(wrong)
        raise SystemExit("taken")
    except vkt.Error as e:
        assert e.exit_code == 2
EOF2
}

@test "xarray: values are those that the units are of, and a file packs them again" {
    /usr/bin/python3 -c "import xarray" 2>/dev/null || with_peer xarray
    python <<'EOF2'
import xarray
a = np.arange(-30, 30).reshape(3, 4, 5).astype(np.int16)
v = vkt.Volume(a, units="HU", slope=2, intercept=-5)
x = vkt.to_xarray(v)
assert x.dtype == np.float32 and np.array_equal(x, 2.0 * a - 5) and x.attrs["units"] == "HU"
assert "scale_factor" not in x.attrs and (x.encoding["scale_factor"], x.encoding["add_offset"]) == (2, -5)
assert x.encoding["dtype"] == np.int16
for y in x, x + 0, x.copy():  # the sum has lost its attrs, or not, by xarray's version
    back = vkt.from_xarray(y)
    assert np.array_equal(back.slope * back.array + back.intercept, 2.0 * a - 5)
assert vkt.from_xarray(x).units == "HU" and vkt.from_xarray(x).stats()["mean"] == v.stats()["mean"]
# What float32 would round is float64.
for slope, intercept, dtype, want in ((0.1, 0, np.int16, np.float64), (1, -1024, np.int16, np.float32), (1, 1, np.int32, np.float64),
                                      (2, 0, np.float32, np.float64), (-300, 0, np.uint16, np.float64), (1, 2.0 ** 24, np.uint8, np.float64)):
    b = np.abs(a).astype(dtype)
    y = vkt.to_xarray(vkt.Volume(b, slope=slope, intercept=intercept))
    assert y.dtype == want and np.array_equal(y, slope * b.astype(float) + intercept), (slope, y.dtype)
plain = vkt.to_xarray(vkt.Volume(a, units="mm"))
assert plain.dtype == np.int16 and not plain.encoding and plain.attrs["units"] == "mm"
# Packed as CF has it: xarray decodes it to the same values.
packed = v.to_xarray(stored=True)
assert packed.dtype == np.int16 and np.array_equal(xarray.decode_cf(packed.to_dataset(name="v"))["v"], x)
try:
    from scipy.io import netcdf_file
except ImportError:
    pass
else:
    x.name = "v"
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "saving variable v with floating point data")  # for NaN, which is not there
        x.to_netcdf("v.nc")
    with netcdf_file("v.nc", mmap=False) as file:
        assert file.variables["v"].data.dtype.kind == "i" and np.array_equal(file.variables["v"].data, a)
    with xarray.open_dataarray("v.nc") as y:
        assert np.array_equal(vkt.from_xarray(y).array, x) and vkt.from_xarray(y).units == "HU"
EOF2
}

@test "xarray is not needed for anything else" {
    python <<'EOF2'
import sys
sys.modules["xarray"] = None
try:
    vkt.to_xarray(volume)
    raise SystemExit("without xarray?")
except ImportError:
    pass
assert volume.stats()["count"] > 0
EOF2
}
