// Ray marching through the blocks of a brick tree: leaf by leaf, with the loops of a lattice inside.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/tree_points.h"

namespace vkt::render {

/// Where a ray is in a leaf.
struct LeafPart {
    BlockLeaf const* leaf;
    double enter, leave;
};

/// A ray among the leaves. Where it enters and leaves one depends on nothing but both of them.
struct LeafWalk {
    BlocksView const& blocks;
    double origin[3], direction[3], inverse[3];
    double hair; ///< more than what rounding does to positions; parts of less than two are passed over

    VKT_HD LeafWalk(TreeView const& tree, Ray const& ray)
        : blocks(tree.blocks), origin{ray.entry.x, ray.entry.y, ray.entry.z}, direction{ray.direction.x,
                                                                                        ray.direction.y,
                                                                                        ray.direction.z},
          inverse{1 / ray.direction.x, 1 / ray.direction.y, 1 / ray.direction.z}, hair(tree.slack) {}

    VKT_HD LeafPart at(double t) const {
        double const p[3] = {origin[0] + direction[0] * t, origin[1] + direction[1] * t, origin[2] + direction[2] * t};
        BlockLeaf const& leaf = blocks.at(p);
        double enter = -std::numeric_limits<double>::infinity(), leave = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 3; ++a) {
            if (direction[a] == 0) continue;
            auto const lower = static_cast<double>(leaf.lower[a]),
                       upper = static_cast<double>(leaf.lower[a] + leaf.edge);
            double const first = ((direction[a] > 0 ? lower : upper) - origin[a]) * inverse[a];
            double const last = ((direction[a] > 0 ? upper : lower) - origin[a]) * inverse[a];
            enter = first > enter ? first : enter;
            leave = last < leave ? last : leave;
        }
        return {&leaf, enter, leave};
    }
    VKT_HD bool counts(LeafPart const& part) const { return part.leave - part.enter > 2 * hair; }
    /// The one in which the ray goes on at t, and the one that it comes from.
    VKT_HD LeafPart after(double t, double length) const {
        LeafPart part = at(t + hair);
        while (!counts(part) && t < length) {
            t = part.leave > t + hair ? part.leave : t + hair;
            part = at(t + hair);
        }
        return part;
    }
    VKT_HD LeafPart before(double t) const {
        LeafPart part = at(t - hair);
        while (!counts(part) && t > 0) {
            t = part.enter < t - hair ? part.enter : t - hair;
            part = at(t - hair);
        }
        return part;
    }
};

/// The points of a ray in a leaf: the multiples of the step times the width of its cells, or, where there is none,
/// where the ray enters.
struct LeafPoints {
    double spacing;
    std::int64_t first, last; ///< multiples
    double enter;

    VKT_HD LeafPoints(LeafPart const& part, double step, double length, double hair) {
        spacing = std::ldexp(step, part.leaf->level);
        enter = part.enter > hair ? part.enter : 0; // the ray begins there
        double const leave = part.leave < length ? part.leave : length;
        first = static_cast<std::int64_t>(enter / spacing);
        while (static_cast<double>(first) * spacing < enter) ++first;
        last = static_cast<std::int64_t>(leave / spacing);
        while (last >= first && !(static_cast<double>(last) * spacing < leave)) --last;
    }
    VKT_HD bool none() const { return last < first; }
    VKT_HD double first_at() const { return none() ? enter : static_cast<double>(first) * spacing; }
    VKT_HD double last_at() const { return none() ? enter : static_cast<double>(last) * spacing; }
};

/// Where the segments of a batch lie.
struct PointComb {
    using Real = double;
    using Vector = Double3;
    double const* points;

    VKT_HD double point(int k) const { return points[k]; }
    VKT_HD bool shows(int) const { return true; }
};

