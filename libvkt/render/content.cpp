// The part of a volume that a picture is to show: from macrocells.
// SPDX-License-Identifier: MIT
#include "libvkt/render/content.h"

#include "libvkt/render/camera.h"
#include "libvkt/render/inner/ray.h"

#include <algorithm>

namespace vkt::render {

CellPlaces places_of(CellGrid const& grid) {
    constexpr std::int64_t first = -1; // between voxels of the padding and the first ones
    return {{grid.nx, grid.ny, grid.nz}, {first, first, first}, macrocell_size, 1};
}

CellPlaces places_of(TreeCells const& cells) {
    auto const whole = [](double v) { return static_cast<std::int64_t>(v); };
    Double3 const& o = cells.origin;
    return {{cells.grid.nx, cells.grid.ny, cells.grid.nz}, {whole(o.x), whole(o.y), whole(o.z)}, whole(cells.size), 0};
}

std::vector<Vec3> visible_corners(CellVisibility const& cells, CellPlaces const& places, Geometry const& geometry,
                                  Box const& within) {
    std::vector<Vec3> points;
    Index3 const counts = places.counts;
    bool const by_extinction = !cells.depth.empty(); // of surfaces there is none
    auto const from = [&](int axis, std::int64_t cell) { return places.origin[axis] + places.size * cell; };
    for (std::int64_t z = 0; z < counts.z; ++z)
        for (std::int64_t y = 0; y < counts.y; ++y) {
            auto const seen = [&](std::int64_t x) {
                auto const at = static_cast<std::size_t>((z * counts.y + y) * counts.x + x);
                return by_extinction ? cells.majorant[at] > 0 : cells.distance[at] == 0;
            };
            std::int64_t first = 0, last = counts.x - 1;
            while (first <= last && !seen(first)) ++first;
            while (last >= first && !seen(last)) --last;
            if (last < first) continue;
            auto const to = [&](int axis, std::int64_t cell) { return from(axis, cell + 1) + places.more; };
            Box const row =
                intersect(Box{{from(0, first), from(1, y), from(2, z)}, {to(0, last), to(1, y), to(2, z)}}, within);
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
