// How noisy a volume is, told from the volume alone.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"

namespace vkt {

/// Standard deviation of white noise in a structured volume, as a stored value: the median of |w| over 0.6745, where w
/// are the finest diagonal Haar coefficients, of blocks of 2x2x2 voxels (2x2, 2 where axes have one voxel). What is
/// smooth cancels in them, and edges are too few to move a median (D. L. Donoho, I. M. Johnstone: Ideal spatial
/// adaptation by wavelet shrinkage, Biometrika 81, 1994). Blocks whose voxels are all equal and those
/// that hold no numbers are left out. The same is asked of what is left without padding, the value that most equal
/// blocks have, and blocks that touch it, with other equal blocks counted as w = 0: the smaller counts, so that masks,
/// labels and thin things on nothing, whose edges are all that differs, have no noise. Too small for noise that
/// neighbours share, as after interpolation; of noise that differs from place to place it is that of a typical place.
/// Two passes. Holds 8 bytes for every eighth voxel.
double noise_level(Volume const& volume);

/// By how much the largest of so many values of normal noise exceeds its standard deviation, about: sqrt(2 ln n).
double noise_extent(std::int64_t voxels);

} // namespace vkt
