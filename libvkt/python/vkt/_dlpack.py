"""Arrays as DLPack, versions 0 and 1 (https://dmlc.github.io/dlpack/latest/c_api.html), also where they are read-only,
which NumPy refuses or cannot say."""
# SPDX-License-Identifier: MIT
import ctypes

from ._cuda import DeviceArray

HOST = 1, 0  # kDLCPU, device 0
GPU = 2  # kDLCUDA
_READ_ONLY, _COPIED = 1, 2
_CODES = {"i": 0, "u": 1, "f": 2}
_KINDS = {code: kind for kind, code in _CODES.items()} | {6: "b"}


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
_rename = _python.PyCapsule_SetName
_rename.restype, _rename.argtypes = ctypes.c_int, [ctypes.py_object, ctypes.c_char_p]
_USED = {b"dltensor": b"used_dltensor", b"dltensor_versioned": b"used_dltensor_versioned"}  # whose bytes must stay
_Deleter = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)


@ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
def _dropped(capsule):
    """Of a capsule that nobody took; who takes it gives it another name."""
    for name in b"dltensor", b"dltensor_versioned":
        if _is_valid(capsule, name):
            _delete(_pointer(capsule, name))


def capsule(array, stream, max_version, device, copy):
    """The capsule that __dlpack__ returns. Consumers of version 0 cannot be told that voxels are read-only: who writes
    through them changes a volume that others may share."""
    on_gpu = isinstance(array, DeviceArray)
    if stream is not None:
        raise BufferError("host memory has no stream")
    if not on_gpu and device != HOST:
        raise BufferError("the voxels are in host memory: device (1, 0)")
    if copy:
        array = array.copy()
    versioned = max_version is not None and max_version[0] >= 1
    managed = _ManagedVersioned() if versioned else _Managed()
    shape = (ctypes.c_int64 * array.ndim)(*array.shape)
    size = array.dtype.itemsize
    strides = (ctypes.c_int64 * array.ndim)(*(n // size for n in array.strides))
    tensor = managed.tensor
    tensor.data = array.pointer if on_gpu else array.ctypes.data
    tensor.device_type, tensor.device_id = device
    tensor.ndim, tensor.code, tensor.bits, tensor.lanes = array.ndim, _CODES[array.dtype.kind], 8 * size, 1
    tensor.shape, tensor.strides = shape, strides
    managed.deleter = ctypes.cast(_delete, ctypes.c_void_p)
    if versioned:
        managed.major, managed.minor = 1, 0
        managed.flags = _COPIED if copy else 0 if not on_gpu and array.flags.writeable else _READ_ONLY
    address = ctypes.addressof(managed)
    _handed_out[address] = managed, array, shape, strides
    return _new(address, b"dltensor_versioned" if versioned else b"dltensor", ctypes.cast(_dropped, ctypes.c_void_p))


class _Taken:
    """A tensor that another package handed out, until nobody uses it any more."""

    def __init__(self, address, deleter):
        self._address, self._deleter = address, deleter

    def __del__(self):
        if self._deleter:
            _Deleter(self._deleter)(self._address)


def taken(array):
    """The array of a GPU behind another package's __dlpack__, in place."""
    try:
        capsule = array.__dlpack__(stream=1, max_version=(1, 0))  # 1: the stream that vkt works in
    except TypeError:  # from before version 1
        capsule = array.__dlpack__(stream=1)
    versioned = bool(_is_valid(id(capsule), b"dltensor_versioned"))
    name = b"dltensor_versioned" if versioned else b"dltensor"
    address = _pointer(id(capsule), name)
    managed = (_ManagedVersioned if versioned else _Managed).from_address(address)
    owner = _Taken(address, managed.deleter)
    _rename(capsule, _USED[name])
    tensor = managed.tensor
    if tensor.lanes != 1 or tensor.code not in _KINDS or tensor.bits % 8 != 0:
        raise BufferError("the elements are no numbers that voxels can be")
    size = tensor.bits // 8
    shape = [tensor.shape[k] for k in range(tensor.ndim)]
    strides = [tensor.strides[k] * size for k in range(tensor.ndim)] if tensor.strides else None
    return DeviceArray(owner, tensor.data + tensor.byte_offset, shape, f"{_KINDS[tensor.code]}{size}", strides)
