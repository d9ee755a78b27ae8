// Signatures of files that other tools make.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/foreign.h"

#include <algorithm>
#include <cstring>

namespace vkt {
namespace {

using namespace std::string_view_literals;

struct Signature {
    std::size_t at;
    std::string_view bytes;
    std::string_view what;
};

constexpr Signature signatures[] = {
    {128, "DICM"sv, "a DICOM file"},
    {0, "II*\0"sv, "a TIFF file"},
    {0, "MM\0*"sv, "a TIFF file"},
    {0, "II+\0"sv, "a BigTIFF file"},
    {0, "MM\0+"sv, "a BigTIFF file"},
    {0, "# vtk DataFile"sv, "a VTK legacy file"},
    {0, "\xff\xd8\xff"sv, "a JPEG picture"},
    {0, "GIF8"sv, "a GIF picture"},
    {0, "v/1\x01"sv, "an OpenEXR picture"},
    {0, "PF\n"sv, "a PFM picture"},
    {0, "Pf\n"sv, "a PFM picture"},
    {0, "\x89HDF\r\n\x1a\n"sv, "an HDF5 file"},
    {0, "CDF\x01"sv, "a NetCDF file of version 3"},
    {0, "CDF\x02"sv, "a NetCDF file of version 3"},
    {0, "CDF\x05"sv, "a NetCDF file of version 3"},
    {0, "MATLAB 5.0 MAT-file"sv, "a MATLAB file before 7.3"},
    {0, "SIMPLE  ="sv, "a FITS file"},
    {0, "PK\x03\x04"sv, "a ZIP archive"},
    {0, "BZh"sv, "a bzip2 file"},
    {0, "\x28\xb5\x2f\xfd"sv, "a Zstandard file"},
    {0,
     "\xfd"
     "7zXZ\0"sv,
     "an xz file"},
    {0, "%PDF"sv, "a PDF document"},
    {0,
     "\x7f"
     "ELF"sv,
     "a program"},
};

bool is_at(std::span<std::byte const> head, std::size_t at, std::string_view bytes) {
    return head.size() >= at + bytes.size() && std::memcmp(head.data() + at, bytes.data(), bytes.size()) == 0;
}

} // namespace

std::string foreign_format(std::span<std::byte const> head) {
    for (auto const& [at, bytes, what] : signatures)
        if (is_at(head, at, bytes)) return std::string(what);
    if (is_at(head, 0, "\x1f\x8b"sv)) return "a gzip file";
    if (is_at(head, 0, "<?xml"sv) || is_at(head, 0, "<VTKFile"sv)) {
        std::string_view const all(reinterpret_cast<char const*>(head.data()), head.size());
        return all.find("<VTKFile") != std::string_view::npos ? "a VTK XML file" : "an XML document";
    }
    return {};
}

} // namespace vkt
