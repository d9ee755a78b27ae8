// The sampled Gaussian of one axis: how many taps an accuracy needs, their weights, and what error remains.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <vector>

namespace vkt {

/// A rounding error: what differences of voxels cost, as a share of the range of the values, and what the averages
/// themselves cost, as a share of the largest |value|. If 0 is among the values their sum is a share of the range.
struct GaussianRounding {
    double range = 0, magnitude = 0;
    double sum() const { return range + magnitude; }
    GaussianRounding& operator+=(GaussianRounding const& other) {
        range += other.range;
        magnitude += other.magnitude;
        return *this;
    }
};

/// Symmetric taps -radius…radius of unit sum. A pass evaluates them from the outside in, as nested averages:
///     a = (x[-r] + x[r]) / 2;  a += share[k] * ((x[-k] + x[k]) / 2 - a) for k = r-1…1;  a += share[0] * (x[0] - a)
/// so that constants come out bit for bit, results never leave the range of the data, and mirror images stay mirrored.
struct GaussianTaps {
    std::int64_t radius = 0;
    std::vector<double> shares; ///< share[k] = weight of pair k within that of the pairs k…radius
    std::vector<float> single_shares;
    double truncation = 0; ///< mass cut off: bounds |error| of the pass as a share of the data's range
    bool folded = false;   ///< taps that would reach beyond the volume are lumped onto the voxels that stand there

    /// Bound of the rounding error of one pass; unit is half the spacing at 1 of the type it computes in.
    GaussianRounding rounding(double unit) const;
};

/// Taps of these weights of 0…radius, scaled to unit sum; their truncation is not known here.
GaussianTaps nested_taps(std::vector<long double> weights);

/// Bound of the rounding error after one more step of a nested average, a += share * (b - a), of which both are off.
GaussianRounding nested_step(GaussianRounding const& a, double share, double unit);

/// Sum of exp(-k^2 / 2 sigma^2) over all integers k.
long double gaussian_mass(double sigma);

/// Taps for a standard deviation in voxels on a line of n voxels. The radius is the smallest that cuts off at most
/// `truncation` of the infinite kernel's mass (half its L1 distance, research: Getreuer 2013 section 3). Where it would
/// exceed the line, the boundary rule is folded into the weights and nothing is cut off. sigma 0 gives the identity.
/// Throws Error{resources} if more than 2^24 taps a side would be needed.
GaussianTaps gaussian_taps(double sigma, std::int64_t n, Boundary boundary, double truncation);

} // namespace vkt
