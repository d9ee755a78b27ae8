// Ray marching through a brick tree segment by segment, with nothing kept of the bricks on the way: for GPUs. What is
// seen is the same as with the batches of tree_march.h and block_march.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/block_walk.h"
#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/stretch_walk.h"
#include "libvkt/render/inner/tree_points.h"
#include "libvkt/render/inner/tree_steps.h"

namespace vkt::render {

/// The comb of one segment, from point 0 to point 1.
struct OneSegment {
    using Real = double;
    using Vector = Double3;
    double begin = 0, end = 0;
    bool gap = false; ///< there is none

    VKT_HD double point(int k) const { return k == 0 ? begin : end; }
    VKT_HD bool shows(int) const { return !gap; }
};

/// Adds the segment that a march's comb says; `carried`: it begins where the one before ended. False when nothing more
/// can be seen.
template <class S, class P, Lighting lighting>
VKT_HD bool add_segment(March<S, OneSegment, P, lighting>& march, bool carried) {
    march.known = carried ? 0 : -1;
    if constexpr (lighting == Lighting::any) march.occlusion.known = carried && march.occlusion.known == 1 ? 0 : -1;
    return march.add(0, 1);
}

/// Answers it by the sums over bricks, with the differences that TreeField takes.
template <class T> struct PointField {
    TreePoints<T, NoScratch> const& points;
    float width; ///< finest cell width at the segment

    VKT_HD void values(Double3 o, Double3 d, double const* t, float* out) const {
        for (int k = 0; k < chunk; ++k) out[k] = points.value(o + d * t[k]);
    }
    VKT_HD void gradients(Double3 o, Double3 d, double const* t, float* gx, float* gy, float* gz) const {
        double const low[3] = {points.lower.x, points.lower.y, points.lower.z},
                     high[3] = {points.upper.x, points.upper.y, points.upper.z};
        for (int k = 0; k < chunk; ++k) {
            Double3 const middle = o + d * t[k];
            float difference[3] = {0, 0, 0};
#ifdef __CUDACC__
#pragma unroll 1
#endif
            for (int s = 0; s < 6; ++s) {
                int const along = s >> 1;
                double place[3] = {middle.x, middle.y, middle.z};
                for (int a = 0; a < 3; ++a) {
                    double const x = place[a] + static_cast<double>((s & 1) != 0 ? width : -width);
                    double const above = x > low[a] ? x : low[a], within = above < high[a] ? above : high[a];
                    place[a] = a == along ? within : place[a];
                }
                float const value = points.value({place[0], place[1], place[2]});
                for (int a = 0; a < 3; ++a) difference[a] = a == along ? value - difference[a] : difference[a];
            }
            gx[k] = 0.5F * difference[0] / width, gy[k] = 0.5F * difference[1] / width;
            gz[k] = 0.5F * difference[2] / width;
        }
    }
};

/// march_tree() without its lists.
template <Lighting lighting, class T>
VKT_HD Radiance march_bricks(TreePoints<T, NoScratch> const& asked, SceneView const& scene, Ray const& ray,
                             Counters& counters) {
    TreeView const& tree = asked.tree;
    ++counters.rays;
    MarchedPart marched;
    if (!marched_part(tree, static_cast<double>(scene.step), ray, marched)) return {0, 0, 0, 1};
    TreeSteps const steps = marched.steps;
    StretchWalk walk(tree, scene.cells, ray, marched.part);
    PointField<T> field{asked, 1};
    March<PointField<T>, OneSegment, TreePoints<T, NoScratch>, lighting> march{
        field, asked, scene, {}, ray.entry, ray.direction, static_cast<float>(ray.world_per_lattice)};
    march.enter(ray);
    std::int64_t k = marched.first, known = -1; // where the next segment begins; the point whose value is carried
    Stretch here = walk.at(marched.part.begin);
    bool on = true;
    while (goes_on(on && k < steps.last)) {
        double const t = steps.at(k);
        if (!(here.end > t)) here = walk.at(t);
        if (scene.skip) {
            std::int64_t n = here.visible ? 0 : steps.segments_inside(k, here);
            if (n == 0) n = steps.unseen(k, here, unseen_from(tree, scene, ray, t));
            if (n > 0) {
                counters.segments += n;
                k += n << here.level;
                continue;
            }
        }
        // It is as short as the finest stretch on its way asks for.
        std::int64_t end = steps.after(k, here.level);
        int level = here.level;
        bool visible = here.visible, hole = here.hole();
        if (here.end < steps.at(end)) {
            StretchWalk ahead = walk;
            for (Stretch next = here; next.end < steps.at(end);) {
                next = ahead.at(next.end);
                if (next.level >= level) continue;
                level = next.level;
                end = steps.after(k, level);
            }
            StretchWalk again = walk;
            for (Stretch next = here; next.end < steps.at(end);) {
                next = again.at(next.end);
                visible = visible || next.visible;
                hole = hole || next.hole(); // values on both sides have nothing to do with each other
            }
        }
        ++counters.segments;
        if (!scene.skip || visible) {
            field.width = hole ? 1.0F : static_cast<float>(std::int64_t{1} << level);
            march.comb = {t, steps.at(end), hole};
            on = add_segment(march, known == k);
            known = end;
        }
        k = end;
    }
    counters.samples += march.samples;
    return {march.light[1], march.light[2], march.light[3], march.passing};
}

/// Answers a March for one segment that ends, and whose middle lies, in the lattices of blocks.
template <class T> struct BlockSegment {
    struct Place {
        float at[3];
        std::int32_t block;
    };
    T const* cells;
    Place begin, end, middle;
    float per_finest; ///< cells of the block in which the middle is per finest one

    VKT_HD void values_of(int first, int count, float* out) const {
        for (int k = 0; k < count; ++k) {
            Place const& p = first + k == 0 ? begin : end;
            out[k] = block(p).value({p.at[0], p.at[1], p.at[2]});
        }
    }
    template <int n> VKT_HD void gradients_of(int, float* gx, float* gy, float* gz) const {
        Float3 const g = block(middle).gradient({middle.at[0], middle.at[1], middle.at[2]}) * per_finest;
        for (int k = 0; k < n; ++k) gx[k] = g.x, gy[k] = g.y, gz[k] = g.z;
    }
    /// A place at a length from where the ray enters the leaf.
    VKT_HD static Place place(LeafFrame const& frame, float way) {
        Place place{};
        for (int a = 0; a < 3; ++a) {
            float const p = way * frame.way[a] + frame.base[a], above = p > 1.0F ? p : 1.0F;
            place.at[a] = above < frame.upper[a] ? above : frame.upper[a];
        }
        place.block = frame.block;
        return place;
    }

private:
    VKT_HD LatticeSampler<T> block(Place const& p) const { return block_sampler(cells, p.block); }
};

/// march_blocks() without its batches: leaf by leaf, and in these point by point.
template <Lighting lighting, class T>
VKT_HD Radiance march_leaves(TreePoints<T, NoScratch> const& asked, SceneView const& scene, Ray const& ray,
                             Counters& counters) {
    using Segment = BlockSegment<T>;
    TreeView const& tree = asked.tree;
    ++counters.rays;
    double near = 0, far = ray.length;
    if (!clip(ray.entry, ray.direction, tree.lower, tree.upper, near, far)) return {0, 0, 0, 1};
    double const step = static_cast<double>(scene.step), per_step = 1 / step;
    LeafWalk const walk(tree, ray);
    Segment segment{static_cast<T const*>(tree.blocks.cells), {}, {}, {}, 1};
    March<Segment, OneSegment, TreePoints<T, NoScratch>, lighting> march{
        segment, asked, scene, {}, ray.entry, ray.direction, static_cast<float>(ray.world_per_lattice)};
    march.enter(ray);
    bool begun = false;   // there is a point
    bool open = false;    // the next segment begins where the last one ended
    bool carried = false; // and that has been looked at
    bool on = true, ends = false;
    LeafPart part{};   // the last leaf
    LeafFrame frame{}; // of the last point
    double t = near;
    while (goes_on(on && !ends)) {
        // On to the next leaf that has points, so that rays that are drawn together look into leaves together.
        bool shown = false, found = false;
        while (goes_on(!found && !ends)) {
            if (t >= (open ? ray.length : far) - walk.hair) {
                ends = true;
                continue;
            }
            double const way = !open && scene.skip ? unseen_from(tree, scene, ray, t) - tree.around : 0;
            if (way > 0) {
                t += way;
                continue;
            }
            LeafPart const next = walk.after(t, ray.length);
            t = walk.behind(next, t);
            if (!walk.counts(next)) continue; // where the ray ends
            part = next;
            shown = !scene.skip || next.leaf->visible != 0;
            found = shown || open;
        }
        if (ends && !open) break;
        if (!open && part.enter > walk.hair) {
            LeafPart const before = walk.before(part.enter);
            LeafPoints const points(before, step, per_step, ray.length, walk.hair);
            int const last = points.last();
            frame = LeafFrame(walk, before);
            segment.end = Segment::place(frame, static_cast<float>(last) * static_cast<float>(points.spacing) +
                                                    static_cast<float>(points.at(0) - frame.enter));
            march.comb.end = points.at(last);
            counters.segments += begun ? 1 : 0;
            begun = open = true;
            carried = false;
        }
        LeafPoints const points =
            ends ? LeafPoints(ray.length) : LeafPoints(part, step, per_step, ray.length, walk.hair);
        LeafFrame const leaf(walk, part);
        auto const apart = static_cast<float>(points.spacing), start = static_cast<float>(points.at(0) - leaf.enter);
        int const last = shown ? points.last() : 0; // behind what shows something there is one more point
        for (int i = 0; goes_on(on && i <= last); ++i) {
            float const way = static_cast<float>(i) * apart + start;
            march.comb = {march.comb.end, points.at(i), false};
            segment.begin = segment.end;
            segment.end = Segment::place(leaf, way);
            counters.segments += begun ? 1 : 0;
            if (open) {
                double const between = 0.5 * (march.comb.begin + march.comb.end);
                bool const across = i == 0 && !(between >= part.enter); // the middle lies in the leaf before
                double const enter = across ? frame.enter : leaf.enter;
                float const middle = i == 0 ? static_cast<float>(between - enter) : way - 0.5F * apart;
                segment.middle = Segment::place(across ? frame : leaf, middle);
                segment.per_finest = across ? frame.per_finest : leaf.per_finest;
                on = add_segment(march, carried);
                carried = true;
            }
            begun = open = true;
        }
        frame = leaf;
        if (!shown && !ends) open = carried = false;
    }
    counters.samples += march.samples;
    return {march.light[1], march.light[2], march.light[3], march.passing};
}

/// Among the integrators, which ask for rays through a sampler.
template <class T>
VKT_HD Radiance march_ray(TreePoints<T, NoScratch> const& points, SceneView const& scene, Ray const& ray,
                          Counters& counters) {
    return points.tree.blocks.cells != nullptr ? march_leaves<Lighting::any>(points, scene, ray, counters)
                                               : march_bricks<Lighting::any>(points, scene, ray, counters);
}

} // namespace vkt::render
