// Sampled Gaussian weights, plain and folded.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/gaussian_taps.h"

#if VKT_HOST

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <numbers>

namespace vkt {
namespace {

constexpr double most_taps = 1 << 24;

double sample(double k, double sigma) { return std::exp(-0.5 * (k / sigma) * (k / sigma)); }

/// Sum over all integers; the integral, to which it converges faster than exponentially, once sigma is large.
double total_mass(double sigma) {
    if (sigma > 8) return sigma * std::sqrt(2 * std::numbers::pi);
    double sum = 0;
    for (int k = 80; k >= 1; --k) sum += 2 * sample(k, sigma);
    return sum + 1;
}

/// Mass of the taps that are congruent to k modulo the period.
double periodic(double k, double period, double sigma, double mass) {
    if (sigma >= 2 * period) return mass / period; // its first harmonic is below 1e-34
    double sum = 0;
    double const reach = 10 * sigma;
    for (double j = k; j <= reach; j += period) sum += sample(j, sigma);
    for (double j = k - period; j >= -reach; j -= period) sum += sample(j, sigma);
    return sum;
}

std::vector<double> folded_weights(double sigma, std::int64_t n, Boundary boundary, double mass) {
    std::vector<double> weights;
    if (boundary == Boundary::mirror || boundary == Boundary::wrap) {
        std::int64_t const period = boundary == Boundary::mirror ? 2 * n : n;
        for (std::int64_t k = 0; k <= period / 2; ++k)
            weights.push_back(periodic(static_cast<double>(k), static_cast<double>(period), sigma, mass));
        if (period % 2 == 0) weights.back() /= 2; // taps -period/2 and period/2 are the same voxel
        return weights;
    }
    // All taps from n on meet the edge voxel or the border value, whichever output voxel they belong to.
    double rest = mass;
    for (std::int64_t k = 0; k < n; ++k) {
        weights.push_back(sample(static_cast<double>(k), sigma));
        rest -= weights.back() * (k == 0 ? 1 : 2);
    }
    weights.push_back(std::max(0.0, rest / 2));
    return weights;
}

/// The smallest radius beyond which at most `truncation` of the mass lies, up to `limit`.
std::int64_t radius_for(double sigma, double mass, double truncation, std::int64_t limit) {
    double const far = std::ceil(9 * sigma); // 4e-19 of the mass lies beyond
    if (far > static_cast<double>(limit) * 4) return limit + 1;
    double beyond = 0;
    auto k = static_cast<std::int64_t>(far);
    for (; k > 0; --k) {
        beyond += 2 * sample(static_cast<double>(k), sigma) / mass;
        if (beyond > truncation) return k;
    }
    return 0;
}

} // namespace

double GaussianTaps::rounding(double unit) const {
    double error = 0;
    for (std::size_t k = shares.size(); k-- > 0;) error = (1 - shares[k]) * error + unit * (1 + 5 * shares[k]);
    return radius == 0 ? 0 : error;
}

GaussianTaps gaussian_taps(double sigma, std::int64_t n, Boundary boundary, double truncation) {
    GaussianTaps taps;
    taps.weights = {1};
    bool const alone = n == 1 && boundary != Boundary::border; // a line of one voxel is constant
    if (sigma > 0 && !alone) {
        double const mass = total_mass(sigma);
        std::int64_t const limit = boundary == Boundary::wrap ? n / 2 : n;
        taps.radius = radius_for(sigma, mass, truncation, limit);
        taps.folded = taps.radius > limit;
        if (static_cast<double>(taps.folded ? limit : taps.radius) > most_taps)
            throw Error(ErrorKind::resources, text("a Gaussian of sigma ", sigma, " voxels has too many taps"),
                        "make the volume smaller first ('vkt resample'), or use a smaller --sigma");
        if (taps.folded) {
            taps.weights = folded_weights(sigma, n, boundary, mass);
        } else {
            for (std::int64_t k = 1; k <= taps.radius; ++k)
                taps.weights.push_back(sample(static_cast<double>(k), sigma));
        }
    }
    while (taps.weights.size() > 1 && !(taps.weights.back() > 0)) taps.weights.pop_back();
    taps.radius = static_cast<std::int64_t>(taps.weights.size()) - 1;

    // From the outside in: small weights are added first.
    double sum = 0;
    taps.shares.assign(taps.weights.size(), 1);
    for (std::size_t k = taps.weights.size(); k-- > 0;) {
        double const pair = taps.weights[k] * (k == 0 ? 1 : 2);
        sum += pair;
        // Just below 1, so that a + share * (b - a) never rounds past b.
        taps.shares[k] = std::min(pair / sum, 1 - 0x1p-24);
    }
    for (double& w : taps.weights) w /= sum;
    if (taps.radius > 0 && !taps.folded) {
        double const mass = total_mass(sigma);
        taps.truncation = std::max(0.0, 1 - sum / mass);
        // Close to 1 the difference is all rounding: add up what lies beyond instead.
        if (taps.truncation < 1e-9) {
            double beyond = 0;
            for (std::int64_t k = taps.radius + static_cast<std::int64_t>(9 * sigma) + 9; k > taps.radius; --k)
                beyond += 2 * sample(static_cast<double>(k), sigma) / mass;
            taps.truncation = beyond;
        }
    } else if (sigma > 0 && !alone && !taps.folded) {
        taps.truncation = 1 - 1 / total_mass(sigma);
    }
    for (double s : taps.shares) taps.single_shares.push_back(static_cast<float>(s));
    return taps;
}

} // namespace vkt

#endif
