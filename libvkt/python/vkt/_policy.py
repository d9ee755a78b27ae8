"""How the calls of a thread run."""
# SPDX-License-Identifier: MIT
import ctypes
import threading
from typing import Any

from ._library import Error, Policy, check, library


class _Asked(threading.local):
    wishes = None, 0, 0  # nothing: what the environment says


_asked = _Asked()


def _set(wishes):
    check(library.vkt_set_policy(ctypes.byref(Policy(*wishes))))
    _asked.wishes = wishes


def _get():
    current = Policy()
    check(library.vkt_get_policy(ctypes.byref(current)))
    return current.device, current.threads, current.memory


class policy:
    """How calls of this thread run that say nothing else: device "auto", "cpu", "gpu", "gpu:N" or "gpu:all", so many
    threads, so many bytes of memory. What is None stays as it is. It holds from now on, or, in a with statement, until
    its end:

        with vkt.policy(device="gpu"):
            small = vkt.resample(vkt.filter.gaussian(volume, sigma=2), scale=0.5)  # nothing comes back in between

    Other threads are not affected. What a GPU that was asked for cannot do is refused, not done elsewhere."""

    def __init__(self, device: "str | None" = None, threads: "int | None" = None, memory: "int | None" = None):
        self._before = _asked.wishes
        for name, value, most in ("threads", threads, 4096), ("memory", memory, 2**63 - 1):
            if value is not None and not 0 <= value <= most:
                raise Error(f"{name}={value} is not between 0 (the default) and {most}", 2)
        wishes = None if device is None else device.encode(), threads, memory
        _set(tuple(old if new is None else new for old, new in zip(self._before, wishes)))

    def __enter__(self) -> "policy":
        return self

    def __exit__(self, *raised: Any) -> None:
        _set(self._before)

    @property
    def device(self) -> str:
        """The device that calls of this thread use now."""
        return _get()[0].decode()

    @property
    def threads(self) -> int:
        return _get()[1]

    @property
    def memory(self) -> int:
        return _get()[2]
