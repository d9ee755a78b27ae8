// Helpers of the rendering tests of hierarchical volumes: trees of known content, cut from structured ones or made.
// SPDX-License-Identifier: MIT
#pragma once

#include "amr_helper.h"
#include "render_testing.h"

#include "libvkt/amr/sampler.h"

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
    s.tree = TreeDrawing::bricks;
    s.width = 61, s.height = 47;
    s.camera.fit = Fit::volume; // what is visible is known by bricks here and by macrocells there
    s.lut = {1, 0.5, 0.2, 0, 0.4, 0.6, 0.8, 0.02, 0.9, 0.9, 0.3, 0.2};
    return s;
}

inline Volume small_tree() { return make_amr(amr_test::small_recipe(), amr_test::execution()); }

inline Layer const& layer(RenderReport const& report, std::string const& name) {
    for (Layer const& one : report.layers)
        if (one.name == name) return one;
    throw std::runtime_error("no layer " + name);
}

/// The whole tree on its finest grid.
inline Volume resampled(Volume const& tree) {
    Index3 const dims = tree.header().dims;
    Volume grid = float_volume(dims, {1, 1, 1});
    auto const v = grid.mutable_view().as<float>();
    TreeSampler const sampler(tree);
    for (std::int64_t z = 0; z < dims.z; ++z)
        for (std::int64_t y = 0; y < dims.y; ++y)
            for (std::int64_t x = 0; x < dims.x; ++x)
                v(x, y, z) = sampler
                                 .sample({static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                                          static_cast<double>(z) + 0.5})
                                 .value;
    return grid;
}

/// Distance from the centre of a cube of 64, fine within 12 of a sphere of radius 20 and coarser elsewhere.
inline Volume sphere_tree() {
    auto const distance = [](Vec3 p) { return std::hypot(p.x - 32, p.y - 32, p.z - 32); };
    std::vector<Brick> bricks;
    for (Brick const& coarse : tiles_of({64, 64, 64}, {16, 16, 16})) {
        Vec3 const centre{static_cast<double>(coarse.lower.x) + 8, static_cast<double>(coarse.lower.y) + 8,
                          static_cast<double>(coarse.lower.z) + 8};
        if (std::abs(distance(centre) - 20) > 18) {
            bricks.push_back({coarse.lower, {8, 8, 8}, 1});
            continue;
        }
        for (Brick fine : tiles_of({16, 16, 16}, {8, 8, 8})) {
            fine.lower = coarse.lower + fine.lower;
            bricks.push_back(fine);
        }
    }
    return amr_test::make_tree({64, 64, 64}, bricks, distance);
}

} // namespace vkt::render::testing
