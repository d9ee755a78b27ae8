// Closed triangle meshes of surfaces through volumes that come slab by slab, and what can be said of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/header.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/shape/kernels/surface.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace vkt {

/// Marching cubes with cases of our own, derived when they are first needed. Where the corners of a face alternate,
/// those that are inside are parted, in both cells that have the face; polygons are cut into triangles without edges
/// that lie in a face. So every edge belongs to two triangles, and around every vertex they form one ring: the result
/// is a manifold for any input (W. E. Lorensen and H. E. Cline, Marching cubes, SIGGRAPH 1987; the choice of one rule
/// for all faces: C. Montani, R. Scateni, R. Scopigno, A modified look-up table, The Visual Computer 10, 1994).
SurfaceCases const& surface_cases();

/// Triangles, counterclockwise seen from outside, and their corners in world coordinates.
struct Mesh {
    std::vector<double> vertices;         ///< x, y, z each
    std::vector<std::uint32_t> triangles; ///< three vertices each
    std::string name;                     ///< what it is the surface of, for files: "3"
    std::int64_t label = 0;

    std::int64_t vertex_count() const { return std::ssize(vertices) / 3; }
    std::int64_t triangle_count() const { return std::ssize(triangles) / 3; }
    std::size_t bytes() const { return vertices.size() * sizeof(double) + triangles.size() * sizeof(std::uint32_t); }
};

/// The same for any number of threads: sums of blocks of triangles, in order.
struct MeshMeasures {
    double area = 0;
    double volume = 0; ///< signed; of an open mesh it means nothing
};
MeshMeasures measure_mesh(Mesh const& mesh, Execution const& execution);
/// Edges that belong to one triangle, to two, to more. O(n log n), 8 bytes an edge of each triangle.
struct MeshEdges {
    std::int64_t one = 0, two = 0, more = 0;
};
MeshEdges count_edges(Mesh const& mesh);
/// Unit vectors, x, y, z each: means of the triangles around each vertex, weighted by their areas.
std::vector<float> vertex_normals(Mesh const& mesh);

/// What is inside of the surface at a physical value: voxels at or above it. With a negative slope stored values are
/// below.
Inside inside_from(Number const& value, Header const& header);
/// What is inside of a label: the voxels of that stored value.
Inside inside_label(Number const& value, DataType type);

/// Collects a mesh from slabs of whole slices that follow one another. Holds a slice and the bits of a slab.
class SurfaceBuilder {
public:
    /// `region` of a volume of this header; closed: as if there were nothing around it, half a voxel away.
    SurfaceBuilder(Header const& header, Box const& region, Inside inside, bool closed);
    /// The next slices, from a view whose rows and columns are those of the region. Throws Error{resources} where the
    /// mesh exceeds the budget or 2^32 vertices.
    void add(ConstView slab, Execution const& execution);
    std::size_t bytes() const { return mesh_.bytes(); }          ///< of the mesh so far
    std::int64_t voxels_inside() const { return inside_count_; } ///< of those so far
    /// The mesh, once all slices were added.
    Mesh finish(Execution const& execution);

private:
    void work(ConstView voxels, std::int64_t slices, bool first, Execution const& execution);

    Header header_;
    Box region_;
    Inside inside_;
    bool closed_ = true, mirrored_ = false;
    std::int64_t done_ = 0; ///< lattice slices
    std::int64_t inside_count_ = 0;
    Index3 lattice_;
    std::int64_t words_ = 0;
    std::vector<std::uint64_t> bits_;
    std::vector<SurfaceRow> rows_;
    std::vector<std::byte> last_;
    Mesh mesh_;
};

} // namespace vkt
