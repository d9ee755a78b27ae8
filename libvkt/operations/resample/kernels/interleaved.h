// Voxels of several slices side by side, on CPUs: what is loaded for a place of a plane belongs to all of its slices.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/resample/kernels/interpolants.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace vkt::VKT_BACKEND {

/// A position in a plane of the input: along x, and along the other axis.
struct PlanePosition {
    double x, row;
};

/// Where the samples of a rectangle of the output look in a plane of the input: a parallelogram.
class Outline {
public:
    /// The corners, one after the other around it, and how far samples look.
    Outline(PlanePosition const (&corners)[4], Reach reach) : reach_(reach) {
        std::copy(std::begin(corners), std::end(corners), std::begin(corners_));
        for (int i = 0; i < 4; ++i) {
            PlanePosition const a = corners_[i], b = corners_[(i + 1) % 4];
            per_row_[i] = a.row == b.row ? 0 : 1 / (b.row - a.row);
        }
    }
    /// Rows of voxels, the first and one beyond the last, that are looked at.
    std::int64_t first_row() const {
        return whole(std::min({corners_[0].row, corners_[1].row, corners_[2].row, corners_[3].row}) - slack) -
               reach_.before;
    }
    std::int64_t end_row() const {
        return whole(std::max({corners_[0].row, corners_[1].row, corners_[2].row, corners_[3].row}) + slack) + 1 +
               reach_.after;
    }
    /// The same for the voxels of a row.
    std::pair<std::int64_t, std::int64_t> range(std::int64_t row) const {
        double const low = static_cast<double>(row - reach_.after) - slack,
                     high = static_cast<double>(row + 1 + reach_.before) + slack;
        double least = 1e300, most = -1e300;
        for (int i = 0; i < 4; ++i) {
            PlanePosition const a = corners_[i], b = corners_[(i + 1) % 4];
            double first = (low - a.row) * per_row_[i], last = (high - a.row) * per_row_[i];
            if (per_row_[i] == 0) {
                if (a.row < low || a.row > high) continue;
                first = 0, last = 1;
            }
            if (first > last) std::swap(first, last);
            first = std::max(first, 0.0), last = std::min(last, 1.0);
            if (first > last) continue;
            double const from = a.x + first * (b.x - a.x), to = a.x + last * (b.x - a.x);
            least = std::min({least, from, to}), most = std::max({most, from, to});
        }
        if (least > most) return {0, 0};
        return {whole(least - slack) - reach_.before, whole(most + slack) + 1 + reach_.after};
    }

private:
    static constexpr double slack = 1e-2; ///< voxels: more than roundings come to
    static std::int64_t whole(double v) { return static_cast<std::int64_t>(std::floor(v)); }

    PlanePosition corners_[4];
    Reach reach_;
    double per_row_[4]; ///< share of the edge that a row takes, 0 for an edge along a row
};

/// The planes of a volume beside an axis that stays, whose positions slices of the output share.
struct SharedPlanes {
    Affine const& map;
    Box box;   ///< of the volume
    int still; ///< the axis that stays, y or z
    int plane; ///< the axis of the planes beside x

    SharedPlanes(Affine const& of, Box const& volume, int axis)
        : map(of), box(volume), still(axis), plane(axis == 2 ? 1 : 2) {}

    PositionRow positions(std::int64_t row, std::int64_t slice) const {
        return plane == 1 ? row_of(map, {}, row, slice) : row_of(map, {}, slice, row);
    }
    /// Of the samples of a tile of the output.
    Outline outline(Box const& tile, Reach reach) const {
        auto const corner = [&](std::int64_t x, std::int64_t row) {
            PositionRow const at = positions(row, tile.lower[still]);
            return PlanePosition{at.x(static_cast<double>(x)) - static_cast<double>(box.lower.x),
                                 at.line(plane)(static_cast<double>(x)) - static_cast<double>(box.lower[plane])};
        };
        std::int64_t const x = tile.upper.x - 1, row = tile.upper[plane] - 1;
        return Outline({corner(tile.lower.x, tile.lower[plane]), corner(x, tile.lower[plane]), corner(x, row),
                        corner(tile.lower.x, row)},
                       reach);
    }
};

