"""Volumes and arrays of GPUs, against packages that nobody here wrote: CuPy, PyTorch, Numba; those that are missing are
named. PYTHONPATH=build-cuda/python python3 tests/gpu/arrays.py; exits with 1 if anything failed."""
# SPDX-License-Identifier: MIT
import faulthandler
import functools
import gc
import importlib
import sys
import time

import numpy as np
import vkt

faulthandler.enable()
print = functools.partial(print, flush=True)
TYPES = "uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64".split()
passed = failed = 0


def check(good, what):
    global passed, failed
    passed, failed = passed + bool(good), failed + (not good)
    if not good:
        print("FAILED:", what)


def module(name):
    try:
        return importlib.import_module(name)
    except ImportError as e:
        print(f"{name} is not there ({e}): not compared with")
        return None


def refused(call, kind, what):
    try:
        call()
    except kind:
        check(True, what)
    else:
        check(False, what)


cupy, torch, cuda = module("cupy"), module("torch"), module("numba.cuda")
random = np.random.default_rng(1)

for dtype in TYPES:
    a = random.integers(0, 100, (5, 6, 7)).astype(dtype)
    v = vkt.Volume(a, spacing=(1, 2, 3))
    check(v.devices == ("cpu",) and not hasattr(v, "__cuda_array_interface__"), f"{dtype}: begins on the host")
    check(v.migrate("gpu") is v and v.devices == ("cpu", "gpu:0"), f"{dtype}: migrate")
    if cupy:
        c = cupy.asarray(v)
        check(c.data.ptr == v.__cuda_array_interface__["data"][0] and (c.get() == a).all(), f"{dtype}: CuPy sees it")
        w = vkt.Volume(c, like=v, copy=False)
        check(w.devices == ("gpu:0",) and w.__cuda_array_interface__["data"][0] == c.data.ptr, f"{dtype}: in place")
        check(w.spacing == (1, 2, 3) and (np.asarray(w) == a).all(), f"{dtype}: back on the host")
        u = vkt.Volume(c)
        check(u.__cuda_array_interface__["data"][0] != c.data.ptr and (u.array == a).all(), f"{dtype}: a copy")
        check((cupy.from_dlpack(vkt.Volume(c)).get() == a).all(), f"{dtype}: DLPack to CuPy")
        d = vkt.from_dlpack(c + c.dtype.type(1))
        gc.collect()
        check(d.devices == ("gpu:0",) and (d.array == a + a.dtype.type(1)).all(), f"{dtype}: DLPack from CuPy")
    if cuda:
        check((cuda.as_cuda_array(v).copy_to_host() == a).all(), f"{dtype}: Numba")
    if torch and hasattr(torch, dtype):
        t = torch.from_dlpack(vkt.Volume(torch.tensor(a).cuda(), copy=True))
        check(t.is_cuda and (t.cpu().numpy() == a).all(), f"{dtype}: PyTorch and back by DLPack")
        check((vkt.from_dlpack(torch.tensor(a).cuda()).array == a).all(), f"{dtype}: DLPack from PyTorch")

if cupy:
    c = cupy.arange(4 * 5 * 6, dtype=cupy.float32).reshape(4, 5, 6)
    refused(lambda: vkt.Volume(c[:, :, ::2]), vkt.Error, "an array with gaps is refused")
    refused(lambda: vkt.Volume(c.ravel()[1:].reshape(-1), copy=False), vkt.Error, "an unaligned one is not used in place")
    check((vkt.Volume(c.ravel()[1:]).array.ravel() == c.ravel()[1:].get()).all(), "an unaligned one is copied")
    refused(lambda: cupy.from_dlpack(vkt.Volume(c)) and vkt.Volume(c).__dlpack__(dl_device=(2, 99)), BufferError,
            "another GPU's memory is refused")
    check((np.from_dlpack(vkt.Volume(np.ones((2, 2, 2)))) == 1).all(), "DLPack of the host")
    pool = cupy.get_default_memory_pool()
    before = pool.used_bytes()
    big = cupy.ones((64, 512, 512), cupy.float32)
    v = vkt.Volume(big, copy=False)
    del big
    gc.collect()
    check(pool.used_bytes() >= before + 64 * 512 * 512 * 4, "a volume keeps the array alive")
    del v
    gc.collect()
    check(pool.used_bytes() == before, "and lets it go")

    # Results stay there, agree with the host's, and a stream of the other package is waited for.
    a = random.random((96, 128, 160), dtype=np.float32)
    stream = cupy.cuda.Stream(non_blocking=True)
    for name, options in ("flip", dict(axes="x")), ("filter gaussian", dict(sigma=2)), ("filter median", dict(radius=1)):
        words = "flip x" if name == "flip" else name
        options = {} if name == "flip" else options
        expected = vkt.Volume(a).apply(words, **options)
        with stream:
            c = cupy.asarray(a)
            for _ in range(50):
                c = c + 1
            for _ in range(50):
                c = c - 1
            with vkt.policy(device="gpu"):
                v = vkt.Volume(c, copy=False).apply(words, **options)
                check(v.devices == ("gpu:0",), f"{name}: the result stays on the GPU, not {v.devices}")
                twice = v.apply("flip y")
                check(twice.devices == ("gpu:0",), f"{name}: and the next one")
        check(np.abs(v.array - expected.array).max() < 2e-5, f"{name}: as on the host")
        check((twice.array == v.array[:, ::-1]).all(), f"{name}: the next one's voxels")

    a = cupy.random.random((512, 512, 512), dtype=cupy.float32)
    with vkt.policy(device="gpu"):
        v = vkt.Volume(a, copy=False)
        v.apply("flip x")
        cupy.cuda.Device().synchronize()
        begin = time.perf_counter()
        for _ in range(10):
            r = cupy.asarray(v.apply("flip x"))
        cupy.cuda.Device().synchronize()
        print(f"flip x of 512^3 float32 from CuPy to CuPy: {(time.perf_counter() - begin) * 100:.2f} ms")
        begin = time.perf_counter()
        for _ in range(10):
            s = cupy.flip(a, 2).copy()
        cupy.cuda.Device().synchronize()
        print(f"CuPy's flip and copy: {(time.perf_counter() - begin) * 100:.2f} ms")
        check((r == s).all(), "flip as CuPy's")

print(f"arrays: {passed} passed, {failed} failed")
sys.exit(failed > 0)
