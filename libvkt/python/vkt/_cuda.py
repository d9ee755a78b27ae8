"""Arrays in memory of GPUs, by __cuda_array_interface__ (https://numba.readthedocs.io, version 3)."""
# SPDX-License-Identifier: MIT
import numpy as np


class DeviceArray:
    """What of an array of NumPy volumes are made of, for one whose elements the host cannot see."""

    def __init__(self, owner, pointer, shape, dtype, strides=None):
        self.owner = owner  # keeps the memory alive
        self.pointer = pointer
        self.shape = tuple(shape)
        self.dtype = np.dtype(np.uint8) if dtype == bool else np.dtype(dtype)
        self.ndim = len(self.shape)
        self.size = int(np.prod(self.shape, dtype=np.int64))
        self.nbytes = self.size * self.dtype.itemsize
        dense = [self.dtype.itemsize * int(np.prod(self.shape[k + 1:], dtype=np.int64)) for k in range(self.ndim)]
        self.strides = tuple(dense)
        self.contiguous = strides is None or all(
            n == 1 or given == wanted for n, given, wanted in zip(self.shape, strides, dense))


def array_of(array):
    """The array if it is one of a GPU, else None."""
    if isinstance(array, DeviceArray):
        return array
    interface = getattr(array, "__cuda_array_interface__", None)
    if interface is None:
        return None
    return DeviceArray(array, interface["data"][0], interface["shape"], interface["typestr"], interface.get("strides"))