/// The part of so many slices that an outline covers. Coordinates are voxels of a view from its first.
template <class T, std::int64_t slices> class Interleaved {
public:
    /// False if that is too much for the caches, or rows have too few voxels. `width` and `rows` are the plane's.
    bool prepare(Outline const& outline, std::int64_t width, std::int64_t rows) {
        first_row_ = std::max<std::int64_t>(outline.first_row(), 0);
        end_row_ = std::min(outline.end_row(), rows);
        if (width < edge || end_row_ - first_row_ > most_places) return false;
        ranges_.clear();
        first_x_ = width - edge;
        std::int64_t end_x = 0;
        for (std::int64_t row = first_row_; row < end_row_; ++row) {
            auto const [begin, end] = outline.range(row);
            Range const range{std::clamp<std::int64_t>(begin, 0, width), std::clamp<std::int64_t>(end, 0, width)};
            if (range.begin < range.end) {
                first_x_ = std::min(first_x_, range.begin);
                end_x = std::max(end_x, range.end + edge);
            }
            ranges_.push_back(range);
        }
        width_ = end_x - first_x_;
        if (width_ <= 0 || width_ * (end_row_ - first_row_) > most_places) return false;
        std::size_t const size = static_cast<std::size_t>(width_ * (end_row_ - first_row_) * slices);
        if (voxels_.size() < size) voxels_.resize(size);
        return true;
    }
    /// `plane` is the first slice's first voxel; the next row's is `across` voxels further, the next slice's `along`.
    void fill(T const* plane, std::int64_t width, std::int64_t across, std::int64_t along) {
        for (std::int64_t row = first_row_; row < end_row_; ++row) {
            Range const range = ranges_[static_cast<std::size_t>(row - first_row_)];
            for (std::int64_t x = range.begin; x < range.end; x += edge) {
                std::int64_t const first = std::min(x, width - edge); // no block reaches beyond the row
                T const* const from = plane + row * across + first;
                T* const to = voxels_.data() + place(first, row) * slices;
                for (std::int64_t slice = 0; slice < slices; slice += edge)
                    transpose_block(from + slice * along, along, to + slice, slices);
            }
        }
    }
    std::int64_t place(std::int64_t x, std::int64_t row) const { return (row - first_row_) * width_ + x - first_x_; }

    /// The voxels of all slices at a place of the plane.
    T const* at(std::int64_t x, std::int64_t row) const { return voxels_.data() + place(x, row) * slices; }
    /// Between the four voxels from a place on, of all slices: what linear interpolation by these fractions gives.
    /// `between` is QuicklyBetween or AlwaysBetween.
    template <class Between>
    void sample(std::int64_t place, float fx, float frow, float* to, Between const& between) const {
        T const *const near = voxels_.data() + place * slices, *const next = near + width_ * slices;
#pragma omp simd
        for (std::int64_t i = 0; i < slices; ++i) {
            float const a = between(static_cast<float>(near[i]), static_cast<float>(near[slices + i]), fx);
            float const b = between(static_cast<float>(next[i]), static_cast<float>(next[slices + i]), fx);
            to[i] = between(a, b, frow);
        }
    }

private:
    static constexpr std::int64_t edge = block_edge<T>;
    static_assert(slices % edge == 0);
    static constexpr std::int64_t most_places = 8192; ///< half a mebibyte of 16 slices in float32

    struct Range {
        std::int64_t begin, end;
    };
    std::vector<T> voxels_; ///< by row, x, slice
    std::vector<Range> ranges_;
    std::int64_t first_x_ = 0, width_ = 0, first_row_ = 0, end_row_ = 0;
};

} // namespace vkt::VKT_BACKEND
