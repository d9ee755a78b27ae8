// Comparing rows of slabs or of bricks, merging them in order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/difference.h"

#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/wide.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/statistics/kernels/difference.h"
#include "libvkt/operations/statistics/slabs.h"

#include <cmath>
#include <limits>
#include <vector>

namespace vkt {

namespace {

/// What rows add up to, one after the other.
class Sum {
public:
    /// `corner`: where the row's voxels count from, `width`: how far apart they are.
    void add(RowDifference const& row, Index3 corner, std::int64_t width, DifferenceResult& to) {
        if (row.differing > 0 && to.differing == 0) to.first = {corner.x + row.first * width, corner.y, corner.z};
        to.differing += row.differing;
        to.max_abs = std::max(to.max_abs, row.max_abs);
        squares_ += row.squares;
        low_ = std::min(low_, row.low);
        high_ = std::max(high_, row.high);
    }
    /// Of so many voxels in all.
    void end(std::int64_t count, DifferenceResult& to) const {
        to.count = count;
        long double const rmse = std::sqrt(squares_ / static_cast<long double>(count));
        long double const range = high_ > low_ ? static_cast<long double>(high_) - low_ : 0;
        to.rmse = static_cast<double>(rmse);
        to.range = static_cast<double>(range);
        to.psnr =
            rmse > 0 ? static_cast<double>(20 * std::log10(range / rmse)) : std::numeric_limits<double>::infinity();
    }

private:
    long double squares_ = 0;
    double low_ = std::numeric_limits<double>::infinity(), high_ = -std::numeric_limits<double>::infinity();
};

void compare_slabs(Source& a, Source& b, Execution const& execution, DifferenceResult& to) {
    Header const &ha = a.header(), &hb = b.header();
    Execution const on = where_looked_at(execution, a.space() == Space::device && b.space() == Space::device);
    Cut const cut = cut_of(ha, slab_hint_on(on, ha, a.natural_slab()), on);
    a.expect(box_of(ha.dims));
    b.expect(box_of(hb.dims));
    Slabs slabs_a(a, on), slabs_b(b, on);
    std::vector<RowDifference> rows;
    Sum sum;
    for_each_piece(box_of(ha.dims), cut, [&](Box const& box) {
        SlabPair const pair{slabs_a.at(box), slabs_b.at(box), ha.values, hb.values};
        std::int64_t const ny = box.dims().y;
        rows.resize(static_cast<std::size_t>(ny * box.dims().z));
        difference_rows(pair, rows.data(), on);
        for (std::size_t i = 0; i < rows.size(); ++i) {
            auto const at = static_cast<std::int64_t>(i);
            sum.add(rows[i], {0, box.lower.y + at % ny, box.lower.z + at / ny}, 1, to);
        }
    });
    sum.end(ha.voxels(), to);
}

/// The cells of a brick that a region has a part of: a coarse one is not left out because its centre is elsewhere.
Box cells_reaching_into(Box const& region, Brick const& brick, Index3 width) {
    Box cells;
    for (int a = 0; a < 3; ++a) {
        std::int64_t const lower = std::max<std::int64_t>(0, region.lower[a] - brick.lower[a]),
                           upper = std::max<std::int64_t>(0, region.upper[a] - brick.lower[a]);
        cells.lower[a] = lower / width[a];
        cells.upper[a] = std::min(brick.dims[a], (upper + width[a] - 1) / width[a]);
    }
    return cells;
}

/// Cell by cell, where the trees are the same; of bricks that stick out of the region of both, those that reach into
/// it.
void compare_trees(Source& a, Source& b, Execution const& execution, DifferenceResult& to) {
    Execution const on = where_looked_at(execution, false);
    BrickSequence cells_a = a.take_bricks(), cells_b = b.take_bricks();
    BrickTable const& bricks = cells_a.bricks();
    to.same_tree = bricks == cells_b.bricks();
    if (!to.same_tree) return;
    Header const &ha = cells_a.header(), &hb = cells_b.header();
    Box const region = region_of(ha) == region_of(hb) ? region_of(ha) : box_of(ha.dims);
    std::vector<RowDifference> rows;
    Sum sum;
    std::int64_t count = 0;
    for (std::size_t first = 0, n = 0; first < bricks.size(); first += n) {
        n = cells_a.group(first, brick_group_bytes);
        std::byte const *at_a = cells_a.cells(first, n, on.space()), *at_b = cells_b.cells(first, n, on.space());
        for (std::size_t i = first; i < first + n; ++i) {
            Brick const brick = bricks[i];
            Box const box = box_of(brick.dims);
            Index3 const width = cell_width(ha.dims, brick.level);
            Box const inside = cells_reaching_into(region, brick, width);
            if (!inside.empty()) {
                count += inside.voxels();
                std::int64_t const ny = inside.dims().y;
                rows.resize(static_cast<std::size_t>(ny * inside.dims().z));
                difference_rows({dense_view(at_a, ha.dtype, box, on.space()).part(inside),
                                 dense_view(at_b, hb.dtype, box, on.space()).part(inside), ha.values, hb.values},
                                rows.data(), on);
                for (std::size_t r = 0; r < rows.size(); ++r) {
                    auto const row = static_cast<std::int64_t>(r);
                    Index3 const cell = inside.lower + Index3{0, row % ny, row / ny}; // rows count x themselves
                    sum.add(rows[r],
                            {brick.lower.x, brick.lower.y + cell.y * width.y, brick.lower.z + cell.z * width.z},
                            width.x, to);
                }
            }
            at_a += static_cast<std::size_t>(brick.cells()) * size_of(ha.dtype);
            at_b += static_cast<std::size_t>(brick.cells()) * size_of(hb.dtype);
        }
    }
    sum.end(count, to);
}

} // namespace

void require_same_kind(Header const& a, Header const& b) {
    if (a.kind != b.kind)
        throw Error(ErrorKind::usage, "one of the volumes is hierarchical and one is not",
                    "make a grid of it first: vkt resample --like GRID");
}

DifferenceResult compare(Source& a, Source& b, Execution const& execution) {
    Header const &ha = a.header(), &hb = b.header();
    require_same_kind(ha, hb);
    DifferenceResult r;
    r.same_dims = ha.dims == hb.dims;
    r.same_type = ha.dtype == hb.dtype;
    r.same_geometry = r.same_dims && same_place(ha, hb);
    if (r.same_dims && ha.kind == Kind::hierarchical)
        compare_trees(a, b, execution, r);
    else if (r.same_dims)
        compare_slabs(a, b, execution, r);
    a.finish();
    b.finish();
    return r;
}

} // namespace vkt
