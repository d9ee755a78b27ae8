// Threshold: closed ranges of the compute type, which mean the same as the numbers given.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/threshold.h"

#include "libvkt/kernel/closed_range.h"
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

/// Floats, and integers that float holds: compared as they lie on CPUs.
template <class Rule> struct Stored : Rule {
    DataType type;

    bool takes_stored(DataType, DataType in) const { return in != DataType::float16; }
    Losses stored_row(std::int64_t n, std::byte* out, std::byte const* in) const {
        auto* const to = reinterpret_cast<std::uint8_t*>(out);
        Losses losses;
        with_type(type, [&]<class T>(T) {
            auto const* const from = reinterpret_cast<T const*>(in);
            if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
                constexpr float lowest = std::numeric_limits<T>::lowest(), highest = std::numeric_limits<T>::max();
                float const first = std::ceil(std::max(this->low, lowest)),
                            last = std::floor(std::min(this->high, highest));
                if (first > last) // or a cast may overflow
                    std::fill_n(to, n, std::uint8_t{0});
                else
                    inside_row(n, static_cast<T>(first), static_cast<T>(last), from, to);
            } else if constexpr (std::is_same_v<T, float>) {
                inside_row(n, this->low, this->high, from, to);
                std::int32_t nan = 0;
#pragma omp simd reduction(+ : nan)
                for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i)
                    nan += from[i] != from[i] ? 1 : 0; // NOLINT(misc-redundant-expression): NaN
                losses.undefined = nan;
            }
        });
        return losses;
    }
};

struct InsideMapped : InsideOrNan<double> {
    double slope, intercept;
    VKT_HD float operator()(double v) const { return InsideOrNan<double>::operator()(slope* v + intercept); }
};

/// Both ends belong to it.
template <class C> Inside<C> closed(ThresholdRule const& rule) {
    C low = least_from<C>(rule.low.value), high = greatest_to<C>(rule.high.value);
    C const infinite = std::numeric_limits<C>::infinity();
    if (rule.above_low && static_cast<double>(low) == rule.low.value) low = std::nextafter(low, infinite);
    if (rule.below_high && static_cast<double>(high) == rule.high.value) high = std::nextafter(high, -infinite);
    return {low, high};
}
template <> Inside<Int128> closed(ThresholdRule const& rule) {
    auto const end = [](Number const& n, bool outside, int inwards, double whole) {
        if (n.whole) return *n.whole + (outside ? inwards : 0);
        return static_cast<Int128>(std::abs(n.value) < 0x1p100 ? whole : std::copysign(0x1p100, n.value));
    };
    return {end(rule.low, rule.above_low, 1, std::ceil(rule.low.value)),
            end(rule.high, rule.below_high, -1, std::floor(rule.high.value))};
}

} // namespace

void threshold_box(ConstView in, AnyView out, ThresholdRule const& rule, Losses& losses, Execution const& execution) {
    if (!(rule.map == ValueMap{})) {
        InsideMapped const inside{{closed<double>(rule)}, rule.map.slope, rule.map.intercept};
        return map<double>(execution, out, losses, inside, in);
    }
    if (is_integer(in.type) && size_of(in.type) == 8)
        return map<Int128>(execution, out, losses, closed<Int128>(rule), in);
    with_compute_type(in.type, [&]<class C>(C) {
        auto const compare = [&]<class Rule>(Rule const& inside) {
            if constexpr (std::is_same_v<C, float>)
                map_stored<C>(execution, out, losses, Stored<Rule>{inside, in.type}, in);
            else
                map<C>(execution, out, losses, inside, in);
        };
        Inside<C> const inside = closed<C>(rule);
        if (is_integer(in.type))
            compare(inside);
        else
            compare(InsideOrNan<C>{inside});
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
