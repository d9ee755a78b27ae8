// Rays in lattice space: from pixels, clipped to the volume's box, stepped through macrocells.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/vector.h"

#include <cmath>
#include <cstdint>
#include <limits>

namespace vkt::render {

/// Voxels of clamped padding around every lattice: one for interpolation, one more for central differences.
inline constexpr int lattice_padding = 2;

/// Edge of a lattice's macrocell in voxels, and where the first one begins in the padded lattice.
inline constexpr int macrocell_size = 8;
inline constexpr float macrocell_origin = lattice_padding - 1;

/// The camera mapped into lattice space, where padded voxel i lies at coordinate i. Vectors are images of world
/// vectors.
struct RayFrame {
    Double3 eye, forward, right, up; ///< right and up span half the image
    double right_length, up_length;  ///< their lengths in the world
    bool perspective;
    double width, height; ///< of the image in pixels
    int top = 0;          ///< row of the image that row 0 of the part which is drawn, and held, is
};

/// A ray inside the box: position entry + t * direction for t in [0, length], direction of unit length in the lattice.
struct Ray {
    Double3 entry, direction;
    double length;            ///< lattice units
    double world_per_lattice; ///< world length of one lattice unit along this ray
    double start = 0;         ///< lattice units from the camera to the entry
};

/// Part of a line within the box [lower, upper]; false if there is none. Written so that 0 and NaN take defined paths.
VKT_HD bool clip_axis(double origin, double direction, double lower, double upper, double& near, double& far) {
    if (direction == 0) return origin >= lower && origin <= upper;
    double const a = (lower - origin) / direction, b = (upper - origin) / direction;
    double const first = a < b ? a : b, last = a < b ? b : a;
    near = first > near ? first : near;
    far = last < far ? last : far;
    return near < far;
}

VKT_HD bool clip(Double3 origin, Double3 direction, Double3 lower, Double3 upper, double& near, double& far) {
    return clip_axis(origin.x, direction.x, lower.x, upper.x, near, far) &&
           clip_axis(origin.y, direction.y, lower.y, upper.y, near, far) &&
           clip_axis(origin.z, direction.z, lower.z, upper.z, near, far) && near < far;
}

/// The half of space in which dot(normal, p) is at least `offset`.
struct HalfSpace {
    Double3 normal;
    double offset;
};
inline constexpr int most_planes = 6;

/// What is shown of a volume, in the lattice: a box, of which planes cut parts off. It is convex, so that a ray meets
/// it in one piece.
struct ShownPart {
    Double3 lower, upper;
    HalfSpace planes[most_planes];
    int plane_count;
};

VKT_HD bool clip(Double3 origin, Double3 direction, ShownPart const& shown, double& near, double& far) {
    if (!clip(origin, direction, shown.lower, shown.upper, near, far)) return false;
    for (int i = 0; i < shown.plane_count; ++i) {
        HalfSpace const& half = shown.planes[i];
        double const rise = dot(half.normal, direction), height = dot(half.normal, origin) - half.offset;
        if (rise == 0) {
            if (!(height >= 0)) return false;
            continue;
        }
        double const at = -height / rise;
        if (rise > 0)
            near = at > near ? at : near;
        else
            far = at < far ? at : far;
    }
    return near < far;
}

/// The ray through position (x, y), in pixels of the part that is drawn; false if it misses what is shown.
VKT_HD bool make_ray(RayFrame const& frame, double x, double y, ShownPart const& shown, Ray& ray) {
    double const u = 2 * x / frame.width - 1, v = 1 - 2 * (y + frame.top) / frame.height;
    Double3 const offset = frame.right * u + frame.up * v;
    double const ru = u * frame.right_length, uv = v * frame.up_length;
    Double3 const origin = frame.perspective ? frame.eye : frame.eye + offset;
    Double3 const along = frame.perspective ? frame.forward + offset : frame.forward;
    double const world = frame.perspective ? std::sqrt(1 + ru * ru + uv * uv) : 1.0;
    double const lattice = std::sqrt(dot(along, along));
    ray.direction = along * (1 / lattice);
    ray.world_per_lattice = world / lattice;
    double near = 0, far = std::numeric_limits<double>::infinity();
    if (!clip(origin, ray.direction, shown, near, far)) return false;
    ray.entry = origin + ray.direction * near;
    ray.length = far - near;
    ray.start = near;
    return true;
}

/// Whether a loop goes on, as a value of which a GPU's compiler knows nothing: so the loop has one exit, behind which
/// the threads of a warp go on together. Taken out of it by several, each would go its own way.
VKT_HD bool goes_on(bool on) {
#ifdef __CUDA_ARCH__
    int value = on ? 1 : 0;
    asm volatile("" : "+r"(value));
    return value != 0;
#else
    return on;
#endif
}

/// Steps of a ray through a grid of cubic cells with edges at multiples of `size` from `lower`. The cell index is
/// authoritative: it changes by one along one axis per step, whatever rounding does to positions.
template <class Real> struct CellWalk {
    int cell[3], step[3], end[3];
    Real next[3], width[3], per_width[3];
    int count[3];
    Real t, exit;

    template <class Vector>
    VKT_HD void start(Vector origin, Vector direction, Real length, Real lower, Real size, int nx, int ny, int nz) {
        Real const o[3] = {origin.x, origin.y, origin.z}, d[3] = {direction.x, direction.y, direction.z};
        int const n[3] = {nx, ny, nz};
        for (int axis = 0; axis < 3; ++axis) {
            Real const place = (o[axis] - lower) / size;
            int const i = static_cast<int>(place);
            cell[axis] = i < 0 ? 0 : i >= n[axis] ? n[axis] - 1 : i;
            step[axis] = d[axis] > 0 ? 1 : d[axis] < 0 ? -1 : 0;
            end[axis] = d[axis] > 0 ? n[axis] : -1;
            Real const ahead =
                d[axis] > 0 ? static_cast<Real>(cell[axis] + 1) - place : place - static_cast<Real>(cell[axis]);
            width[axis] = d[axis] == 0 ? 0 : size / (d[axis] > 0 ? d[axis] : -d[axis]);
            per_width[axis] = (d[axis] > 0 ? d[axis] : -d[axis]) / size;
            count[axis] = n[axis];
            next[axis] = d[axis] == 0 ? std::numeric_limits<Real>::infinity() : ahead * width[axis];
        }
        t = 0;
        exit = length;
    }
    /// The same within one cell of another walk along the same direction: through count * count * count cells, a power
    /// of two. `origin` is in small cells. The same numbers, without divisions.
    template <class Vector> VKT_HD void start_within(CellWalk const& outer, Vector origin, Real length, int cells) {
        Real const o[3] = {origin.x, origin.y, origin.z};
        Real const per = Real(1) / static_cast<Real>(cells);
        for (int axis = 0; axis < 3; ++axis) {
            int const i = static_cast<int>(o[axis]);
            cell[axis] = i < 0 ? 0 : i >= cells ? cells - 1 : i;
            step[axis] = outer.step[axis];
            end[axis] = step[axis] > 0 ? cells : -1;
            Real const ahead =
                step[axis] > 0 ? static_cast<Real>(cell[axis] + 1) - o[axis] : o[axis] - static_cast<Real>(cell[axis]);
            width[axis] = outer.width[axis] * per;
            per_width[axis] = outer.per_width[axis] * static_cast<Real>(cells);
            count[axis] = cells;
            next[axis] = step[axis] == 0 ? std::numeric_limits<Real>::infinity() : ahead * width[axis];
        }
        t = 0;
        exit = length;
    }
    /// Where the ray leaves the present cell.
    VKT_HD Real leave() const {
        Real const xy = next[0] < next[1] ? next[0] : next[1];
        Real const all = xy < next[2] ? xy : next[2];
        return all < exit ? all : exit;
    }
    /// Where it leaves the cube of cells less than `distance` away from the present one.
    VKT_HD Real leave(int distance) const {
        auto const further = static_cast<Real>(distance - 1);
        Real const x = next[0] + further * width[0], y = next[1] + further * width[1], z = next[2] + further * width[2];
        Real const xy = x < y ? x : y;
        Real const all = xy < z ? xy : z;
        return all < exit ? all : exit;
    }
    /// Moves to the next cell; false behind the last one. Without an index that varies, so that a GPU keeps all of it
    /// in registers.
    VKT_HD bool advance() {
        int const axis = next[0] <= next[1] ? (next[0] <= next[2] ? 0 : 2) : (next[1] <= next[2] ? 1 : 2);
        t = axis == 0 ? next[0] : axis == 1 ? next[1] : next[2];
        if (!(t < exit)) return false;
        cell[0] += axis == 0 ? step[0] : 0;
        cell[1] += axis == 1 ? step[1] : 0;
        cell[2] += axis == 2 ? step[2] : 0;
        next[0] = axis == 0 ? next[0] + width[0] : next[0];
        next[1] = axis == 1 ? next[1] + width[1] : next[1];
        next[2] = axis == 2 ? next[2] + width[2] : next[2];
        return axis == 0 ? cell[0] != end[0] : axis == 1 ? cell[1] != end[1] : cell[2] != end[2];
    }
    /// Leaves the cube of cells less than `distance` away from the present one at once; false behind the last cell.
    VKT_HD bool leap(int distance) {
        if (distance <= 1) return advance();
        auto const further = static_cast<Real>(distance - 1);
        Real const x = next[0] + further * width[0], y = next[1] + further * width[1], z = next[2] + further * width[2];
        Real const xy = x < y ? x : y;
        Real const out = xy < z ? xy : z;
        if (!(out < exit)) return false;
        t = out;
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis) {
            if (!(next[axis] <= out)) continue;
            int const steps = static_cast<int>((out - next[axis]) * per_width[axis]) + 1;
            cell[axis] += steps * step[axis];
            next[axis] += static_cast<Real>(steps) * width[axis];
            inside = inside && cell[axis] >= 0 && cell[axis] < count[axis];
        }
        return inside;
    }
};

} // namespace vkt::render
