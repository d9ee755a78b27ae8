// Files of triangle meshes: STL, PLY, OBJ, VTP. They are only written.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/io/output_file.h"
#include "libvkt/operations/shape/surface.h"

#include <optional>
#include <span>
#include <string>

namespace vkt {

enum class MeshFormat : std::uint8_t { stl, ply, obj, vtp };
template <> struct EnumNames<MeshFormat> {
    static std::vector<std::pair<MeshFormat, char const*>> all() {
        return {{MeshFormat::stl, "stl"}, {MeshFormat::ply, "ply"}, {MeshFormat::obj, "obj"}, {MeshFormat::vtp, "vtp"}};
    }
};

struct MeshFileOptions {
    MeshFormat format = MeshFormat::ply;
    bool ascii = false;   ///< numbers as text; OBJ knows nothing else
    bool normals = false; ///< of vertices; STL has those of triangles
    bool labels =
        false; ///< triangles tell the label of their mesh: PLY and VTP as numbers, OBJ and STL as text by parts
    double spacing = 1; ///< the least distance of voxels; tells how many digits coordinates need
};

/// That of the name's extension; none if it has another one.
std::optional<MeshFormat> mesh_format_of(std::string const& path);

/// The format that was said, or else that of the name. Throws Error{usage} if there is none, and for normals where the
/// format has no place for them.
MeshFormat mesh_format(std::string const& path, std::optional<MeshFormat> said, bool normals);

/// Several meshes become one file. Coordinates are float32 in STL, in PLY and VTP where that is exact to 1/2048 of
/// the spacing, float64 otherwise. Throws Error{io}, and Error{usage} for more than 2^32 triangles in STL.
void write_meshes(OutputFile& file, std::span<Mesh const> meshes, MeshFileOptions const& options);

/// Whether float32 is exact to 1/2048 of the spacing.
bool fits_float32(std::span<Mesh const> meshes, double spacing);

} // namespace vkt
