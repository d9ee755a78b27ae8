# Random pipelines against float64: the error that a header states is never below the true one, and not far above it.
# SPDX-License-Identifier: MIT
#
# usage: travelling_errors.py LIBRARY COUNT [SEED]; its files lie in a scratch directory. Runs in one process, through
# the C API. Everything is computed a second time here, from the definitions, in float64, with SciPy where it has the
# filter; nothing is rounded on the way, and saturated where the type of a stage is an integer's.
import ctypes
import json
import os
import sys
import tempfile

import numpy as np
from scipy import ndimage

INTEGERS = ("uint8", "int8", "uint16", "int16", "int32")
MODES = {"mirror": "reflect", "clamp": "nearest", "wrap": "wrap"}


class Description(ctypes.Structure):
    _fields_ = [("dims", ctypes.c_int64 * 3), ("dtype", ctypes.c_char_p), ("origin", ctypes.c_double * 3),
                ("spacing", ctypes.c_double * 3), ("direction", ctypes.c_double * 9), ("slope", ctypes.c_double),
                ("intercept", ctypes.c_double), ("units", ctypes.c_char_p), ("hierarchical", ctypes.c_int),
                ("space", ctypes.c_char_p)]


class Library:
    def __init__(self, path):
        self.c = ctypes.CDLL(path)
        self.c.vkt_error.restype = ctypes.c_char_p

    def check(self, status, what):
        if status != 0:
            raise SystemExit(f"{what}: {self.c.vkt_error().decode()}")

    def create(self, array, like=None):
        d = Description()
        self.c.vkt_default_description(ctypes.byref(d))
        if like is not None:
            self.check(self.c.vkt_describe(like, ctypes.byref(d)), "describe")
            d.slope, d.intercept = 1, 0
        d.dims[:] = array.shape[::-1]
        d.dtype = array.dtype.name.encode()
        volume = ctypes.c_void_p()
        kept = np.ascontiguousarray(array)
        self.check(self.c.vkt_create(ctypes.byref(d), kept.ctypes.data_as(ctypes.c_void_p), ctypes.byref(volume)), "create")
        return volume

    def apply(self, words, inputs):
        words = words.split()
        result = ctypes.c_void_p()
        status = self.c.vkt_apply((ctypes.c_char_p * len(words))(*(w.encode() for w in words)), ctypes.c_size_t(len(words)),
                                  (ctypes.c_void_p * len(inputs))(*inputs), ctypes.c_size_t(len(inputs)), ctypes.byref(result))
        self.check(status, " ".join(words))
        return result

    def header(self, volume):
        json_text = ctypes.c_void_p()
        self.check(self.c.vkt_header(volume, ctypes.byref(json_text)), "header")
        header = json.loads(ctypes.cast(json_text, ctypes.c_char_p).value)
        self.c.vkt_free_text(json_text)
        return header

    def voxels(self, volume):
        header = self.header(volume)
        at, size = ctypes.c_void_p(), ctypes.c_size_t()
        self.check(self.c.vkt_voxels(volume, ctypes.byref(at), ctypes.byref(size)), "voxels")
        x, y, z = header["dims"]
        array = np.frombuffer(ctypes.string_at(at, size.value), header["dtype"]).reshape(z, y, x)
        return array, header


def limits(dtype):
    i = np.iinfo(dtype)
    return float(i.min), float(i.max)


def folded(i, n, boundary):
    if boundary == "clamp":
        return min(max(i, 0), n - 1)
    if boundary == "wrap":
        return i % n
    i %= 2 * n
    return i if i < n else 2 * n - 1 - i


def along(a, axis, matrix):
    return np.moveaxis(np.tensordot(matrix, np.moveaxis(a, axis, 0), axes=1), 0, axis)


def correlation(n, taps, boundary):
    """The matrix of a correlation with taps of odd number on a line of n voxels."""
    m = np.zeros((n, n))
    r = len(taps) // 2
    for o in range(n):
        for k, w in enumerate(taps):
            m[o, folded(o + k - r, n, boundary)] += w
    return m


