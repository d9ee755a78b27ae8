// Balls whose voxels at the surface have their covered share, on GPUs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/make_covered.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/covered_share.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct CoveredBall {
    BallField field;
    VKT_HD double operator()(double x, double y, double z) const {
        double const share = covered_share(x - field.center.x, y - field.center.y, z - field.center.z, field.radius);
        return field.outside + (field.inside - field.outside) * share;
    }
};

} // namespace

void make_covered_ball(AnyView out, BallField const& field, Losses& losses, Execution const& execution) {
    map_at<double>(execution, out, losses, CoveredBall{field});
}

} // namespace VKT_BACKEND

} // namespace vkt
