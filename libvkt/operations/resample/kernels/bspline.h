// Coefficients of splines through the voxels of a region: what the kernel is told.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// The filter of SplinePrefilter, and how the volume goes on outside. Coefficients lie outside as well, wherever the
/// spline through the continued volume needs them.
struct SplineFilter {
    double const* weight = nullptr; ///< of 0 … radius voxels aside, either way
    std::int64_t radius = 0;
    Index3 dims; ///< of the volume
    Boundary boundary = Boundary::clamp;
    double border = 0; ///< for Boundary::border: its coefficient, which is the stored value times the scale
    double scale = 1;  ///< a power of two by which voxels are multiplied
};

/// Computes the coefficients in `box` from the voxels in `source`, which are all that they need. `out`, float32 or
/// float64, covers both along x and y and the box along z; what it holds outside of the box is lost. Sums are in
/// double.
VKT_KERNEL(bspline_coefficients,
           (ConstView in, AnyView out, Box const& box, Box const& source, SplineFilter const& filter,
            Execution const& execution),
           (in, out, box, source, filter, execution))

} // namespace vkt