def gaussian_taps(sigma, reach):
    k = np.arange(-reach, reach + 1)
    w = np.exp(-0.5 * (k / sigma) ** 2)
    return w / w.sum()


def smooth(a, sigma, boundary, reach=12):
    for axis in range(3):
        a = along(a, axis, correlation(a.shape[axis], gaussian_taps(sigma, int(np.ceil(reach * sigma)) + 1), boundary))
    return a


def keys(t):
    t = abs(t)
    if t < 1:
        return 1.5 * t**3 - 2.5 * t**2 + 1
    return -0.5 * t**3 + 2.5 * t**2 - 4 * t + 2 if t < 2 else 0.0


def resampling(n, m, method):
    """Cell-centred sampling of a line of n voxels at m, edges repeated."""
    w = np.zeros((m, n))
    for o in range(m):
        at = (o + 0.5) * n / m - 0.5
        if method == "area":
            low, high = o * n / m, (o + 1) * n / m
            for i in range(n):
                w[o, i] = max(0.0, min(high, i + 1) - max(low, i)) / (high - low)
        else:
            first = int(np.floor(at))
            for i in range(first - 2, first + 4):
                t = at - i
                weight = max(0.0, 1 - abs(t)) if method == "linear" else keys(t)
                w[o, min(max(i, 0), n - 1)] += weight
    return w


