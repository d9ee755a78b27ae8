// Balls whose voxels at the surface have their covered share.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/make_covered.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct CoveredBall {
    BallField field;
    double operator()(double x, double y, double z) const {
        Vec3 const p{x - field.center.x, y - field.center.y, z - field.center.z};
        return field.outside + (field.inside - field.outside) * ball_coverage(p, field.radius);
    }
};

} // namespace

void make_covered_ball(AnyView out, BallField const& field, Losses& losses, Execution const& execution) {
    map_at<double>(execution, out, losses, CoveredBall{field});
}

} // namespace VKT_BACKEND

} // namespace vkt
