// What an operation source includes: back-end pattern, arithmetic, and the drivers of the back end being compiled.
// SPDX-License-Identifier: MIT
#pragma once

// Drivers (same names and meaning in every back end; a functor returns the voxel and the driver stores it):
//
//   map(execution, box, out, f, in...)          out = f(in...)           inputs have out's coordinates
//   map_at(execution, box, out, f, in...)       out = f(x, y, z, in...)  x, y, z are std::int64_t, absolute
//   gather(execution, box, out, f)              out = f(x, y, z)         f reads what it likes
//   map_rounded, map_at_rounded, gather_rounded the same, but f returns a compute type; the driver applies round_to<T>,
//                                               and adds to a Tally what was clipped or lost (extra last parameter)
//   fill(execution, box, out, value)            out = value
//   copy_box(execution, from, to, mirror)       permuting copy between boxes of equal dims
//
// `box` is the part of `out` to be computed, in out's coordinates. In and out may be the same memory in map and map_at.

#include "libvkt/kernel/backend.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Axes along which a copy reverses the order of the voxels.
struct Mirror {
    bool x = false, y = false, z = false;
};

} // namespace vkt

#ifdef __CUDACC__
#include "libvkt/kernel/cuda_drivers.h"
#else
#include "libvkt/kernel/cpu_drivers.h"
#endif
