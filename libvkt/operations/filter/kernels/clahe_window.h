// What CLAHE makes of a voxel on every back end: between which bricks it lies, which bin it is in, and the way back.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/kernels/clahe.h"

namespace vkt::VKT_BACKEND {

/// The two bricks between whose centres a voxel lies along an axis, and how far it is from the first.
struct Between {
    std::int32_t first, second;
    double weight;
};

/// Along one axis: (i + 1/2) / length of a brick - 1/2, from the first brick's centre to the last one's.
struct AxisBlend {
    double lower, bricks, voxels;

    AxisBlend(BrickGrid const& grid, int axis)
        : lower(static_cast<double>(grid.box.lower[axis])), bricks(static_cast<double>(grid.bricks[axis])),
          voxels(static_cast<double>(grid.box.dims()[axis])) {}

    VKT_HD Between at(double i) const {
        double position = (i - lower + 0.5) * bricks / voxels - 0.5;
        position = position > 0 ? position : 0;
        position = position < bricks - 1 ? position : bricks - 1;
        auto const first = static_cast<std::int32_t>(position);
        auto const last = static_cast<std::int32_t>(bricks) - 1;
        return {first, first < last ? first + 1 : last, position - static_cast<double>(first)};
    }
};

template <class C> VKT_HD C blend(C a, C b, C weight) { return a + weight * (b - a); }

/// Where a voxel's value lies among the bins.
template <class C> struct Place {
    std::int32_t bin;
    C rest;
};

/// From values to bins, and from shares to values. C is float or double.
template <class C> struct IntensityWindow {
    std::int32_t bins;
    C low, high, scale, unscale, scaled_low, scaled_width, per_unit;

    explicit IntensityWindow(ClaheField const& f)
        : bins(f.bins), low(static_cast<C>(f.low)), high(static_cast<C>(f.high)), scale(static_cast<C>(f.scale)),
          unscale(static_cast<C>(1 / f.scale)), scaled_low(static_cast<C>(f.scaled_low)),
          scaled_width(static_cast<C>(f.scaled_width)), per_unit(static_cast<C>(f.per_unit)) {}

    VKT_HD Place<C> place(C v) const {
        C at = (v * scale - scaled_low) * per_unit;
        at = at > C(0) ? at : C(0); // NaN becomes 0
        C const last = static_cast<C>(bins - 1);
        auto const bin = static_cast<std::int32_t>(at < last ? at : last);
        C const rest = at - static_cast<C>(bin);
        return {bin, rest < C(1) ? rest : C(1)};
    }
    VKT_HD C value(C share, C v) const {
        C result = (scaled_low + share * scaled_width) * unscale;
        result = result > low ? result : low;
        result = result < high ? result : high;
        return v == v ? result : v;
    }
    VKT_HD bool outside(C v) const { return v < low || v > high; }
};

/// 64-bit integers count from the base, as doubles.
VKT_HD double distance(Int128 v, Int128 base) { return static_cast<double>(v - base); }
VKT_HD Int128 from_distance(double d, Int128 base) { return base + static_cast<Int128>(__builtin_rint(d)); }

/// Calls map(V{}, C{}): the type that voxels are given as, and that of the curves.
template <class Map> void clahe_in_type(ClaheField const& field, Losses& losses, Map const& map) {
    Losses found;
    if (field.whole)
        map(Int128{}, double{}, found);
    else if (field.wide)
        map(double{}, double{}, found);
    else
        map(float{}, float{}, found);
    losses.clipped += found.clipped + found.undefined;
}

} // namespace vkt::VKT_BACKEND
