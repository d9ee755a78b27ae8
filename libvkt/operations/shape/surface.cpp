// Surfaces: slabs in, counts, places in the mesh, triangles out.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/surface.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/closed_range.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace vkt {
namespace {

/// The least value of T that is not below `level` (from), or the greatest that is not above it.
template <class T> Inside bound(double level, bool from) {
    Inside inside;
    inside.level = level;
    inside.rule = from ? Inside::Rule::from : Inside::Rule::to;
    std::conditional_t<std::is_same_v<T, Half>, float, T> at{};
    if constexpr (std::is_integral_v<T>) {
        double const whole = from ? std::ceil(level) : std::floor(level);
        // One beyond the greatest is a power of two, and exact.
        double const lowest = static_cast<double>(std::numeric_limits<T>::lowest());
        double const beyond = std::ldexp(1.0, std::numeric_limits<T>::digits);
        if (whole < lowest) {
            inside.rule = from ? Inside::Rule::everybody : Inside::Rule::nobody;
        } else if (whole >= beyond) {
            inside.rule = from ? Inside::Rule::nobody : Inside::Rule::everybody;
        } else {
            at = static_cast<T>(whole);
        }
    } else if constexpr (std::is_same_v<T, double>) {
        at = level;
    } else {
        // Halves are compared as floats.
        at = from ? VKT_BACKEND::least_from<float>(level) : VKT_BACKEND::greatest_to<float>(level);
    }
    std::memcpy(inside.at.data(), static_cast<void const*>(&at), sizeof at);
    return inside;
}

double determinant(std::array<Vec3, 3> const& m) {
    return m[0].x * (m[1].y * m[2].z - m[1].z * m[2].y) - m[1].x * (m[0].y * m[2].z - m[0].z * m[2].y) +
           m[2].x * (m[0].y * m[1].z - m[0].z * m[1].y);
}

Vec3 corner(Mesh const& mesh, std::size_t triangle, std::size_t i) {
    double const* const at = mesh.vertices.data() + 3 * static_cast<std::size_t>(mesh.triangles[3 * triangle + i]);
    return {at[0], at[1], at[2]};
}

} // namespace

MeshMeasures measure_mesh(Mesh const& mesh, Execution const& execution) {
    constexpr std::size_t block = 65536;
    std::size_t const n = static_cast<std::size_t>(mesh.triangle_count()), blocks = (n + block - 1) / block;
    if (n == 0) return {};
    // Around the first vertex, lest what is far from the origin loses digits.
    Vec3 const centre = corner(mesh, 0, 0);
    std::vector<MeshMeasures> sums(blocks);
#pragma omp parallel for num_threads(execution.threads) schedule(static) if (blocks > 1)
    for (std::size_t b = 0; b < blocks; ++b) {
        MeshMeasures sum;
        for (std::size_t t = b * block; t < std::min(n, (b + 1) * block); ++t) {
            Vec3 const p = corner(mesh, t, 0) - centre, q = corner(mesh, t, 1) - centre,
                       r = corner(mesh, t, 2) - centre;
            Vec3 const normal = cross(q - p, r - p);
            sum.area += std::sqrt(dot(normal, normal)) / 2;
            sum.volume += dot(p, cross(q, r)) / 6;
        }
        sums[b] = sum;
    }
    MeshMeasures total;
    for (MeshMeasures const& sum : sums) {
        total.area += sum.area;
        total.volume += sum.volume;
    }
    return total;
}

