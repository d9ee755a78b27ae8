#!/usr/bin/python3
# Times every operation with a bar against its peer, or against copying and reading, in one process and one run.
# SPDX-License-Identifier: MIT
#
#   algorithms.py [--build DIR] [--only WORD …] [--size N] [--runs N] [--busy] [--list]   exit 1 if a bar is missed
#
# --build   build folder whose package vkt is measured (default: build); configure it as Release
# --only    rows whose names contain one of these words
# --size    edge of the largest volumes (512); the others shrink with them, and bars in milliseconds do not apply
# --runs    each figure is the best of so many, ours and the peer's in turns (5)
# --busy    for a machine that does other work: processor time, shared out to the threads, instead of wall time
#
# Peers, each left out where it is missing: python3-scipy, python3-opencv, python3-skimage from Debian; SimpleITK,
# connected-components-3d and edt from PyPI, wherever PYTHONPATH finds them:
#
#   python3 -m pip install --no-deps --target build/oracles SimpleITK connected-components-3d edt
#
# All of them, and vkt, may use all processors. GPUs have their own: tests/gpu.sh. Threads of vkt and of copying, reading
# and OpenCV stay on a processor each: schedulers of virtual machines have put both threads of short work on one.
import argparse
import concurrent.futures
import ctypes
import importlib
import os
import sys
import tempfile
import time
import warnings
from pathlib import Path

processors = sorted(os.sched_getaffinity(0))
threads = len(processors)
os.environ.setdefault("VKT_THREADS", str(threads))  # OpenMP leaves this thread one processor, and it would count that
os.environ.setdefault("OMP_PROC_BIND", "spread")  # before any library that is loaded reads it

import numpy as np

here = Path(__file__).resolve().parent
free = list(processors)
pool = concurrent.futures.ThreadPoolExecutor(threads, initializer=lambda: os.sched_setaffinity(0, {free.pop()}))
vkt = None  # imported when it is known from where


def module(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


class Missing(Exception):
    """A peer that is not installed."""


def needs(name):
    found = module(name)
    if found is None:
        raise Missing(name)
    return found


def in_parts(n, work):
    """work(begin, end) in all threads, on parts that cover 0 … n."""
    edges = [n * i // threads for i in range(threads + 1)]
    list(pool.map(work, edges[:-1], edges[1:]))


class Limits:
    """Bytes a second that all threads copy (read and written counted) and read."""

    def __init__(self, runs, volume):
        libc = ctypes.CDLL(None)
        n = volume.nbytes
        to = np.empty_like(volume).view(np.uint8).ravel()
        to[:] = 1
        self.to, self.source, self.n, self.runs = to, volume, n, runs
        copy, find = libc.memcpy, libc.memchr
        copy.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t]
        find.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t]
        a, b = volume.ctypes.data, to.ctypes.data
        self.copying = lambda: in_parts(n, lambda i, j: copy(b + i, a + i, j - i))
        self.searched = np.ones(n, np.uint8)
        c = self.searched.ctypes.data
        self.reading = lambda: in_parts(n, lambda i, j: find(c + i, 2, j - i))

    def copy(self, seconds):
        return 2 * self.n / seconds

    def read(self, seconds):
        return self.n / seconds


clock = time.perf_counter


def seconds_of(*functions, runs, serial=(), strange=()):
    """The best time of each, in turns, and the last result of each. `serial`: which of them use one thread; `strange`:
    which start threads of their own, which would inherit this one's processor."""
    best, results = [float("inf")] * len(functions), [None] * len(functions)
    for run in range(runs + 1):  # the first warms
        for i, function in enumerate(functions):
            os.sched_setaffinity(0, processors if i in strange else processors[:1])
            begin = clock()
            results[i] = function()
            taken = clock() - begin
            if clock is time.process_time and i not in serial:
                taken /= threads
            if run > 0:
                best[i] = min(best[i], taken)
    return best, results


def array_of(result):
    return result.array if isinstance(result, vkt.Volume) else np.asarray(result)


