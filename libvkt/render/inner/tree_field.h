// Values and gradients of a brick tree at many points of a ray at once: the sums of sample(), brick by brick.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"
#include "libvkt/render/inner/tree_lists.h"

namespace vkt::render {

/// A chunk of positions in finest cells.
struct Points {
    alignas(64) double x[3][chunk];
};

struct Sums {
    alignas(64) float sum[chunk] = {}, weight[chunk] = {};
};

namespace detail {

/// Points that are worked on together.
#ifdef VKT_LANES
inline constexpr int group = VKT_LANES;
#else
inline constexpr int group = chunk < 8 ? chunk : 8;
#endif

/// Points [from, to) of a chunk, whole groups of them.
struct Part {
    int from = 0, to = chunk;
};

/// CellWeights of a chunk of points along one axis of a brick: weights and places of cells; those that are not
/// there weigh nothing.
struct CellWeights {
    alignas(64) float weight[2][chunk];
    alignas(64) std::int32_t place[2][chunk];

    VKT_HD CellWeights(double const* p, double lower, double inverse, std::int32_t dims, std::int32_t stride,
                       Part part) {
        double const end = static_cast<double>(dims);
        for (int begin = part.from; begin < part.to; begin += group)
            for (int k = begin; k < begin + group; ++k) {
                double const exact = (p[k] - lower) * inverse - 0.5;
                // Points out of reach weigh nothing at these limits.
                double const above = exact > -1.0 ? exact : -1.0, q = above < end ? above : end;
                auto const whole = static_cast<std::int32_t>(q + 1.0) - 1; // floor, as q >= -1
                float const t = static_cast<float>(q - static_cast<double>(whole));
                bool const first = whole >= 0 && whole < dims, second = whole + 1 < dims;
                weight[0][k] = first ? 1.0F - t : 0.0F;
                weight[1][k] = second ? t : 0.0F;
                place[0][k] = first ? whole * stride : 0;
                place[1][k] = second ? (whole + 1) * stride : 0;
            }
    }
};

#ifdef VKT_LANES
/// Cells at some places of a brick. Words are fetched, which narrower cells need not have behind the last of them: the
/// last word then is, and the cell is somewhere in it. `last`: where that begins, in bytes from the brick's first cell.
template <class T> VKT_HD Lanes::F cells_at(T const* cells, Lanes::I place, int last) {
    if constexpr (std::is_same_v<T, float>) {
        return Lanes::gather_floats(cells, place);
    } else {
        Lanes::I const at = sizeof(T) == 1 ? place : Lanes::left<1>(place);
        Lanes::I const word_at = Lanes::least(at, Lanes::set(last));
        Lanes::I const word = Lanes::right(Lanes::gather(cells, word_at), Lanes::left<3>(Lanes::sub(at, word_at)));
        if constexpr (sizeof(T) == 1)
            return Lanes::real(Lanes::mask(word, 255));
        else
            return lane_low<T>(word);
    }
}
#endif

/// Adds what a brick contributes to a chunk of points; the same operations in the same order as sample().
template <class T>
VKT_HD void add_cells(TreeView const& tree, SampledBrick const& brick, CellWeights const& x, CellWeights const& y,
                      CellWeights const& z, Part part, Sums& sums) {
    T const* const cells = static_cast<T const*>(tree.cells) + brick.offset;
#ifdef VKT_LANES
    constexpr std::int64_t size = sizeof(T), farthest = 2147483647;
    std::int64_t const behind = tree.bytes - brick.offset * size - 4;
    if (std::is_same_v<T, float> ||
        (behind >= 0 && size * brick.dims[0] * brick.dims[1] * static_cast<std::int64_t>(brick.dims[2]) <= farthest)) {
        int const last = static_cast<int>(behind < farthest ? behind : farthest);
        for (int k = part.from; k < part.to; k += VKT_LANES) {
            Lanes::F sum = Lanes::load(sums.sum + k), weight = Lanes::load(sums.weight + k);
            for (int corner = 0; corner < 8; ++corner) {
                int const i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
                Lanes::F const h = Lanes::mul(Lanes::mul(Lanes::load(x.weight[i] + k), Lanes::load(y.weight[j] + k)),
                                              Lanes::load(z.weight[l] + k));
                Lanes::I const place = Lanes::add(Lanes::add(Lanes::load(z.place[l] + k), Lanes::load(y.place[j] + k)),
                                                  Lanes::load(x.place[i] + k));
                // A cell without weight must not spread its NaN.
                sum = Lanes::add(sum, Lanes::positive_times(h, cells_at(cells, place, last)));
                weight = Lanes::add(weight, h);
            }
            Lanes::store(sums.sum + k, sum);
            Lanes::store(sums.weight + k, weight);
        }
        return;
    }
#endif
    for (int corner = 0; corner < 8; ++corner) {
        int const i = corner & 1, j = corner >> 1 & 1, l = corner >> 2;
        for (int begin = part.from; begin < part.to; begin += group)
            for (int k = begin; k < begin + group; ++k) {
                float const h = x.weight[i][k] * y.weight[j][k] * z.weight[l][k];
                float const cell = static_cast<float>(cells[z.place[l][k] + y.place[j][k] + x.place[i][k]]);
                // A cell without weight must not spread its NaN.
                sums.sum[k] += h > 0 ? h * cell : 0.0F;
                sums.weight[k] += h;
            }
    }
}

/// The groups of points along a ray that may lie within a length of what a brick reaches.
VKT_HD Part part_near(SampledBrick const& brick, Double3 o, Double3 d, double const* t, double around) {
    double const from[3] = {o.x, o.y, o.z}, way[3] = {d.x, d.y, d.z};
    double enter = t[0], leave = t[chunk - 1];
    for (int a = 0; a < 3; ++a) {
        double const width = 1 / static_cast<double>(brick.inverse_width[a]), inverse = 1 / way[a];
        double const lower = brick.lower[a] - 0.5 * width - around;
        double const upper = brick.lower[a] + (static_cast<double>(brick.dims[a]) + 0.5) * width + around;
        // Not a number, from a way of zero along the border, is no limit.
        double const p = (lower - from[a]) * inverse, q = (upper - from[a]) * inverse;
        double const first = p < q ? p : q, last = p < q ? q : p;
        enter = first > enter ? first : enter;
        leave = last < leave ? last : leave;
    }
    Part part;
    while (part.from < part.to && t[part.from + group - 1] < enter) part.from += group;
    while (part.from < part.to && t[part.to - group] > leave) part.to -= group;
    return part;
}

VKT_HD CellWeights taps_along(SampledBrick const& brick, int a, double const* p, Part part) {
    std::int32_t const stride = a == 0 ? 1 : a == 1 ? brick.dims[0] : brick.dims[0] * brick.dims[1];
    return {p, brick.lower[a], static_cast<double>(brick.inverse_width[a]), brick.dims[a], stride, part};
}

/// Points between two ends.
struct Line {
    double from[3], inverse[3]; ///< one end; 1 / way to the other one
    double low[3], high[3];     ///< box of the points
    bool straight;              ///< false: they may be anywhere in the box

