// The mean of a neighbourhood, weighted by distance in space and in value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Largest radius of a bilateral filter.
inline constexpr int most_bilateral_radius = 32;

struct BilateralRule {
    Index3 radius;
    Vec3 sigma{1, 1, 1};    ///< voxels; 0 where the radius is
    double range_sigma = 1; ///< stored values
};

/// out(p) = in(p) + sum of w (in(q) - in(p)) / sum of w over the box around p, with w = exp(-|q - p|^2 / 2 sigma^2 -
/// (in(q) - in(p))^2 / 2 range_sigma^2), distances in units of sigma along each axis. What is not finite has no weight;
/// such voxels stay as they are.
VKT_KERNEL(bilateral_box,
           (ConstView in, AnyView out, BilateralRule const& rule, Losses& losses, Execution const& execution),
           (in, out, rule, losses, execution))

} // namespace vkt
