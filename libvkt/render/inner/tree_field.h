// Values and gradients of a brick tree at many points of a ray at once: the sums of sample(), brick by brick.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"
#include "libvkt/render/inner/tree.h"

namespace vkt::render {

/// A chunk of positions in finest cells.
struct Points {
    alignas(64) double x[3][chunk];
};

struct Sums {
    alignas(64) float sum[chunk] = {}, weight[chunk] = {};
};

namespace detail {

/// Taps of a chunk of points along one axis of a brick: weights and cells; cells that are not there weigh nothing.
struct Taps {
    alignas(64) float weight[2][chunk];
    alignas(64) std::int32_t cell[2][chunk];

    VKT_HD Taps(double const* p, double lower, double inverse, std::int32_t dims) {
        double const end = static_cast<double>(dims);
        for (int k = 0; k < chunk; ++k) {
            double const place = (p[k] - lower) * inverse - 0.5;
            // Points out of reach weigh nothing at these limits.
            double const above = place > -1.0 ? place : -1.0, q = above < end ? above : end;
            auto const whole = static_cast<std::int32_t>(q + 1.0) - 1; // floor, as q >= -1
            float const t = static_cast<float>(q - static_cast<double>(whole));
            bool const first = whole >= 0 && whole < dims, second = whole + 1 < dims;
            weight[0][k] = first ? 1.0F - t : 0.0F;
            weight[1][k] = second ? t : 0.0F;
            cell[0][k] = first ? whole : 0;
            cell[1][k] = second ? whole + 1 : 0;
        }
    }
};

/// Adds what a brick contributes to a chunk of points; the same operations in the same order as sample().
template <class T> VKT_HD void add_brick(T const* all, SampledBrick const& brick, Points const& p, Sums& sums) {
    Taps const x(p.x[0], brick.lower[0], static_cast<double>(brick.inverse_width[0]), brick.dims[0]);
    Taps const y(p.x[1], brick.lower[1], static_cast<double>(brick.inverse_width[1]), brick.dims[1]);
    Taps const z(p.x[2], brick.lower[2], static_cast<double>(brick.inverse_width[2]), brick.dims[2]);
    T const* const cells = all + brick.offset;
    std::int32_t const row = brick.dims[0], slice = brick.dims[0] * brick.dims[1];
    for (int corner = 0; corner < 8; ++corner) {
        int const i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
        for (int k = 0; k < chunk; ++k) {
            float const h = x.weight[i][k] * y.weight[j][k] * z.weight[l][k];
            float const cell = static_cast<float>(cells[z.cell[l][k] * slice + y.cell[j][k] * row + x.cell[i][k]]);
            // A cell without weight must not spread its NaN.
            sums.sum[k] += h > 0 ? h * cell : 0.0F;
            sums.weight[k] += h;
        }
    }
}

} // namespace detail

/// Answers a March for one batch of segments. The bricks near the batch are known beforehand; for more than `most` of
/// them every point asks the whole tree.
template <class T> struct TreeField {
    static constexpr int most = 32;
    TreeView const& tree;
    Growing<NearBrick>& near;
    double lower[3], upper[3]; ///< of what is shown
    std::int32_t ids[most];    ///< ascending
    int count;                 ///< of ids, above `most` if there are too many
    float width[chunk];        ///< finest cell width at each segment of the batch

    VKT_HD void clear() { count = 0; }
    VKT_HD void include(std::int32_t id) {
        int at = 0;
        if (count > most) return;
        while (at < count && ids[at] < id) ++at;
        if (at < count && ids[at] == id) return;
        if (count++ == most) return;
        for (int i = count - 1; i > at; --i) ids[i] = ids[i - 1];
        ids[at] = id;
    }

    VKT_HD static Points points(Double3 o, Double3 d, double const* t) {
        Points p;
        for (int k = 0; k < chunk; ++k) p.x[0][k] = o.x + d.x * t[k];
        for (int k = 0; k < chunk; ++k) p.x[1][k] = o.y + d.y * t[k];
        for (int k = 0; k < chunk; ++k) p.x[2][k] = o.z + d.z * t[k];
        return p;
    }

    VKT_HD void values(Double3 o, Double3 d, double const* t, float* out) const {
        constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
        Points const p = points(o, d, t);
        T const* const cells = static_cast<T const*>(tree.cells);
        if (count > most) {
            SamplerView<T> const view{tree.nodes, tree.order, tree.bricks, cells};
            for (int k = 0; k < chunk; ++k) {
                TreeSample const s = sample(view, p.x[0][k], p.x[1][k], p.x[2][k]);
                out[k] = s.weight > 0 ? s.value : nothing;
            }
            return;
        }
        Sums sums;
        for (int i = 0; i < count; ++i) detail::add_brick(cells, tree.bricks[ids[i]], p, sums);
        for (int k = 0; k < chunk; ++k) out[k] = sums.weight[k] > 0 ? sums.sum[k] / sums.weight[k] : nothing;
    }

    /// Central differences over one finest cell to either side. The exact derivative jumps from cell to cell and is
    /// zero next to coarser levels, which shows as bands; in one level this is what a lattice has. What is outside of
    /// the picture counts as what is on its border.
    VKT_HD void gradients(Double3 o, Double3 d, double const* t, float* gx, float* gy, float* gz) const {
        Points const middle = points(o, d, t);
        Points p[6];
        Sums sums[6];
        double low[6][3], high[6][3];
        double all_low[3], all_high[3], widest = 0;
        for (int k = 0; k < chunk; ++k)
            widest = static_cast<double>(width[k]) > widest ? static_cast<double>(width[k]) : widest;
        for (int s = 0; s < 6; ++s) {
            p[s] = middle;
            double* const moved = p[s].x[s / 2];
            for (int k = 0; k < chunk; ++k)
                moved[k] += s % 2 != 0 ? static_cast<double>(width[k]) : -static_cast<double>(width[k]);
            for (int a = 0; a < 3; ++a) {
                double* const x = p[s].x[a];
                for (int k = 0; k < chunk; ++k) {
                    double const above = x[k] > lower[a] ? x[k] : lower[a];
                    x[k] = above < upper[a] ? above : upper[a];
                }
                // Points follow each other along a line, moved by no more than the greatest width.
                double const one = middle.x[a][0], two = middle.x[a][chunk - 1];
                double const back = a == s / 2 && s % 2 == 0 ? widest : 0,
                             front = a == s / 2 && s % 2 != 0 ? widest : 0;
                low[s][a] = (one < two ? one : two) - back - tree.slack;
                high[s][a] = (one < two ? two : one) + front + tree.slack;
                // What was moved into the picture lies on its border.
                low[s][a] = low[s][a] < upper[a] ? low[s][a] : upper[a] - tree.slack;
                high[s][a] = high[s][a] > lower[a] ? high[s][a] : lower[a] + tree.slack;
                all_low[a] = s == 0 || low[s][a] < all_low[a] ? low[s][a] : all_low[a];
                all_high[a] = s == 0 || high[s][a] > all_high[a] ? high[s][a] : all_high[a];
            }
        }
        find_near(all_low, all_high);
        T const* const cells = static_cast<T const*>(tree.cells);
        for (int i = 0; i < near.size; ++i) {
            BrickBox const& box = tree.boxes[near.items[i].slot];
            for (int s = 0; s < 6; ++s) {
                if (meets(box.lower, box.upper, low[s], high[s]))
                    detail::add_brick(cells, tree.bricks[box.id], p[s], sums[s]);
            }
        }
        float* const out[3] = {gx, gy, gz};
        for (int a = 0; a < 3; ++a)
            for (int k = 0; k < chunk; ++k) {
                Sums const &back = sums[2 * a], &front = sums[2 * a + 1];
                // Without any weight this is NaN: next to a hole there is no gradient, and nothing is shaded.
                out[a][k] = 0.5F * (front.sum[k] / front.weight[k] - back.sum[k] / back.weight[k]) / width[k];
            }
    }

    VKT_HD static bool meets(float const* lower_of, float const* upper_of, double const* low, double const* high) {
        bool all = true;
        for (int a = 0; a < 3; ++a)
            all = all && high[a] > static_cast<double>(lower_of[a]) && low[a] < static_cast<double>(upper_of[a]);
        return all;
    }

    /// Bricks whose domains may meet a box, ascending.
    VKT_HD void find_near(double const* low, double const* high) const {
        near.size = 0;
        std::int32_t stack[64];
        int depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            IndexNode const& node = tree.nodes[stack[--depth]];
            if (!meets(node.lower, node.upper, low, high)) continue;
            if (node.count == 0) {
                stack[depth++] = node.first;
                stack[depth++] = node.first + 1;
                continue;
            }
            for (std::int32_t k = node.first; k < node.first + node.count; ++k) {
                BrickBox const& box = tree.boxes[k];
                if (!meets(box.lower, box.upper, low, high)) continue;
                near.push({box.id, k});
                int at = near.size - 1;
                for (; at > 0 && near.items[at - 1].id > box.id; --at) near.items[at] = near.items[at - 1];
                near.items[at] = {box.id, k};
            }
        }
    }
};

} // namespace vkt::render
