// Mesh files, in pieces of about a MiB. Binary ones are little-endian.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/mesh_file.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace vkt {
namespace {

static_assert(std::endian::native == std::endian::little, "mesh files are written as numbers lie in memory");

/// Bytes on their way to the file.
class Output {
public:
    explicit Output(OutputFile& file) : file_(file) {}
    void put(std::string_view text) {
        held_.append(text);
        if (held_.size() >= piece) flush();
    }
    template <class T> void number(T value) {
        char bytes[sizeof(T)];
        std::memcpy(bytes, &value, sizeof value);
        put({bytes, sizeof bytes});
    }
    void flush() {
        file_.write(held_.data(), held_.size());
        held_.clear();
    }

private:
    static constexpr std::size_t piece = std::size_t{1} << 20;
    OutputFile& file_;
    std::string held_;
};

struct Totals {
    std::int64_t vertices = 0, triangles = 0;
};

Totals totals_of(std::span<Mesh const> meshes) {
    Totals totals;
    for (Mesh const& mesh : meshes) {
        totals.vertices += mesh.vertex_count();
        totals.triangles += mesh.triangle_count();
    }
    if (totals.vertices > std::numeric_limits<std::int32_t>::max())
        throw Error(ErrorKind::resources, "one file numbers no more than 2147483647 vertices",
                    "write one file each: -o part-%d.stl");
    return totals;
}

/// Calls f(mesh, index of its first vertex).
template <class F> void for_each_mesh(std::span<Mesh const> meshes, F const& f) {
    std::int64_t first = 0;
    for (Mesh const& mesh : meshes) {
        f(mesh, first);
        first += mesh.vertex_count();
    }
}

float as_float(double v) { return static_cast<float>(v); }

/// One coordinate or several, with blanks between.
template <class T> std::string words(T const* v, std::size_t n) {
    std::string line;
    for (std::size_t i = 0; i < n; ++i) line += text(i == 0 ? "" : " ", v[i]);
    return line;
}

std::string coordinates(double const* v, bool wide) {
    if (wide) return words(v, 3);
    float const narrow[3] = {as_float(v[0]), as_float(v[1]), as_float(v[2])};
    return words(narrow, 3);
}

void put_coordinates(Output& out, double const* v, bool wide) {
    for (int i = 0; i < 3; ++i) {
        if (wide)
            out.number(v[i]);
        else
            out.number(as_float(v[i]));
    }
}

std::array<float, 3> normal_of(Mesh const& mesh, std::size_t triangle) {
    auto const at = [&](std::size_t i, std::size_t axis) {
        return mesh.vertices[3 * static_cast<std::size_t>(mesh.triangles[3 * triangle + i]) + axis];
    };
    std::array<double, 3> a{}, b{};
    for (std::size_t i = 0; i < 3; ++i) {
        a[i] = at(1, i) - at(0, i);
        b[i] = at(2, i) - at(0, i);
    }
    std::array<double, 3> const n{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    double const length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0)) return {0, 0, 0};
    return {as_float(n[0] / length), as_float(n[1] / length), as_float(n[2] / length)};
}

void write_stl(Output& out, std::span<Mesh const> meshes, MeshFileOptions const& options) {
    Totals const totals = totals_of(meshes);
    if (totals.triangles > std::numeric_limits<std::uint32_t>::max())
        throw Error(ErrorKind::usage, "STL holds no more than 4294967295 triangles", "write PLY or VTP");
    if (!options.ascii) {
        std::string head = "vkt " VKT_VERSION ", binary STL, little-endian, float32";
        head.resize(80, ' ');
        out.put(head);
        out.number(static_cast<std::uint32_t>(totals.triangles));
    }
    for (Mesh const& mesh : meshes) {
        std::string const name = mesh.name.empty() ? "surface" : mesh.name;
        if (options.ascii) out.put(text("solid ", name, "\n"));
        for (std::size_t t = 0; t < static_cast<std::size_t>(mesh.triangle_count()); ++t) {
            std::array<float, 3> const normal = normal_of(mesh, t);
            if (options.ascii)
                out.put(text("facet normal ", words(normal.data(), 3), "\nouter loop\n"));
            else
                for (float const v : normal) out.number(v);
            for (std::size_t i = 0; i < 3; ++i) {
                double const* const at = mesh.vertices.data() + 3 * static_cast<std::size_t>(mesh.triangles[3 * t + i]);
                if (options.ascii)
                    out.put(text("vertex ", coordinates(at, false), "\n"));
                else
                    put_coordinates(out, at, false);
            }
            if (options.ascii)
                out.put("endloop\nendfacet\n");
            else
                out.number(std::uint16_t{0});
        }
        if (options.ascii) out.put(text("endsolid ", name, "\n"));
    }
}

