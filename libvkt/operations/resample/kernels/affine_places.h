// Where rows of an affine map's result look, on CPUs: what of a row lies inside, tiles that stay in the caches, and
// samples at the faces, one by one.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/resample/kernels/interpolants.h"

#include <algorithm>
#include <cmath>

namespace vkt::VKT_BACKEND {

struct XRange {
    std::int64_t begin, end;
};

/// The first x of a range for which `true_from_there_on` says so.
template <class F> std::int64_t first_x(XRange range, F const& true_from_there_on) {
    while (range.begin < range.end) {
        std::int64_t const middle = range.begin + (range.end - range.begin) / 2;
        if (true_from_there_on(middle))
            range.end = middle;
        else
            range.begin = middle + 1;
    }
    return range.begin;
}

/// The part of a range in which low <= position < high.
inline XRange narrowed(XRange range, PositionLine const& line, double low, double high) {
    auto const at = [&](std::int64_t x) { return line(static_cast<double>(x)); };
    auto const holds = [&](std::int64_t x) { return at(x) >= low && at(x) < high; };
    if (range.begin >= range.end || (holds(range.begin) && holds(range.end - 1))) return range;
    if (line.step >= 0) {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) >= low; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) >= high; });
    } else {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) < high; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) < low; });
    }
    return range;
}

/// The part of a piece of a row that is samples, not background. `still`: an axis along which positions are whole and
/// lie in the volume, or none.
inline XRange inside(XRange range, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    for (int axis = 0; axis < 3 && !rule.boundary; ++axis)
        if (axis != still) range = narrowed(range, row.line(axis), first_position(), end_position(rule.dims[axis]));
    range.end = std::max(range.begin, range.end);
    return range;
}

/// The part of it in which the interpolant looks at nothing beyond the volume.
inline XRange interior(XRange range, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    Reach const reach = reach_of(rule.interpolant);
    XRange part = range;
    for (int axis = 0; axis < 3; ++axis)
        if (axis != still)
            part = narrowed(part, row.line(axis), static_cast<double>(reach.before),
                            static_cast<double>(rule.dims[axis] - reach.after));
    return part.begin < part.end ? part : XRange{range.end, range.end};
}

struct RowRanges {
    XRange all, inside, interior;
};
inline RowRanges ranges_of(XRange all, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    XRange const quick = interior(all, row, rule, still);
    if (quick.begin == all.begin && quick.end == all.end) return {all, all, all}; // nearly everywhere
    XRange const part = inside(all, row, rule, still);
    return {all, part, interior(part, row, rule, still)};
}

template <class F> void for_each_row(Box const& box, F const& f) {
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
        for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) f(y, z);
}

/// What became of the voxels of a tile.
struct Tally {
    Losses losses;
    std::int64_t outside = 0;
};

struct NoScratch {};

/// A part of a view, by a function of the back end's own: what is compiled for newer processors must not be left for
/// others to link.
[[gnu::flatten]] inline AnyView part_of(AnyView const& view, Box const& box) { return view.part(box); }

/// Calls f(tile, tally), or f(tile, tally, scratch) with what a thread keeps from tile to tile, for tiles of at most
/// this extent that cover the box: what the samples of a tile look at lies together, however the rows run through the
/// volume.
template <class Scratch = NoScratch, class F>
void for_each_tile(Execution const& execution, Box const& box, Index3 extent, Losses& losses, std::int64_t& outside,
                   F const& f) {
    for_each_tile(execution, threads_for(execution, box.voxels()), box, extent, [&](auto const& each) {
        Tally tally;
        Scratch scratch;
        each([&](Box const& tile) {
            if constexpr (std::is_same_v<Scratch, NoScratch>)
                f(tile, tally);
            else
                f(tile, tally, scratch);
        });
        stream_fence();
        driver::add(losses, tally.losses);
#pragma omp atomic
        outside += tally.outside;
    });
}

/// Where the samples of a row look, if all the voxels lie in the view.
struct Places {
    double lower_x, lower_y, lower_z, row_length, slice_length;
    PositionRow at;

    Places(ConstView const& in, PositionRow const& positions)
        : lower_x(static_cast<double>(in.box.lower.x)), lower_y(static_cast<double>(in.box.lower.y)),
          lower_z(static_cast<double>(in.box.lower.z)), row_length(static_cast<double>(in.row)),
          slice_length(static_cast<double>(in.slice)), at(positions) {}

    /// Where the voxel at the floor of the position of x lies, and the fractions beyond it.
    VKT_HD std::int64_t of(double x, double& fx, double& fy, double& fz) const {
        double const wx = at.x.floor(x, fx), wy = at.y.floor(x, fy), wz = at.z.floor(x, fz);
        return integer_of((wx - lower_x) + (wy - lower_y) * row_length + (wz - lower_z) * slice_length);
    }
};

constexpr std::int32_t strip = 64; ///< samples worked on together

inline std::int64_t whole_of(double whole) {
    double const limit = 0x1p60; // positions may be anything that a header can say
    return static_cast<std::int64_t>(std::clamp(whole, -limit, limit));
}

/// What a view that begins at `first` has for a voxel anywhere, -1 if that is the border. A wrapped volume's may begin
/// and end outside.
inline std::int64_t place_of(std::int64_t at, std::int64_t n, Boundary boundary, std::int64_t first) {
    return boundary == Boundary::wrap ? first + fold(at - first, n, boundary) : fold(at, n, boundary);
}

/// Where a sample anywhere looks, along each axis: what lies outside the volume is folded back or is the border.
template <class Kernel> struct FoldedPlaces {
    static constexpr int before = static_cast<int>(reach_of(Kernel::kind).before),
                         n = before + 1 + static_cast<int>(reach_of(Kernel::kind).after);
    std::int64_t place[3][n] = {}; ///< voxels from the view's first
    bool border[3][n] = {};
    bool any_border = false;
    double fraction[3] = {};

    FoldedPlaces(ConstView const& in, PositionRow const& at, double x, AffineSampling const& rule) {
        Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
        bool const continued =
            spline_degree(Kernel::kind) > 0 && boundary != Boundary::mirror && boundary != Boundary::wrap;
        std::int64_t const stride[3] = {1, in.row, in.slice};
        for (int axis = 0; axis < 3; ++axis) {
            double const p = at.line(axis)(x), whole = std::floor(p);
            fraction[axis] = p - whole;
            std::int64_t const first = whole_of(whole) - before, dims = rule.dims[axis], lower = in.box.lower[axis];
            std::int64_t const beyond = beyond_along(dims, rule.beyond, boundary);
            for (int i = 0; i < n; ++i) {
                std::int64_t const index = continued ? std::clamp(first + i, -beyond, dims - 1 + beyond)
                                                     : place_of(first + i, dims, boundary, lower);
                border[axis][i] = !continued && boundary == Boundary::border && index < 0;
                any_border = any_border || border[axis][i];
                place[axis][i] = (index - lower) * stride[axis];
            }
        }
    }
};

/// The sample at such places, one voxel after another, which data[] gives.
template <class Kernel, class Data> double sample_folded(Data data, FoldedPlaces<Kernel> const& at, double border) {
    constexpr int before = FoldedPlaces<Kernel>::before;
    auto const value = [&](int i, int j, int k) {
        i += before, j += before, k += before;
        return at.border[0][i] || at.border[1][j] || at.border[2][k]
                   ? border
                   : static_cast<double>(data[at.place[0][i] + at.place[1][j] + at.place[2][k]]);
    };
    return Kernel::value(value, at.fraction[0], at.fraction[1], at.fraction[2]);
}

} // namespace vkt::VKT_BACKEND
