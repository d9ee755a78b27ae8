"""napari reads and writes volumes through vkt: voxels in place, where they lie in the world, names of segments, series."""
# SPDX-License-Identifier: MIT
import os

import numpy as np
import vkt


def get_reader(path):
    """napari's question whether this file or folder can be read: who reads it, or None."""
    if isinstance(path, list):
        if len(path) != 1:  # to be stacked, which napari does itself
            return None
        path = path[0]
    return (lambda path: read(path[0] if isinstance(path, list) else path)) if _is_volume(path) else None


def _is_volume(path):
    """Any file may be one; a folder is one of Zarr, of slices, DICOM's by their contents, or an AMReX plotfile."""
    if not os.path.isdir(path):
        return os.path.isfile(path)
    for entry in sorted(os.scandir(path), key=lambda entry: entry.name):
        if entry.name in (".zarray", ".zgroup", "zarr.json", "Header"):
            return True
        if entry.is_file():
            with open(entry.path, "rb") as file:
                if entry.name.lower().endswith((".tif", ".tiff", ".dcm")) or file.read(132)[128:] == b"DICM":
                    return True
    return False


def read(path):
    """The layers of a file or folder: voxels [z, y, x], a transformation to the world, and what else is known about them.
    A series has a layer for each of its channels, [t, z, y, x] where there are several times; volumes that differ in
    extent or place have one each. An image with a value map becomes physical values, those that its units are of: napari
    has no map of its own, and shows the values of a layer under the pointer and at the ends of its contrast. They are
    float32, as it draws them."""
    name = os.path.basename(os.path.normpath(path))
    channels = {}
    for volume in vkt.read_series(path):
        if volume.hierarchical:  # an adaptive mesh becomes a grid of about so many voxels
            volume = vkt.resample(volume, cells="50M")
        channels.setdefault(volume.header.get("attributes", {}).get("channel"), []).append(volume)
    layers = []
    for channel, volumes in channels.items():
        called = name if channel is None or len(channels) == 1 else f"{name} {channel}"
        if all(_alike(volumes[0], other) for other in volumes):
            layers.append(_layer(volumes, called, path))
        else:
            layers += [_layer([volume], f"{called} {i}", path) for i, volume in enumerate(volumes)]
    return layers


def _alike(a, b):
    """Whether two volumes are one at two times."""
    return a.dims == b.dims and a.dtype == b.dtype and np.allclose(_affine(a), _affine(b))


def _layer(volumes, name, path):
    """The layer of one volume, or of the times of one."""
    first = volumes[0]
    labels = _labels(first, path)
    data = [volume.array for volume in volumes]
    if labels is None and any(volume.slope != 1 or volume.intercept != 0 for volume in volumes):
        data = [(volume.slope * volume.array.astype(float) + volume.intercept).astype(np.float32) for volume in volumes]
    affine, units = _affine(first), _units(first.header, "space units", 3)[::-1]
    if len(volumes) > 1:
        begin, step, unit = _times([volume.header for volume in volumes])
        of_space, affine = affine, np.eye(5)
        affine[1:, 1:] = of_space
        affine[0, 0], affine[0, 4] = step, begin
        units = [unit, *units]
    properties = {"name": name, "affine": affine, "metadata": {"vkt": first.header}}
    if any(unit != "pixel" for unit in units):
        properties["units"] = tuple(units)
    if labels is not None:
        properties["features"] = {"index": list(labels), "name": list(labels.values())}
    return data[0] if len(data) == 1 else np.stack(data), properties, "image" if labels is None else "labels"


def _units(header, attribute, count):
    """Units of axes as napari names them; "pixel" where the header says none that it has."""
    said = header.get("attributes", {}).get(attribute, "").replace('"', "").split()
    known = {"m", "cm", "mm", "um", "\N{MICRO SIGN}m", "micron", "nm", "angstrom", "s", "ms", "us", "ns", "min", "h", "Hz"}
    return [unit if unit in known else "pixel" for unit in said] if len(said) == count else ["pixel"] * count


