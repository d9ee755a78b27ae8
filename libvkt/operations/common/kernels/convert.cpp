// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/kernels/convert.h"

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

/// to[i] = the integer nearest to what the map makes of from[i], where that is in the range of T and all values are in
/// that of the map: neither is limited then.
template <class T> void map_row(std::int64_t n, Mapped const f, float const* from, T* to) {
    constexpr double to_whole = 6755399441055744.0; // as in round_to
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double const value = (static_cast<double>(from[i]) - f.low) * f.factor + f.to_low;
        to[i] = static_cast<T>(detail::bits_as<std::int64_t>(value + to_whole));
    }
}

/// The same of values that float holds: on CPUs limited and counted as floats if the ends of the range are some.
struct MappedFloats {
    Mapped map;
    DataType type;     ///< of the results
    float least, most; ///< floats in the range

    MappedFloats(Mapped const& of, DataType out)
        : map(of), type(out), least(least_from<float>(of.least)), most(greatest_to<float>(of.most)) {}
    VKT_HD double operator()(float v) const { return map(static_cast<double>(v)); }
    VKT_HD bool undefined(float v) const { return v < least || v > most; }

    bool takes_stored(DataType out, DataType in) const {
        return in == DataType::float32 && map.scale == 1 && is_integer(out) && size_of(out) <= 2;
    }
    Losses stored_row(std::int64_t n, std::byte* out, std::byte const* in) const {
        auto const* const from = reinterpret_cast<float const*>(in);
        float const first = least, last = most;
        std::int32_t inside = 0;
#pragma omp simd reduction(+ : inside)
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i)
            inside += (from[i] >= first ? 1 : 0) & (from[i] <= last ? 1 : 0);
        Losses losses;
        with_type(type, [&]<class T>(T) {
            if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
                auto* const to = reinterpret_cast<T*>(out);
                if (inside == n) return map_row(n, map, from, to);
                alignas(64) double values[row_piece];
                row(n, values, from);
                losses = store_row(type, static_cast<double const*>(values), out, n);
                losses.undefined = n - inside - losses.nan;
            }
        });
        return losses;
    }

    void row(std::int64_t n, double* out, float const* in) const {
        Mapped const f = map; // see driver::apply
        float const first = least, last = most;
        if (static_cast<double>(first) == f.least && static_cast<double>(last) == f.most && f.scale == 1) {
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) {
                float v = in[i];
                v = v < first ? first : v; // NaN passes
                v = v > last ? last : v;
                out[i] = (static_cast<double>(v) - f.low) * f.factor + f.to_low;
            }
        } else {
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) out[i] = f(static_cast<double>(in[i]));
        }
    }
};

/// The same of 64-bit integers, exactly from the base on.
struct MappedWhole {
    Int128 base;
    Mapped map;

    VKT_HD double distance(Int128 v) const { return static_cast<double>(v - base); }
    VKT_HD double operator()(Int128 v) const { return map(distance(v)); }
    VKT_HD bool undefined(Int128 v) const { return map.undefined(distance(v)); }
};

/// Finite extremes; C is float, double or Int128.
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
        if constexpr (std::is_floating_point_v<C>) {
            C least = std::numeric_limits<C>::infinity(), most = -least;
#pragma omp simd reduction(min : least) reduction(max : most)
            for (std::int64_t i = 0; i < n; ++i) {
                C const v = values[i];
                least = finite(v) && v < least ? v : least;
                most = finite(v) && v > most ? v : most;
            }
            merge({least, most, least <= most});
        } else {
            for (std::int64_t i = 0; i < n; ++i) add(values[i]);
        }
    }
};

