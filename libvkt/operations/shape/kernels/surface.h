// Surfaces through a lattice of voxels: who is inside, how many vertices and triangles rows have, and which.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/geometry.h"
#include "libvkt/kernel/numeric.h"

#include <array>

namespace vkt {

/// Which voxels are inside. `at` is of the voxels' type, float for halves, rounded so that comparing with it is exact.
struct Inside {
    enum class Rule : std::uint8_t { nobody, everybody, from, to, equal };
    Rule rule = Rule::from; ///< stored value >= at, <= at, == at; NaN never is
    VoxelBytes at{};
    double level = 0; ///< stored value at which the surface lies between two voxels; with `equal` it lies half way
};

/// Triangles of a cell by which of its corners are inside: corner x | y << 1 | z << 2 is that bit of the case.
/// Edges are numbered 4 * axis + k, where k holds the other two coordinates, the lower axis in bit 0.
struct SurfaceCases {
    std::array<std::uint8_t, 256> count{};                 ///< triangles
    std::array<std::array<std::uint8_t, 15>, 256> edges{}; ///< three of each triangle
};

/// Of one lattice row: crossed edges that come from the slice before, that lie in the row, and that go to the next row,
/// and triangles of the cells between this slice and the one before, from this row to the next. First their numbers,
/// then the index of the first one.
struct SurfaceRow {
    std::uint32_t before = 0, along = 0, next = 0, triangles = 0;
};

/// Some slices of a lattice. Slice 0 is the last one of the slab before, whose edges within the slice have their
/// vertices already. A closed surface has a layer of lattice points around the voxels that are outside.
struct SurfaceSlab {
    Index3 lattice;                     ///< points along x and y, and slices
    std::int64_t border = 0;            ///< 1: closed
    std::int64_t words = 0;             ///< of 64 bits that a row takes
    bool first = false;                 ///< slice 0 is not there: there are no cells between it and slice 1
    std::uint64_t* bits = nullptr;      ///< rows of all slices: 1 is inside
    SurfaceRow* rows = nullptr;         ///< of all slices
    ConstView last;                     ///< voxels of slice 0, if there are any
    ConstView voxels;                   ///< of slices 1, 2, …; a border slice may follow them, or be slice 1
    std::int64_t voxels_from = 1;       ///< slice of the first of them
    Geometry geometry;                  ///< of the volume that boxes of voxels refer to
    std::int64_t origin_z = 0;          ///< of slice 0, as an index of that volume
    Index3 origin;                      ///< of lattice point (0, 0), as an index of that volume; z is not used
    double* vertices = nullptr;         ///< x, y, z in the world, those of earlier slabs first
    std::uint32_t* triangles = nullptr; ///< three vertices each, of this slab
    std::int64_t first_vertex = 0;      ///< of this slab
    std::int64_t vertex_count = 0, triangle_count = 0; ///< of this slab
    SurfaceCases const* cases = nullptr;
    bool mirrored = false; ///< directions are a left-handed system: triangles turn around
};

/// Nearest that a vertex comes to a voxel, as a part of their distance: no two of them coincide, not in float32 either.
inline constexpr double surface_margin = 1.0 / 1024;

/// Bits of the slices of slab.voxels.
VKT_KERNEL(surface_bits, (SurfaceSlab const& slab, Inside const& inside, Execution const& execution),
           (slab, inside, execution))
/// Numbers of the rows of slices 1, 2, …
VKT_KERNEL(surface_count, (SurfaceSlab const& slab, Execution const& execution), (slab, execution))
/// Vertices and triangles of the rows of slices 1, 2, …, where their SurfaceRows say.
VKT_KERNEL(surface_emit, (SurfaceSlab const& slab, Inside const& inside, Execution const& execution),
           (slab, inside, execution))

} // namespace vkt
