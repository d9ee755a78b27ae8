// How much of a voxel a ball covers, as all instruction sets call it.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/covered_share.h"
#include "libvkt/operations/voxels/make.h"

namespace vkt {

double ball_coverage(Vec3 center, double radius) {
    return baseline::covered_share(center.x, center.y, center.z, radius);
}

} // namespace vkt
