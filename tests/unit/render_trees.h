// Helpers of the rendering tests of hierarchical volumes: trees of known content, cut from structured ones or made.
// SPDX-License-Identifier: MIT
#pragma once

#include "amr_helper.h"
#include "render_testing.h"

namespace vkt::render::testing {

/// Bricks of one level that tile a grid, `edge` cells each, less where the grid ends.
inline std::vector<Brick> tiles_of(Index3 dims, Index3 edge) {
    std::vector<Brick> bricks;
    for (std::int64_t z = 0; z < dims.z; z += edge.z)
        for (std::int64_t y = 0; y < dims.y; y += edge.y)
            for (std::int64_t x = 0; x < dims.x; x += edge.x)
                bricks.push_back(
                    {{x, y, z},
                     {std::min(edge.x, dims.x - x), std::min(edge.y, dims.y - y), std::min(edge.z, dims.z - z)},
                     0});
    return bricks;
}

template <class T> Volume cut(Volume const& volume, Index3 edge) {
    Header header = volume.header();
    header.kind = Kind::hierarchical;
    Volume tree(header, tiles_of(header.dims, edge));
    auto* cell = reinterpret_cast<T*>(tree.buffer().write(Space::host));
    auto const v = volume.view().as<T>();
    for (Brick const& b : tree.bricks())
        for (std::int64_t z = 0; z < b.dims.z; ++z)
            for (std::int64_t y = 0; y < b.dims.y; ++y)
                for (std::int64_t x = 0; x < b.dims.x; ++x) *cell++ = v(b.lower.x + x, b.lower.y + y, b.lower.z + z);
    return tree;
}

inline Volume with_geometry(Volume const& volume, Geometry const& geometry) {
    Header header = volume.header();
    header.geometry = geometry;
    Volume result(header);
    std::memcpy(result.buffer().write(Space::host), volume.buffer().read(Space::host),
                static_cast<std::size_t>(header.bytes()));
    return result;
}

/// Turned and stretched: 3-4-5 in the xy plane.
inline Geometry skewed() {
    Geometry g;
    g.spacing = {0.7, 1.3, 2.1};
    g.direction = {Vec3{0.6, 0.8, 0}, Vec3{-0.8, 0.6, 0}, Vec3{0, 0, 1}};
    g.origin = {100, -20, 3};
    return g;
}

inline RenderSettings colourful() {
    RenderSettings s;
    s.width = 61, s.height = 47;
    s.camera.fit = Fit::volume; // what is visible is known by bricks here and by macrocells there
    s.lut = {1, 0.5, 0.2, 0, 0.4, 0.6, 0.8, 0.02, 0.9, 0.9, 0.3, 0.2};
    return s;
}

inline Volume small_tree() { return make_amr(amr_test::small_recipe(), amr_test::execution()); }

} // namespace vkt::render::testing
