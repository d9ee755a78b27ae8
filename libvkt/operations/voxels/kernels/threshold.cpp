// Threshold: closed ranges of the compute type, which mean the same as the numbers given.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/threshold.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/map_stored.h"
#include "libvkt/kernel/rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class C> struct Inside {
    C low, high;
    VKT_HD float operator()(C v) const { return v >= low && v <= high ? 1.0f : 0.0f; }
};
template <class C> struct InsideOrNan : Inside<C> {
    VKT_HD bool undefined(C v) const { return v != v; }
};

/// to[i] = 1 if voxel i is in the range; the loop is a vector of the smaller of both types.
template <class T> void inside_row(std::int64_t n, T const low, T const high, T const* from, std::uint8_t* to) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i)
        to[i] = static_cast<std::uint8_t>((from[i] >= low ? 1 : 0) & (from[i] <= high ? 1 : 0));
}

/// Floats: compared as they lie on CPUs.
struct InsideFloats : InsideOrNan<float> {
    bool takes_stored(DataType, DataType in) const { return in == DataType::float32; }
    Losses stored_row(std::int64_t n, std::byte* to, std::byte const* in) const {
        auto const* const from = reinterpret_cast<float const*>(in);
        inside_row(n, low, high, from, reinterpret_cast<std::uint8_t*>(to));
        std::int32_t nan = 0;
#pragma omp simd reduction(+ : nan)
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i)
            nan += from[i] != from[i] ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
        return {0, 0, nan};
    }
};

/// Integers that float holds: as well.
struct InsideIntegers : Inside<float> {
    DataType type;

    bool takes_stored(DataType, DataType) const { return true; }
    Losses stored_row(std::int64_t n, std::byte* to, std::byte const* in) const {
        with_type(type, [&]<class T>(T) {
            if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
                constexpr float lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
                float const first = std::ceil(std::max(low, lowest)), last = std::floor(std::min(high, highest));
                auto* const inside = reinterpret_cast<std::uint8_t*>(to);
                if (first <= last)
                    inside_row(n, static_cast<T>(first), static_cast<T>(last), reinterpret_cast<T const*>(in), inside);
                else
                    std::fill_n(inside, n, std::uint8_t{0});
            }
        });
        return {};
    }
};
struct InsideMapped : InsideOrNan<double> {
    double slope, intercept;
    VKT_HD float operator()(double v) const { return InsideOrNan<double>::operator()(slope* v + intercept); }
};

/// The value of C nearest to a number on the side of `to`, or the next one on that side if the end itself is outside.
template <class C> C end_of(Number const& number, C to, bool outside) {
    double const side = to > C(0) ? 1 : -1, value = number.value;
    if constexpr (std::is_same_v<C, Int128>) {
        if (number.whole) return *number.whole + (outside ? (to > 0 ? 1 : -1) : 0);
        if (!(std::abs(value) < 0x1p100)) return static_cast<Int128>(std::copysign(0x1p100, value));
        return static_cast<Int128>(side > 0 ? std::ceil(value) : std::floor(value));
    } else {
        C const nearest = static_cast<C>(value);
        double const beyond = side * (static_cast<double>(nearest) - value);
        return beyond < 0 || (outside && beyond == 0) ? std::nextafter(nearest, to) : nearest;
    }
}

template <class C> Inside<C> closed(ThresholdRule const& rule, C infinite) {
    return {end_of<C>(rule.low, infinite, rule.above_low), end_of<C>(rule.high, -infinite, rule.below_high)};
}

} // namespace

void threshold_box(ConstView in, AnyView out, ThresholdRule const& rule, Losses& losses, Execution const& execution) {
    double const infinite = std::numeric_limits<double>::infinity();
    if (!(rule.map == ValueMap{})) {
        InsideMapped const inside{{closed<double>(rule, infinite)}, rule.map.slope, rule.map.intercept};
        return map<double>(execution, out, losses, inside, in);
    }
    if (is_integer(in.type) && size_of(in.type) == 8)
        return map<Int128>(execution, out, losses, closed<Int128>(rule, 1), in);
    with_compute_type(in.type, [&]<class C>(C) {
        Inside<C> const inside = closed<C>(rule, static_cast<C>(infinite));
        if constexpr (std::is_same_v<C, float>) {
            if (is_integer(in.type)) return map_stored<C>(execution, out, losses, InsideIntegers{inside, in.type}, in);
            return map_stored<C>(execution, out, losses, InsideFloats{{inside}}, in);
        } else {
            if (is_integer(in.type)) return map<C>(execution, out, losses, inside, in);
            map<C>(execution, out, losses, InsideOrNan<C>{inside}, in);
        }
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