    VKT_HD bool meets(BrickBox const& box, double slack) const {
        double enter = 0, leave = 1;
        bool all = true;
        for (int a = 0; a < 3; ++a) {
            double const lower = static_cast<double>(box.lower[a]) - slack;
            double const upper = static_cast<double>(box.upper[a]) + slack;
            all = all && high[a] > lower && low[a] < upper;
            // Not a number, from a way of zero along the border, is no limit.
            double const p = (lower - from[a]) * inverse[a], q = (upper - from[a]) * inverse[a];
            double const first = p < q ? p : q, last = p < q ? q : p;
            enter = first > enter ? first : enter;
            leave = last < leave ? last : leave;
        }
        return all && (!straight || enter <= leave);
    }
};

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
        if (count > most) {
            with_voxel_type<T>(tree.type, [&]<class V>(V) {
                SamplerView<V> const view{tree.nodes, tree.order, tree.bricks, static_cast<V const*>(tree.cells)};
                for (int k = 0; k < chunk; ++k) {
                    TreeSample const s = sample(view, p.x[0][k], p.x[1][k], p.x[2][k]);
                    out[k] = s.weight > 0 ? s.value : nothing;
                }
            });
            return;
        }
        Sums sums;
        for (int i = 0; i < count; ++i) {
            SampledBrick const& brick = tree.bricks[ids[i]];
            detail::Part const part = detail::part_near(brick, o, d, t, tree.slack);
            if (part.from == part.to) continue;
            detail::CellWeights const x = detail::taps_along(brick, 0, p.x[0], part),
                                      y = detail::taps_along(brick, 1, p.x[1], part),
                                      z = detail::taps_along(brick, 2, p.x[2], part);
            add_cells(brick, x, y, z, part, sums);
        }
        for (int k = 0; k < chunk; ++k) out[k] = sums.weight[k] > 0 ? sums.sum[k] / sums.weight[k] : nothing;
    }

