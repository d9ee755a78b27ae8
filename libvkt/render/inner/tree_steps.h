// The points of a ray through a brick tree between which its segments lie.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/tree.h"

#include <cmath>

namespace vkt::render {

/// Points are multiples of the step; where the finest brick near is of level l every 2^l-th of them counts, so that one
/// level has the comb of a lattice. A segment depends on where it begins and on the stretches it meets, not on how the
/// ray came there: leaving some out changes none of the others.
struct TreeSteps {
    double step, length;
    std::int64_t last; ///< the number of the point at that length

    VKT_HD double at(std::int64_t k) const { return k < last ? static_cast<double>(k) * step : length; }
    VKT_HD std::int64_t after(std::int64_t k, int level) const {
        std::int64_t const next = ((k >> level) + 1) << level;
        return next < last ? next : last;
    }

    /// How many whole segments from point k on lie within its stretch.
    VKT_HD std::int64_t segments_inside(std::int64_t k, Stretch const& stretch) const {
        std::int64_t const unit = std::int64_t{1} << stretch.level;
        if ((k & (unit - 1)) != 0) return 0;
        auto n = static_cast<std::int64_t>((stretch.end / step - static_cast<double>(k)) / static_cast<double>(unit));
        while (n > 0 && (k + n * unit > last || at(k + n * unit) > stretch.end)) --n;
        return n;
    }

    /// How many of them lie within a length from point k.
    VKT_HD std::int64_t unseen(std::int64_t k, Stretch const& stretch, double way) const {
        double const unit = std::ldexp(step, stretch.level);
        if (!(way > unit)) return 0;
        auto const n = static_cast<std::int64_t>(way / unit) - 1, inside = segments_inside(k, stretch);
        return n < inside ? n : inside;
    }
};

/// What of a ray through a tree is marched: the steps, and the number of the point at which that begins. Points are
/// counted from the entry all the same, as in a lattice.
struct MarchedPart {
    TreeSteps steps;
    std::int64_t first;
    RayPart part;
};
/// The part in which something can be seen; false if there is none.
VKT_HD bool marched_part(TreeView const& tree, double step, Ray const& ray, MarchedPart& marched) {
    double near = 0, far = ray.length;
    if (!clip(ray.entry, ray.direction, tree.lower, tree.upper, near, far)) return false;
    auto const last_point = [&](double length) __attribute__((always_inline)) {
        auto const n = static_cast<std::int64_t>(std::ceil(length / step));
        return n > 1 ? n : std::int64_t{1};
    };
    auto const first = static_cast<std::int64_t>(near / step);
    std::int64_t const last = last_point(far);
    RayPart const part{static_cast<double>(first) * step,
                       last < last_point(ray.length) ? static_cast<double>(last) * step : ray.length};
    marched = {{step, part.end, last}, first, part};
    return part.begin < part.end;
}

} // namespace vkt::render
