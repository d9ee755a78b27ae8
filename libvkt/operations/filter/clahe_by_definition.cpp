// CLAHE once more, as its manual page defines it: shares of voxels, curves and blends by sums in long double. What vkt
// stress compares results with.
// SPDX-License-Identifier: MIT
#include "libvkt/core/type_dispatch.h"
#include "libvkt/core/wide.h"
#include "libvkt/operations/filter/clahe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace vkt {
namespace {

using Real = long double; // holds integers of 64 bits

/// Bricks of equal size along one axis, of which a voxel that lies across a face is in both.
struct AxisBricks {
    std::int64_t voxels = 1, bricks = 1;

    Real width() const { return static_cast<Real>(voxels) / static_cast<Real>(bricks); }
    Real share(std::int64_t brick, std::int64_t voxel) const {
        Real const from = std::max(static_cast<Real>(voxel), width() * static_cast<Real>(brick));
        Real const to = std::min(static_cast<Real>(voxel + 1), width() * static_cast<Real>(brick + 1));
        return std::max(Real{0}, to - from);
    }
    /// The first and the one after the last brick that a voxel may have a share in.
    std::pair<std::int64_t, std::int64_t> touched(std::int64_t voxel) const {
        return {voxel * bricks / voxels, std::min(bricks, (voxel + 1) * bricks / voxels + 1)};
    }
    /// The first of the bricks whose centres a voxel lies between, and the weight of the second.
    std::pair<std::int64_t, Real> between(std::int64_t voxel) const {
        Real const at = std::clamp((static_cast<Real>(voxel) + Real(0.5)) / width() - Real(0.5), Real{0},
                                   static_cast<Real>(bricks - 1));
        auto const first = std::min(static_cast<std::int64_t>(at), std::max<std::int64_t>(0, bricks - 2));
        return {first, at - static_cast<Real>(first)};
    }
};

/// Shares of the voxels below each edge of the bins, after these were cut and what was cut off spread over all.
std::vector<Real> curve_of(std::vector<Real> const& heights, ClipRule rule, Real clip) {
    auto const n = static_cast<Real>(heights.size());
    Real mass = 0, tallest = 0;
    for (Real const h : heights) {
        mass += h;
        tallest = std::max(tallest, h);
    }
    auto const excess = [&](Real at) {
        Real sum = 0;
        for (Real const h : heights) sum += std::max(Real{0}, h - at);
        return sum;
    };
    Real cut = rule == ClipRule::opencv    ? clip * mass / n
               : rule == ClipRule::skimage ? clip * mass
               : rule == ClipRule::volkit  ? clip * tallest
                                           : 0;
    if (rule == ClipRule::pizer && clip > 1) { // the height to cut at is found by halving
        Real low = 0, high = tallest;
        for (int i = 0; i < 80; ++i) {
            Real const middle = (low + high) / 2;
            (middle + excess(middle) / n < clip * mass / n ? low : high) = middle;
        }
        cut = high;
    }
    Real const spread = mass > 0 ? excess(cut) / n : 1;
    std::vector<Real> curve(heights.size() + 1, 0);
    for (std::size_t i = 0; i < heights.size(); ++i) curve[i + 1] = curve[i] + std::min(heights[i], cut) + spread;
    Real const sum = curve.back();
    for (Real& point : curve) point /= sum;
    return curve;
}

std::vector<Real> values_of(ConstView view) {
    Box const box = view.box;
    std::vector<Real> values;
    values.reserve(static_cast<std::size_t>(box.voxels()));
    with_type(view.type, [&]<class T>(T) {
        View<T const> const voxels = view.as<T>();
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                    if constexpr (std::is_integral_v<T>)
                        values.push_back(static_cast<Real>(voxels(x, y, z)));
                    else
                        values.push_back(static_cast<Real>(static_cast<double>(voxels(x, y, z))));
    });
    return values;
}

} // namespace