    /// Central differences over one finest cell to either side. The exact derivative jumps from cell to cell and is
    /// zero next to coarser levels, which shows as bands; in one level this is what a lattice has. What is outside of
    /// the picture counts as what is on its border.
    VKT_HD void gradients(Double3 o, Double3 d, double const* t, float* gx, float* gy, float* gz) const {
        Points const middle = points(o, d, t);
        alignas(64) double moved[6][chunk]; // along axis s / 2, backwards and forwards
        detail::Line lines[6];
        Sums sums[6];
        float narrowest = width[0], widest = width[0];
        for (int k = 1; k < chunk; ++k) {
            narrowest = width[k] < narrowest ? width[k] : narrowest;
            widest = width[k] > widest ? width[k] : widest;
        }
        double all_low[3], all_high[3];
        for (int s = 0; s < 6; ++s) {
            detail::Line& line = lines[s];
            int const along = s / 2;
            double const sign = s % 2 != 0 ? 1 : -1;
            double const low = lower[along], high = upper[along];
            for (int k = 0; k < chunk; ++k) {
                double const x = middle.x[along][k] + sign * static_cast<double>(width[k]);
                double const above = x > low ? x : low;
                moved[s][k] = above < high ? above : high;
            }
            line.straight = narrowest == widest;
            for (int a = 0; a < 3; ++a) {
                double const shift = a == along ? sign * static_cast<double>(widest) : 0;
                double const one = middle.x[a][0] + shift, two = middle.x[a][chunk - 1] + shift;
                line.from[a] = one, line.inverse[a] = 1 / (two - one);
                // Widths differ by what is between none and the widest; what left the picture lies on its border.
                double const least = (one < two ? one : two) - (narrowest == widest || shift < 0 ? 0 : shift);
                double const most_of = (one < two ? two : one) - (narrowest == widest || shift > 0 ? 0 : shift);
                line.straight = line.straight && least >= lower[a] && most_of <= upper[a];
                line.low[a] = least < upper[a] ? least : upper[a];
                line.high[a] = most_of > lower[a] ? most_of : lower[a];
                all_low[a] = s == 0 || line.low[a] < all_low[a] ? line.low[a] : all_low[a];
                all_high[a] = s == 0 || line.high[a] > all_high[a] ? line.high[a] : all_high[a];
            }
        }
        for (int a = 0; a < 3; ++a) all_low[a] -= tree.slack, all_high[a] += tree.slack;
        find_near(all_low, all_high);
        for (int i = 0; i < near.size; ++i) {
            BrickBox const& box = tree.boxes[near.items[i].slot];
            bool met[6], any = false;
            for (int s = 0; s < 6; ++s) any = (met[s] = lines[s].meets(box, tree.slack)) || any;
            if (!any) continue;
            SampledBrick const& brick = tree.bricks[box.id];
            // What left the picture came nearer, along its own axis.
            detail::Part const part = detail::part_near(brick, o, d, t, static_cast<double>(widest) + tree.slack);
            if (part.from == part.to) continue;
            detail::CellWeights const x = detail::taps_along(brick, 0, middle.x[0], part),
                                      y = detail::taps_along(brick, 1, middle.x[1], part),
                                      z = detail::taps_along(brick, 2, middle.x[2], part);
            for (int s = 0; s < 6; ++s) {
                if (!met[s]) continue;
                detail::CellWeights const there = detail::taps_along(brick, s / 2, moved[s], part);
                add_cells(brick, s / 2 == 0 ? there : x, s / 2 == 1 ? there : y, s / 2 == 2 ? there : z, part, sums[s]);
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

    VKT_HD void add_cells(SampledBrick const& brick, detail::CellWeights const& x, detail::CellWeights const& y,
                          detail::CellWeights const& z, detail::Part part, Sums& sums) const {
        with_voxel_type<T>(
            tree.type, [&]<class V>(V)
                           __attribute__((always_inline)) { detail::add_cells<V>(tree, brick, x, y, z, part, sums); });
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
