// Mesh: which surfaces, slab by slab.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/mesh.h"

#include "libvkt/core/error.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/host_copy.h"

#include <algorithm>
#include <limits>

namespace vkt {
namespace {

constexpr std::size_t most_labels = 65535;

} // namespace

VKT_OPERATION(MakeMesh, "mesh")

Texts MakeMesh::texts() const {
    return {
        "Make closed triangle meshes of a surface or of labels.",
        "The surface parts voxels at or above --iso from those below it; every edge belongs to two triangles, which "
        "are counterclockwise seen from outside. Coordinates are those of the world. Surfaces are closed where the "
        "volume ends. Prints numbers of vertices and triangles, area, volume and Euler characteristic; -o writes "
        "STL, PLY, OBJ or VTP."
        "\n\n"
        "Accuracy: Which voxels are inside is exact; vertices lie where linear interpolation in double precision meets "
        "the value, but at least 1/1024 of the way from either voxel.",
        {{"A sphere, measured and written",
          "vkt make sphere --dims 64 64 64 --edge coverage | vkt mesh --iso 0.5 -o sphere.ply"},
         {"Bone in a CT", "vkt mesh volume.nrrd --iso 300 -o bone.stl"},
         {"A file for each label",
          "vkt threshold volume.nrrd --otsu | vkt label --keep-largest 3 | vkt mesh --labels -o part-%d.stl"},
         {"For a program", "vkt mesh volume.nrrd --iso 300 --json"}}};
}

void MakeMesh::parameters(Parameters& p) {
    p.option("iso", iso, "VALUE", "surface between voxels at or above this physical value and those below");
    p.option("label", labels, "N...", "surface around the voxels of this stored value");
    p.flag("labels", all_labels, "surfaces around each label but 0");
    p.option("roi", roi, "X0:X1,Y0:Y1,Z0:Z1", "only these voxels, as if there were no others");
    p.flag("open", open, "leave surfaces open where the volume ends");
}

void MakeMesh::check() const {
    int const given = (iso ? 1 : 0) + (labels.empty() ? 0 : 1) + (all_labels ? 1 : 0);
    if (given == 1) return;
    throw Error(ErrorKind::usage,
                given == 0 ? "there is no surface yet" : "--iso, --label and --labels: give one of them",
                "say --iso VALUE, or --label N or --labels for volumes of labels");
}

Plan MakeMesh::plan(std::span<Header const> inputs) const {
    check();
    Header const& in = inputs.front();
    if (in.kind == Kind::hierarchical)
        throw Error(ErrorKind::usage, "meshes are made of structured volumes",
                    "make it a grid first: vkt resample --cells 50M");
    if (!iso && !is_integer(in.dtype))
        throw Error(ErrorKind::usage, text("labels are integers, the volume is ", in.dtype),
                    "convert first: vkt convert --dtype int32, or say --iso");
    Plan plan;
    plan.output = in;
    plan.scans = !iso.has_value();
    plan.method = iso ? "marching cubes, manifold" : "marching cubes around labels, manifold";
    plan.cost = 60;
    plan.grows_by = "24 bytes a vertex, 12 a triangle";
    // The slice before, one that comes in rows, and bits of both.
    Index3 const n = region_in(in.dims).dims();
    plan.state_bytes = static_cast<std::size_t>(n.x * n.y) * (2 * size_of(in.dtype) + 1);
    return plan;
}

void MakeMesh::begin(std::span<Header const> inputs, Plan const& plan) {
    input_ = inputs.front();
    region_ = region_in(input_.dims);
    held_ = plan.state_bytes;
    parts_.clear();
    boxes_.clear();
    meshes_.clear();
    slice_.clear();
    inside_ = 0;
    scans_again_ = false;
    finding_ = !iso.has_value();
    if (iso) parts_.push_back({SurfaceBuilder(input_, region_, inside_from(*iso, input_), !open), region_, "", 0});
}

void MakeMesh::find_labels(ConstView voxels) {
    with_type(input_.dtype, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) {
            Box const& box = voxels.box;
            View<T const> const view = voxels.as<T>();
            for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                    for (std::int64_t x = box.lower.x; x < box.upper.x;) {
                        T const label = view(x, y, z);
                        std::int64_t const first = x;
                        while (x < box.upper.x && view(x, y, z) == label) ++x;
                        if (label == 0 && all_labels) continue;
                        if (static_cast<std::int64_t>(label) < 0 && !std::is_signed_v<T>)
                            throw Error(ErrorKind::data, "labels go up to 9223372036854775807");
                        auto const key = static_cast<std::int64_t>(label);
                        if (!all_labels && std::find(labels.begin(), labels.end(), key) == labels.end()) continue;
                        auto const [at, added] = boxes_.try_emplace(key, Box{{first, y, z}, {x, y + 1, z + 1}});
                        Box& b = at->second;
                        if (added && boxes_.size() > most_labels)
                            throw Error(ErrorKind::data, text("there are more than ", most_labels, " labels"),
                                        "is this a volume of labels? A value's surface is --iso");
                        b.lower = {std::min(b.lower.x, first), std::min(b.lower.y, y), b.lower.z};
                        b.upper = {std::max(b.upper.x, x), std::max(b.upper.y, y + 1), z + 1};
                    }
        }
    });
}

