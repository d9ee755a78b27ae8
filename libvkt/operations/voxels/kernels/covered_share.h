// How much of a voxel a ball covers: analytic along two axes, quadrature between the kinks of the third. For kernel
// sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

#include <cmath>
#include <numbers>

namespace vkt::VKT_BACKEND {

/// Integral over [0, x] of min(c, sqrt(s - t^2)) dt; x within [-sqrt(s), sqrt(s)].
VKT_HD double capped_circle(double x, double s, double c) {
    auto const circle = [s](double t) {
        double const root = std::sqrt(s), rest = s - t * t, sine = t / root;
        double const angle = std::asin(sine < -1 ? -1 : 1 < sine ? 1 : sine);
        return 0.5 * (t * std::sqrt(0 < rest ? rest : 0.0) + s * angle);
    };
    double const sign = x < 0 ? -1 : 1;
    double const length = std::abs(x);
    double const flat = s > c * c ? std::sqrt(s - c * c) : 0; // below it the cap, beyond it the circle
    if (length <= flat) return sign * c * length;
    return sign * (c * flat + circle(length) - circle(flat));
}

/// Area of the slice at y: the box [x0, x0 + 1] x [z0, z0 + 1] with z0 > -1 against a disc of squared radius s.
VKT_HD double slice_area(double x0, double z0, double s) {
    double const reach = s - (z0 > 0 ? z0 * z0 : 0);
    if (!(reach > 0)) return 0;
    double const root = std::sqrt(reach), from = x0 < -root ? -root : x0, to = root < x0 + 1 ? root : x0 + 1;
    if (!(from < to)) return 0;
    double const above = capped_circle(to, s, z0 + 1) - capped_circle(from, s, z0 + 1);
    if (z0 > 0) return above - z0 * (to - from);
    return above + capped_circle(to, s, -z0) - capped_circle(from, s, -z0);
}

/// Integral of f over [a, b]; the substitution by a cosine tames square-root ends.
template <class F> VKT_HD double integrate(double a, double b, F const& f) {
    // Nodes and weights of Gauss and Legendre's 12-point rule on [0, 1], the positive half.
    constexpr double legendre[6][2] = {
        {0.1252334085114689, 0.2491470458134028}, {0.3678314989981802, 0.2334925365383548},
        {0.5873179542866175, 0.2031674267230659}, {0.7699026741943047, 0.1600783285433462},
        {0.9041172563704749, 0.1069393259953184}, {0.9815606342467192, 0.0471753363865118}};
    double sum = 0;
    for (int k = 0; k < 6; ++k)
        for (double sign = -1; sign <= 1; sign += 2) {
            double const node = legendre[k][0], weight = legendre[k][1];
            double const angle = std::numbers::pi * (0.5 + 0.5 * sign * node);
            double const y = a + (b - a) * 0.5 * (1 - std::cos(angle));
            sum += 0.5 * weight * std::numbers::pi * 0.5 * std::sin(angle) * f(y);
        }
    return sum * (b - a);
}

VKT_HD void sort_values(double* values, int n) {
    for (int i = 1; i < n; ++i) {
        double const v = values[i];
        int at = i;
        for (; at > 0 && v < values[at - 1]; --at) values[at] = values[at - 1];
        values[at] = v;
    }
}

/// Share of the cube of side 1 around (x, y, z) that a ball of this radius around the origin covers.
VKT_HD double covered_share(double x, double y, double z, double radius) {
    double c[3] = {std::abs(x), std::abs(y), std::abs(z)};
    sort_values(c, 3); // the steepest axis last
    double const distance = std::sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    double const diagonal = std::sqrt(3.0) / 2;
    if (distance >= radius + diagonal) return 0;
    if (distance <= radius - diagonal) return 1;
    double const x0 = c[1] - 0.5, y0 = c[0] - 0.5, z0 = c[2] - 0.5, r2 = radius * radius;
    double kinks[20] = {y0, y0 + 1};
    int count = 2;
    for (int i = 0; i < 9; ++i) {
        double const at_x = i % 3 == 0 ? 0 : i % 3 == 1 ? x0 : x0 + 1, at_z = i / 3 == 0 ? 0 : i / 3 == 1 ? z0 : z0 + 1;
        double const square = r2 - at_x * at_x - at_z * at_z;
        if (!(square > 0)) continue;
        double const root = std::sqrt(square);
        if (-root > y0 && -root < y0 + 1) kinks[count++] = -root;
        if (root > y0 && root < y0 + 1) kinks[count++] = root;
    }
    sort_values(kinks, count);
    double volume = 0;
    for (int i = 0; i + 1 < count; ++i)
        if (kinks[i + 1] > kinks[i])
            volume +=
                integrate(kinks[i], kinks[i + 1], [&](double at_y) { return slice_area(x0, z0, r2 - at_y * at_y); });
    return volume < 0 ? 0 : 1 < volume ? 1 : volume;
}

} // namespace vkt::VKT_BACKEND
