"""napari reads and writes volumes through vkt: voxels in place, where they lie in the world, names of segments."""
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
    An image with a value map becomes physical values, those that its units are of: napari has no map of its own, and
    shows the values of a layer under the pointer and at the ends of its contrast. They are float32, as it draws them."""
    volume = vkt.read(path)
    if volume.hierarchical:  # an adaptive mesh becomes a grid of about so many voxels
        volume = vkt.resample(volume, cells="50M")
    header = volume.header
    labels = _labels(volume, path)
    properties = {
        "name": os.path.basename(os.path.normpath(path)),
        "affine": _affine(volume),
        "metadata": {"vkt": header},
    }
    if labels is not None:
        properties["features"] = {"index": list(labels), "name": list(labels.values())}
        return [(volume.array, properties, "labels")]
    if volume.slope != 1 or volume.intercept != 0:
        values = volume.slope * volume.array.astype(float) + volume.intercept
        return [(values.astype(np.float32), properties, "image")]
    return [(volume.array, properties, "image")]


def write_layer(path, data, properties):
    """Writes one layer; the name tells the format. napari has asked before it replaces a file."""
    known = properties.get("metadata", {}).get("vkt", {})
    spacing, origin, direction = _geometry(data, properties)
    volume = vkt.Volume(np.asarray(data), spacing=spacing, origin=origin, direction=direction,
                        units=known.get("units", ""))
    attributes = known.get("attributes", {})
    kept = [f"{key}={value}" for key, value in attributes.items() if key == "space" or key.startswith("Segment")]
    if kept:
        volume = vkt.set(volume, attribute=kept)
    volume.write(path, force=True)
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


def _geometry(data, properties):
    """Spacing, origin and direction of a layer, whose transformation is affine after rotation after scale."""
    n = np.ndim(data)
    matrix = np.asarray(properties.get("rotate", np.eye(n)), float) @ np.diag(properties.get("scale", np.ones(n)))
    if np.any(np.asarray(properties.get("shear", 0))):
        raise vkt.Error("a sheared layer is no volume", 2, "let napari resample it first")
    offset = np.asarray(properties.get("translate", np.zeros(n)), float)
    affine = np.asarray(properties.get("affine", np.eye(n + 1)), float)
    matrix, offset = affine[:n, :n] @ matrix, affine[:n, :n] @ offset + affine[:n, n]
    whole, origin = np.eye(3), np.zeros(3)  # a picture is a volume of one slice
    whole[3 - n:, 3 - n:], origin[3 - n:] = matrix, offset
    whole = whole[::-1, ::-1]
    spacing = np.linalg.norm(whole, axis=0)
    return spacing, origin[::-1], whole / spacing
