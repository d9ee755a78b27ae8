// Surfaces of the C API: triangles of a value or of labels, in memory and in files.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/shape/mesh.h"
#include "libvkt/operations/shape/mesh_file.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

struct vkt_surface {
    std::vector<vkt::Mesh> parts{};
    bool labels = false;
    double spacing = 1;
    std::string report{}, remarks{};
};

using namespace vkt;
using namespace vkt::c;

namespace {

vkt_surface surface_of(Volume const& volume, char const* const* words, size_t count, Call& call) {
    MakeMesh operation;
    Parameters own, shared;
    ExecutionOptions options = call.policy();
    operation.parameters(own);
    options.declare(shared);
    read_options(words, count, {&own, &shared});
    operation.check();
    Execution const execution = call.execution(options);
    vkt_surface surface;
    StageInfo info;
    info.name = "mesh";
    info.listener = [&](std::string const&, std::string const& message, bool) {
        surface.remarks += (surface.remarks.empty() ? "" : "\n") + printable(message);
    };
    auto const source = volume_source({volume});
    source->next_volume();
    reduce(*source, operation, execution, info);
    Vec3 const spacing = volume.header().geometry.spacing;
    surface.parts = operation.meshes();
    surface.labels = !operation.iso;
    surface.spacing = std::min({spacing.x, spacing.y, spacing.z});
    surface.report = operation.report().json();
    return surface;
}

Mesh const& part_at(vkt_surface const* surface, int64_t part) {
    need(surface, "surface");
    if (part < 0 || part >= std::ssize(surface->parts))
        throw Error(ErrorKind::usage,
                    text("part ", part, " is not one of ", std::ssize(surface->parts), ", counted from 0"));
    return surface->parts[static_cast<std::size_t>(part)];
}

} // namespace

vkt_status vkt_make_surface(vkt_volume const* volume, char const* const* words, size_t count, vkt_surface** surface) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(surface, "surface");
        *surface = new vkt_surface(surface_of(volume->volume, words, count, call));
    });
}

int64_t vkt_surface_parts(vkt_surface const* surface) { return surface == nullptr ? 0 : std::ssize(surface->parts); }

vkt_status vkt_surface_part(vkt_surface const* surface, int64_t part, vkt_surface_view* view) {
    return guarded([&](Call&) {
        Mesh const& mesh = part_at(surface, part);
        need(view, "view");
        *view = {mesh.label, mesh.vertex_count(), mesh.vertices.data(), mesh.triangle_count(), mesh.triangles.data()};
    });
}

char const* vkt_surface_report(vkt_surface const* surface) { return surface == nullptr ? "" : surface->report.c_str(); }

char const* vkt_surface_remarks(vkt_surface const* surface) {
    return surface == nullptr ? "" : surface->remarks.c_str();
}

vkt_status vkt_surface_write(vkt_surface const* surface, char const* path, char const* const* words, size_t count) {
    return guarded([&](Call&) {
        need(surface, "surface");
        need(path, "path");
        Parameters parameters;
        std::optional<MeshFormat> format;
        MeshFileOptions options;
        bool force = false;
        parameters.option("format", format, "FORMAT", "stl, ply, obj or vtp, where the name does not tell");
        parameters.flag("ascii", options.ascii, "numbers as text instead of binary");
        parameters.flag("normals", options.normals, "normals of vertices");
        parameters.flag("force", force, "overwrite an existing output file");
        read_options(words, count, {&parameters});
        options.format = mesh_format(path, format, options.normals);
        options.labels = surface->labels;
        options.spacing = surface->spacing;
        OutputFile file(path, force);
        write_meshes(file, surface->parts, options);
        file.commit();
    });
}

void vkt_free_surface(vkt_surface* surface) { delete surface; }
