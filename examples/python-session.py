"""A session with vkt in Python: the phantom is smoothed, what is bright in it is labelled and measured; its largest
component is looked at with NumPy, and drawn.

python-session.py [DIRECTORY]: writes there (here) session.nrrd, the labels, and session.png, the picture.
SPDX-License-Identifier: MIT
"""
import pathlib
import sys

import numpy as np
import vkt

out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
out.mkdir(parents=True, exist_ok=True)
volume = vkt.read(pathlib.Path(__file__).parent / "data" / "phantom.nrrd")
print(f"{volume}: spacing {volume.spacing}, [z, y, x] in NumPy: {volume.array.shape}")

smooth = vkt.filter.gaussian(volume, sigma=1)
labels = vkt.label(vkt.threshold(smooth, above=80), min_size=10)
sizes = [component["size"] for component in labels.report["labels"]]
print(f"{len(sizes)} components of {sizes} voxels")
rows = vkt.stats(volume, labels=labels)["labels"]  # a row for each label, what is left is 0
for row in rows:
    print(f"label {row['label']}: mean {row['mean']:.1f}, from {row['min']} to {row['max']}")

# Arrays show the voxels in place, for NumPy to compute with; what it makes is a volume again where the other one lies.
array, names = volume.array, np.asarray(labels)
assert np.shares_memory(array, np.asarray(volume)) and not array.flags.writeable
largest = names == 1 + np.argmax(sizes)
assert np.isclose(array[largest].mean(), rows[1 + np.argmax(sizes)]["mean"])
part = vkt.Volume(np.where(largest, array, 0), like=volume)
box = vkt.crop(part, roi=[(n.min(), n.max() + 1) for n in reversed(np.nonzero(largest))])  # in the order x, y, z
print(f"the largest one fills a box of {' x '.join(map(str, box.dims))} voxels")

labels.write(out / "session.nrrd", force=True)
(out / "session.png").write_bytes(vkt.render(box, size=(320, 320), format="png"))
print(f"wrote session.nrrd and session.png to {out}")