std::optional<WrongVoxel> Clahe::wrong_voxel(ConstView input, ConstView output) const {
    // Ends that are no voxels may be rounded, and then it is not certain on which side of an edge a voxel lies.
    if (range_.low.percentile != range_.high.percentile || !range_.depends() || range_.percentiles())
        return std::nullopt;
    Box const box = window_.field.grid.box;
    Index3 const n = box.dims(), whole = input.box.dims();
    std::vector<Real> const in = values_of(input), out = values_of(output);
    auto const for_each = [&](auto const& look) {
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) {
                    Index3 const p = box.lower + Index3{x, y, z};
                    look(x, y, z, static_cast<std::size_t>((p.z * whole.y + p.y) * whole.x + p.x));
                }
    };
    Real low = std::numeric_limits<Real>::infinity(), high = -low;
    for_each([&](auto, auto, auto, std::size_t i) {
        if (!std::isfinite(in[i])) return;
        low = std::min(low, in[i]);
        high = std::max(high, in[i]);
    });
    Real const width = high - low;
    if (!(width >= 0x1p-900L && width <= 0x1p900L)) return std::nullopt; // no window, or edges beyond double precision

    // Bins of integers are exact. Of floats nothing is told where one comes so near to an edge that its rounding
    // counts.
    auto const bins = static_cast<std::size_t>(bin_count_);
    bool certain = true;
    std::vector<std::size_t> bin(in.size(), 0);
    for_each([&](auto, auto, auto, std::size_t i) {
        if (std::isnan(in[i])) return;
        Real const v = std::clamp(in[i], low, high), at = (v - low) / width * static_cast<Real>(bins);
        if (is_integer(input_.dtype)) {
            Int128 const slot = static_cast<Int128>(v - low) * static_cast<Int128>(bins) / static_cast<Int128>(width);
            bin[i] = std::min(bins - 1, static_cast<std::size_t>(slot));
            return;
        }
        bin[i] = std::min(bins - 1, static_cast<std::size_t>(at));
        Real const to_edge = std::abs(at - std::round(at)) * width / static_cast<Real>(bins);
        bool const inner = v > low && v < high;
        certain = certain && !(inner && to_edge <= 0x1p-50L * std::max(std::abs(low), std::abs(high)));
    });
    if (!certain) return std::nullopt;

    std::array<AxisBricks, 3> parts;
    for (int axis = 0; axis < 3; ++axis)
        parts[static_cast<std::size_t>(axis)] = {n[axis], std::min(bricks_[axis], n[axis])};
    auto const& [px, py, pz] = parts;
    auto const brick = [&, bx = px.bricks, by = py.bricks](std::int64_t a, std::int64_t b, std::int64_t c) {
        return static_cast<std::size_t>((c * by + b) * bx + a);
    };
    std::vector<std::vector<Real>> curves(static_cast<std::size_t>(px.bricks * py.bricks * pz.bricks),
                                          std::vector<Real>(bins, 0));
    for_each([&](std::int64_t x, std::int64_t y, std::int64_t z, std::size_t i) {
        if (std::isnan(in[i])) return;
        auto const tx = parts[0].touched(x), ty = parts[1].touched(y), tz = parts[2].touched(z);
        for (std::int64_t c = tz.first; c < tz.second; ++c)
            for (std::int64_t b = ty.first; b < ty.second; ++b)
                for (std::int64_t a = tx.first; a < tx.second; ++a)
                    curves[brick(a, b, c)][bin[i]] +=
                        parts[0].share(a, x) * parts[1].share(b, y) * parts[2].share(c, z);
    });
    for (auto& curve : curves) curve = curve_of(curve, rule_, static_cast<Real>(clip()));

    std::vector<Real> expected = in; // NaN, and what is outside the region
    for_each([&](std::int64_t x, std::int64_t y, std::int64_t z, std::size_t i) {
        if (std::isnan(in[i])) return;
        Real const at = (std::clamp(in[i], low, high) - low) / width * static_cast<Real>(bins);
        std::size_t const below = std::min(bins - 1, static_cast<std::size_t>(at));
        auto const wx = parts[0].between(x), wy = parts[1].between(y), wz = parts[2].between(z);
        Real share = 0;
        for (std::int64_t c = 0; c < 2; ++c)
            for (std::int64_t b = 0; b < 2; ++b)
                for (std::int64_t a = 0; a < 2; ++a) {
                    Real const weight = (a == 1 ? wx.second : 1 - wx.second) * (b == 1 ? wy.second : 1 - wy.second) *
                                        (c == 1 ? wz.second : 1 - wz.second);
                    if (!(weight > 0)) continue;
                    auto const& curve = curves[brick(wx.first + a, wy.first + b, wz.first + c)];
                    share += weight * std::lerp(curve[below], curve[below + 1], at - static_cast<Real>(below));
                }
        expected[i] = low + width * share;
    });
    double const magnitude = static_cast<double>(std::max(std::abs(low), std::abs(high)));
    double const allowed = error_.over(static_cast<double>(width), magnitude) + storing_floor(input_.dtype) +
                           (is_integer(input_.dtype) ? 0.5 : 0);
    std::optional<WrongVoxel> worst;
    Real most = static_cast<Real>(allowed);
    for (std::size_t i = 0; i < out.size(); ++i) {
        bool const same = out[i] == expected[i] || (std::isnan(out[i]) && std::isnan(expected[i]));
        Real const off = std::abs(out[i] - expected[i]);
        if (same || off <= most) continue;
        most = std::isnan(off) ? std::numeric_limits<Real>::infinity() : off;
        worst = WrongVoxel{static_cast<std::int64_t>(i), static_cast<double>(out[i]), static_cast<double>(expected[i]),
                           allowed};
    }
    return worst;
}

} // namespace vkt
