// Ray marching through the blocks of a brick tree: leaf by leaf, with the loops of a lattice inside.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/block_walk.h"
#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/tree_points.h"

namespace vkt::render {

/// As many of the points of a leaf as a register holds, from number i on; what lies behind the last one is none.
VKT_HD Doubles several(LeafPoints const& points, int i) {
    Doubles const numbers = counting_doubles() + static_cast<double>(points.first + i);
    return points.count == 0 ? all_of(points.enter) : numbers * points.spacing;
}

/// Where the segments of a batch lie, and between which points there is none.
struct PointComb {
    using Real = double;
    using Vector = Double3;
    double const* points;
    bool const* gaps;

    VKT_HD double point(int k) const { return points[k]; }
    VKT_HD bool shows(int k) const { return !gaps[k]; }
};

/// The points of a ray whose segments are added together.
template <class T, class Scratch> class BlockBatch {
public:
    VKT_HD BlockBatch(TreePoints<T, Scratch> const& asked, SceneView const& scene, Ray const& ray, LeafWalk const& walk)
        : walk_(walk), march_{field_,
                              asked,
                              scene,
                              {at_, gaps_},
                              ray.entry,
                              ray.direction,
                              static_cast<float>(ray.world_per_lattice)} {
        field_.cells = asked.tree.blocks.cells;
        field_.type = asked.tree.type;
        march_.enter(ray);
    }

    VKT_HD auto const& march() const { return march_; }
    VKT_HD std::int64_t segments() const { return segments_; }
    /// Whether what follows begins where this ends.
    VKT_HD bool open() const { return open_; }
    VKT_HD void close() {
        open_ = false;
        if (count_ > chunk / 2) flush();
    }
    /// The points [from, to] of a leaf, by their numbers.
    VKT_HD void add(LeafPart const& part, LeafPoints const& points, int from, int to) {
        LeafFrame const frame(walk_, part);
        auto const apart = static_cast<float>(points.spacing);
        auto const start = static_cast<float>(points.at(0) - frame.enter);
        for (bool enters = true; from <= to; enters = false) {
            if (count_ == room()) flush();
            if (march_.settled()) return;
            int const left = room() - count_, k = count_;
            int const n = to - from < left ? to - from + 1 : left;
            // Whole registers: what is too much is written again.
            for (int done = 0; done < n; done += group) {
                for (int j = done; j < done + group; j += wide / 2) store(at_ + k + j, several(points, from + j));
                for (int j = done; j < done + group; j += wide) {
                    Floats const number = counting() + static_cast<float>(from + j);
                    Floats const way = number * apart + start;
                    place(frame, way, way - 0.5F * apart, k + j);
                }
            }
            for (int j = k > 0 ? k - 1 : 0; j < k + n - 1; ++j) gaps_[j] = false;
            if (enters && k > 0) { // from another leaf, or from far
                double const between = 0.5 * (at_[k - 1] + at_[k]);
                place_middle(between >= part.enter ? frame : frame_, between, k - 1);
                gaps_[k - 1] = !open_;
            }
            open_ = true;
            count_ += n;
            from += n;
        }
        frame_ = frame;
    }
    VKT_HD void add_last(LeafPart const& part, double t) { add(part, LeafPoints{t}, 0, 0); }
    /// Adds what there is; the last point stays.
    __attribute__((noinline)) void flush() {
        int const segments = count_ - 1;
        if (segments < 1 || march_.settled()) return;
        // What lanes meet behind the last one is the same again.
        field_.points.pad(count_);
        field_.middles.pad(count_);
        march_.known = carried_ ? 0 : -1;
        march_.occlusion.known = carried_ && march_.occlusion.known == flushed_ ? 0 : -1;
        flushed_ = segments;
        segments_ += segments;
        march_.advance(0, segments);
        for (int a = 0; a < 3; ++a) field_.points.at[a][0] = field_.points.at[a][segments];
        field_.points.block[0] = field_.points.block[segments];
        at_[0] = at_[segments];
        count_ = 1;
        carried_ = true;
    }

private:
    VKT_HD static Floats within(LeafFrame const& frame, int axis, Floats p) {
        Floats const least = all_of(1.0F), most = all_of(frame.upper[axis]), above = p > least ? p : least;
        return above < most ? above : most;
    }
    /// Points at lengths from where the ray enters the leaf, and the middles of the segments that end there.
    VKT_HD void place(LeafFrame const& frame, Floats way, Floats middle, int k) {
        for (int a = 0; a < 3; ++a) {
            store(field_.points.at[a] + k, within(frame, a, way * frame.way[a] + frame.base[a]));
            store(field_.middles.at[a] + k, within(frame, a, middle * frame.way[a] + frame.base[a]));
        }
        store(field_.points.block + k, all_of(frame.block));
        store(field_.middles.block + k, all_of(frame.block));
        store(field_.middles.per_finest + k, all_of(frame.per_finest));
    }
    VKT_HD void place_middle(LeafFrame const& frame, double t, int segment) {
        Floats const middle = all_of(static_cast<float>(t - frame.enter));
        for (int a = 0; a < 3; ++a)
            field_.middles.at[a][segment + 1] = within(frame, a, middle * frame.way[a] + frame.base[a])[0];
        field_.middles.block[segment + 1] = frame.block;
        field_.middles.per_finest[segment + 1] = frame.per_finest;
    }
    VKT_HD int room() const { return carried_ ? chunk + 1 : chunk; }

    LeafWalk const& walk_;
    BlockPoints<T> field_;
    alignas(64) double at_[BlockPoints<T>::room];
    bool gaps_[BlockPoints<T>::room];
    March<BlockPoints<T>, PointComb, TreePoints<T, Scratch>> march_;
    LeafFrame frame_{}; ///< of the last point
    int count_ = 0;
    int flushed_ = -1; ///< segments of the batch before
    std::int64_t segments_ = 0;
    bool carried_ = false; ///< the first point was the last one of the batch before
    bool open_ = false;
};

/// Segments lie between the points of the leaves on the way, and are added if one of the leaves of their ends shows
/// something: leaving some out changes none of the others.
template <class T, class Scratch>
VKT_HD Radiance march_blocks(TreePoints<T, Scratch> const& asked, SceneView const& scene, Ray const& ray,
                             Counters& counters) {
    TreeView const& tree = asked.tree;
    ++counters.rays;
    double near = 0, far = ray.length;
    if (!clip(ray.entry, ray.direction, tree.lower, tree.upper, near, far)) return {0, 0, 0, 1};
    double const step = static_cast<double>(scene.step), per_step = 1 / step;
    LeafWalk const walk(tree, ray);
    BlockBatch<T, Scratch> batch(asked, scene, ray, walk);
    auto const points_of = [&](LeafPart const& part) __attribute__((always_inline)) {
        return LeafPoints(part, step, per_step, ray.length, walk.hair);
    };
    double t = near;
    LeafPart part{};
    while (!batch.march().settled()) {
        bool const open = batch.open();
        if (t >= (open ? ray.length : far) - walk.hair) break;
        if (!open && scene.skip)
            if (double const way = unseen_from(tree, scene, ray, t) - tree.around; way > 0) {
                t += way;
                continue;
            }
        LeafPart const next = walk.after(t, ray.length);
        t = walk.behind(next, t);
        if (!walk.counts(next)) continue; // where the ray ends
        part = next;
        if (scene.skip && part.leaf->visible == 0) {
            if (open) {
                batch.add(part, points_of(part), 0, 0);
                batch.close();
            }
            continue;
        }
        if (!open && part.enter > walk.hair) {
            LeafPart const before = walk.before(part.enter);
            LeafPoints const points = points_of(before);
            batch.add(before, points, points.last(), points.last());
        }
        LeafPoints const points = points_of(part);
        batch.add(part, points, 0, points.last());
    }
    if (batch.open()) batch.add_last(part, ray.length);
    batch.flush();
    counters.segments += batch.segments();
    counters.samples += batch.march().samples;
    Quad const& light = batch.march().light;
    return {light[1], light[2], light[3], batch.march().passing};
}

} // namespace vkt::render
