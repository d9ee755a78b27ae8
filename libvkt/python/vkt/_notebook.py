"""How a volume shows itself in notebooks: three slices through its middle, and a picture."""
# SPDX-License-Identifier: MIT
import base64
import html as _html
import warnings

import numpy as np

from ._library import Error
from ._picture import drawn, png_of


def html(volume):
    figures = [] if volume.hierarchical else [_slice(volume, axis) for axis in (2, 1, 0)]
    small = volume
    if not volume.hierarchical and volume.array.size > 1 << 24:  # a look, not a study
        small = volume.apply("resample", scale=(2.0 ** 24 / volume.array.size) ** (1 / 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            figures.append(("render", drawn(small, {"size": 256, "format": "png"}, 4), 256, 256))
        except Error as error:
            figures.append((str(error), None, 0, 0))
    cells = "".join(
        f'<figure style="display:inline-block;margin:4px"><img width="{w}" height="{h}" '
        f'src="data:image/png;base64,{base64.b64encode(png).decode()}"/><figcaption>{name}</figcaption></figure>'
        if png else f"<p>{_html.escape(name)}</p>" for name, png, w, h in figures)
    return f"<div><code>{_html.escape(repr(volume))}</code><br/>{cells}</div>"


def _slice(volume, axis):
    """Name, PNG and shown size of the middle slice across an axis of x, y, z; z points upwards."""
    array = volume.array
    pixels = np.take(array, array.shape[2 - axis] // 2, axis=2 - axis)
    if axis != 2:
        pixels = pixels[::-1]
    down, across = [a for a in (2, 1, 0) if a != axis]
    step = -(-max(pixels.shape) // 512)
    pixels = pixels[::step, ::step].astype(float)
    known = pixels[np.isfinite(pixels)]
    low, high = np.percentile(known, (1, 99)) if known.size else (0, 1)
    if not low < high:
        low, high = (known.min(), known.max() + 1) if known.size else (0, 1)
    share = np.nan_to_num((pixels - low) / (high - low), nan=0, posinf=1, neginf=0)
    if volume.slope < 0:
        share = 1 - share
    size = np.array([volume.dims[a] * volume.spacing[a] for a in (across, down)])
    width, height = (max(1, round(256 * n / size.max())) for n in size)
    return ("xyz"[axis] + f" = {volume.dims[axis] // 2}",
            png_of(np.round(255 * np.clip(share, 0, 1)).astype(np.uint8)), width, height)
