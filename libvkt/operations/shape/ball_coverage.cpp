// How much of a voxel a ball covers: analytic along two axes, quadrature between the kinks of the third.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/make.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vkt {
namespace {

/// Integral over [0, x] of min(c, sqrt(s - t^2)) dt; x within [-sqrt(s), sqrt(s)].
double capped_circle(double x, double s, double c) {
    auto const circle = [s](double t) {
        double const root = std::sqrt(s);
        return 0.5 * (t * std::sqrt(std::max(0.0, s - t * t)) + s * std::asin(std::clamp(t / root, -1.0, 1.0)));
    };
    double const sign = x < 0 ? -1 : 1;
    double const length = std::abs(x);
    double const flat = s > c * c ? std::sqrt(s - c * c) : 0; // below it the cap, beyond it the circle
    if (length <= flat) return sign * c * length;
    return sign * (c * flat + circle(length) - circle(flat));
}

/// Area of the slice at y: the box [x0, x0 + 1] x [z0, z0 + 1] with z0 > -1 against a disc of squared radius s.
double slice_area(double x0, double z0, double s) {
    double const reach = s - (z0 > 0 ? z0 * z0 : 0);
    if (!(reach > 0)) return 0;
    double const from = std::max(x0, -std::sqrt(reach)), to = std::min(x0 + 1, std::sqrt(reach));
    if (!(from < to)) return 0;
    double const above = capped_circle(to, s, z0 + 1) - capped_circle(from, s, z0 + 1);
    if (z0 > 0) return above - z0 * (to - from);
    return above + capped_circle(to, s, -z0) - capped_circle(from, s, -z0);
}

/// Nodes and weights of Gauss and Legendre's 12-point rule on [0, 1], the positive half.
constexpr std::array<std::array<double, 2>, 6> legendre{{{0.1252334085114689, 0.2491470458134028},
                                                         {0.3678314989981802, 0.2334925365383548},
                                                         {0.5873179542866175, 0.2031674267230659},
                                                         {0.7699026741943047, 0.1600783285433462},
                                                         {0.9041172563704749, 0.1069393259953184},
                                                         {0.9815606342467192, 0.0471753363865118}}};

/// Integral of f over [a, b]; the substitution by a cosine tames square-root ends.
template <class F> double integrate(double a, double b, F const& f) {
    double sum = 0;
    for (auto const& [node, weight] : legendre)
        for (double const sign : {-1.0, 1.0}) {
            double const angle = std::numbers::pi * (0.5 + 0.5 * sign * node);
            double const y = a + (b - a) * 0.5 * (1 - std::cos(angle));
            sum += 0.5 * weight * std::numbers::pi * 0.5 * std::sin(angle) * f(y);
        }
    return sum * (b - a);
}

} // namespace

double ball_coverage(Vec3 center, double radius) {
    std::array<double, 3> c{std::abs(center.x), std::abs(center.y), std::abs(center.z)};
    std::sort(c.begin(), c.end()); // the steepest axis last
    double const distance = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    double const diagonal = std::sqrt(3.0) / 2;
    if (distance >= radius + diagonal) return 0;
    if (distance <= radius - diagonal) return 1;
    double const x0 = c[1] - 0.5, y0 = c[0] - 0.5, z0 = c[2] - 0.5, r2 = radius * radius;
    std::vector<double> kinks{y0, y0 + 1};
    for (double const z : {0.0, z0, z0 + 1})
        for (double const x : {0.0, x0, x0 + 1}) {
            double const square = r2 - x * x - z * z;
            if (!(square > 0)) continue;
            for (double const y : {-std::sqrt(square), std::sqrt(square)})
                if (y > y0 && y < y0 + 1) kinks.push_back(y);
        }
    std::sort(kinks.begin(), kinks.end());
    double volume = 0;
    for (std::size_t i = 0; i + 1 < kinks.size(); ++i)
        if (kinks[i + 1] > kinks[i])
            volume += integrate(kinks[i], kinks[i + 1], [&](double y) { return slice_area(x0, z0, r2 - y * y); });
    return std::clamp(volume, 0.0, 1.0);
}

} // namespace vkt
