// Correlation with kernels: dense ones, and sums of separable ones.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/filter/kernels/large_values.h"

#include <vector>

namespace vkt {

/// What a filter along one axis computes from the voxels v(-r) … v(r) around the middle one.
struct AxisTaps {
    enum class Kind : std::uint8_t {
        plain,    ///< sum of w(k) v(k), taps from -r to r
        even,     ///< w(0) v(0) + sum of w(k) (v(k) + v(-k)), taps from 0 to r
        odd,      ///< sum of w(k) (v(k) - v(-k)), taps from 0 to r
        zero_sum, ///< sum of w(k) ((v(k) - v(0)) + (v(-k) - v(0))), taps from 0 to r: exactly 0 for constants
        average,  ///< v(0) plus that: exactly v(0) for constants, a mean if w(0) + 2 sum of w(k) is 1
    };
    Kind kind = Kind::even;
    std::vector<double> taps{1};

    std::int64_t radius() const {
        auto const n = static_cast<std::int64_t>(taps.size());
        return kind == Kind::plain ? n / 2 : n - 1;
    }
};

/// Sums of separable kernels, filtered along x, then y, then z. What several terms share is computed once.
struct SeparableSum {
    struct Plane {
        int x = 0, y = 0; ///< index of the taps
    };
    struct Term {
        int plane = 0, z = 0;
        int part = 0; ///< the sum that it belongs to
        double weight = 1;
    };
    std::vector<AxisTaps> x, y, z;
    std::vector<Plane> planes;
    std::vector<Term> terms; ///< those of a part follow one another
    int parts = 1;           ///< more than one: the result is the root of the sum of their squares
    double offset = 0;       ///< added to the result
    bool wide = false;       ///< computes in float64

    Index3 radius() const;
    /// Multiply-adds a voxel.
    double cost() const;
    /// Output voxels worked on together, and the bytes a thread needs for them.
    Index3 tile() const;
    std::size_t bytes() const;
    /// A power of two by which voxels of any magnitude may be multiplied: nothing in between overflows then.
    double headroom() const;
};

namespace VKT_BACKEND {

/// A power of two by which values may be multiplied before they are squared, `most` being the largest of their
/// magnitudes: neither do sums of squares overflow then, nor is what has a share in them lost below the normal numbers.
template <class C> VKT_HD C scale_for_squares(C most) {
    constexpr bool single = sizeof(C) == 4;
    constexpr C large = single ? C(0x1p40) : C(0x1p300), factor = single ? C(0x1p100) : C(0x1p700);
    return most > large ? 1 / factor : most < 1 / large ? factor : C(1);
}

} // namespace VKT_BACKEND

/// One tap of a dense kernel.
struct Tap {
    Index3 at; ///< offset from the middle
    double weight = 0;
};
struct DenseKernel {
    Index3 radius;
    std::vector<Tap> taps;
    double offset = 0;
    bool wide = false;

    /// As SeparableSum's.
    double headroom() const;
};

VKT_KERNEL(correlate, (ConstView in, AnyView out, SeparableSum const& sum, Losses& losses, Execution const& execution),
           (in, out, sum, losses, execution))
VKT_KERNEL(correlate_dense,
           (ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution),
           (in, out, kernel, losses, execution))

} // namespace vkt
