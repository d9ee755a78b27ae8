// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/convert.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

#include <cmath>
#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Values as they are.
template <class C> struct Same {
    [[maybe_unused]] static constexpr bool is_identity = true;
    VKT_HD C operator()(C v) const { return v; }
};

/// Values limited to a range and mapped linearly; those that were outside are counted.
struct Mapped {
    double low, scale, factor, to_low, least, most; ///< see LinearMap

    VKT_HD double operator()(double v) const {
        v = v < least ? least : v; // NaN passes
        v = v > most ? most : v;
        return (v * scale - low) * factor + to_low;
    }
    VKT_HD bool undefined(double v) const { return v < least || v > most; }
};

/// The same of 64-bit integers, exactly from the base on.
struct MappedWhole {
    Int128 base;
    Mapped map;

    VKT_HD double distance(Int128 v) const { return static_cast<double>(v - base); }
    VKT_HD double operator()(Int128 v) const { return map(distance(v)); }
    VKT_HD bool undefined(Int128 v) const { return map.undefined(distance(v)); }
};

/// Finite extremes; C is double or Int128.
template <class C> struct Extremes {
    C low, high;
    bool any = false;

    static VKT_HD bool finite(C v) { return v - v == C(0); }
    VKT_HD void add(C v) { merge({v, v, finite(v)}); }
    VKT_HD void merge(Extremes const& other) {
        if (!other.any) return;
        low = !any || other.low < low ? other.low : low;
        high = !any || other.high > high ? other.high : high;
        any = true;
    }
    void add_row(C const* values, std::int64_t n) {
        if constexpr (std::is_same_v<C, double>) {
            double least = std::numeric_limits<double>::infinity(), most = -least;
#pragma omp simd reduction(min : least) reduction(max : most)
            for (std::int64_t i = 0; i < n; ++i) {
                double const v = values[i];
                least = finite(v) && v < least ? v : least;
                most = finite(v) && v > most ? v : most;
            }
            merge({least, most, least <= most});
        } else {
            for (std::int64_t i = 0; i < n; ++i) add(values[i]);
        }
    }
};

bool is_wide(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

} // namespace

void convert_values(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    if (is_wide(in.type)) return map<Int128>(execution, out, losses, Same<Int128>{}, in);
    if (float_suffices(in.type) && float_suffices(out.type))
        return map<float>(execution, out, losses, Same<float>{}, in);
    map<double>(execution, out, losses, Same<double>{}, in);
}

void find_extremes(ConstView in, FiniteExtremes& found, Execution const& execution) {
    if (is_wide(in.type)) {
        auto const extremes = reduce<Int128>(execution, in, Extremes<Int128>{0, 0});
        found = {static_cast<double>(extremes.low), static_cast<double>(extremes.high), extremes.low, extremes.high};
        return;
    }
    auto const extremes = reduce<double>(execution, in, Extremes<double>{0, 0});
    if (extremes.any) found = {extremes.low, extremes.high, 0, 0};
}

void convert_range(ConstView in, AnyView out, LinearMap const& range, Losses& losses, Execution const& execution) {
    Mapped const mapped{range.low * range.scale, range.scale, range.factor, range.to_low, range.least, range.most};
    Losses found;
    if (is_wide(in.type))
        map<Int128>(execution, out, found, MappedWhole{range.base, mapped}, in);
    else
        map<double>(execution, out, found, mapped, in);
    // What lies in the range fits; the ends of 64-bit types, which double rounds up, only seem not to.
    losses += {found.undefined, found.nan, 0};
}

} // namespace VKT_BACKEND

} // namespace vkt