MeshEdges count_edges(Mesh const& mesh) {
    std::vector<std::uint64_t> edges(mesh.triangles.size());
    for (std::size_t i = 0; i < edges.size(); ++i) {
        std::uint64_t const a = mesh.triangles[i], b = mesh.triangles[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = std::min(a, b) << 32 | std::max(a, b);
    }
    std::sort(edges.begin(), edges.end());
    MeshEdges count;
    for (std::size_t i = 0, j = 0; i < edges.size(); i = j) {
        while (j < edges.size() && edges[j] == edges[i]) ++j;
        ++(j - i == 1 ? count.one : j - i == 2 ? count.two : count.more);
    }
    return count;
}

std::vector<float> vertex_normals(Mesh const& mesh) {
    std::vector<double> sums(mesh.vertices.size());
    for (std::size_t t = 0; t < static_cast<std::size_t>(mesh.triangle_count()); ++t) {
        Vec3 const p = corner(mesh, t, 0);
        Vec3 const normal = cross(corner(mesh, t, 1) - p, corner(mesh, t, 2) - p);
        for (std::size_t i = 0; i < 3; ++i)
            for (int axis = 0; axis < 3; ++axis)
                sums[3 * static_cast<std::size_t>(mesh.triangles[3 * t + i]) + static_cast<std::size_t>(axis)] +=
                    normal[axis];
    }
    std::vector<float> normals(sums.size());
    for (std::size_t v = 0; v < sums.size(); v += 3) {
        double const length = std::sqrt(sums[v] * sums[v] + sums[v + 1] * sums[v + 1] + sums[v + 2] * sums[v + 2]);
        for (std::size_t i = v; i < v + 3; ++i) normals[i] = length > 0 ? static_cast<float>(sums[i] / length) : 0.0f;
    }
    return normals;
}

Inside inside_from(Number const& value, Header const& header) {
    bool const from = header.values.slope > 0;
    double const level = header.values == ValueMap{} ? value.value : header.values.stored(value.value);
    Inside inside;
    with_type(header.dtype, [&]<class T>(T) { inside = bound<T>(level, from); });
    return inside;
}

Inside inside_label(Number const& value, DataType type) {
    Inside inside;
    inside.rule = fits(type, value) && storing_loss(type, value) == 0 ? Inside::Rule::equal : Inside::Rule::nobody;
    inside.at = voxel_bytes(type == DataType::float16 ? DataType::float32 : type, value);
    return inside;
}

SurfaceBuilder::SurfaceBuilder(Header const& header, Box const& region, Inside inside, bool closed)
    : header_(header), region_(region), inside_(inside), closed_(closed),
      mirrored_(determinant(header.geometry.direction) < 0), lattice_(region.dims()) {
    if (closed_) lattice_ = lattice_ + Index3{2, 2, 2};
    words_ = (lattice_.x + 63) / 64;
    bits_.assign(static_cast<std::size_t>(lattice_.y * words_), 0);
    rows_.resize(static_cast<std::size_t>(lattice_.y));
    done_ = closed_ ? 1 : 0; // a border slice without a bit
}

void SurfaceBuilder::add(ConstView slab, Execution const& execution) {
    work(slab, slab.dims().z, done_ == 0, execution);
    // What the next slab needs of this one's last slice.
    Box slice = slab.box;
    slice.lower.z = slice.upper.z - 1;
    last_.resize(static_cast<std::size_t>(slice.voxels()) * size_of(slab.type));
    copy_region(slab.part(slice), dense_view(last_.data(), slab.type, slice), Execution{});
}

Mesh SurfaceBuilder::finish(Execution const& execution) {
    if (closed_) work({}, 1, false, execution);
    return std::move(mesh_);
}

/// Adds lattice slices; `voxels` may be nothing: a slice of the border.
void SurfaceBuilder::work(ConstView voxels, std::int64_t slices, bool first, Execution const& execution) {
    auto const slice_words = static_cast<std::size_t>(lattice_.y * words_);
    auto const slice_rows = static_cast<std::size_t>(lattice_.y), n = static_cast<std::size_t>(slices) + 1;
    bits_.resize(slice_words * n);
    std::fill(bits_.begin() + static_cast<std::ptrdiff_t>(slice_words), bits_.end(), 0);
    rows_.resize(slice_rows * n);
    std::int64_t const border = closed_ ? 1 : 0;
    SurfaceSlab slab;
    slab.lattice = {lattice_.x, lattice_.y, slices + 1};
    slab.border = border;
    slab.words = words_;
    slab.first = first;
    slab.bits = bits_.data();
    slab.rows = rows_.data();
    if (!last_.empty()) {
        Box const box = box_of({region_.dims().x, region_.dims().y, 1});
        slab.last = dense_view(static_cast<std::byte const*>(last_.data()), header_.dtype, box);
    }
    slab.voxels = voxels;
    slab.geometry = header_.geometry;
    slab.origin = region_.lower - Index3{border, border, border};
    slab.origin_z = region_.lower.z - border + done_ - 1;
    slab.cases = &surface_cases();
    slab.mirrored = mirrored_;
    surface_bits(slab, inside_, execution);
    for (std::size_t i = slice_words; i < bits_.size(); ++i) inside_count_ += std::popcount(bits_[i]);
    // Nothing is crossed on the way from a slice that is not there.
    if (first) std::copy_n(bits_.begin() + static_cast<std::ptrdiff_t>(slice_words), slice_words, bits_.begin());
    surface_count(slab, execution);

    auto const held = static_cast<std::uint64_t>(mesh_.vertex_count());
    std::uint64_t vertices = held, triangles = 0;
    for (std::size_t r = slice_rows; r < rows_.size(); ++r) {
        SurfaceRow const count = rows_[r];
        rows_[r].before = static_cast<std::uint32_t>(vertices);
        rows_[r].along = static_cast<std::uint32_t>(vertices + count.before);
        rows_[r].next = static_cast<std::uint32_t>(vertices + count.before + count.along);
        rows_[r].triangles = static_cast<std::uint32_t>(triangles);
        vertices += std::uint64_t{count.before} + count.along + count.next;
        triangles += count.triangles;
    }
    if (vertices > std::numeric_limits<std::int32_t>::max())
        throw Error(ErrorKind::resources, "the mesh has more than 2147483647 vertices, which no file numbers",
                    "smooth or resample the volume, or take parts of it: --roi");
    std::size_t const old = mesh_.triangles.size();
    std::size_t const bytes = 3 * vertices * sizeof(double) + (old + 3 * triangles) * sizeof(std::uint32_t);
    if (bytes > execution.memory)
        throw Error(ErrorKind::resources,
                    text("the mesh takes more than --memory: ", bytes_text(static_cast<double>(bytes)), " of ",
                         bytes_text(static_cast<double>(execution.memory)), " so far"),
                    "give more, smooth or resample the volume, or take parts of it: --roi");
    if (vertices > held || triangles > 0) {
        // What is to come is likely as much a slice as what came; memory that is not touched costs nothing.
        double const share =
            static_cast<double>(lattice_.z) / static_cast<double>(std::max<std::int64_t>(done_ + slices, 1));
        auto const make_room = [&](auto& list, std::size_t size) {
            std::size_t const whole =
                std::max(2 * list.capacity(), static_cast<std::size_t>(static_cast<double>(size) * share * 1.05));
            std::size_t const room = execution.memory / 2 / sizeof(list[0]);
            if (size > list.capacity()) list.reserve(std::max(size, std::min(whole, room)));
            list.resize(size);
        };
        make_room(mesh_.vertices, 3 * vertices);
        make_room(mesh_.triangles, old + 3 * triangles);
        slab.vertices = mesh_.vertices.data();
        slab.triangles = mesh_.triangles.data() + old;
        slab.first_vertex = static_cast<std::int64_t>(held);
        slab.vertex_count = static_cast<std::int64_t>(vertices - held);
        slab.triangle_count = static_cast<std::int64_t>(triangles);
        surface_emit(slab, inside_, execution);
    }
    std::copy(bits_.end() - static_cast<std::ptrdiff_t>(slice_words), bits_.end(), bits_.begin());
    std::copy(rows_.end() - static_cast<std::ptrdiff_t>(slice_rows), rows_.end(), rows_.begin());
    bits_.resize(slice_words);
    rows_.resize(slice_rows);
    done_ += slices;
}

} // namespace vkt
