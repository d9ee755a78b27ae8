// Index to world and back, and how operations move the lattice.
// SPDX-License-Identifier: MIT
#include "libvkt/core/geometry.h"

#include "libvkt/core/error.h"
#include "libvkt/core/products.h"

#include <cmath>

namespace vkt {
namespace {

bool finite(Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

double determinant(Geometry const& g) { return dot(g.direction[0], cross(g.direction[1], g.direction[2])); }

} // namespace

Vec3 index_to_world(Geometry const& g, Vec3 index) {
    Vec3 world = g.origin;
    for (int axis = 0; axis < 3; ++axis) world = world + g.direction[axis] * (g.spacing[axis] * index[axis]);
    return world;
}

Vec3 world_to_index(Geometry const& g, Vec3 world) {
    double const volume = determinant(g);
    if (!(std::abs(volume) > 1e-12)) throw Error(ErrorKind::data, "the direction vectors are linearly dependent");
    Vec3 const d = world - g.origin;
    Vec3 const& a = g.direction[0];
    Vec3 const& b = g.direction[1];
    Vec3 const& c = g.direction[2];
    return {dot(d, cross(b, c)) / (volume * g.spacing.x), dot(d, cross(c, a)) / (volume * g.spacing.y),
            dot(d, cross(a, b)) / (volume * g.spacing.z)};
}

Geometry cropped(Geometry const& geometry, Index3 lower) {
    Geometry result = geometry;
    if (lower == Index3{}) return result;
    result.origin = index_to_world(
        geometry, {static_cast<double>(lower.x), static_cast<double>(lower.y), static_cast<double>(lower.z)});
    return result;
}

Geometry flipped(Geometry const& geometry, Axis axis, std::int64_t n) {
    Geometry result = geometry;
    auto const a = static_cast<int>(axis);
    Vec3 last{};
    last[a] = static_cast<double>(n - 1);
    result.origin = index_to_world(geometry, last);
    result.direction[a] = geometry.direction[a] * -1.0;
    for (int i = 0; i < 3; ++i) result.direction[a][i] += 0.0; // no negative zeros
    return result;
}

Geometry rescaled(Geometry const& geometry, Index3 from, Index3 to) {
    Geometry result = geometry;
    Vec3 first{};
    for (int axis = 0; axis < 3; ++axis) {
        if (from[axis] == to[axis]) continue;
        double const factor = static_cast<double>(from[axis]) / static_cast<double>(to[axis]);
        result.spacing[axis] = geometry.spacing[axis] * factor;
        first[axis] = 0.5 * factor - 0.5;
    }
    if (!(first == Vec3{})) result.origin = index_to_world(geometry, first);
    return result;
}

void check(Geometry const& g) {
    if (!finite(g.origin)) throw Error(ErrorKind::data, "the origin is not finite");
    if (!finite(g.spacing) || !(g.spacing.x > 0 && g.spacing.y > 0 && g.spacing.z > 0))
        throw Error(ErrorKind::data, "the spacing is not positive and finite");
    for (auto const& column : g.direction)
        if (!finite(column)) throw Error(ErrorKind::data, "a direction vector is not finite");
    if (!(std::abs(determinant(g)) > 1e-6))
        throw Error(ErrorKind::data, "the direction vectors are linearly dependent");
}

bool same_geometry(Geometry const& a, Geometry const& b) {
    for (int axis = 0; axis < 3; ++axis) {
        double const s = std::min(a.spacing[axis], b.spacing[axis]);
        if (std::abs(a.spacing[axis] - b.spacing[axis]) > 1e-6 * s) return false;
        if (std::abs(a.origin[axis] - b.origin[axis]) > 1e-4 * s) return false;
        for (int i = 0; i < 3; ++i)
            if (std::abs(a.direction[axis][i] - b.direction[axis][i]) > 1e-6) return false;
    }
    return true;
}

} // namespace vkt
