// Test fields: what their kernels are given.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/voxels/make.h"

namespace vkt {

struct BallField {
    Vec3 center;
    double radius = 1, inside = 1, outside = 0;
    SphereEdge edge = SphereEdge::hard;
};
struct MarschnerLobbField {
    Index3 dims;
    double frequency = 6, amplitude = 0.25, low = 0, high = 1;
};
struct NoiseField {
    Index3 dims;
    std::uint64_t seed = 0;
    double low = 0, high = 1;
};

VKT_KERNEL(make_ramp, (AnyView out, Axis axis, double first, double last, std::int64_t n, Execution const& execution),
           (out, axis, first, last, n, execution))
VKT_KERNEL(make_checkerboard, (AnyView out, std::int64_t period, double low, double high, Execution const& execution),
           (out, period, low, high, execution))
/// Of hard edges and distances.
VKT_KERNEL(make_ball, (AnyView out, BallField const& field, Losses& losses, Execution const& execution),
           (out, field, losses, execution))
VKT_KERNEL(make_marschner_lobb, (AnyView out, MarschnerLobbField const& field, Execution const& execution),
           (out, field, execution))
VKT_KERNEL(make_noise, (AnyView out, NoiseField const& field, Execution const& execution), (out, field, execution))

} // namespace vkt