/// The points of a ray in a row whose segments are added together.
template <class T, class Scratch> class BlockBatch {
public:
    VKT_HD BlockBatch(TreePoints<T, Scratch> const& asked, SceneView const& scene, Ray const& ray, LeafWalk const& walk)
        : walk_(walk),
          march_{field_, asked, scene, {at_}, ray.entry, ray.direction, static_cast<float>(ray.world_per_lattice)} {
        field_.cells = static_cast<T const*>(asked.tree.blocks.cells);
    }

    VKT_HD auto const& march() const { return march_; }
    /// What follows does not begin where this ends.
    VKT_HD void end() {
        flush();
        count_ = 0;
        carried_ = false;
    }
    VKT_HD void add(LeafPart const& part, double t) {
        if (full()) flush();
        if (march_.settled()) return;
        Frame const frame = frame_of(part);
        if (count_ > 0) {
            double const between = 0.5 * (at_[count_ - 1] + t);
            place(between >= part.enter ? frame : frame_, between, field_.middles, count_ - 1);
        }
        place(frame, t, field_.points, count_);
        at_[count_++] = t;
        frame_ = frame;
    }
    /// Multiples [first, last] of the spacing, which lie in the leaf of the point before.
    VKT_HD void add_rest(std::int64_t first, std::int64_t last, double spacing) {
        while (first <= last) {
            if (full()) flush();
            if (march_.settled()) return;
            int const left = room() - count_, from = count_;
            int const n = last - first < left ? static_cast<int>(last - first) + 1 : left;
            for (int j = 0; j < n; ++j) at_[from + j] = static_cast<double>(first + j) * spacing;
            for (int a = 0; a < 3; ++a) {
                double const base = frame_.base[a], way = frame_.way[a], enter = frame_.enter;
                for (int j = from; j < from + n; ++j) {
                    field_.points.at[a][j] = static_cast<float>(base + way * (at_[j] - enter));
                    field_.middles.at[a][j - 1] =
                        static_cast<float>(base + way * (0.5 * (at_[j - 1] + at_[j]) - enter));
                }
            }
            for (int j = from; j < from + n; ++j) field_.points.block[j] = field_.middles.block[j - 1] = frame_.block;
            count_ += n;
            first += n;
        }
    }
    VKT_HD int count() const { return count_; }

private:
    /// From lengths along the ray to the lattice of a leaf's block.
    struct Frame {
        double base[3], way[3], enter;
        float upper[3]; ///< within which there are central differences
        std::int32_t block;
    };
    VKT_HD Frame frame_of(LeafPart const& part) const {
        Frame frame;
        BlockLeaf const& leaf = *part.leaf;
        double const per = std::ldexp(1.0, -leaf.level);
        frame.enter = part.enter > 0 ? part.enter : 0;
        frame.block = leaf.block;
        for (int a = 0; a < 3; ++a) {
            double const scale = walk_.blocks.thin[a] ? 1 : per;
            frame.way[a] = walk_.direction[a] * scale;
            frame.base[a] =
                (walk_.origin[a] + walk_.direction[a] * frame.enter - static_cast<double>(leaf.lower[a])) * scale +
                (block_halo - 0.5);
            frame.upper[a] = static_cast<float>(leaf.thickness[a]) + (block_halo - 1e-3F);
        }
        return frame;
    }
    VKT_HD static void place(Frame const& frame, double t, typename BlockPoints<T>::Places& to, int k) {
        for (int a = 0; a < 3; ++a) {
            auto const p = static_cast<float>(frame.base[a] + frame.way[a] * (t - frame.enter));
            float const above = p > 1.0F ? p : 1.0F;
            to.at[a][k] = above < frame.upper[a] ? above : frame.upper[a];
        }
        to.block[k] = frame.block;
    }
    VKT_HD int room() const { return carried_ ? chunk + 1 : chunk; }
    VKT_HD bool full() const { return count_ == room(); }

    /// Adds what there is; the last point stays.
    __attribute__((noinline)) void flush() {
        int const segments = count_ - 1;
        if (segments < 1 || march_.settled()) return;
        // What lanes meet behind the last one is the same again.
        pad(field_.points, count_);
        pad(field_.middles, segments);
        march_.known = carried_ ? 0 : -1;
        march_.occlusion.known = carried_ && march_.occlusion.known == flushed_ ? 0 : -1;
        flushed_ = segments;
        march_.advance(0, segments);
        for (int a = 0; a < 3; ++a) field_.points.at[a][0] = field_.points.at[a][segments];
        field_.points.block[0] = field_.points.block[segments];
        at_[0] = at_[segments];
        count_ = 1;
        carried_ = true;
    }
    VKT_HD static void pad(typename BlockPoints<T>::Places& places, int count) {
        for (int k = count; k < BlockPoints<T>::room; ++k) {
            for (int a = 0; a < 3; ++a) places.at[a][k] = places.at[a][count - 1];
            places.block[k] = places.block[count - 1];
        }
    }

    LeafWalk const& walk_;
    BlockPoints<T> field_;
    double at_[chunk + 1];
    March<BlockPoints<T>, PointComb, TreePoints<T, Scratch>> march_;
    Frame frame_{}; ///< of the last point
    int count_ = 0;
    int flushed_ = -1;     ///< segments of the batch before
    bool carried_ = false; ///< the first point was the last one of the batch before
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
    double const step = static_cast<double>(scene.step);
    LeafWalk const walk(tree, ray);
    BlockBatch<T, Scratch> batch(asked, scene, ray, walk);
    double t = near;
    LeafPart part{};
    while (!batch.march().settled()) {
        bool const open = batch.count() > 0;
        if (t >= (open ? ray.length : far) - walk.hair) break;
        if (!open && scene.skip)
            if (double const way = unseen_from(tree, scene, ray, t) - tree.around; way > 0) {
                t += way;
                continue;
            }
        LeafPart const next = walk.after(t, ray.length);
        t = next.leave > t + walk.hair ? next.leave : t + walk.hair;
        if (!walk.counts(next)) continue; // where the ray ends
        part = next;
        if (scene.skip && part.leaf->visible == 0) {
            if (open) {
                batch.add(part, LeafPoints(part, step, ray.length, walk.hair).first_at());
                batch.end();
            }
            continue;
        }
        if (!open && part.enter > walk.hair) {
            LeafPart const before = walk.before(part.enter);
            batch.add(before, LeafPoints(before, step, ray.length, walk.hair).last_at());
        }
        LeafPoints const points(part, step, ray.length, walk.hair);
        batch.add(part, points.first_at());
        if (!points.none()) batch.add_rest(points.first + 1, points.last, points.spacing);
    }
    if (batch.count() > 0) batch.add(part, ray.length);
    batch.end();
    counters.samples += batch.march().samples;
    Quad const& light = batch.march().light;
    return {light[1], light[2], light[3], batch.march().passing};
}

} // namespace vkt::render
