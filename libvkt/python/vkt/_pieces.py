"""Pieces of volumes, slices and bricks, and what they make together."""
# SPDX-License-Identifier: MIT
import ctypes
from typing import Any, Iterable

from ._library import check, library, option_words, words_of
from ._series import read_all
from ._volume import Volume


def stack(volumes: "Iterable[Volume]", *, force_uniform: bool = False) -> Volume:
    """Volumes on one another along z: slices to a volume, stack([slice, slice]), or parts of one. They must have one type
    and one extent along x and y. Those that say where they lie must lie behind one another, evenly spaced, and give the
    spacing; force_uniform=True takes them in this order all the same. A series, which keeps volumes apart, is a list:
    write_series()."""
    handles, count, _kept = _handles(volumes, "stack")
    return _made(library.vkt_stack, handles, count, *words_of(option_words({"force_uniform": force_uniform})))


def split(volume: Volume) -> "list[Volume]":
    """The slices of a volume along z, each a volume with its place in the world. stack() puts them together again."""
    return list(read_all(library.vkt_split, _handle(volume, "split")))


def brick(volume: Volume, **options: Any) -> "list[Volume]":
    """The bricks of a volume, x fastest, which say in attributes where they belong. Options are those of `vkt brick`:
    size=64 or (64, 64, 32), ghost=2 for voxels of the neighbours on every side, boundary="mirror" for ghosts outside of
    the volume, too. merge() puts bricks together again, or what was made of them."""
    return list(read_all(library.vkt_brick, _handle(volume, "brick"), *words_of(option_words(options))))


def merge(bricks: "Iterable[Volume]") -> Volume:
    """Bricks put together again, in any order: bit for bit the volume that brick() cut, or what was made of its bricks.
    Ghosts are dropped; bricks that are missing, overlap or belong elsewhere are refused."""
    handles, count, _kept = _handles(bricks, "merge")
    return _made(library.vkt_merge, handles, count)


def _handle(volume, name):
    if not isinstance(volume, Volume):
        raise TypeError(f"{name}() takes a vkt.Volume, and this is {type(volume).__name__}: vkt.Volume(array)")
    return volume._handle


def _handles(volumes, name):
    """For C, how many, and the volumes themselves, which must live as long."""
    if isinstance(volumes, Volume) or not hasattr(volumes, "__iter__"):
        raise TypeError(f"{name}() takes several volumes, and this is {type(volumes).__name__}: [volume, volume]")
    kept = list(volumes)
    return (ctypes.c_void_p * len(kept))(*(_handle(volume, name) for volume in kept)), len(kept), kept


def _made(function, *arguments):
    handle = ctypes.c_void_p()
    check(function(*arguments, ctypes.byref(handle)))
    return Volume._of(handle)