VKT_HD std::uint64_t common_divisor(std::uint64_t a, std::uint64_t b) {
    while (b != 0) {
        std::uint64_t const rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/// TypeFit of some values; C is double or Int128. Differences are counted from one of them, `base`.
template <class C> struct Fit {
    C low, high, base;
    double off_whole = 0, off_half = 0, off_single = 0;
    std::uint64_t step = 0;
    bool any = false, nan = false, infinite = false;

    VKT_HD void add(C v) {
        Fit one{v, v, v, 0, 0, 0, 0, true, false, false};
        if constexpr (std::is_same_v<C, double>) {
            one.nan = v != v;
            one.infinite = !one.nan && v - v != 0;
            one.any = !one.nan && !one.infinite;
        }
        if (one.any) {
            if constexpr (std::is_same_v<C, double>) one.off_whole = off(v, std::rint(v));
            one.off_half = off(v, static_cast<double>(Half(static_cast<double>(v))));
            one.off_single = off(v, static_cast<double>(static_cast<float>(v)));
        }
        merge(one);
    }
    VKT_HD void merge(Fit const& o) {
        nan = nan || o.nan;
        infinite = infinite || o.infinite;
        if (!o.any) return;
        if (!any) {
            low = o.low;
            high = o.high;
            base = o.base;
            step = o.step;
        } else {
            step = joined(o);
            low = o.low < low ? o.low : low;
            high = o.high > high ? o.high : high;
        }
        off_whole = o.off_whole > off_whole ? o.off_whole : off_whole;
        off_half = o.off_half > off_half ? o.off_half : off_half;
        off_single = o.off_single > off_single ? o.off_single : off_single;
        any = true;
    }
    void add_row(C const* values, std::int64_t n) {
        for (std::int64_t i = 0; i < n; ++i) add(values[i]);
    }

private:
    static VKT_HD double off(C v, double stored) {
        if constexpr (std::is_same_v<C, double>) {
            double const distance = v - stored;
            return distance < 0 ? -distance : distance;
        } else {
            if (stored - stored != 0) return stored < 0 ? -stored : stored;
            Int128 const distance = v - static_cast<Int128>(stored);
            return static_cast<double>(distance < 0 ? -distance : distance);
        }
    }
    /// Of both together. Differences of more than 2^53 and of values that are no whole numbers have no step.
    VKT_HD std::uint64_t joined(Fit const& o) const {
        if (step == 1 || o.step == 1 || off_whole > 0 || o.off_whole > 0) return 1;
        C const apart = o.base < base ? base - o.base : o.base - base;
        if (!(apart <= static_cast<C>(std::int64_t{1} << 53))) return 1;
        std::uint64_t const distance = static_cast<std::uint64_t>(apart);
        // Most values add nothing new, and one division tells it.
        if (o.step == 0 && step != 0 && distance % step == 0) return step;
        return common_divisor(common_divisor(step, o.step), distance);
    }
};

template <class C> TypeFit fit_of(ConstView in, Execution const& execution) {
    Fit<C> const fit = reduce<C>(execution, in, Fit<C>{0, 0, 0});
    TypeFit result;
    if (fit.any) result.extremes = {static_cast<double>(fit.low), static_cast<double>(fit.high), 0, 0};
    if constexpr (std::is_same_v<C, Int128>) {
        result.extremes.whole_low = fit.low;
        result.extremes.whole_high = fit.high;
    }
    bool const steps = fit.off_whole == 0 && std::abs(static_cast<double>(fit.low)) <= 0x1p62;
    if (std::is_same_v<C, double> && fit.any && steps) {
        result.extremes.whole_low = static_cast<Int128>(fit.low);
        result.extremes.whole_high = static_cast<Int128>(std::min(static_cast<double>(fit.high), 0x1p63));
    }
    result.off_whole = fit.off_whole;
    result.off_half = fit.off_half;
    result.off_single = fit.off_single;
    result.step = steps ? fit.step : 1;
    result.nan = fit.nan;
    result.infinite = fit.infinite;
    return result;
}

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
    auto const find = [&]<class C>(C) {
        auto const extremes = reduce<C>(execution, in, Extremes<C>{0, 0});
        if (extremes.any) found = {static_cast<double>(extremes.low), static_cast<double>(extremes.high), 0, 0};
    };
    if (float_suffices(in.type)) return find(0.0F);
    find(0.0);
}

void find_fit(ConstView in, TypeFit& found, Execution const& execution) {
    found = is_wide(in.type) ? fit_of<Int128>(in, execution) : fit_of<double>(in, execution);
}

void convert_range(ConstView in, AnyView out, LinearMap const& range, Losses& losses, Execution const& execution) {
    Mapped const mapped{range.low * range.scale, range.scale, range.factor, range.to_low, range.least, range.most};
    Losses found;
    if (is_wide(in.type))
        map<Int128>(execution, out, found, MappedWhole{range.base, mapped}, in);
    else if (float_suffices(in.type))
        map_stored<float>(execution, out, found, MappedFloats(mapped, out.type), in);
    else
        map<double>(execution, out, found, mapped, in);
    // What lies in the range fits; the ends of 64-bit types, which double rounds up, only seem not to.
    losses += {found.undefined, found.nan, 0};
}

} // namespace VKT_BACKEND

} // namespace vkt
