// What the histogram of a brick becomes in CLAHE: the curve of what was cut and spread again.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace vkt {

/// What the clip limit c is a share of, for a brick of V voxels and n bins.
enum class ClipRule : std::uint8_t {
    opencv,  ///< bins are cut at c V / n
    skimage, ///< at c V, 0 < c <= 1
    volkit,  ///< at c times the tallest bin, 0 < c <= 1
    pizer,   ///< lower, so that none exceeds c V / n after what was cut off is spread again
};

struct ClipLimit {
    ClipRule rule = ClipRule::opencv;
    double clip = 2; ///< above 0; infinity limits nothing
};

/// The height at which a histogram of so many voxels is cut, whose tallest of n bins is known. ClipRule::pizer wants to
/// see all bins.
VKT_HD double height_to_cut(ClipLimit const& limit, double voxels, double n, double tallest) {
    return limit.rule == ClipRule::opencv    ? limit.clip * voxels / n
           : limit.rule == ClipRule::skimage ? limit.clip * voxels
                                             : limit.clip * tallest;
}

/// A histogram after bins were cut and what was cut off spread evenly over all of them. Sums of whole bins are exact,
/// and so are numbers of cut ones: however many bins lie below an edge, its share is rounded a few times only, and
/// never falls from one edge to the next.
struct CutHistogram {
    double voxels = 1, cut = 0, spread = 0; ///< per bin

    /// Of n bins, `cut_bins` of them cut, which held `above` voxels.
    VKT_HD static CutHistogram of(double voxels, double cut, std::uint64_t above, std::uint64_t cut_bins, double n) {
        double const off = std::fma(-static_cast<double>(cut_bins), cut, static_cast<double>(above));
        return {voxels, cut, cut_bins == 0 || !(off > 0) ? 0 : off / n};
    }
    /// The share of the voxels below an edge that has so many cut bins below it, and the others of so many voxels.
    VKT_HD double share_below(double edge, std::uint64_t cut_bins, std::uint64_t whole) const {
        double const kept = cut_bins == 0 // no bin is cut where nothing limits them
                                ? static_cast<double>(whole)
                                : std::fma(static_cast<double>(cut_bins), cut, static_cast<double>(whole)),
                     share = (kept + edge * spread) / voxels;
        return share < 1 ? share : 1;
    }
};

/// Points of a curve: the share of a brick's voxels below each of counts.size() + 1 edges, after bins were cut and what
/// was cut off spread evenly over all of them, in real numbers. Without any voxel a straight line.
std::vector<double> clipped_curve(std::span<std::uint64_t const> counts, ClipLimit const& limit);

} // namespace vkt
