// The bricks on the way of a ray, and the stretches along which the set of them stays the same, in lists that grow. For
// CPUs: stretch_walk.h and piece_walk.h find the same without lists.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/tree.h"

#include <cstdlib>
#include <new>

namespace vkt::render {

/// An array that grows; its owner frees it. Plain, so that every instruction set has its own copy of the code.
template <class E> struct Growing {
    E* items = nullptr;
    int size = 0, capacity = 0;

    VKT_HD void push(E const& e) {
        if (size == capacity) {
            capacity = capacity > 0 ? 2 * capacity : 256;
            void* const grown = std::realloc(static_cast<void*>(items), static_cast<std::size_t>(capacity) * sizeof(E));
            if (grown == nullptr) throw std::bad_alloc();
            items = static_cast<E*>(grown);
        }
        items[size++] = e;
    }
};

/// Part of a ray inside the domain of a brick.
struct Crossing {
    double enter, leave;
    std::int32_t id, level;
    BrickNodes range;
};

struct NearBrick {
    std::int32_t id, slot; ///< slot: place in TreeView::boxes
};

/// A ray on its way through the cells of a brick; lengths are counted from where it enters, at `enter`. In the units of
/// CellWalk cell i reaches from the centre of the brick's cell i - 1 to that of its cell i.
struct BrickWalk {
    double enter, leave;
    std::int32_t id;
    float per_finest;         ///< cells of its level per finest cell
    Double3 entry, direction; ///< in the brick's own cells, the centre of the first one at 1
    CellWalk<double> walk;
};

/// Lists of one thread, used again for every ray.
struct TreeScratch {
    Growing<Crossing> crossings;
    Growing<Stretch> stretches;
    Growing<std::int32_t> ids;    ///< of stretches
    Growing<std::int32_t> active; ///< crossings at the present position, by ascending brick id
    Growing<NearBrick> near;
    Growing<BrickWalk> walks;

    VKT_HD void release() {
        std::free(static_cast<void*>(crossings.items));
        std::free(static_cast<void*>(stretches.items));
        std::free(static_cast<void*>(ids.items));
        std::free(static_cast<void*>(active.items));
        std::free(static_cast<void*>(near.items));
        std::free(static_cast<void*>(walks.items));
    }
};

/// Collects the bricks whose domains the ray crosses, by the place where it enters. Near children come first, so that
/// new crossings belong near the end of the list.
VKT_HD void cross_bricks(TreeView const& tree, Ray const& ray, RayPart part, TreeScratch& scratch) {
    Growing<Crossing>& crossings = scratch.crossings;
    crossings.size = 0;
    detail::Slabs const slabs{{ray.entry.x, ray.entry.y, ray.entry.z},
                              {1 / ray.direction.x, 1 / ray.direction.y, 1 / ray.direction.z},
                              tree.slack,
                              part};
    std::int32_t stack[64];
    int depth = 0;
    double enter, leave;
    if (slabs.cross(tree.nodes[0].lower, tree.nodes[0].upper, enter, leave)) stack[depth++] = 0;
    while (depth > 0) {
        IndexNode const& node = tree.nodes[stack[--depth]];
        if (node.count == 0) {
            IndexNode const &one = tree.nodes[node.first], &two = tree.nodes[node.first + 1];
            double other;
            bool const first = slabs.cross(one.lower, one.upper, enter, leave);
            bool const second = slabs.cross(two.lower, two.upper, other, leave);
            bool const swap = first && second && other < enter;
            if (second && !swap) stack[depth++] = node.first + 1;
            if (first) stack[depth++] = node.first;
            if (swap) stack[depth++] = node.first + 1;
            continue;
        }
        for (std::int32_t k = node.first; k < node.first + node.count; ++k) {
            BrickBox const& box = tree.boxes[k];
            if (!slabs.cross(box.lower, box.upper, enter, leave)) continue;
            Crossing const crossing{enter, leave, box.id, box.level, tree.range[box.id]};
            crossings.push(crossing);
            int at = crossings.size - 1;
            for (; at > 0 && crossings.items[at - 1].enter > enter; --at) crossings.items[at] = crossings.items[at - 1];
            crossings.items[at] = crossing;
        }
    }
}

/// Cuts the ray where it enters or leaves the domain of a brick. The last stretch ends where the part does.
VKT_HD void find_stretches(TreeView const& tree, RayPart part, TreeScratch& scratch) {
    Growing<std::int32_t>& active = scratch.active;
    Crossing const* const crossings = scratch.crossings.items;
    int const n = scratch.crossings.size;
    scratch.stretches.size = scratch.ids.size = active.size = 0;
    int next = 0;
    for (double t = part.begin; t < part.end;) {
        for (; next < n && crossings[next].enter <= t; ++next) {
            active.push(next);
            int at = active.size - 1;
            for (; at > 0 && crossings[active.items[at - 1]].id > crossings[next].id; --at)
                active.items[at] = active.items[at - 1];
            active.items[at] = next;
        }
        Stretch stretch{part.end, scratch.ids.size, 0, no_level, false};
        if (next < n) stretch.end = crossings[next].enter;
        BrickNodes range{1 << 30, -1};
        int kept = 0;
        for (int i = 0; i < active.size; ++i) {
            Crossing const& c = crossings[active.items[i]];
            if (!(c.leave > t)) continue;
            active.items[kept++] = active.items[i];
            scratch.ids.push(c.id);
            stretch.end = c.leave < stretch.end ? c.leave : stretch.end;
            stretch.level = c.level < stretch.level ? c.level : stretch.level;
            range.first = c.range.first < range.first ? c.range.first : range.first;
            range.last = c.range.last > range.last ? c.range.last : range.last;
        }
        active.size = stretch.count = kept;
        stretch.visible = kept > 0 && tree.visible_before[range.last + 1] > tree.visible_before[range.first];
        scratch.stretches.push(stretch);
        t = stretch.end;
    }
    int level = no_level;
    for (int i = scratch.stretches.size - 1; i >= 0; --i) {
        Stretch& s = scratch.stretches.items[i];
        if (s.hole()) s.level = level;
        level = s.level;
    }
}

} // namespace vkt::render
