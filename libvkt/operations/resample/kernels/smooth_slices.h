// Cubic, Lanczos and spline samples where an axis stays, on CPUs: slices side by side, which share places and weights.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/operations/resample/kernels/affine_places.h"
#include "libvkt/operations/resample/kernels/interleaved.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

namespace vkt::VKT_BACKEND {

/// The samples of a tile of affine_tile by a kernel of N^3 voxels, in the order of weighted(). Along the axis that
/// stays positions are whole: splines look at `side` slices to either side there, the others at none.
template <class Kernel, int N> class SmoothSlices {
public:
    static constexpr std::int64_t together = affine_tile.z, side = spline_degree(Kernel::kind) > 0 ? 2 : 0;
    static constexpr std::int64_t slices = together + 2 * side;
    static_assert(affine_tile.y == together && affine_tile.x == strip);
    /// Types whose voxels are put side by side: coefficients of splines are floats.
    template <class T> static constexpr bool takes = side == 0 ? sizeof(T) <= 4 : std::is_floating_point_v<T>;

    SmoothSlices(ConstView const& in, AffineSampling const& rule, StillAxis still)
        : in_(in), rule_(rule), still_(still), planes_(rule.map, in.box, still.axis),
          across_(still.axis == 2 ? in.row : in.slice), along_(still.axis == 2 ? in.slice : in.row) {
        Kernel::weights(0, weight_along_);
    }
    SmoothSlices(SmoothSlices const&) = delete;
    SmoothSlices& operator=(SmoothSlices const&) = delete;

    /// The slices of the output whose samples look at nothing beyond the volume along the axis.
    static XRange whole_slices(AffineSampling const& rule, StillAxis still) {
        return {side - still.shift, std::max(side - still.shift, rule.dims[still.axis] - side - still.shift)};
    }
    /// Computes what looks at nothing beyond the volume in a tile of `together` slices; values() has it then. False if
    /// the tile's part of the volume is too much for the caches.
    template <class T> bool sample(Box const& tile, Interleaved<T, slices>& voxels) {
        std::int64_t const slice = tile.lower[still_.axis], rows = tile.dims()[planes_.plane];
        if (!voxels.prepare(planes_.outline(tile, reach_of(Kernel::kind)), in_.box.dims().x,
                            in_.box.dims()[planes_.plane]))
            return false;
        std::int64_t const first = slice + still_.shift - side - in_.box.lower[still_.axis];
        voxels.fill(reinterpret_cast<T const*>(in_.data) + first * along_, in_.box.dims().x, across_, along_);
        for (std::int64_t row = 0; row < rows; ++row) {
            PositionRow const at = planes_.positions(tile.lower[planes_.plane] + row, slice);
            XRange const quick = ranges_of({tile.lower.x, tile.upper.x}, at, rule_, still_.axis).interior;
            PositionLine const& line = at.line(planes_.plane);
            for (std::int64_t x = quick.begin; x < quick.end; ++x) {
                double fx, frow, wx[N], wrow[N];
                auto const column = static_cast<std::int64_t>(at.x.floor(static_cast<double>(x), fx));
                auto const in_row = static_cast<std::int64_t>(line.floor(static_cast<double>(x), frow));
                Kernel::weights(fx, wx);
                Kernel::weights(frow, wrow);
                double sample[together];
                sum(voxels, column - in_.box.lower.x, in_row - in_.box.lower[planes_.plane], wx, wrow, sample);
                for (std::int64_t i = 0; i < together; ++i) value(row, i, x - tile.lower.x) = sample[i];
            }
        }
        return true;
    }
    /// Of output row (y, z) of the tile that was sampled last, by x from the tile's first.
    double const* values(Box const& tile, std::int64_t y, std::int64_t z) const {
        std::int64_t const row = still_.axis == 2 ? y - tile.lower.y : z - tile.lower.z;
        std::int64_t const slice = still_.axis == 2 ? z - tile.lower.z : y - tile.lower.y;
        return values_ + (row * together + slice) * strip;
    }

private:
    static constexpr int before = N / 2 - 1;

    double& value(std::int64_t row, std::int64_t slice, std::int64_t x) {
        return values_[(row * together + slice) * strip + x];
    }

    /// to[i] += w times what slice i, of those beside each other in `from`, and its neighbours come to along the axis.
    template <class V> void add_along(V const* from, double w, double* to) const {
        double total[together] = {};
        for (int k = 0; k < N; ++k) {
            double const along = weight_along_[k];
            if (along == 0) continue; // what has no weight takes no part
            V const* const shifted = from + side + k - before;
#pragma omp simd
            for (std::int64_t i = 0; i < together; ++i) total[i] += along * static_cast<double>(shifted[i]);
        }
#pragma omp simd
        for (std::int64_t i = 0; i < together; ++i) to[i] += w * total[i];
    }
    /// What a column, all rows of it, comes to in each slice: y before z, whichever of them stays.
    template <class T>
    void sum_column(Interleaved<T, slices> const& voxels, std::int64_t x, std::int64_t row, double const (&wrow)[N],
                    double* to) const {
        std::fill_n(to, together, 0.0);
        double rows[slices] = {};
        for (int j = 0; j < N; ++j) {
            double const w = wrow[j];
            if (w == 0) continue;
            T const* const from = voxels.at(x, row - before + j);
            if (side > 0 && planes_.plane == 2) {
                add_along(from, w, to);
                continue;
            }
#pragma omp simd
            for (std::int64_t i = 0; i < slices; ++i) rows[i] += w * static_cast<double>(from[i]);
        }
        if (side == 0) std::copy_n(rows, together, to);
        if (side > 0 && planes_.plane == 1) add_along(rows, 1, to);
    }
    template <class T>
    void sum(Interleaved<T, slices> const& voxels, std::int64_t x, std::int64_t row, double const (&wx)[N],
             double const (&wrow)[N], double* to) const {
        double total[together] = {};
        for (int i = 0; i < N; i += 2) {
            double pair[2][together];
            for (int c = 0; c < 2; ++c)
                if (wx[i + c] != 0)
                    sum_column(voxels, x - before + i + c, row, wrow, pair[c]);
                else
                    std::fill_n(pair[c], together, 0.0);
#pragma omp simd
            for (std::int64_t s = 0; s < together; ++s) total[s] += wx[i] * pair[0][s] + wx[i + 1] * pair[1][s];
        }
        std::copy_n(total, together, to);
    }

    ConstView in_;
    AffineSampling const& rule_;
    StillAxis still_;
    SharedPlanes planes_;
    std::int64_t across_, along_;
    double weight_along_[N];
    Buffer memory_{static_cast<std::size_t>(together * together * strip) * sizeof(double)};
    double* values_ = reinterpret_cast<double*>(memory_.write(Space::host)); ///< by row, slice, x
};

} // namespace vkt::VKT_BACKEND
