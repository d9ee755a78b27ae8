// The part of a volume that a picture is to show: from macrocells.
// SPDX-License-Identifier: MIT
#include "libvkt/render/content.h"

#include "libvkt/render/camera.h"
#include "libvkt/render/inner/ray.h"

#include <algorithm>

namespace vkt::render {

std::vector<Vec3> visible_corners(CellVisibility const& cells, Index3 counts, Geometry const& geometry,
                                  Box const& within) {
    std::vector<Vec3> points;
    auto const from = [](std::int64_t cell) { return macrocell_size * cell + lattice_padding - 1 - lattice_padding; };
    for (std::int64_t z = 0; z < counts.z; ++z)
        for (std::int64_t y = 0; y < counts.y; ++y) {
            auto const seen = [&](std::int64_t x) {
                return cells.distance[static_cast<std::size_t>((z * counts.y + y) * counts.x + x)] == 0;
            };
            std::int64_t first = 0, last = counts.x - 1;
            while (first <= last && !seen(first)) ++first;
            while (last >= first && !seen(last)) --last;
            if (last < first) continue;
            Box const row = intersect(
                Box{{from(first), from(y), from(z)}, {from(last + 1) + 1, from(y + 1) + 1, from(z + 1) + 1}}, within);
            if (row.empty()) continue;
            auto const corners = corners_of(geometry, row);
            points.insert(points.end(), corners.begin(), corners.end());
        }
    return points;
}

Box visible_box(CellVisibility const& cells, Index3 dims) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        if (cells.last[axis] < cells.first[axis]) return box_of(dims);
        constexpr std::int64_t before = lattice_padding - 1; // cells begin there in the padded lattice
        box.lower[axis] = macrocell_size * static_cast<std::int64_t>(cells.first[axis]) + before - lattice_padding;
        box.upper[axis] =
            macrocell_size * static_cast<std::int64_t>(cells.last[axis] + 1) + before - lattice_padding + 1;
    }
    return intersect(box, box_of(dims));
}

} // namespace vkt::render
