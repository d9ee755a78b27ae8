"""Volumes from and to xarray, which is imported when it is asked for."""
# SPDX-License-Identifier: MIT
import json
from typing import Any

import numpy as np

from ._library import Error
from ._volume import Volume


def to_xarray(volume: Volume, stored: bool = False) -> Any:
    """An xarray.DataArray of the physical values, those that the units are of, with the dimensions z, y and x. Its
    coordinates are positions in the world where the axes of the volume are those of the world, up to their signs; else
    distances from the first voxel along each axis. attrs holds what from_xarray() makes the same volume of: origin,
    spacing, direction, units, space, and the history as JSON.

    Without a value map the values are those of the volume, in place. With one they are float64, or float32 where the
    type of the voxels and the map leave nothing to round; and encoding says how they were stored, as xarray has it of a
    file (dtype, scale_factor, add_offset, by the conventions of CF), so that to_netcdf() packs them again. stored=True
    gives the stored values in place, packed as CF has it: scale_factor and add_offset are in attrs, xarray.decode_cf()
    applies them, and from_xarray() makes a value map of them."""
    import xarray

    header = volume.header
    upright = _signs(volume.direction)
    steps = np.array(volume.spacing) * (upright if upright is not None else 1)
    first = np.array(volume.origin) if upright is not None else np.zeros(3)
    coordinates = {"xyz"[axis]: first[axis] + steps[axis] * np.arange(volume.dims[axis]) for axis in range(3)}
    attributes = {"origin": list(volume.origin), "spacing": list(volume.spacing),
                  "direction": volume.direction.ravel().tolist()}
    if volume.units:
        attributes["units"] = volume.units
    mapped = (volume.slope, volume.intercept) != (1, 0)
    packing = {"scale_factor": volume.slope, "add_offset": volume.intercept} if mapped else {}
    if stored:
        attributes |= packing
    if volume.space:
        attributes["space"] = volume.space
    if "history" in header:
        attributes["vkt_history"] = json.dumps(header["history"])
    values = volume.array if stored or not mapped else _physical(volume)
    array = xarray.DataArray(values, coordinates, ("z", "y", "x"), attrs=attributes)
    if mapped and not stored:
        array.encoding |= {"dtype": volume.dtype, **packing}
    return array


def from_xarray(array: Any) -> Volume:
    """A volume of an xarray.DataArray of up to three dimensions, called x, y and z, in any order, or else in the order of
    the last three: slices, rows, columns. Coordinates must be numbers at equal distances, or be absent: they give spacing
    and origin, and a direction where they fall. attrs may say direction, origin (beside a direction that is not that of
    the world's axes), units and space, as to_xarray() does, and scale_factor and add_offset of values that are stored.
    encoding, which says how a file held the values, decides nothing: a volume of physical values has them as they are."""
    names = list(array.dims)
    if not 1 <= len(names) <= 3:
        raise Error(f"an array of the dimensions {', '.join(map(str, names)) or 'none'} is no volume", 2,
                    "select up to three: array.isel(time=0)")
    known = [name for name in names if str(name).lower() in ("x", "y", "z")]
    axes = {name: str(name).lower() for name in known} if len(known) == len(names) else dict(
        zip(reversed(names), "xyz"))
    by_axis = {axis: name for name, axis in axes.items()}
    ordered = array.transpose(*(by_axis[axis] for axis in "zyx" if axis in by_axis))
    values = ordered.values.reshape([ordered.sizes[by_axis[axis]] if axis in by_axis else 1 for axis in "zyx"])
    attributes = array.attrs
    stated = np.array(attributes.get("direction", np.eye(3)), float).reshape(3, 3)
    spacing = np.array(attributes.get("spacing", np.ones(3)), float)
    origin = np.array(attributes.get("origin", np.zeros(3)), float)
    upright = _signs(stated)
    signs = np.ones(3) if upright is None else upright
    along = np.zeros(3)  # of an oblique volume, distances along its axes
    direction = stated.copy()
    for i, axis in enumerate("xyz"):
        coordinate = array.coords.get(by_axis.get(axis, axis))  # that of a slice is a single number
        if coordinate is None or coordinate.ndim > 1:
            continue
        step, first = _regular(coordinate, signs[i] * spacing[i])
        direction[:, i] *= np.sign(step) * signs[i]
        spacing[i] = abs(step)
        if upright is None:
            along[i] = first
        else:
            origin[i] = first
    volume = Volume(values, spacing=spacing, origin=origin + stated @ along, direction=direction,
                    units=attributes.get("units"), slope=attributes.get("scale_factor"),
                    intercept=attributes.get("add_offset"))
    if attributes.get("space"):
        volume = volume.apply("set", attribute=f"space={attributes['space']}")
    return volume


def _physical(volume):
    """Physical values, rounded once. Whole numbers below 2^24 are float32, which holds all of them."""
    slope, intercept = volume.slope, volume.intercept
    exact = False
    if volume.dtype.kind in "iu" and float(slope).is_integer() and float(intercept).is_integer():
        ends = np.iinfo(volume.dtype)
        exact = abs(slope) * max(abs(ends.min), ends.max) + abs(intercept) <= 2 ** 24
    values = np.multiply(volume.array, slope, dtype=np.float32 if exact else np.float64)
    values += intercept
    return values


def _signs(direction):
    """1 or -1 for each axis whose direction is that of the world's axis or its opposite; None if one is not."""
    signs = np.diag(direction)
    return signs if np.array_equal(np.abs(direction), np.eye(3)) else None


def _regular(coordinate, stated):
    """The step between numbers at equal distances, and the first. The step is the stated one where it is that up to
    rounding, and where there is one number."""
    values = np.atleast_1d(coordinate.values)
    if values.dtype.kind not in "iuf":
        raise Error(f"the coordinate '{coordinate.name}' is {values.dtype}, and no number", 2)
    values = values.astype(float)
    if values.size == 1:
        return stated, values[0]
    step = (values[-1] - values[0]) / (values.size - 1)
    if not np.isfinite(values).all() or step == 0 or (
            np.abs(values - (values[0] + step * np.arange(values.size))).max() > 1e-3 * abs(step)):
        raise Error(f"the coordinate '{coordinate.name}' is not at equal distances", 2,
                    "interpolate to a regular grid first: array.interp()")
    rounding = 1e-9 * abs(stated) + 4e-16 * np.abs(values).max()
    return (stated if abs(step - stated) <= rounding else step), values[0]
