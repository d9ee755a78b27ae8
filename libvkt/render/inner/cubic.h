// Trilinear values along a ray through one cell: a cubic, its extrema and where it passes a value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"

#include <cmath>

namespace vkt::render {

/// A sampler whose values are trilinear in the cells of a lattice.
template <class S>
concept CellSampler = Sampler<S> && requires(S const& s, float* c) {
    s.corners(1, 1, 1, c);
};

/// Values along a ray through one cell, as a cubic of s in [0,1].
struct Cubic {
    double a, b, c, d;
    VKT_HD double operator()(double s) const { return ((a * s + b) * s + c) * s + d; }
};

/// From the corners of a cell (x fastest), the local position where the ray enters and its way to the exit.
VKT_HD Cubic cubic_along(float const* v, Double3 p, Double3 d) {
    double const v0 = v[0];
    double const kx = v[1] - v0, ky = v[2] - v0, kz = v[4] - v0;
    double const kxy = (static_cast<double>(v[3]) - v[2]) - kx, kxz = (static_cast<double>(v[5]) - v[4]) - kx;
    double const kyz = (static_cast<double>(v[6]) - v[4]) - ky;
    double const kxyz = ((static_cast<double>(v[7]) - v[6]) - (static_cast<double>(v[5]) - v[4])) - kxy;
    double const xx = p.x * p.y, yz = p.y * p.z, xz = p.x * p.z;
    double const dxy = d.x * p.y + p.x * d.y, dyz = d.y * p.z + p.y * d.z, dxz = d.x * p.z + p.x * d.z;
    double const exy = d.x * d.y, eyz = d.y * d.z, exz = d.x * d.z;
    return {kxyz * exy * d.z, kxy * exy + kyz * eyz + kxz * exz + kxyz * (exy * p.z + dxy * d.z),
            kx * d.x + ky * d.y + kz * d.z + kxy * dxy + kyz * dyz + kxz * dxz + kxyz * (dxy * p.z + xx * d.z),
            v0 + kx * p.x + ky * p.y + kz * p.z + kxy * xx + kyz * yz + kxz * xz + kxyz * xx * p.z};
}

/// Whether the cubic keeps the sign of `above` over [0, 1] for sure: its control points do (Bernstein).
VKT_HD bool stays(Cubic const& f, double end, bool above) {
    constexpr double third = 1.0 / 3;
    double const near = f.d + f.c * third, far = f.d + (2 * f.c + f.b) * third;
    return above ? f.d >= 0 && near >= 0 && far >= 0 && end >= 0 : f.d < 0 && near < 0 && far < 0 && end < 0;
}

/// Whether it rises, or falls, all the way for sure: the control points of its derivative have one sign.
VKT_HD bool is_monotone(Cubic const& f) {
    double const middle = f.c + f.b, end = middle + f.b + 3 * f.a;
    return (f.c >= 0 && middle >= 0 && end >= 0) || (f.c <= 0 && middle <= 0 && end <= 0);
}

/// The crossing between s0 and s1, whose sides differ: regula falsi (Illinois) kept safe by its bracket.
VKT_HD double crossing(Cubic const& f, double s0, double s1, double f0, double f1) {
    bool const above = f1 >= 0;
    int stuck = 0;
    for (int i = 0; i < 60 && s1 - s0 > 1e-12; ++i) {
        double const guess = i < 40 && f1 != f0 ? s0 - f0 * (s1 - s0) / (f1 - f0) : 0.5 * (s0 + s1);
        double const s = guess > s0 && guess < s1 ? guess : 0.5 * (s0 + s1);
        double const value = f(s);
        if ((value >= 0) == above) {
            s1 = s, f1 = value;
            f0 *= stuck == 1 ? 0.5 : 1.0;
            stuck = 1;
            if (value == 0) break;
        } else {
            s0 = s, f0 = value;
            f1 *= stuck == 2 ? 0.5 : 1.0;
            stuck = 2;
        }
    }
    return s1;
}

/// The extrema between 0 and 1, ascending; returns how many there are, at most 2.
VKT_HD int extrema(Cubic f, double* at) {
    int n = 0;
    double const q = f.b * f.b - 3 * f.a * f.c;
    if (!(q > 0)) return 0;
    double const w = -(f.b + (f.b >= 0 ? std::sqrt(q) : -std::sqrt(q)));
    double const one = f.a != 0 ? w / (3 * f.a) : -1, two = w != 0 ? f.c / w : -1;
    double const low = one < two ? one : two, high = one < two ? two : one;
    if (low > 0 && low < 1) at[n++] = low;
    if (high > 0 && high < 1) at[n++] = high;
    return n;
}

} // namespace vkt::render
