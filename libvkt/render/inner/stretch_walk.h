// The stretches of a ray through a brick tree without a list of them: what threads of a GPU have no memory for is found
// anew, macrocell by macrocell, where it is asked for. The same as those of tree_lists.h, cut by macrocells.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/tree.h"

#include <bit>

namespace vkt::render {

/// In the place of lists.
struct NoScratch {};

/// Goes along a ray: places that are asked for must not come before those asked for earlier. Copies go on by
/// themselves.
class StretchWalk {
public:
    VKT_HD StretchWalk(TreeView const& tree, CellGridView const& grid, Ray const& ray, RayPart part)
        : tree_(tree), grid_(grid), slabs_{{ray.entry.x, ray.entry.y, ray.entry.z},
                                           {1 / ray.direction.x, 1 / ray.direction.y, 1 / ray.direction.z},
                                           tree.slack,
                                           part} {
        cells_.start(ray.entry + ray.direction * part.begin - tree.cell_origin, ray.direction, part.end - part.begin,
                     0.0, tree.cell_size, grid.nx, grid.ny, grid.nz);
    }

    /// The stretch that holds the place t of the part.
    VKT_HD Stretch at(double t) {
        reach(t);
        Stretch here = stretch(t);
        if (!here.hole()) return here;
        // Where nothing is, steps are those of what comes next.
        StretchWalk ahead = *this;
        while (here.end < slabs_.part.end) {
            ahead.reach(here.end);
            Stretch const next = ahead.stretch(here.end);
            if (!next.hole()) {
                here.level = next.level;
                break;
            }
            here.end = next.end;
        }
        return here;
    }

private:
    /// Where the ray leaves the macrocell, of which the last one goes on to the end.
    VKT_HD double leave() const {
        double const way = cells_.leave();
        return last_ || !(way < cells_.exit) ? slabs_.part.end : slabs_.part.begin + way;
    }
    /// Moves on to the macrocell that holds a place.
    VKT_HD void reach(double t) {
        while (!last_ && !(leave() > t)) {
            last_ = !cells_.advance();
            for (int a = 0; a < 3 && last_; ++a) // back into the grid
                cells_.cell[a] -= cells_.cell[a] == cells_.end[a] ? cells_.step[a] : 0;
        }
    }
    VKT_HD static int level_of(SampledBrick const& brick) {
        // Cells are 2^level finest ones wide; along axes of one cell there is but one width.
        float const *const w = brick.inverse_width, xy = w[0] < w[1] ? w[0] : w[1];
        return 127 - (std::bit_cast<std::int32_t>(xy < w[2] ? xy : w[2]) >> 23);
    }
    /// The stretch at a place in the present macrocell, up to the end of that.
    VKT_HD Stretch stretch(double t) const {
        double const end = leave();
        Stretch found{end < slabs_.part.end ? end : slabs_.part.end, 0, 0, no_level, false};
        std::int32_t lowest = 1 << 30, highest = -1;
        std::int64_t const cell = grid_.index(cells_.cell);
        for (std::int64_t k = tree_.cell_first[cell]; k < tree_.cell_first[cell + 1]; ++k) {
            std::int32_t const id = tree_.cell_bricks[k];
            SampledBrick const& brick = tree_.bricks[id];
            double lower[3], upper[3], enter, leave;
            for (int a = 0; a < 3; ++a) {
                double const width = 1 / static_cast<double>(brick.inverse_width[a]);
                lower[a] = brick.lower[a] - 0.5 * width;
                upper[a] = brick.lower[a] + (static_cast<double>(brick.dims[a]) + 0.5) * width;
            }
            if (!slabs_.cross(lower, upper, enter, leave) || !(leave > t)) continue;
            double const next = enter > t ? enter : leave;
            found.end = next < found.end ? next : found.end;
            if (enter > t) continue;
            ++found.count;
            int const level = level_of(brick);
            found.level = level < found.level ? level : found.level;
            BrickNodes const range = tree_.range[id];
            lowest = range.first < lowest ? range.first : lowest;
            highest = range.last > highest ? range.last : highest;
        }
        if (found.count > 0) found.visible = tree_.visible_before[highest + 1] > tree_.visible_before[lowest];
        return found;
    }

    TreeView const& tree_;
    CellGridView const& grid_;
    detail::Slabs slabs_;
    CellWalk<double> cells_; ///< lengths from where the part begins
    bool last_ = false;      ///< no macrocell comes behind the present one
};

} // namespace vkt::render
