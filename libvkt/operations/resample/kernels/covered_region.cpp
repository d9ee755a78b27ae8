// What moves inside a region, put where the region covers voxels partly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/covered_region.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/resample/kernels/affine.h"

namespace vkt::VKT_BACKEND {
namespace {

/// Of the voxel at i, what lies between two ends.
struct CoveredPart {
    double begin, end;
    VKT_HD CoveredPart(double i, double lower, double upper)
        : begin(i < lower ? lower : i), end(i + 1 > upper ? upper : i + 1) {}
    VKT_HD double share() const { return end - begin; }
    VKT_HD double middle() const { return 0.5 * (begin + end) - 0.5; } ///< an index
};

/// 1 where what moves comes from beyond the region, as seen from the middle of what is covered.
struct Beyond {
    CoveredRegion region;
    VKT_HD double operator()(double x, double y, double z) const {
        Vec3 const &low = region.lower, &high = region.upper;
        double const px = CoveredPart(x, low.x, high.x).middle(), py = CoveredPart(y, low.y, high.y).middle(),
                     pz = CoveredPart(z, low.z, high.z).middle();
        Affine const& m = region.map;
        double const qx = m.offset.x + m.column[0].x * px + m.column[1].x * py + m.column[2].x * pz,
                     qy = m.offset.y + m.column[0].y * px + m.column[1].y * py + m.column[2].y * pz,
                     qz = m.offset.z + m.column[0].z * px + m.column[1].z * py + m.column[2].z * pz;
        return within(qx, low.x, high.x) && within(qy, low.y, high.y) && within(qz, low.z, high.z) ? 0 : 1;
    }
    /// Like AffineSampling at the faces of a volume.
    VKT_HD static bool within(double at, double low, double high) {
        return at >= low - 0.5 - face_slack && at < high - 0.5 - face_slack;
    }
};

struct Cover {
    CoveredRegion region;
    VKT_HD double operator()(double x, double y, double z, double moved, double original, double beyond) const {
        double const share = CoveredPart(x, region.lower.x, region.upper.x).share() *
                             CoveredPart(y, region.lower.y, region.upper.y).share() *
                             CoveredPart(z, region.lower.z, region.upper.z).share();
        double const value = beyond != 0 ? region.background : moved;
        // Shares of one value are this value, also to its last bit.
        return share == 1 || value == original ? value : value * share + original * (1 - share);
    }
    VKT_HD bool undefined(double /*moved*/, double /*original*/, double beyond) const { return beyond != 0; }
};

} // namespace

void cover_region(ConstView moved, ConstView original, AnyView out, CoveredRegion const& region, AnyView scratch,
                  Losses& losses, Execution const& execution) {
    Losses none;
    if (region.continues)
        fill(execution, scratch.box, scratch.as<std::uint8_t>(), std::uint8_t{0});
    else
        map_at<double>(execution, scratch, none, Beyond{region});
    map_at<double>(execution, out, losses, Cover{region}, moved, original, ConstView(scratch));
}

} // namespace vkt::VKT_BACKEND
