"""The watershed as the manual page says it, slowly, with a heap: what vkt must give voxel for voxel."""
import heapq
import itertools

import numpy as np


def offsets(connectivity):
    near = {6: 1, 18: 2, 26: 3}[connectivity]
    all_ = [d for d in itertools.product((-1, 0, 1), repeat=3) if 0 < sum(map(abs, d)) <= near]
    return sorted(all_, key=lambda d: (sum(map(abs, d)), d))


def neighbours(shape, p, steps):
    for d in steps:
        q = tuple(a + b for a, b in zip(p, d))
        if all(0 <= a < n for a, n in zip(q, shape)):
            yield q


def watershed(image, markers, connectivity=6, mask=None, line=False):
    """Labels of image[z, y, x]; NaN is the highest value."""
    steps = offsets(connectivity)
    mask = np.ones(image.shape, bool) if mask is None else mask
    key = lambda p: (bool(np.isnan(image[p])) if image.dtype.kind == "f" else False, image[p].item())
    out = np.where(mask, markers, 0).astype(np.uint32)
    heap = [(*key(p), age, p) for age, p in enumerate(zip(*map(list, np.nonzero(out))))]
    heap = [(nan, 0 if nan else v, age, p) for nan, v, age, p in heap]
    heapq.heapify(heap)
    known = out > 0
    age = len(heap)
    while heap:
        p = heapq.heappop(heap)[3]
        if line and out[p] == 0:
            around = {out[q] for q in neighbours(image.shape, p, steps)} - {0}
            if len(around) > 1:
                continue
            out[p] = around.pop()
        for q in neighbours(image.shape, p, steps):
            if not mask[q] or known[q]:
                continue
            known[q] = True
            if not line:
                out[q] = out[p]
            nan, v = key(q)
            age += 1
            heapq.heappush(heap, (nan, 0 if nan else v, age, q))
    return out


def minima(image, connectivity=6, mask=None, depth=0):
    """Regional minima by flooding each alone until it flows over; numbered by their first voxel."""
    steps = offsets(connectivity)
    mask = np.ones(image.shape, bool) if mask is None else mask
    seen = np.zeros(image.shape, bool)
    out = np.zeros(image.shape, np.uint32)
    firsts = {}
    plateaus = []
    for p in map(tuple, np.argwhere(mask)):
        if seen[p]:
            continue
        part, rest, lowest = [p], [p], True
        seen[p] = True
        while rest:
            for q in neighbours(image.shape, rest.pop(), steps):
                if not mask[q]:
                    continue
                if image[q] < image[p]:
                    lowest = False
                if image[q] == image[p] and not seen[q]:
                    seen[q] = True
                    part.append(q)
                    rest.append(q)
        if lowest:
            plateaus.append(part)
            for q in part:
                firsts[q] = len(plateaus) - 1
    count = 0
    for number, part in enumerate(plateaus):
        start = image[part[0]]
        # Rise until a lower minimum, or an equal one that comes before, is reached.
        flooded = set(part)
        heap = [(image[q], q) for p in part for q in neighbours(image.shape, p, steps) if mask[q] and q not in flooded]
        flooded |= {q for _, q in heap}
        heapq.heapify(heap)
        level, deep = start, np.inf
        while heap:
            v, p = heapq.heappop(heap)
            level = max(level, v)
            other = firsts.get(p)
            if v < start or (v == start and other is not None and other < number):
                deep = float(level) - float(start)
                break
            for q in neighbours(image.shape, p, steps):
                if mask[q] and q not in flooded:
                    flooded.add(q)
                    heapq.heappush(heap, (image[q], q))
        if deep >= depth:
            count += 1
            for q in part:
                out[q] = count
    return out


def passes(image, sources, connectivity=6, allowed=None):
    """The least level up to which water must rise to come to each voxel from the sources; infinite where it cannot."""
    steps = offsets(connectivity)
    allowed = np.ones(image.shape, bool) if allowed is None else allowed
    level = np.full(image.shape, np.inf)
    heap = [(float(image[p]), p) for p in zip(*map(list, np.nonzero(sources & allowed)))]
    for v, p in heap:
        level[p] = v
    heapq.heapify(heap)
    while heap:
        v, p = heapq.heappop(heap)
        if v > level[p]:
            continue
        for q in neighbours(image.shape, p, steps):
            over = max(v, float(image[q]))
            if allowed[q] and over < level[q]:
                level[q] = over
                heapq.heappush(heap, (over, q))
    return level
