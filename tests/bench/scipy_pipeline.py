#!/usr/bin/python3
# The peer of tests/bench/pipelines.sh in SciPy, at its best: one process, mapped input, one thread.
# SPDX-License-Identifier: MIT
import sys

import numpy as np
from scipy.ndimage import gaussian_filter

source, target, n = sys.argv[1], sys.argv[2], int(sys.argv[3])
volume = np.memmap(source, dtype=np.float32, mode="r", shape=(n, n, n))
q = n // 4
smooth = gaussian_filter(np.ascontiguousarray(volume[q : 3 * q, q : 3 * q, q : 3 * q]), 2, mode="reflect")
half = smooth.reshape(q, 2, q, 2, q, 2).mean(axis=(1, 3, 5), dtype=np.float32)
np.ascontiguousarray(half[:, :, ::-1]).tofile(target)
