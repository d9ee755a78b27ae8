// Ray marching through a brick tree: long steps where cells are large, none where nothing can be seen.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/block_march.h"
#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/tree_field.h"
#include "libvkt/render/inner/tree_points.h"
#include "libvkt/render/inner/tree_steps.h"

namespace vkt::render {

/// The comb of a ray through a tree: its stretches in a list.
struct TreeComb : TreeSteps {
    Stretch const* stretches;
    int count;

    struct Segment {
        std::int64_t end; ///< number of the point
        int stretches;    ///< that it meets
        int level;
        bool visible, hole;
    };

    /// The segment that begins at point k, which lies in stretch `first`. It is as short as the finest stretch on its
    /// way asks for.
    VKT_HD Segment segment(std::int64_t k, int first) const {
        int level = stretches[first].level;
        std::int64_t end = after(k, level);
        for (int i = first + 1; i < count && stretches[i - 1].end < at(end); ++i)
            if (stretches[i].level < level) {
                level = stretches[i].level;
                end = after(k, level);
            }
        Segment segment{end, 1, level, stretches[first].visible, stretches[first].hole()};
        for (int i = first + 1; i < count && stretches[i - 1].end < at(end); ++i) {
            ++segment.stretches;
            segment.visible = segment.visible || stretches[i].visible;
            // Values on both sides of a hole have nothing to do with each other.
            segment.hole = segment.hole || stretches[i].hole();
        }
        return segment;
    }
};

/// Scratch is a TreeScratch by a name that only one object file knows, so that the functions that are not inlined here
/// are its own: those for another instruction set have the same names.
template <class T, class Scratch>
VKT_HD Radiance march_tree(TreePoints<T, Scratch> const& asked, SceneView const& scene, Ray const& ray,
                           Counters& counters) {
    TreeView const& tree = asked.tree;
    Scratch& scratch = asked.scratch;
    ++counters.rays;
    MarchedPart marched;
    if (!marched_part(tree, static_cast<double>(scene.step), ray, marched)) return {0, 0, 0, 1};
    std::int64_t k = marched.first; // where the next segment begins
    cross_bricks(tree, ray, marched.part, scratch);
    find_stretches(tree, marched.part, scratch);
    TreeComb const comb{marched.steps, scratch.stretches.items, scratch.stretches.size};
    TreeField<T> field{tree,
                       scratch.near,
                       {scene.shown.lower.x, scene.shown.lower.y, scene.shown.lower.z},
                       {scene.shown.upper.x, scene.shown.upper.y, scene.shown.upper.z},
                       {},
                       0,
                       {}};
    double points[chunk + 1];
    bool empty[chunk];
    March<TreeField<T>, PointComb, TreePoints<T, Scratch>> march{
        field, asked, scene, {points, empty}, ray.entry, ray.direction, static_cast<float>(ray.world_per_lattice)};
    march.enter(ray);
    int size = 0;            // segments in the batch
    int included = -1;       // the last stretch whose bricks the batch knows
    std::int64_t known = -1; // the point whose value the march carries
    std::int64_t begin = 0;  // where the batch does
    int flushed = -1;        // segments of the one before
    // Called from four places.
    auto const flush = [&]() __attribute__((noinline)) {
        if (size == 0) return;
        for (int j = size; j < chunk; ++j) field.width[j] = field.width[size - 1];
        march.known = known == begin ? 0 : -1;
        march.occlusion.known = known == begin && march.occlusion.known == flushed ? 0 : -1;
        flushed = size;
        march.advance(0, size);
        known = k;
        size = 0;
    };
    int stretch = 0;
    while (k < comb.last && !march.settled()) {
        while (comb.stretches[stretch].end <= comb.at(k)) ++stretch;
        Stretch const& here = comb.stretches[stretch];
        if (scene.skip && !here.visible) {
            std::int64_t const n = comb.segments_inside(k, here);
            if (n > 0) {
                flush();
                counters.segments += n;
                k += n << here.level;
                continue;
            }
        }
        // Macrocells are finer than bricks may be. None next to this one shows anything, or none further on.
        if (std::int64_t const n =
                scene.skip && size == 0 ? comb.unseen(k, here, unseen_from(tree, scene, ray, comb.at(k))) : 0;
            n > 0) {
            counters.segments += n;
            k += n << here.level;
            continue;
        }
        TreeComb::Segment const segment = comb.segment(k, stretch);
        ++counters.segments;
        if (scene.skip && !segment.visible) {
            flush();
            k = segment.end;
            continue;
        }
        if (size == 0) {
            field.clear();
            included = stretch - 1;
            begin = k;
            points[0] = comb.at(k);
        }
        for (int i = included + 1 > stretch ? included + 1 : stretch; i < stretch + segment.stretches; ++i) {
            for (int j = 0; j < comb.stretches[i].count; ++j)
                field.include(scratch.ids.items[comb.stretches[i].first + j]);
            included = i;
        }
        points[size + 1] = comb.at(segment.end);
        empty[size] = segment.hole;
        field.width[size] = segment.hole ? 1.0F : static_cast<float>(std::int64_t{1} << segment.level);
        ++size;
        k = segment.end;
        if (size == (known == begin ? chunk : chunk - 1)) flush();
    }
    flush();
    counters.samples += march.samples;
    return {march.light[1], march.light[2], march.light[3], march.passing};
}

/// Among the integrators, which ask for rays through a sampler.
template <class T, class Scratch>
VKT_HD Radiance march_ray(TreePoints<T, Scratch> const& points, SceneView const& scene, Ray const& ray,
                          Counters& counters) {
    return points.tree.blocks.cells != nullptr ? march_blocks(points, scene, ray, counters)
                                               : march_tree(points, scene, ray, counters);
}

} // namespace vkt::render
