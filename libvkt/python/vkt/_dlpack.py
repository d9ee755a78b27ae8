"""Arrays as DLPack, versions 0 and 1 (https://dmlc.github.io/dlpack/latest/c_api.html), also where they are read-only,
which NumPy refuses or cannot say."""
# SPDX-License-Identifier: MIT
import ctypes

HOST = 1, 0  # kDLCPU, device 0
_READ_ONLY, _COPIED = 1, 2
_CODES = {"i": 0, "u": 1, "f": 2}


class _Tensor(ctypes.Structure):
    _fields_ = [
        ("data", ctypes.c_void_p),
        ("device_type", ctypes.c_int32),
        ("device_id", ctypes.c_int32),
        ("ndim", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    ]


class _Managed(ctypes.Structure):
    _fields_ = [("tensor", _Tensor), ("context", ctypes.c_void_p), ("deleter", ctypes.c_void_p)]


class _ManagedVersioned(ctypes.Structure):
    _fields_ = [("major", ctypes.c_uint32), ("minor", ctypes.c_uint32), ("context", ctypes.c_void_p),
                ("deleter", ctypes.c_void_p), ("flags", ctypes.c_uint64), ("tensor", _Tensor)]


_handed_out = {}  # by address of the managed tensor, what must stay as long as it


@ctypes.CFUNCTYPE(None, ctypes.c_void_p)
def _delete(managed, _handed_out=_handed_out):
    _handed_out.pop(managed, None)


_python = ctypes.PyDLL(None)
_new = _python.PyCapsule_New
_new.restype, _new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
_is_valid = _python.PyCapsule_IsValid
_is_valid.restype, _is_valid.argtypes = ctypes.c_int, [ctypes.c_void_p, ctypes.c_char_p]
_pointer = _python.PyCapsule_GetPointer
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_char_p]


@ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
def _dropped(capsule):
    """Of a capsule that nobody took; who takes it gives it another name."""
    for name in b"dltensor", b"dltensor_versioned":
        if _is_valid(capsule, name):
            _delete(_pointer(capsule, name))


def capsule(array, stream, max_version, device, copy):
    """The capsule that __dlpack__ returns. Consumers of version 0 cannot be told that voxels are read-only: who writes
    through them changes a volume that others may share."""
    if stream is not None:
        raise BufferError("host memory has no stream")
    if device is not None and tuple(int(n) for n in device) != HOST:
        raise BufferError("the voxels are in host memory: device (1, 0)")
    if copy:
        array = array.copy()
    versioned = max_version is not None and max_version[0] >= 1
    managed = _ManagedVersioned() if versioned else _Managed()
    shape = (ctypes.c_int64 * array.ndim)(*array.shape)
    strides = (ctypes.c_int64 * array.ndim)(*(n // array.itemsize for n in array.strides))
    tensor = managed.tensor
    tensor.data, tensor.device_type, tensor.device_id = array.ctypes.data, *HOST
    tensor.ndim, tensor.code, tensor.bits, tensor.lanes = array.ndim, _CODES[array.dtype.kind], 8 * array.itemsize, 1
    tensor.shape, tensor.strides = shape, strides
    managed.deleter = ctypes.cast(_delete, ctypes.c_void_p)
    if versioned:
        managed.major, managed.minor = 1, 0
        managed.flags = _COPIED if copy else 0 if array.flags.writeable else _READ_ONLY
    address = ctypes.addressof(managed)
    _handed_out[address] = managed, array, shape, strides
    return _new(address, b"dltensor_versioned" if versioned else b"dltensor", ctypes.cast(_dropped, ctypes.c_void_p))