void MakeMesh::scan(ConstView slab, Execution const& execution) {
    execution_ = execution;
    check_budget(held_, execution);
    Box const box = intersect(slab.box, region_);
    if (box.empty()) return;
    ConstView const part = slab.part(box);
    if (finding_) {
        HostCopy copy;
        return find_labels(copy.of(part));
    }
    if (box.dims().y == region_.dims().y) return take(part, execution);
    // Rows of one slice, kept on the host: it is worked on when it is whole.
    std::size_t const row = static_cast<std::size_t>(box.dims().x) * size_of(slab.type);
    slice_.resize(row * static_cast<std::size_t>(region_.dims().y));
    std::byte* const first = slice_.data() + static_cast<std::size_t>(box.lower.y - region_.lower.y) * row;
    copy_region(part, dense_view(first, slab.type, box), Execution{});
    if (box.upper.y < region_.upper.y) return;
    Box const whole{{region_.lower.x, region_.lower.y, box.lower.z}, {region_.upper.x, region_.upper.y, box.upper.z}};
    take(dense_view(static_cast<std::byte const*>(slice_.data()), slab.type, whole), execution);
}

void MakeMesh::take(ConstView slices, Execution const& execution) {
    std::size_t held = 0;
    for (Part& part : parts_) held += part.builder.bytes();
    for (Part& part : parts_) {
        Box const box = intersect(slices.box, part.box);
        if (box.empty()) continue;
        Execution own = execution;
        std::size_t const others = held - part.builder.bytes();
        own.memory = execution.memory > others ? execution.memory - others : 0;
        part.builder.add(slices.part(box), own);
        held = others + part.builder.bytes();
    }
}

void MakeMesh::scan_end() {
    scans_again_ = finding_;
    if (finding_) {
        finding_ = false;
        for (std::int64_t const label : labels)
            if (!boxes_.contains(label))
                throw Error(ErrorKind::data, text("no voxel has the label ", label), "vkt stats --labels counts them");
        for (auto const& [label, box] : boxes_) {
            Number number;
            number.value = static_cast<double>(label);
            number.whole = label;
            bool const closed = !open;
            // Open where the volume ends is not open where the label does.
            Box const around = closed ? box : intersect(grow(box, {1, 1, 1}), region_);
            parts_.push_back({SurfaceBuilder(input_, around, inside_label(number, input_.dtype), closed), around,
                              text(label), label});
        }
        return;
    }
    inside_ = parts_.empty() ? 0 : parts_.front().builder.voxels_inside();
    for (Part& part : parts_) {
        meshes_.push_back(part.builder.finish(execution_));
        meshes_.back().name = part.name;
        meshes_.back().label = part.label;
    }
    parts_.clear();
}

std::vector<Remark> MakeMesh::remarks() const {
    bool const nobody = inside_ == 0, everybody = inside_ == region_.voxels();
    if (!iso || !(nobody || everybody)) return {};
    return {
        {text("no surface of ", to_text(*iso), " is there: ", nobody ? "no" : "every",
              " voxel is at or above it, and the mesh ", nobody || open ? "is empty" : "is the end of the volume")}};
}

Report MakeMesh::row_of(Mesh const& mesh) const {
    if (execution_.monitor != nullptr) execution_.monitor->poll(0, 1);
    MeshMeasures const measures = measure_mesh(mesh, execution_);
    std::int64_t edges = mesh.triangle_count() * 3 / 2, ends = 0;
    if (open) {
        MeshEdges const count = count_edges(mesh);
        edges = count.one + count.two + count.more;
        ends = count.one;
    }
    Report row;
    if (!iso) row.add("label", mesh.label);
    row.add("vertices", mesh.vertex_count()).add("triangles", mesh.triangle_count()).add("area", measures.area);
    if (open) row.add("boundary_edges", ends);
    // What is open has no inside.
    if (ends == 0) row.add("volume", measures.volume);
    row.add("euler", mesh.vertex_count() - edges + mesh.triangle_count());
    return row;
}

Report MakeMesh::report() const {
    if (iso) return row_of(meshes_.front());
    std::vector<Report> rows;
    for (Mesh const& mesh : meshes_) rows.push_back(row_of(mesh));
    Report report;
    report.write_as(ReportForm::text, rows.empty() ? "no labels\n" : Report::table(rows));
    return report.add("labels", std::move(rows));
}

} // namespace vkt
