// Threshold: closed ranges of the compute type, which mean the same as the numbers given.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/threshold.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"

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
        if (is_integer(in.type)) return map<C>(execution, out, losses, inside, in);
        map<C>(execution, out, losses, InsideOrNan<C>{inside}, in);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