def _times(headers):
    """When the first volume was, their distance and its unit; 0, 1 and no unit where they are not evenly apart."""
    attributes = [header.get("attributes", {}) for header in headers]
    if not all("sequence position" in one for one in attributes):
        return 0.0, 1.0, "pixel"
    at = np.array([float(one["sequence position"]) for one in attributes])
    step = (at[-1] - at[0]) / (len(at) - 1)
    if step <= 0 or not np.allclose(at, at[0] + step * np.arange(len(at)), rtol=0, atol=1e-3 * step):
        return 0.0, 1.0, "pixel"
    return float(at[0]), float(step), _units(headers[0], "sequence units", 1)[0]


def write_layer(path, data, properties):
    """Writes one layer; the name tells the format. napari has asked before it replaces a file. The first of four axes is
    time."""
    known = properties.get("metadata", {}).get("vkt", {})
    matrix, offset = _transformation(data, properties)
    n = len(offset)
    if n > 4 or (n == 4 and (np.any(matrix[0, 1:]) or np.any(matrix[1:, 0]))):
        raise vkt.Error("a layer of more than time and space is no series", 2, "write each volume by itself")
    spacing, origin, direction = _geometry(matrix[n - 3:, n - 3:], offset[n - 3:]) if n >= 3 else _geometry(matrix, offset)
    attributes = known.get("attributes", {})
    kept = [f"{key}={value}" for key, value in attributes.items()
            if key in ("space", "space units", "channel") or key.startswith("Segment")]

    def volume_of(voxels, more):
        volume = vkt.Volume(np.asarray(voxels), spacing=spacing, origin=origin, direction=direction,
                            units=known.get("units", ""))
        return vkt.set(volume, attribute=kept + more) if kept + more else volume

    if n < 4:
        volume_of(data, []).write(path, force=True)
        return [path]
    unit = attributes.get("sequence units")
    times = [["sequence kind=time", f"sequence position={offset[0] + matrix[0, 0] * i!r}",
              f"sequence step={matrix[0, 0]!r}", *([f"sequence units={unit}"] if unit else [])] for i in range(len(data))]
    vkt.write_series((volume_of(voxels, time) for voxels, time in zip(data, times)), path, force=True)
    return [path]


def _labels(volume, path):
    """Names by label of a segmentation; None of what is no such thing."""
    attributes = volume.header.get("attributes", {})
    numbers = [key[7:-11] for key in attributes if key.startswith("Segment") and key.endswith("_LabelValue")]
    if not numbers and not path.endswith(".seg.nrrd"):
        return None
    return {int(attributes[f"Segment{n}_LabelValue"]): attributes.get(f"Segment{n}_Name", n) for n in numbers}


def _affine(volume):
    """From indices [z, y, x] to the world, in the order z, y, x that napari has."""
    affine = np.eye(4)
    affine[:3, :3] = (volume.direction * volume.spacing)[::-1, ::-1]
    affine[:3, 3] = volume.origin[::-1]
    return affine


def _transformation(data, properties):
    """From indices of a layer to the world, a matrix and an offset: affine after rotation after scale."""
    n = np.ndim(data)
    matrix = np.asarray(properties.get("rotate", np.eye(n)), float) @ np.diag(properties.get("scale", np.ones(n)))
    if np.any(np.asarray(properties.get("shear", 0))):
        raise vkt.Error("a sheared layer is no volume", 2, "let napari resample it first")
    offset = np.asarray(properties.get("translate", np.zeros(n)), float)
    affine = np.asarray(properties.get("affine", np.eye(n + 1)), float)
    return affine[:n, :n] @ matrix, affine[:n, :n] @ offset + affine[:n, n]


def _geometry(matrix, offset):
    """Spacing, origin and direction; a picture is a volume of one slice."""
    n = len(offset)
    whole, origin = np.eye(3), np.zeros(3)
    whole[3 - n:, 3 - n:], origin[3 - n:] = matrix, offset
    whole = whole[::-1, ::-1]
    spacing = np.linalg.norm(whole, axis=0)
    return spacing, origin[::-1], whole / spacing
