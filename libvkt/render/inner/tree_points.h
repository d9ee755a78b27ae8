// Values and gradients of a brick tree at single points, for rays that go anywhere.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"
#include "libvkt/render/inner/tree.h"

namespace vkt::render {

/// The ScalarField of a brick tree: the basis reconstruction, in positions of doubles. Scratch is a TreeScratch by a
/// name that only one object file knows, as march_tree() has it.
template <class T, class Scratch> struct TreePoints {
    using Real = double;
    using Vector = Double3;
    static constexpr bool skips_exactly = true;
    static constexpr std::int64_t most = 64; ///< bricks of a macrocell that are asked one by one

    TreeView const& tree;
    CellGridView const& grid;
    Double3 lower, upper; ///< of what is shown
    Scratch& scratch;

    VKT_HD static Vector place(Double3 p) { return p; }
    VKT_HD Vector cell_origin() const { return tree.cell_origin; }
    VKT_HD Real cell_size() const { return tree.cell_size; }

    VKT_HD std::int64_t cell_at(Double3 p) const {
        double const per = 1 / tree.cell_size;
        double const place[3] = {(p.x - tree.cell_origin.x) * per, (p.y - tree.cell_origin.y) * per,
                                 (p.z - tree.cell_origin.z) * per};
        int const count[3] = {grid.nx, grid.ny, grid.nz};
        int cell[3];
        for (int a = 0; a < 3; ++a) {
            auto const i = static_cast<int>(place[a]);
            cell[a] = i < 0 ? 0 : i < count[a] ? i : count[a] - 1;
        }
        return grid.index(cell);
    }

    VKT_HD float value(Double3 p) const { return look(p).value; }

    /// Central differences over one cell of the finest brick that reaches the point: in one level those of a lattice.
    /// What is outside of the picture counts as what is on its border; next to a hole the difference is one-sided.
    VKT_HD Float3 gradient(Double3 p) const {
        Look const middle = look(p);
        double const width = static_cast<double>(middle.width);
        float const at[3] = {slope(p, {1, 0, 0}, width, middle.value), slope(p, {0, 1, 0}, width, middle.value),
                             slope(p, {0, 0, 1}, width, middle.value)};
        return {at[0], at[1], at[2]};
    }

private:
    struct Look {
        float value, width; ///< NaN: no data; edge of the finest cells that reach the point
    };

    VKT_HD Double3 limited(Double3 p) const {
        auto const between = [](double v, double low, double high) __attribute__((always_inline)) {
            return v < low ? low : v > high ? high : v;
        };
        return {between(p.x, lower.x, upper.x), between(p.y, lower.y, upper.y), between(p.z, lower.z, upper.z)};
    }
    VKT_HD float slope(Double3 p, Double3 axis, double width, float middle) const {
        float const before = value(limited(p - axis * width)), behind = value(limited(p + axis * width));
        bool const back = before == before, front = behind == behind;
        float const difference = (front ? behind : middle) - (back ? before : middle);
        return difference * (back && front ? 0.5F : 1.0F) / static_cast<float>(width);
    }

    VKT_HD Look look(Double3 point) const {
        return with_voxel_type<T>(
            tree.type, [&]<class V>(V) __attribute__((always_inline)) { return look_at<V>(point); });
    }
    template <class V> VKT_HD_CALLED Look look_at(Double3 point) const {
        double const p[3] = {point.x, point.y, point.z};
        V const* const cells = static_cast<V const*>(tree.cells);
        SamplerView<V> const view{tree.nodes, tree.order, tree.bricks, cells};
        std::int64_t const cell = cell_at(point);
        std::int64_t const first = tree.cell_first[cell], last = tree.cell_first[cell + 1];
        float sum = 0, weight = 0, finest = 0;
        auto const add = [&](std::int32_t id) __attribute__((always_inline)) {
            SampledBrick const& brick = tree.bricks[id];
            float q[3];
            if (!vkt::detail::reaches(brick, p, q)) return;
            vkt::detail::visit_cells(view, brick, p, [&](float const* hat, float const*, float cell_value) {
                float const h = hat[0] * hat[1] * hat[2];
                // A cell without weight must not spread its NaN.
                if (h > 0) sum += h * cell_value, weight += h;
            });
            // Along axes of one cell there is but one width.
            float const *const w = brick.inverse_width, xy = w[0] < w[1] ? w[0] : w[1], own = xy < w[2] ? xy : w[2];
            finest = own > finest ? own : finest;
        };
        if (last - first <= most) {
            for (std::int64_t k = first; k < last; ++k) add(tree.cell_bricks[k]);
        } else {
            std::int32_t ids[vkt::detail::most_bricks_at_once], after = -1;
            int count;
            do {
                count = vkt::detail::collect(view, p, after, ids);
                for (int i = 0; i < count; ++i) add(ids[i]);
                if (count > 0) after = ids[count - 1];
            } while (count == vkt::detail::most_bricks_at_once);
        }
        if (!(weight > 0)) return {std::numeric_limits<float>::quiet_NaN(), 1};
        return {sum / weight, 1 / finest};
    }
};

} // namespace vkt::render