void write_ply(Output& out, std::span<Mesh const> meshes, MeshFileOptions const& options, bool wide) {
    Totals const totals = totals_of(meshes);
    char const* const type = wide ? "double" : "float";
    out.put(text("ply\nformat ", options.ascii ? "ascii" : "binary_little_endian",
                 " 1.0\ncomment vkt " VKT_VERSION "\nelement vertex ", totals.vertices, "\nproperty ", type,
                 " x\nproperty ", type, " y\nproperty ", type, " z\n"));
    if (options.normals) out.put("property float nx\nproperty float ny\nproperty float nz\n");
    out.put(text("element face ", totals.triangles, "\nproperty list uchar int vertex_indices\n",
                 options.labels ? "property int label\n" : "", "end_header\n"));
    for (Mesh const& mesh : meshes) {
        std::vector<float> const normals = options.normals ? vertex_normals(mesh) : std::vector<float>();
        for (std::size_t v = 0; v < mesh.vertices.size(); v += 3) {
            if (options.ascii) {
                out.put(coordinates(mesh.vertices.data() + v, wide));
                if (options.normals) out.put(text(" ", words(normals.data() + v, 3)));
                out.put("\n");
                continue;
            }
            put_coordinates(out, mesh.vertices.data() + v, wide);
            for (std::size_t i = 0; i < 3 && options.normals; ++i) out.number(normals[v + i]);
        }
    }
    for_each_mesh(meshes, [&](Mesh const& mesh, std::int64_t first) {
        auto const label = static_cast<std::int32_t>(mesh.label);
        for (std::size_t i = 0; i < mesh.triangles.size(); i += 3) {
            if (options.ascii)
                out.put("3");
            else
                out.number(std::uint8_t{3});
            for (std::size_t k = i; k < i + 3; ++k) {
                auto const vertex = static_cast<std::int32_t>(mesh.triangles[k] + first);
                if (options.ascii)
                    out.put(text(" ", vertex));
                else
                    out.number(vertex);
            }
            if (options.labels && options.ascii) out.put(text(" ", label));
            if (options.labels && !options.ascii) out.number(label);
            if (options.ascii) out.put("\n");
        }
    });
}

void write_obj(Output& out, std::span<Mesh const> meshes, MeshFileOptions const& options) {
    static_cast<void>(totals_of(meshes));
    out.put("# vkt " VKT_VERSION "\n");
    for_each_mesh(meshes, [&](Mesh const& mesh, std::int64_t first) {
        std::vector<float> const normals = options.normals ? vertex_normals(mesh) : std::vector<float>();
        if (options.labels) out.put(text("g label_", mesh.name, "\n"));
        for (std::size_t v = 0; v < mesh.vertices.size(); v += 3)
            out.put(text("v ", words(mesh.vertices.data() + v, 3), "\n"));
        for (std::size_t v = 0; v < normals.size(); v += 3) out.put(text("vn ", words(normals.data() + v, 3), "\n"));
        for (std::size_t i = 0; i < mesh.triangles.size(); i += 3) {
            out.put("f");
            for (std::size_t k = i; k < i + 3; ++k) {
                std::int64_t const vertex = mesh.triangles[k] + first + 1; // the first one is 1
                out.put(options.normals ? text(" ", vertex, "//", vertex) : text(" ", vertex));
            }
            out.put("\n");
        }
    });
}

/// An array of VTK's XML: its element in the header, and its bytes at the end.
struct VtpArray {
    std::string attributes;
    std::size_t bytes;
    std::function<void(bool ascii)> put;
};