class Pipeline:
    """Stages as words for vkt, and what they do to float64."""

    def __init__(self, library, r, number):
        self.library, self.r, self.number, self.stages, self.mapped = library, r, number, [], False
        self.dtype = str(r.choice(["uint8", "int16", "uint16", "float32", "int32"]))
        shape = tuple(int(n) for n in r.integers(5, 14, 3))
        base = smooth(r.random(shape), 1.0, "clamp") if r.random() < 0.5 else r.random(shape)
        base = (base - base.min()) / max(np.ptp(base), 1e-9)
        if self.dtype == "float32":
            a = (base * 10.0 ** r.integers(-2, 5) + r.choice([0, 0, 100, -3000])).astype(np.float32)
        else:
            low, high = limits(self.dtype)
            if self.dtype == "int32":
                low, high = -1e6, 1e6
            a = np.rint(low + base * (high - low)).astype(self.dtype)
        self.start = a
        self.exact = a.astype(np.float64)
        self.volume = library.create(a)
        if self.dtype == "float32":  # of floats nothing is known before somebody limits them
            low, high = float(np.float32(a.min())), float(np.float32(a.max()))
            self.add(f"arith clamp - {low!r} {high!r}", lambda x: np.clip(x, low, high))
        for _ in range(int(r.integers(1, 7))):
            self.grow()

    def add(self, words, f, dtype=None, others=()):
        self.stages.append(words)
        result = self.library.apply(words, [self.volume, *others])
        for used in (self.volume, *others):
            self.library.c.vkt_free(used)
        self.volume = result
        self.exact = f(self.exact)
        self.dtype = dtype or self.dtype
        if self.dtype in INTEGERS and not self.mapped:
            self.exact = np.clip(self.exact, *limits(self.dtype))

    def widened(self):
        """What derivatives give."""
        return "float64" if self.dtype in ("float64", "int32") else "float32"

    def grow(self):
        r = self.r
        shape = self.exact.shape
        boundary = str(r.choice(list(MODES)))
        kinds = ["crop", "flip", "permute", "gaussian", "gaussian", "box", "median", "morphology", "convert", "arith",
                 "arith", "two", "gradient", "laplacian", "kernel", "sharpen", "up", "down", "pad", "project", "range", "region"]
        kind = str(r.choice(kinds))
        wide = self.exact.size and np.abs(self.exact).max() > 1e9
        if kind == "crop":
            low = [int(r.integers(0, max(1, n // 3))) for n in shape]
            high = [n - int(r.integers(0, max(1, n // 3))) for n in shape]
            if any(b - a < 3 for a, b in zip(low, high)):
                return
            z, y, x = (slice(a, b) for a, b in zip(low, high))
            self.add(f"crop --roi {x.start}:{x.stop},{y.start}:{y.stop},{z.start}:{z.stop}", lambda a: a[z, y, x])
        elif kind == "flip":
            axis = int(r.integers(3))
            self.add(f"flip {'zyx'[axis]}", lambda a: np.flip(a, axis))
        elif kind == "permute":
            self.add("permute zyx", lambda a: a.transpose(2, 1, 0))
        elif kind == "gaussian":
            sigma = float(r.choice([0.6, 1.0, 1.7, 3.0]))
            tolerance = str(r.choice(["", " --tolerance 1%", " --tolerance 0.1%", " --tolerance 1e-5%"]))
            self.add(f"filter gaussian --sigma {sigma} --boundary {boundary}{tolerance}",
                     lambda a: smooth(a, sigma, boundary))
        elif kind == "box":
            n = int(r.integers(1, 3))
            self.add(f"filter box --radius {n} --boundary {boundary}",
                     lambda a: ndimage.uniform_filter(a, 2 * n + 1, mode=MODES[boundary]))
        elif kind == "median":
            self.add(f"filter median --radius 1 --boundary {boundary}",
                     lambda a: ndimage.median_filter(a, 3, mode=MODES[boundary]))
        elif kind == "morphology":
            what, f = [("erode", ndimage.minimum_filter), ("dilate", ndimage.maximum_filter)][int(r.integers(2))]
            self.add(f"morphology {what} --shape box --boundary {boundary}", lambda a: f(a, 3, mode=MODES[boundary]))
        elif kind == "convert":
            dtype = str(r.choice(["uint8", "int16", "uint16", "float32", "float64"]))
            if not self.mapped:
                self.add(f"convert --dtype {dtype}", lambda a: a, dtype)
        elif kind == "range" and not self.mapped:
            low, high = float(np.floor(self.exact.min())), float(np.ceil(self.exact.max()) + 1)
            dtype = str(r.choice(["uint8", "uint16"]))
            self.mapped = True
            self.add(f"convert --dtype {dtype} --range {low!r}:{high!r}", lambda a: np.clip(a, low, high), dtype)
        elif kind == "arith" and not self.mapped:
            what = str(r.choice(["add", "sub", "mul", "div", "min", "max", "absdiff", "abs", "neg", "sqrt", "pow", "log",
                                "clamp"]))
            v = float(r.choice([2, 3, -5, 0.5, 2.75, 40, 1000]))
            floats = {"sqrt": lambda a: np.sqrt(a)}
            if what == "abs":
                self.add("arith abs -", np.abs)
            elif what == "neg":
                self.add("arith neg -", np.negative)
            elif what == "sqrt":
                if self.exact.min() > 1:
                    self.add("arith sqrt -", floats["sqrt"], "float64" if self.dtype in ("float64", "int32") else "float32")
            elif what == "pow":
                power = float(r.choice([2, 3, 0.5, -1]))
                if power > 1 and np.abs(self.exact).max() < 1e6 or self.exact.min() > 1:
                    self.add(f"arith pow - {power!r}", lambda a: np.power(a, power),
                             "float64" if self.dtype in ("float64", "int32") else "float32")
            elif what == "log":
                if self.exact.min() > 1:
                    self.add("arith log -", np.log, "float64" if self.dtype in ("float64", "int32") else "float32")
            elif what == "clamp":
                low, high = sorted((v, float(r.choice([10, 100, 3000]))))
                self.add(f"arith clamp - {low!r} {high!r}", lambda a: np.clip(a, low, high))
            elif not (what == "mul" and wide):
                f = {"add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "min": np.minimum,
                     "max": np.maximum, "absdiff": lambda a, b: np.abs(a - b)}[what]
                # A float that is compared or added is one of the type.
                self.add(f"arith {what} - {v!r}", lambda a: f(a, v))
        elif kind == "region" and not self.mapped:  # the others keep their values, in the type of the result
            what, f = [("add", np.add), ("sub", np.subtract), ("mul", np.multiply), ("min", np.minimum), ("abs", np.abs),
                       ("sqrt", np.sqrt), ("clamp", None)][int(r.integers(7))]
            v = float(r.choice([3, -5, 0.5, 40]))
            words = f"- {v!r}"
            if what == "clamp":
                words, f = f"- 10 {300 + v!r}", lambda a, b: np.clip(a, 10, 300 + b)
            elif what in ("abs", "sqrt"):
                words, f = "-", lambda a, b, one=f: one(a)
            if (what == "mul" and wide) or (what == "sqrt" and not self.exact.min() > 1):
                return
            dtype = str(r.choice(["", "", "float32", "int16"]))
            low = [int(r.integers(0, n // 2 + 1)) for n in shape]
            z, y, x = (slice(a, n) for a, n in zip(low, shape))

            def within(a):
                a = a.copy()
                a[z, y, x] = f(a[z, y, x], v)
                return a
            self.add(f"arith {what} {words} --roi {x.start}:,{y.start}:,{z.start}:" + (f" --dtype {dtype}" if dtype else ""),
                     within, dtype or None)
        elif kind == "two" and not self.mapped:
            what, f = [("add", np.add), ("sub", np.subtract), ("mul", np.multiply)][int(r.integers(3))]
            if what == "mul" and wide:
                return
            other = r.integers(0, 100, shape)
            dtype = self.dtype
            other = other.astype(dtype)
            second = self.library.create(other, like=self.volume)
            if dtype.startswith("float"):
                second = self.library.apply("arith clamp - 0 100", [second])
            self.add(f"arith {what} - -", lambda a: f(a, other.astype(np.float64)), others=(second,))
        elif kind in ("gradient", "laplacian") and all(n > 2 for n in shape):
            if self.resampled():
                return
            self.mapped = False
            dtype = self.widened()
            if kind == "gradient":
                axis = int(r.integers(3))
                self.add(f"filter gradient --component {'zyx'[axis]} --boundary {boundary}",
                         lambda a: ndimage.correlate1d(a, [-0.5, 0, 0.5], axis, mode=MODES[boundary]), dtype)
            else:
                self.add(f"filter laplacian --boundary {boundary}", lambda a: ndimage.laplace(a, mode=MODES[boundary]), dtype)
        elif kind == "kernel":
            weights = np.round(r.normal(size=(3, 3, 3)), 3)
            name = f"kernel{len(self.stages)}.txt"
            with open(name, "w") as f:
                f.write("3 3 3 " + " ".join(repr(float(w)) for w in weights.ravel()))
            self.mapped = False
            self.add(f"filter kernel {name} --boundary {boundary}",
                     lambda a: ndimage.correlate(a, weights, mode=MODES[boundary]), self.widened())
        elif kind == "sharpen" and not self.mapped:
            sigma, amount = 1.0, float(r.choice([0.5, 1.0]))

            def sharpen(a):
                s = a
                for axis in range(3):
                    s = along(s, axis, correlation(s.shape[axis], gaussian_taps(sigma, 5), boundary))
                return a + amount * (a - s)
            self.add(f"filter sharpen --sigma {sigma} --amount {amount} --boundary {boundary}", sharpen)
        elif kind in ("up", "down") and not self.mapped:
            method = str(r.choice(["linear", "cubic"])) if kind == "up" else "area"
            if method == "cubic" and self.dtype in ("uint8", "uint16"):
                dtype = "float32"
            else:
                dtype = self.dtype
            to = [int(n * 1.6) if kind == "up" else max(1, int(n * 0.6)) for n in shape]
            if max(to) > 40 or min(to) < 3:
                return

            def resample(a):
                for axis in range(3):
                    a = along(a, axis, resampling(a.shape[axis], to[axis], method))
                return a
            self.add(f"resample --dims {to[2]} {to[1]} {to[0]} --method {method}", resample, dtype)
        elif kind == "pad":
            n = int(r.integers(1, 3))
            self.add(f"pad --by {n} --boundary {boundary}", lambda a: np.pad(
                a, n, mode={"mirror": "symmetric", "clamp": "edge", "wrap": "wrap"}[boundary]))
        elif kind == "project" and len(self.stages) > 3 and not self.mapped:
            what = str(r.choice(["max", "min", "mean"]))
            f = {"max": np.max, "min": np.min, "mean": np.mean}[what]
            self.add(f"project {what} --axis z", lambda a: f(a, axis=0, keepdims=True),
                     self.widened() if what == "mean" else None)

    def resampled(self):
        return any(s.startswith(("resample", "permute")) for s in self.stages)

    def outcome(self):
        """The stated error, the true one, and what float64 cannot tell apart."""
        array, header = self.library.voxels(self.volume)
        self.library.c.vkt_free(self.volume)
        got = array.astype(np.float64) * header["slope"] + header["intercept"]
        if got.shape != self.exact.shape:
            raise SystemExit(f"{self}: {got.shape} is not {self.exact.shape}")
        largest = np.abs(self.exact).max() + np.abs(self.start.astype(np.float64)).max()
        noise = 1e-13 * largest * (1 + len(self.stages))
        true = float(np.abs(got - self.exact).max())
        error = header.get("error", {"kind": "silent"})
        if "values" in error:
            low, high = error["values"]
            if got.min() < low - noise or got.max() > high + noise:
                raise SystemExit(f"{self}: values {got.min()} to {got.max()} leave {error}")
        return error, true, noise

    def __str__(self):
        return f"pipeline {self.number}, of {self.start.dtype.name} {self.start.shape}: {' | '.join(self.stages)}"


def main():
    library, count = Library(sys.argv[1]), int(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    with tempfile.TemporaryDirectory() as scratch: # of the kernels that pipelines read
        os.chdir(scratch)
        check(library, count, seed)


def check(library, count, seed):
    ratios, kinds, because, exceeded = [], {}, {}, []
    for number in range(count):
        pipeline = Pipeline(library, np.random.default_rng([seed, number]), number)
        if not pipeline.stages:
            continue
        error, true, noise = pipeline.outcome()
        kinds[error["kind"]] = kinds.get(error["kind"], 0) + 1
        if error["kind"] == "silent":
            raise SystemExit(f"{pipeline} says nothing")
        if error["kind"] == "unknown":
            because[error["because"]] = because.get(error["because"], 0) + 1
            continue
        stated = error.get("at_most", 0)
        if true > stated + noise:
            exceeded.append(f"{pipeline}: stated {stated}, true {true}")
        elif true > noise:
            ratios.append(stated / true)
        else:
            ratios.append(1.0 if stated <= noise else np.inf)
    ratios = np.array(ratios)
    known = len(ratios) + len(exceeded)
    print(f"{sum(kinds.values())} pipelines: " + ", ".join(f"{n} {k}" for k, n in sorted(kinds.items())))
    for reason, n in because.items():
        print(f"  unknown {n} times: {reason}")
    near = int((ratios <= 10).sum())
    print(f"within 10x of the true error: {near} of {known}; median ratio {np.median(ratios):.3g}")
    for line in exceeded:
        print(line)
    if exceeded:
        raise SystemExit(f"{len(exceeded)} errors are larger than stated")
    if 2 * near < known:
        raise SystemExit("fewer than half of the stated errors are within 10x of the true ones")
    if 4 * known < 3 * sum(kinds.values()):
        raise SystemExit("too many errors are unknown")


main()
