// Means of voxels whose surroundings are alike, and how noisy voxels are.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <array>
#include <cmath>
#include <vector>

namespace vkt {

struct NlMeansRule {
    Index3 patch, search;
    double strength = 1; ///< stored values
    double noise = 0;    ///< standard deviation, stored values
};

/// Differences are scaled before they are squared, so that their sum over a patch, less `free`, is the exponent of 2
/// that they cost.
template <class C> struct NlMeansFactors { C scale, free; };
template <class C> NlMeansFactors<C> factors_of(NlMeansRule const& rule) {
    Index3 const p = rule.patch;
    auto const count = static_cast<double>((2 * p.x + 1) * (2 * p.y + 1) * (2 * p.z + 1));
    constexpr double per_exponent = 0.693147180559945309;
    double const scale = 1 / (rule.strength * std::sqrt(count * per_exponent)), ratio = rule.noise / rule.strength,
                 free = 2 * ratio * ratio / per_exponent;
    // Finite: what is beyond has no weight, and no difference costs nothing.
    constexpr double most = sizeof(C) == 4 ? 1e38 : 1e300, most_free = 1e30;
    return {static_cast<C>(scale < most ? scale : most), static_cast<C>(free < most_free ? free : most_free)};
}

/// out(p) = in(p) + sum of w (in(q) - in(p)) / sum of w over the search box around p, with
/// w = exp(-max(d - 2 noise^2, 0) / strength^2), d being the mean squared difference between the patches around p and
/// q, and for q = p the largest of the others. Patches that hold what is not finite have no weight. `in` covers out.box
/// grown by both radii.
VKT_KERNEL(nlmeans_box,
           (ConstView in, AnyView out, NlMeansRule const& rule, Losses& losses, Execution const& execution),
           (in, out, rule, losses, execution))

/// Memory of a thread.
std::size_t nlmeans_bytes(DataType type, Index3 patch, Index3 search);

/// How often which size of differences occurs, to 7 binary digits.
struct NoiseCounts {
    std::vector<std::uint64_t> counts;
    /// The standard deviation of the noise that makes the median of these differences; 0 if there are none.
    double deviation() const;
};

/// Counts |a - b - c + d| / 2 of the 2 x 2 voxels of slices, from the first row and column of `in` on, whose four
/// values are finite and not all equal.
VKT_CPU_KERNEL(count_noise, (ConstView in, NoiseCounts& counts, Execution const& execution), (in, counts, execution))

} // namespace vkt
