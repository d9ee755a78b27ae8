// Sampled Gaussian weights, plain and folded.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/gaussian_taps.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace vkt {
namespace {

constexpr double most_taps = 1 << 24;

// In long double, so that the shares are right to the last bit of double: what they are off by is an error of the
// result.
using Real = long double;

Real sample(Real k, double sigma) { return std::exp(-0.5L * (k / sigma) * (k / sigma)); }

/// Mass of the taps that are congruent to k modulo the period.
Real periodic(Real k, Real period, double sigma, Real mass) {
    if (sigma >= 2 * period) return mass / period; // its first harmonic is below 1e-34
    Real sum = 0;
    Real const reach = 10 * static_cast<Real>(sigma);
    for (Real j = k; j <= reach; j += period) sum += sample(j, sigma);
    for (Real j = k - period; j >= -reach; j -= period) sum += sample(j, sigma);
    return sum;
}

std::vector<Real> folded_weights(double sigma, std::int64_t n, Boundary boundary, Real mass) {
    std::vector<Real> weights;
    if (boundary == Boundary::mirror || boundary == Boundary::wrap) {
        std::int64_t const period = boundary == Boundary::mirror ? 2 * n : n;
        for (std::int64_t k = 0; k <= period / 2; ++k)
            weights.push_back(periodic(static_cast<Real>(k), static_cast<Real>(period), sigma, mass));
        if (period % 2 == 0) weights.back() /= 2; // taps -period/2 and period/2 are the same voxel
        return weights;
    }
    // All taps from n on meet the edge voxel or the border value, whichever output voxel they belong to.
    Real rest = mass;
    for (std::int64_t k = 0; k < n; ++k) {
        weights.push_back(sample(static_cast<Real>(k), sigma));
        rest -= weights.back() * (k == 0 ? 1 : 2);
    }
    weights.push_back(std::max<Real>(0, rest / 2));
    return weights;
}

/// The smallest radius beyond which at most `truncation` of the mass lies, up to `limit`.
std::int64_t radius_for(double sigma, Real mass, double truncation, std::int64_t limit) {
    double const far = std::ceil(9 * sigma); // 4e-19 of the mass lies beyond
    if (far > static_cast<double>(limit) * 4) return limit + 1;
    Real beyond = 0;
    auto k = static_cast<std::int64_t>(far);
    for (; k > 0; --k) {
        beyond += 2 * sample(static_cast<Real>(k), sigma) / mass;
        if (beyond > truncation) return k;
    }
    return 0;
}

} // namespace

long double gaussian_mass(double sigma) {
    // The integral, to which the sum converges faster than exponentially, once sigma is large.
    if (sigma > 8) return sigma * std::sqrt(2 * std::numbers::pi_v<Real>);
    Real sum = 0;
    for (int k = 80; k >= 1; --k) sum += 2 * sample(k, sigma);
    return sum + 1;
}

GaussianRounding nested_step(GaussianRounding const& a, double share, double unit) {
    // The difference, its product with the share, and the share: also where that is 1 and stays just below. Then the
    // average and the pair.
    return {(1 - share) * a.range + unit * 3 * share, (1 - share) * a.magnitude + unit * (1 + share)};
}

GaussianRounding GaussianTaps::rounding(double unit) const {
    GaussianRounding error;
    if (radius == 0) return error;
    unit *= 1 + 4 * unit; // roundings of what was rounded
    for (std::size_t k = shares.size(); k-- > 0;) error = nested_step(error, shares[k], unit);
    return error;
}

GaussianTaps nested_taps(std::vector<Real> weights) {
    GaussianTaps taps;
    while (weights.size() > 1 && !(weights.back() > 0)) weights.pop_back();
    taps.radius = static_cast<std::int64_t>(weights.size()) - 1;

    // From the outside in: small weights are added first.
    Real sum = 0;
    taps.shares.resize(weights.size());
    for (std::size_t k = weights.size(); k-- > 0;) {
        Real const pair = weights[k] * (k == 0 ? 1 : 2);
        sum += pair;
        taps.shares[k] = static_cast<double>(pair / sum);
    }
    // Just below 1, so that a + share * (b - a) never rounds past b.
    for (double& s : taps.shares) {
        taps.single_shares.push_back(std::min(static_cast<float>(s), 1 - 0x1p-24F));
        s = std::min(s, 1 - 0x1p-53);
    }
    return taps;
}

GaussianTaps gaussian_taps(double sigma, std::int64_t n, Boundary boundary, double truncation) {
    GaussianTaps taps;
    std::vector<Real> weights{1};                              // of taps 0…radius, not yet of unit sum
    bool const alone = n == 1 && boundary != Boundary::border; // a line of one voxel is constant
    Real mass = 1;
    if (sigma > 0 && !alone) {
        mass = gaussian_mass(sigma);
        std::int64_t const limit = boundary == Boundary::wrap ? n / 2 : n;
        taps.radius = radius_for(sigma, mass, truncation, limit);
        taps.folded = taps.radius > limit;
        if (static_cast<double>(taps.folded ? limit : taps.radius) > most_taps)
            throw Error(ErrorKind::resources, text("a Gaussian of sigma ", sigma, " voxels has too many taps"),
                        "make the volume smaller first ('vkt resample'), or use a smaller --sigma");
        if (taps.folded) {
            weights = folded_weights(sigma, n, boundary, mass);
        } else {
            for (std::int64_t k = 1; k <= taps.radius; ++k) weights.push_back(sample(static_cast<Real>(k), sigma));
        }
    }
    bool const folded = taps.folded;
    taps = nested_taps(std::move(weights));
    taps.folded = folded;
    if (sigma > 0 && !alone && !taps.folded) {
        // Added up and not subtracted from 1, where little is left.
        Real beyond = 0;
        for (std::int64_t k = taps.radius + static_cast<std::int64_t>(9 * sigma) + 9; k > taps.radius; --k)
            beyond += 2 * sample(static_cast<Real>(k), sigma) / mass;
        taps.truncation = static_cast<double>(beyond);
    }
    return taps;
}

} // namespace vkt
