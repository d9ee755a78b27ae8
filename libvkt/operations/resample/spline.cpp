// B-splines and their prefilters.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/spline.h"

#include <array>
#include <cmath>

namespace vkt {

long double bspline(int degree, long double t) {
    t = std::abs(t);
    if (degree == 3) {
        if (t < 1) return (4 - 3 * t * t * (2 - t)) / 6;
        if (t < 2) return (2 - t) * (2 - t) * (2 - t) / 6;
        return 0;
    }
    if (t < 1) return (66 - t * t * (60 - t * t * (30 - 10 * t))) / 120;
    if (t < 2) return (51 + t * (75 - t * (210 - t * (150 - t * (45 - 5 * t))))) / 120;
    if (t < 3) return std::pow(3 - t, 5.0L) / 120;
    return 0;
}

SplinePrefilter::SplinePrefilter(int degree, double share) {
    // The poles z of the inverse inside the unit circle (Unser, Aldroubi, Eden 1993): for degree 5 roots of
    // z^4 + 26 z^3 + 66 z^2 + 26 z + 1, which in w = z + 1/z is w^2 + 26 w + 64.
    auto const pole = [](long double w) { return (w + std::sqrt(w * w - 4)) / 2; }; // of the two the smaller
    std::vector<long double> const poles =
        degree == 3 ? std::vector{pole(-4.0L)}
                    : std::vector{pole(-13 + std::sqrt(105.0L)), pole(-13 - std::sqrt(105.0L))};
    // One pole gives z^|k| (1 - z)^2 / (1 - z^2); two are convolved.
    constexpr std::int64_t far = 96; // 0.43^96 is 1e-35
    std::vector<long double> all(far + 1);
    auto const one = [](long double z, std::int64_t k) {
        return std::pow(z, static_cast<long double>(std::abs(k))) * (1 - z) / (1 + z);
    };
    for (std::int64_t k = 0; k <= far; ++k) {
        long double& sum = all[static_cast<std::size_t>(k)];
        if (poles.size() == 1) {
            sum = one(poles[0], k);
            continue;
        }
        for (std::int64_t i = -far; i <= far; ++i) sum += one(poles[0], i) * one(poles[1], k - i);
    }
    long double tail = 0;
    radius = far;
    while (radius > 1 && 4 * (tail + std::abs(all[static_cast<std::size_t>(radius)])) <= share)
        tail += std::abs(all[static_cast<std::size_t>(radius--)]);
    long double sum = all[0];
    for (std::int64_t k = 1; k <= radius; ++k) sum += 2 * all[static_cast<std::size_t>(k)];
    weight.assign(all.begin(), all.begin() + radius + 1);
    long double total = 0;
    for (std::int64_t k = 0; k <= radius; ++k) {
        weight[static_cast<std::size_t>(k)] /= sum; // constants stay
        total += (k == 0 ? 1 : 2) * std::abs(weight[static_cast<std::size_t>(k)]);
    }
    gain = static_cast<double>(total);
    cut = static_cast<double>(2 * tail + total * std::abs(1 - sum));
}

} // namespace vkt