void write_vtp(Output& out, std::span<Mesh const> meshes, MeshFileOptions const& options, bool wide) {
    Totals const totals = totals_of(meshes);
    auto const vertices = static_cast<std::size_t>(totals.vertices);
    auto const triangles = static_cast<std::size_t>(totals.triangles);
    auto const put = [&](bool ascii, auto value) {
        if (ascii)
            out.put(text(value, "\n"));
        else
            out.number(value);
    };
    VtpArray const points{text("type=\"", wide ? "Float64" : "Float32", "\" NumberOfComponents=\"3\" Name=\"Points\""),
                          vertices * 3 * (wide ? 8 : 4), [&](bool ascii) {
                              for (Mesh const& mesh : meshes)
                                  for (double const v : mesh.vertices) wide ? put(ascii, v) : put(ascii, as_float(v));
                          }};
    VtpArray const normals{"type=\"Float32\" NumberOfComponents=\"3\" Name=\"Normals\"", vertices * 12,
                           [&](bool ascii) {
                               for (Mesh const& mesh : meshes)
                                   for (float const v : vertex_normals(mesh)) put(ascii, v);
                           }};
    VtpArray const connectivity{"type=\"Int32\" Name=\"connectivity\"", triangles * 12, [&](bool ascii) {
                                    for_each_mesh(meshes, [&](Mesh const& mesh, std::int64_t first) {
                                        for (std::uint32_t const v : mesh.triangles)
                                            put(ascii, static_cast<std::int32_t>(v + first));
                                    });
                                }};
    VtpArray const offsets{"type=\"Int64\" Name=\"offsets\"", triangles * 8, [&](bool ascii) {
                               for (std::int64_t i = 1; i <= totals.triangles; ++i) put(ascii, 3 * i);
                           }};
    VtpArray const labels{"type=\"Int64\" Name=\"label\"", triangles * 8, [&](bool ascii) {
                              for (Mesh const& mesh : meshes)
                                  for (std::int64_t i = 0; i < mesh.triangle_count(); ++i) put(ascii, mesh.label);
                          }};
    std::vector<VtpArray const*> appended;
    std::size_t offset = 0;
    auto const array = [&](VtpArray const& a) {
        if (options.ascii) {
            out.put(text("<DataArray ", a.attributes, " format=\"ascii\">\n"));
            a.put(true);
            out.put("</DataArray>\n");
            return;
        }
        out.put(text("<DataArray ", a.attributes, " format=\"appended\" offset=\"", static_cast<std::uint64_t>(offset),
                     "\"/>\n"));
        appended.push_back(&a);
        offset += a.bytes + 8;
    };
    out.put(text("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
                 "header_type=\"UInt64\">\n<PolyData>\n<Piece NumberOfPoints=\"",
                 totals.vertices, "\" NumberOfPolys=\"", totals.triangles, "\">\n"));
    if (options.normals) {
        out.put("<PointData Normals=\"Normals\">\n");
        array(normals);
        out.put("</PointData>\n");
    }
    if (options.labels) {
        out.put("<CellData Scalars=\"label\">\n");
        array(labels);
        out.put("</CellData>\n");
    }
    out.put("<Points>\n");
    array(points);
    out.put("</Points>\n<Polys>\n");
    array(connectivity);
    array(offsets);
    out.put("</Polys>\n</Piece>\n</PolyData>\n");
    if (!options.ascii) {
        out.put("<AppendedData encoding=\"raw\">\n_");
        for (VtpArray const* const a : appended) {
            out.number(static_cast<std::uint64_t>(a->bytes));
            a->put(false);
        }
        out.put("\n</AppendedData>\n");
    }
    out.put("</VTKFile>\n");
}

} // namespace

std::optional<MeshFormat> mesh_format_of(std::string const& path) {
    std::string const lower = lower_case(path);
    for (auto const& [format, name] : EnumNames<MeshFormat>::all())
        if (lower.ends_with(text(".", name))) return format;
    return std::nullopt;
}

bool fits_float32(std::span<Mesh const> meshes, double spacing) {
    double largest = 0;
    for (Mesh const& mesh : meshes)
        for (double const v : mesh.vertices) largest = std::max(largest, std::abs(v));
    return largest * 0x1p-24 <= spacing / 2048;
}

MeshFormat mesh_format(std::string const& path, std::optional<MeshFormat> said, bool normals) {
    std::optional<MeshFormat> const format = said ? said : mesh_format_of(path);
    if (!format)
        throw Error(ErrorKind::usage, text("'", path, "' is no name of a mesh file"),
                    "name it .stl, .ply, .obj or .vtp, or say --format");
    if (*format == MeshFormat::stl && normals)
        throw Error(ErrorKind::usage, "--normals: STL has those of triangles only", "write PLY, OBJ or VTP");
    return *format;
}

void write_meshes(OutputFile& file, std::span<Mesh const> meshes, MeshFileOptions const& options) {
    Output out(file);
    bool const wide = options.format != MeshFormat::stl && !fits_float32(meshes, options.spacing);
    switch (options.format) {
    case MeshFormat::stl:
        write_stl(out, meshes, options);
        break;
    case MeshFormat::ply:
        write_ply(out, meshes, options, wide);
        break;
    case MeshFormat::obj:
        write_obj(out, meshes, options);
        break;
    case MeshFormat::vtp:
        write_vtp(out, meshes, options, wide);
        break;
    }
    out.flush();
}

} // namespace vkt
