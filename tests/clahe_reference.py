"""CLAHE as its manual page defines it, slowly: shares of voxels by matrices, curves by numpy, blends by sums."""
import numpy as np


def shares(n, b):
    """[brick, voxel]: how much of each voxel lies in each brick."""
    edges = np.arange(b + 1) * n / b
    i = np.arange(n)
    return np.maximum(0, np.minimum(i + 1, edges[1:, None]) - np.maximum(i, edges[:-1, None]))


def weights(n, b):
    """[brick, voxel]: linear interpolation between the bricks' centres."""
    at = np.clip((np.arange(n) + 0.5) * b / n - 0.5, 0, b - 1)
    return np.maximum(0, 1 - np.abs(at - np.arange(b)[:, None]))


def cut(h, rule, clip):
    n, mass = len(h), h.sum()
    if rule == "opencv":
        return clip * mass / n
    if rule == "skimage":
        return clip * mass
    if rule == "volkit":
        return clip * h.max()
    low, high = 0.0, float(h.max())  # pizer: by bisection
    for _ in range(200):
        c = (low + high) / 2
        highest = np.minimum(h, c).max() + np.maximum(h - c, 0).sum() / n
        low, high = (c, high) if highest < clip * mass / n else (low, c)
    return low


def curves(v, window, bricks, bins, clip, rule):
    """[brick z, y, x, point]; v[z, y, x] without NaN, bricks x, y, z."""
    lo, hi = window
    counted = np.clip(v, lo, hi)
    edges = lo + np.arange(bins + 1) * ((hi - lo) / bins)
    edges[-1] = hi
    slot = np.clip(np.searchsorted(edges, counted, side="right") - 1, 0, bins - 1)
    one = (slot[..., None] == np.arange(bins)).astype(float)
    sz, sy, sx = (shares(n, min(b, n)) for n, b in zip(v.shape, bricks[::-1]))
    h = np.einsum("az,by,cx,zyxn->abcn", sz, sy, sx, one, optimize=True)
    table = np.zeros(h.shape[:3] + (bins + 1,))
    for brick in np.ndindex(h.shape[:3]):
        c = cut(h[brick], rule, clip)
        limited = np.minimum(h[brick], c) + np.maximum(h[brick] - c, 0).sum() / bins
        assert abs(limited.sum() - h[brick].sum()) < 1e-9 * h[brick].sum()
        table[brick][1:] = np.cumsum(limited) / limited.sum()
    return table


def clahe(v, window=None, bricks=(8, 8, 8), bins=256, clip=2.0, rule="opencv"):
    v = np.asarray(v, np.float64)
    lo, hi = window = window or (v.min(), v.max())
    table = curves(v, window, bricks, bins, clip, rule)
    at = np.clip((v - lo) / (hi - lo) * bins, 0, bins)
    wz, wy, wx = (weights(n, b) for n, b in zip(v.shape, table.shape[:3]))
    result = np.zeros(v.shape)
    for a, b, c in np.ndindex(table.shape[:3]):
        share = np.interp(at, np.arange(bins + 1), table[a, b, c])
        result += wz[a][:, None, None] * wy[b][:, None] * wx[c] * share
    return lo + (hi - lo) * result
