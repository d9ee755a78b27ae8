// What a sample at a position is: positions along rows, and the interpolants, for every back end.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/resample/kernels/affine.h"

#include <cmath>
#include <limits>

namespace vkt::VKT_BACKEND {

inline constexpr double magic = 6755399441055744.0; // 1.5 * 2^52: adding it leaves no room for a fraction

VKT_HD double nearest_whole(double p) { return (p + magic) - magic; }
VKT_HD double floor_of(double p) {
    double const r = nearest_whole(p);
    return r > p ? r - 1 : r;
}
/// A whole number below 2^51 as an integer; vectorises everywhere, which conversions of doubles do not.
VKT_HD std::int64_t integer_of(double whole) {
    return detail::bits_as<std::int64_t>(whole + magic) - detail::bits_as<std::int64_t>(magic);
}
VKT_HD double snapped(double p) {
    double const r = nearest_whole(p), d = p - r;
    return d < 1e-9 && d > -1e-9 ? r : p;
}

/// What a finite number becomes is finite, too: beyond the largest of float64 that.
VKT_HD double saturated(double result, double of) {
    constexpr double most = std::numeric_limits<double>::max();
    double const kept = result > most ? most : result < -most ? -most : result;
    return of - of == 0 ? kept : result; // NOLINT(misc-redundant-expression): NaN, and what is not finite
}

/// Between a and b where their difference has room in R; not finite where it has not. From the nearer one on: nothing
/// is lost of values that are large and alike, and no rounding leads beyond either.
template <class R> VKT_HD R quickly_between(R a, R b, R f) {
    bool const second = f > R(0.5);
    return (second ? b : a) + (second ? f - 1 : f) * (b - a);
}
/// Between a and b, never beyond either; at 0 all of a, whatever b is. The bits of quickly_between() where that is
/// finite, and of values a power of two smaller where their difference has no room.
template <class R> VKT_HD R between(R a, R b, R f) {
    auto const is_finite = [](R v) { return v - v == 0; }; // NOLINT(misc-redundant-expression): NaN, too
    R const quick = quickly_between(a, b, f), half = quickly_between(a / 2, b / 2, f);
    if (is_finite(quick)) return quick;
    return is_finite(half) ? 2 * half : f == 0 ? a : (1 - f) * a + f * b;
}
struct QuicklyBetween {
    template <class R> VKT_HD R operator()(R a, R b, R f) const { return quickly_between(a, b, f); }
};
struct AlwaysBetween {
    template <class R> VKT_HD R operator()(R a, R b, R f) const { return between(a, b, f); }
};

/// The interpolants, by the voxels around floor(position), v(i, j, k), and the fractions.
struct Linear {
    static constexpr Interpolant kind = Interpolant::linear;
    template <class V> VKT_HD static double value(V const& v, double x, double y, double z) {
        return between(between(between(v(0, 0, 0), v(1, 0, 0), x), between(v(0, 1, 0), v(1, 1, 0), x), y),
                       between(between(v(0, 0, 1), v(1, 0, 1), x), between(v(0, 1, 1), v(1, 1, 1), x), y), z);
    }
};

/// What has no weight takes no part, whatever it is.
VKT_HD double term_of(double weight, double value) { return weight == 0 ? 0 : weight * value; }

/// A sum over N^3 voxels from `First` on, with weights along each axis: the columns of the same place in x first.
template <int N, int First, class V>
VKT_HD double weighted(V const& v, double const* wx, double const* wy, double const* wz) {
    double column[N] = {};
    for (int k = 0; k < N; ++k) {
        double slice[N] = {};
        for (int j = 0; j < N; ++j)
            for (int i = 0; i < N; ++i) slice[i] += term_of(wy[j], v(First + i, First + j, First + k));
        for (int i = 0; i < N; ++i) column[i] += term_of(wz[k], slice[i]);
    }
    double sum = 0;
    for (int i = 0; i < N; i += 2) sum += term_of(wx[i], column[i]) + term_of(wx[i + 1], column[i + 1]);
    return sum;
}
/// The interpolant of degree N - 1 whose weights Kernel::weights(fraction, w) gives.
template <class Kernel, int N> struct Convolution {
    template <class V> VKT_HD static double value(V const& v, double x, double y, double z) {
        double wx[N], wy[N], wz[N];
        Kernel::weights(x, wx);
        Kernel::weights(y, wy);
        Kernel::weights(z, wz);
        return weighted<N, 1 - N / 2>(v, wx, wy, wz);
    }
};

struct Cubic : Convolution<Cubic, 4> {
    static constexpr Interpolant kind = Interpolant::cubic;
    VKT_HD static void weights(double f, double* w) {
        w[0] = ((-0.5 * f + 1) * f - 0.5) * f;
        w[1] = (1.5 * f - 2.5) * f * f + 1;
        w[2] = ((-1.5 * f + 2) * f + 0.5) * f;
        w[3] = (0.5 * f - 0.5) * f * f;
    }
};

struct BSpline3 : Convolution<BSpline3, 4> {
    static constexpr Interpolant kind = Interpolant::bspline3;
    VKT_HD static void weights(double f, double* w) {
        double const g = 1 - f;
        w[0] = g * g * g * (1.0 / 6);
        w[1] = (4 - 3 * f * f * (2 - f)) * (1.0 / 6);
        w[2] = (4 - 3 * g * g * (2 - g)) * (1.0 / 6);
        w[3] = f * f * f * (1.0 / 6);
    }
};

struct BSpline5 : Convolution<BSpline5, 6> {
    static constexpr Interpolant kind = Interpolant::bspline5;
    VKT_HD static double inner(double t) { return (66 - t * t * (60 - t * t * (30 - 10 * t))) * (1.0 / 120); }
    VKT_HD static double middle(double t) {
        return (51 + t * (75 - t * (210 - t * (150 - t * (45 - 5 * t))))) * (1.0 / 120);
    }
    VKT_HD static void weights(double f, double* w) {
        double const g = 1 - f;
        w[0] = g * g * (g * g) * g * (1.0 / 120);
        w[1] = middle(1 + f);
        w[2] = inner(f);
        w[3] = inner(g);
        w[4] = middle(1 + g);
        w[5] = f * f * (f * f) * f * (1.0 / 120);
    }
};

struct Lanczos3 : Convolution<Lanczos3, 6> {
    static constexpr Interpolant kind = Interpolant::lanczos3;
    VKT_HD static void weights(double f, double* w) {
        // sin(pi t) sin(pi t / 3) / t^2 at t = f + 2 - i. The first factor is that of f up to its sign; the second has
        // three phases.
        constexpr double pi = 3.14159265358979323846, half_root3 = 0.86602540378443864676;
        double const s = std::sin(pi / 3 * f), c = std::cos(pi / 3 * f);
        double const a = s, b = 0.5 * s + half_root3 * c, d = -0.5 * s + half_root3 * c; // of f, f + 1, f + 2
        double const phase[6] = {d, -b, a, d, -b, a}; // with the signs of both factors, but for one that all share
        double sum = 0;
        for (int i = 0; i < 6; ++i) {
            double const t = f + 2 - i;
            w[i] = phase[i] / (t == 0 ? 1 : t * t);
            sum += w[i];
        }
        for (int i = 0; i < 6; ++i) w[i] = f == 0 ? (i == 2 ? 1 : 0) : w[i] / sum;
    }
};

struct Nearest {
    static constexpr Interpolant kind = Interpolant::nearest;
    template <class V> VKT_HD static double value(V const& v, double x, double y, double z) {
        double const half = 0.5 - face_slack;
        return v(x >= half ? 1 : 0, y >= half ? 1 : 0, z >= half ? 1 : 0);
    }
};

/// The positions of one row along one axis of the input: monotone in x.
struct PositionLine {
    double base = 0, step = 0;
    VKT_HD double operator()(double x) const { return snapped(base + x * step); }
    /// The floor of the position, and the fraction beyond it: what floor_of() and a difference give, in fewer steps.
    VKT_HD double floor(double x, double& fraction) const {
        double const p = base + x * step, r = nearest_whole(p), d = p - r;
        bool const below = d <= -1e-9;
        fraction = below ? d + 1 : d < 1e-9 ? 0 : d;
        return below ? r - 1 : r;
    }
};
struct PositionRow {
    PositionLine x, y, z;
    PositionLine const& line(int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};

/// Positions of output row (y, z), `shift` voxels of the input aside.
VKT_HD PositionRow row_of(Affine const& map, Vec3 shift, std::int64_t y, std::int64_t z) {
    auto const fy = static_cast<double>(y), fz = static_cast<double>(z);
    auto const &slow = map.column[1], &slowest = map.column[2];
    return {{map.offset.x + slow.x * fy + slowest.x * fz + shift.x, map.column[0].x},
            {map.offset.y + slow.y * fy + slowest.y * fz + shift.y, map.column[0].y},
            {map.offset.z + slow.z * fy + slowest.z * fz + shift.z, map.column[0].z}};
}

} // namespace vkt::VKT_BACKEND