def largest_difference(inner=0):
    def compare(ours, theirs):
        a, b = array_of(ours), array_of(theirs)
        if inner:
            a, b = (v[tuple(slice(inner, -inner) for _ in range(3))] for v in (a, b))
        step = max(1, a.shape[0] // 32)  # of some slices: double differences of all would not fit
        return f"{max(np.nanmax(np.abs(x.astype(float) - y)) for x, y in zip(a[::step], b[::step])):.2g}"

    return compare


def same_values(ours, theirs):
    return "none" if np.array_equal(array_of(ours), array_of(theirs)) else "DIFFERS"


def same_partition(ours, theirs):
    a, b = array_of(ours).ravel(), np.asarray(theirs).ravel()
    n = int(a.max())
    if n != int(b.max()) or not np.array_equal(a == 0, b == 0):
        return "DIFFERS"
    name = np.zeros(n + 1, b.dtype)
    name[a] = b
    return "none" if np.array_equal(name[a], b) else "DIFFERS"


class Bench:
    def __init__(self, options):
        self.options = options
        self.big, self.small = options.size, options.size // 2
        self.odd = max(16, round(302 * options.size / 512))
        self.random = np.random.default_rng(1)
        self.volumes, self.limits, self.missed = {}, None, 0
        self.rows = []

    # Inputs, each made once.

    def noise(self, n, dtype="float32"):
        key = (n, dtype)
        if key not in self.volumes:
            if dtype == "float32":
                v = self.random.random((n, n, n), np.float32)
            else:
                v = self.random.integers(0, 256, (n, n, n), np.uint8).astype(dtype)
            self.volumes[key] = vkt.Volume(v)
        return self.volumes[key]

    def blobs(self, n, share, seed=3):
        """White noise, smoothed and cut so that about this share is set."""
        key = ("blobs", n, share)
        if key not in self.volumes:
            v = vkt.Volume(np.random.default_rng(seed).random((n, n, n), np.float32))
            smooth = v.apply("filter box", radius=2).apply("filter box", radius=2)
            level = float(np.quantile(smooth.array[::4, ::4, ::4], 1 - share))
            self.volumes[key] = smooth.apply("threshold", above=level)
        return self.volumes[key]

    def white(self, n, share):
        key = ("white", n, share)
        if key not in self.volumes:
            self.volumes[key] = vkt.Volume((np.random.default_rng(5).random((n, n, n), np.float32) < share))
        return self.volumes[key]

    def writable(self, volume):
        """A copy for peers that take no array that is read-only."""
        key = ("copy", id(volume))
        if key not in self.volumes:
            self.volumes[key] = np.array(volume.array)
        return self.volumes[key]

    # Rows of the table.

    def wanted(self, name):
        return not self.options.only or any(word in name for word in self.options.only)

    def say(self, name, bar, figure, met, difference, times):
        verdict = "" if met is None else "met" if met else "MISSED"
        self.missed += met is False
        print(f"{name:<34} {bar:<22} {figure:>12} {verdict:<7} {difference:<10} {times}", flush=True)

    def row(self, name, function):
        if self.options.list:
            print(name)
        elif self.wanted(name):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(name)
            except Missing as missing:
                self.say(name, "", "", None, "", f"no {missing}")

    # Peers that use one thread whatever there is.
    serial = {"SciPy", "skimage", "cc3d"}

    def against(self, name, ours, theirs, most, peer, compare=largest_difference(), runs=None):
        """Ours takes at most this share of the peer's time."""

        def run(row):
            peer_module = peer.split()[0]
            needs({"OpenCV": "cv2", "ITK": "SimpleITK", "SciPy": "scipy.ndimage", "skimage": "skimage", "cc3d": "cc3d",
                   "edt": "edt", "vkt": "vkt"}[peer_module])
            few = runs or self.options.runs
            serial = {1} if peer_module in self.serial else ()
            strange = () if peer_module in ("vkt", "OpenCV") else {1}
            (mine, other), results = seconds_of(ours, theirs, runs=few, serial=serial, strange=strange)
            ratio = mine / other
            self.say(row, f"<= {most:.4g} of {peer}", f"{ratio:.4f}", ratio <= most,
                     compare(*results) if compare else "", f"{mine * 1e3:.1f} : {other * 1e3:.1f} ms")

        self.row(name, run)

    def bandwidth(self, name, ours, bytes_moved, least, kind, expected=None):
        """Moves or reads at least this share of the bytes a second that copying or reading does."""

        def run(row):
            if self.limits is None:
                self.limits = Limits(self.options.runs, self.noise(self.big).array)
            limit = self.limits.copying if kind == "copy" else self.limits.reading
            (mine, other), results = seconds_of(ours, limit, runs=self.options.runs)
            of_limit = getattr(self.limits, kind)(other)
            share = bytes_moved / mine / of_limit
            difference = ""
            if expected:
                difference = same_values(results[0], expected())
            self.say(row, f">= {least:.4g} of {kind}", f"{share:.3f}", share >= least, difference,
                     f"{mine * 1e3:.1f} ms, {bytes_moved / mine * 1e-9:.1f} of {of_limit * 1e-9:.1f} GB/s")

        self.row(name, run)

    def at_most(self, name, ours, most_ms, check=None):
        def run(row):
            (mine,), results = seconds_of(ours, runs=self.options.runs)
            applies = self.options.size == 512
            self.say(row, f"<= {most_ms} ms", f"{mine * 1e3:.1f} ms", mine * 1e3 <= most_ms if applies else None,
                     check(results[0]) if check else "", "")

        self.row(name, run)

    def flat(self, name, ours, radii, most=1.25):
        """The largest radius takes about as long as the smallest."""

        def run(row):
            times, _ = seconds_of(*[lambda r=r: ours(r) for r in radii], runs=self.options.runs)
            ratio = max(times) / times[0]
            self.say(row, f"<= {most} of radius {radii[0]}", f"{ratio:.2f}", ratio <= most, "",
                     ", ".join(f"{r}: {t * 1e3:.1f}" for r, t in zip(radii, times)) + " ms")

        self.row(name, run)


def opencv_gaussian(volume, sigma):
    """sepFilter2D on slices, then along z on strips of columns; both in all threads. float32."""
    cv2 = needs("cv2")
    cv2.setNumThreads(1)
    radius = int(4 * sigma + 0.5)
    k = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    k = (k / k.sum()).astype(np.float32)
    one = np.ones(1, np.float32)
    v = volume.array
    n = v.shape[0]
    # Kept between calls, as a program that does this often would.
    kept = opencv_gaussian.__dict__.setdefault("kept", {})
    if v.shape not in kept:
        kept.clear()
        kept[v.shape] = (np.empty(v.shape, np.float32), np.empty(v.shape, np.float32))
    between, out = kept[v.shape]

    def slices(begin, end):
        for z in range(begin, end):
            cv2.sepFilter2D(v[z], cv2.CV_32F, k, k, dst=between[z], borderType=cv2.BORDER_REFLECT)

    flat_in, flat_out = between.reshape(n, -1), out.reshape(n, -1)
    width = 4096

    def strips(begin, end):
        for s in range(begin, end):
            part = flat_in[:, s * width : (s + 1) * width]
            flat_out[:, s * width : (s + 1) * width] = cv2.sepFilter2D(
                part, cv2.CV_32F, one, k, borderType=cv2.BORDER_REFLECT)

    in_parts(n, slices)
    in_parts((flat_in.shape[1] + width - 1) // width, strips)
    return out


def opencv_rotate(volume, degrees):
    """warpAffine on slices, in all threads."""
    cv2 = needs("cv2")
    cv2.setNumThreads(1)
    v = volume.array
    n = v.shape[0]
    matrix = cv2.getRotationMatrix2D(((v.shape[2] - 1) / 2, (v.shape[1] - 1) / 2), -degrees, 1)
    kept = opencv_rotate.__dict__.setdefault("kept", {})
    if v.shape not in kept:
        kept.clear()
        kept[v.shape] = np.empty_like(v)
    out = kept[v.shape]

    def slices(begin, end):
        for z in range(begin, end):
            cv2.warpAffine(v[z], matrix, (v.shape[2], v.shape[1]), dst=out[z], flags=cv2.INTER_LINEAR)

    in_parts(n, slices)
    return out


def rotation(axis, degrees):
    """The matrix of a rotation about an axis x, y, z."""
    a = np.asarray(axis, float)
    a /= np.linalg.norm(a)
    t = np.radians(degrees)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.cos(t) * np.eye(3) + np.sin(t) * cross + (1 - np.cos(t)) * np.outer(a, a)


def gaussians(b):
    big, odd = b.noise, b.odd
    for sigma, most in ((2, 0.45), (8, 1 / 8)):
        b.against(f"gaussian float32 sigma {sigma}",
                  lambda s=sigma: big(b.big).apply("filter gaussian", sigma=s, tolerance="0.01%"),
                  lambda s=sigma: opencv_gaussian(big(b.big), s), most, "OpenCV")
    b.against("gaussian sigma 32 to 8", lambda: big(b.big).apply("filter gaussian", sigma=32, tolerance="0.01%"),
              lambda: big(b.big).apply("filter gaussian", sigma=8, tolerance="0.01%"), 1.2, "vkt at 8", None)
    b.against("gaussian uint8 sigma 2", lambda: big(odd, "uint8").apply("filter gaussian", sigma=2),
              lambda: opencv_gaussian(big(odd, "uint8"), 2), 0.45, "OpenCV",
              lambda ours, theirs: f"{np.abs(array_of(ours).astype(float) - theirs).max():.2g}")


def pointwise(b):
    n = b.big
    v = lambda: b.noise(n)  # noqa: E731
    size = 4 * n**3
    a = lambda: v().array  # noqa: E731
    rows = (
        ("copy", lambda: vkt.apply("copy", b.noise(b.small), v(), at=(3, 4, 5)), 2 * size, None),
        ("pad", lambda: v().apply("pad", by="1:1,1:1,1:1"), 2 * size, lambda: np.pad(a(), 1)),
        ("permute zyx", lambda: v().apply("permute", "zyx"), 2 * size, lambda: a().transpose(2, 1, 0)),
        ("permute yxz", lambda: v().apply("permute", "yxz"), 2 * size, lambda: a().transpose(0, 2, 1)),
        ("permute xzy", lambda: v().apply("permute", "xzy"), 2 * size, lambda: a().transpose(1, 0, 2)),
        ("arith add number", lambda: v().apply("arith add", 1), 2 * size, lambda: a() + np.float32(1)),
        ("arith mul volumes", lambda: vkt.apply("arith mul", v(), v()), 2 * size, lambda: a() * a()),
        ("arith sqrt", lambda: v().apply("arith sqrt"), 2 * size, lambda: np.sqrt(a())),
        ("threshold", lambda: v().apply("threshold", above=0.5), size + n**3, lambda: a() > np.float32(0.5)),
        ("convert to uint16", lambda: v().apply("convert", dtype="uint16", range="0:1"), size * 3 // 2, None),
        ("convert to float64", lambda: v().apply("convert", dtype="float64"), 3 * size, lambda: a().astype(float)),
        ("delete", lambda: v().apply("delete", roi="25%:75%,25%:75%,25%:75%"), 2 * size, None),
    )
    for name, ours, moved, expected in rows:
        b.bandwidth(name, ours, moved, 0.8, "copy", expected)
    b.bandwidth("scan", lambda: v().apply("scan"), 3 * size, 0.4, "copy")
    b.bandwidth("scan uint8", lambda: b.noise(n, "uint8").apply("scan"), 9 * n**3, 0.4, "copy")


def reductions(b):
    n = b.big
    v = lambda: b.noise(n)  # noqa: E731
    size = 4 * n**3
    for dtype, bytes_each in (("float32", 4), ("uint8", 1), ("uint16", 2)):
        b.bandwidth(f"stats {dtype}", lambda d=dtype: b.noise(n, d).stats(), bytes_each * n**3, 0.8, "read")
        b.bandwidth(f"histogram 256 {dtype}",
                    lambda d=dtype: b.noise(n, d).apply("histogram", bins=256, range="0:1" if d == "float32" else "0:256"),
                    bytes_each * n**3, 0.5, "read")
    for axis, number in (("z", 0), ("y", 1), ("x", 2)):
        b.bandwidth(f"project max {axis}", lambda x=axis: v().apply("project", "max", axis=x), size, 0.7, "read",
                    lambda k=number: v().array.max(k).reshape(1, n, n))
        for what in ("mean", "sum", "std"):
            b.bandwidth(f"project {what} {axis}", lambda x=axis, w=what: v().apply("project", w, axis=x), size, 0.7, "read")
    b.bandwidth("project median z", lambda: v().apply("project", "median", axis="z"), size, 0.7, "read")


def kernels(b):
    folder = tempfile.TemporaryDirectory()
    b.kept = folder
    n = b.small
    for edge, most, peer in ((3, 15, 1), (5, 60, 1)):
        weights = np.random.default_rng(edge).standard_normal((edge, edge, edge))
        path = os.path.join(folder.name, f"kernel{edge}.txt")
        with open(path, "w", encoding="ascii") as file:
            file.write(f"{edge} {edge} {edge}\n" + " ".join(repr(float(w)) for w in weights.ravel()))

        def check(result, w=weights):
            scipy = module("scipy.ndimage")
            if scipy is None:
                return ""
            part = b.noise(n).array[:24]
            want = scipy.correlate(part.astype(float), w, mode="reflect")
            return f"{np.abs(array_of(result)[:20] - want[:20]).max():.2g}"

        ours = lambda p=path: b.noise(n).apply("filter kernel", p)  # noqa: E731
        b.at_most(f"kernel {edge}^3", ours, most, check)
        b.against(f"kernel {edge}^3 to SciPy", ours,
                  lambda w=weights.astype(np.float32): needs("scipy.ndimage").correlate(b.noise(n).array, w, mode="reflect"),
                  1 / 14 if edge == 3 else 1 / 7, "SciPy", runs=1)
    for edge in (9, 17, 31):
        weights = np.random.default_rng(edge).standard_normal((edge, edge, edge)).astype(np.float32) / edge**2
        path = os.path.join(folder.name, f"kernel{edge}.npy")
        np.save(path, weights)
        b.against(f"kernel {edge}^3 to FFT", lambda p=path: b.noise(n).apply("filter kernel", p, boundary="border:0"),
                  lambda w=weights: needs("scipy.signal").fftconvolve(b.noise(n).array, w[::-1, ::-1, ::-1], "same"),
                  1, "SciPy fftconvolve", runs=1)


def rotations(b):
    n = b.big
    v = lambda: b.noise(n)  # noqa: E731
    middle = (n - 1) / 2
    b.against("rotate z linear", lambda: v().apply("rotate", axis="z", angle=30), lambda: opencv_rotate(v(), 30), 0.5,
              "OpenCV", largest_difference(inner=n // 4))

    def itk(degrees, axis):
        itk = needs("SimpleITK")
        itk.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
        kept = itk.__dict__.setdefault("kept_by_bench", {})
        if "image" not in kept:
            kept["image"] = itk.GetImageFromArray(v().array)
        t = itk.AffineTransform(3)
        t.SetMatrix(rotation(axis, -degrees).ravel().tolist())
        t.SetCenter([middle] * 3)
        return itk.Resample(kept["image"], t, itk.sitkLinear, 0.0)

    def compare(ours, theirs):
        theirs = needs("SimpleITK").GetArrayViewFromImage(theirs)
        return largest_difference(inner=n // 4)(ours, theirs)

    for axis in ((1, 2, 3), (1, 0, 0)):
        b.against(f"rotate {','.join(map(str, axis))} linear", lambda a=axis: v().apply("rotate", axis=a, angle=30),
                  lambda a=axis: itk(30, a), 0.25, "ITK", compare, runs=2)
    small = lambda: b.noise(b.small)  # noqa: E731

    def spline():
        matrix = rotation((1, 2, 3), -30)[::-1, ::-1]  # SciPy's axes are z, y, x
        c = (b.small - 1) / 2 * np.ones(3)
        return needs("scipy.ndimage").affine_transform(small().array, matrix, c - matrix @ c, order=3, mode="reflect")

    b.against("rotate 1,2,3 bspline3",
              lambda: small().apply("rotate", axis=(1, 2, 3), angle=30, method="bspline3", boundary="mirror"), spline,
              1 / 8, "SciPy", largest_difference(inner=b.small // 4), runs=1)


def ranks(b):
    n = b.small
    part = slice(0, max(16, n // 4))

    def median(dtype, radius):
        # SciPy is so slow that it gets a fourth of the slices, and as many times that.
        def theirs():
            return needs("scipy.ndimage").median_filter(b.noise(n, dtype).array[part], 2 * radius + 1, mode="reflect")

        def run(row):
            needs("scipy.ndimage")
            most = {("uint8", 1): 1 / 200, ("float32", 1): 1 / 60, ("uint8", 2): 1 / 60, ("float32", 2): 1 / 16}
            (mine,), (ours,) = seconds_of(lambda: b.noise(n, dtype).apply("filter median", radius=radius),
                                          runs=b.options.runs)
            begin = clock()
            result = theirs()
            other = (clock() - begin) * n / result.shape[0]
            ratio, bar = mine / other, most[dtype, radius]
            inner = result.shape[0] - radius
            self_same = "none" if np.array_equal(ours.array[:inner], result[:inner]) else "DIFFERS"
            b.say(row, f"<= 1/{1 / bar:.0f} of SciPy", f"1/{1 / ratio:.0f}", ratio <= bar, self_same,
                  f"{mine * 1e3:.1f} : {other * 1e3:.0f} ms")

        b.row(f"median {2 * radius + 1}^3 {dtype}", run)

    for radius in (1, 2):
        for dtype in ("uint8", "float32"):
            median(dtype, radius)
    for dtype in ("uint8", "float32"):
        b.flat(f"box {dtype}", lambda r, d=dtype: b.noise(n, d).apply("filter box", radius=r), (2, 4, 16, 32))
        b.flat(f"erode box {dtype}",
               lambda r, d=dtype: b.noise(n, d).apply("morphology", "erode", radius=r, shape="box"), (2, 4, 16, 32))


def shapes(b):
    n = b.small
    for connectivity, name, volume, most in (
        (26, "blobs 20 %", lambda: b.blobs(n, 0.2), 0.5),
        (26, "blobs 50 %", lambda: b.blobs(n, 0.5), 0.5),
        (26, "white 30 %", lambda: b.white(n, 0.3), 1.0),
        (6, "blobs 20 %", lambda: b.blobs(n, 0.2), 0.55),
        (6, "blobs 50 %", lambda: b.blobs(n, 0.5), 0.55),
        (6, "white 30 %", lambda: b.white(n, 0.3), 1.0),
    ):
        b.against(f"label {connectivity} {name}", lambda v=volume, c=connectivity: v().apply("label", connectivity=c),
                  lambda v=volume, c=connectivity: needs("cc3d").connected_components(b.writable(v()), connectivity=c), most,
                  "cc3d", same_partition)

    def one_site():
        key = ("site", n)
        if key not in b.volumes:
            v = np.ones((n, n, n), np.uint8)
            v[n // 3, n // 4, n // 5] = 0
            b.volumes[key] = vkt.Volume(v)
        return b.volumes[key]

    for name, volume, most in (("blobs 20 %", lambda: b.blobs(n, 0.2), 0.25), ("blobs 50 %", lambda: b.blobs(n, 0.5), 0.25),
                               ("white 30 %", lambda: b.white(n, 0.3), 0.25), ("single site", one_site, 1.0)):
        b.against(f"distance {name}", lambda v=volume: v().apply("distance"),
                  lambda v=volume: needs("edt").edt(b.writable(v()), parallel=threads), most, "edt")


def contrast(b):
    n = b.small
    v = lambda: b.noise(n)  # noqa: E731
    b.against("clahe float32", lambda: v().apply("clahe", bricks=(8, 8, 8), bins=256),
              lambda: needs("skimage.exposure").equalize_adapthist(v().array, kernel_size=n // 8, nbins=256), 1 / 20,
              "skimage", None, runs=1)
    b.against("clahe uint8", lambda: b.noise(n, "uint8").apply("clahe", bricks=(8, 8, 8), bins=256),
              lambda: needs("skimage.exposure").equalize_adapthist(b.noise(n, "uint8").array, kernel_size=n // 8, nbins=256),
              1 / 20, "skimage", None, runs=1)
    m = max(32, n // 4)
    few = lambda: b.noise(m)  # noqa: E731

    def itk_bilateral():
        itk = needs("SimpleITK")
        itk.ProcessObject.SetGlobalDefaultNumberOfThreads(threads)
        image = itk.GetImageFromArray(few().array)
        return itk.GetArrayFromImage(itk.Bilateral(image, 1.0, 0.3, 1000))

    b.against("bilateral", lambda: few().apply("filter bilateral", sigma=1, range_sigma=0.3), itk_bilateral, 0.25, "ITK",
              largest_difference(inner=4), runs=2)
    b.against("nlmeans",
              lambda: few().apply("filter nlmeans", patch=1, search=3, strength=0.3),
              lambda: needs("skimage.restoration").denoise_nl_means(few().array, 3, 3, 0.3, fast_mode=True), 0.25,
              "skimage", largest_difference(inner=6), runs=1)


def texts(b):
    """Lines that an operation takes."""

    def lines(*names):
        root = here.parent.parent / "libvkt" / "operations"
        return sum(len((root / name).read_text().splitlines()) for name in names)

    def row(name, files, most):
        def run(title):
            n = lines(*files)
            b.say(title, f"<= {most} lines", str(n), n <= most, "", ", ".join(files))

        b.row(name, run)

    row("lines of threshold", ("voxels/threshold.cpp", "voxels/kernels/threshold.cpp", "voxels/kernels/threshold.h"), 60)
    row("lines of median", ("filter/median.cpp", "filter/kernels/median.cpp", "filter/kernels/median.h"), 120)


def main():
    parser = argparse.ArgumentParser(description="Times operations against their peers; the head of the file says how.")
    parser.add_argument("--build", default=here.parent.parent / "build", type=Path)
    parser.add_argument("--only", nargs="+", metavar="WORD")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--busy", action="store_true")
    parser.add_argument("--list", action="store_true", help="names of the rows")
    options = parser.parse_args()
    global vkt, clock
    if options.busy:
        clock = time.process_time
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    sys.path.insert(0, str((options.build / "python").resolve()))
    import vkt as package

    vkt = package
    bench = Bench(options)
    if not options.list:
        print(f"# vkt {vkt.__version__}, {threads} threads, volumes of {bench.big}^3, {bench.small}^3 and {bench.odd}^3")
        print(f"{'row':<34} {'bar':<22} {'figure':>12} {'':7} {'difference':<10}")
    for part in (gaussians, pointwise, reductions, kernels, rotations, ranks, shapes, contrast, texts):
        part(bench)
    return 1 if bench.missed else 0


if __name__ == "__main__":
    sys.exit(main())
