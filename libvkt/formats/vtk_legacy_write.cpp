// VTK's legacy files, written: numbers as bytes.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/vtk_legacy.h"
#include "libvkt/io/output_file.h"

#include <algorithm>
#include <bit>
#include <vector>

namespace vkt {
namespace {

/// Names stand between blanks, so that VTK writes other characters as %20.
bool stands_for_itself(char c) { return c > ' ' && c < 127 && c != '%' && c != '"'; }

std::string encoded(std::string const& name) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    std::string result;
    for (char const c : name) {
        auto const code = static_cast<unsigned char>(c);
        if (stands_for_itself(c))
            result += c;
        else
            result += {'%', digits[code / 16], digits[code % 16]};
    }
    return result;
}

/// VTK's name of a type whose size does not depend on the compiler; none for half precision.
char const* written_name(DataType type) {
    switch (type) {
    case DataType::uint8:
        return "unsigned_char";
    case DataType::int8:
        return "signed_char";
    case DataType::uint16:
        return "unsigned_short";
    case DataType::int16:
        return "short";
    case DataType::uint32:
        return "unsigned_int";
    case DataType::int32:
        return "int";
    case DataType::uint64:
        return "vtktypeuint64";
    case DataType::int64:
        return "vtktypeint64";
    case DataType::float32:
        return "float";
    case DataType::float64:
        return "double";
    case DataType::float16:
        break;
    }
    return nullptr;
}

/// Binary, which in these files is big-endian.
class LegacyWriter : public VolumeWriter {
public:
    LegacyWriter(std::string const& path, WriteOptions const& options) : options_(options), file_(path, options.force) {
        if (options.compress)
            throw Error(ErrorKind::usage, ".vtk files are not compressed inside", "write .vti, or NAME.vtk.gz");
    }

    void begin(Header const& header) override {
        refuse_bricks_and_series(header, begun_, ".vtk files", "a .vtk file", ".vtk");
        char const* const type = written_name(header.dtype);
        if (type == nullptr)
            throw Error(ErrorKind::usage, text(".vtk files cannot hold ", header.dtype),
                        "convert first: vkt convert --dtype float32");
        tell_losses(options_, header, ".vtk files",
                    {.directions = false,
                     .frame = false,
                     .values = false,
                     .attributes = false,
                     .named = {"variable"},
                     .provenance = false,
                     .besides = {}});
        size_ = size_of(header.dtype);
        Geometry const& g = header.geometry;
        auto const found = header.attributes.find("variable");
        bool const unnamed = found == header.attributes.end() || found->second.empty();
        auto const vector = [](Vec3 v) { return text(to_text(v.x), " ", to_text(v.y), " ", to_text(v.z)); };
        std::string const head =
            text(vtk_legacy_magic, " 3.0\nvkt\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS ", header.dims.x, " ",
                 header.dims.y, " ", header.dims.z, "\nSPACING ", vector(g.spacing), "\nORIGIN ", vector(g.origin),
                 "\nPOINT_DATA ", header.voxels(), "\nSCALARS ", unnamed ? "values" : encoded(found->second), " ", type,
                 " 1\nLOOKUP_TABLE default\n");
        file_.expect(header.bytes());
        file_.write(head.data(), head.size());
    }

    void write(std::byte const* voxels, std::size_t n) override {
        if (size_ == 1 || std::endian::native == std::endian::big) return file_.write(voxels, n);
        // A part at a time, since the voxels are not ours to change.
        constexpr std::size_t part = std::size_t{1} << 20;
        for (std::size_t at = 0; at < n; at += part) {
            swapped_.assign(voxels + at, voxels + std::min(n, at + part));
            swap_bytes(swapped_.data(), swapped_.size() / size_, size_);
            file_.write(swapped_.data(), swapped_.size());
        }
    }

    void end() override { file_.write("\n", 1); }

    void close() override {
        if (!begun_) throw Error(ErrorKind::data, "there is no volume to write");
        file_.commit();
    }

private:
    WriteOptions options_;
    OutputFile file_;
    bool begun_ = false;
    std::size_t size_ = 1;
    std::vector<std::byte> swapped_;
};

} // namespace

std::unique_ptr<Sink> create_vtk_legacy(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<LegacyWriter>(path, options));
}

} // namespace vkt
