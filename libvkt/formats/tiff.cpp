// TIFF: reading by a child, writing through the module tiff.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/tiff_module.h"

#include <cstring>

namespace vkt {
namespace {

using namespace std::string_view_literals;

/// Not so DICOM files that some scanners begin with a directory of TIFF, which leads nowhere once they were edited.
bool is_tiff(std::span<std::byte const> head) {
    if (head.size() >= 132 && std::memcmp(head.data() + 128, "DICM", 4) == 0) return false;
    for (std::string_view const magic : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv})
        if (head.size() >= magic.size() && std::memcmp(head.data(), magic.data(), magic.size()) == 0) return true;
    return false;
}

std::unique_ptr<Source> open_tiff(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const what = text(bytes->name(), ": reading TIFF");
    std::shared_ptr<ByteSource const> const file = seekable_bytes(std::move(bytes));
    return parsed_grids("tiff", what, file, file->size(), options);
}

std::unique_ptr<Sink> create_tiff(std::string const& path, WriteOptions const& options) {
    void const* const functions = module_functions("tiff", text(path, ": writing TIFF"));
    return slab_sink(static_cast<TiffFunctions const*>(functions)->writer(path, options));
}

} // namespace

Format tiff_format() {
    return {"tiff", "TIFF stacks: classic, BigTIFF, ImageJ, OME", {".tif", ".tiff"}, is_tiff, open_tiff, create_tiff};
}

} // namespace vkt
