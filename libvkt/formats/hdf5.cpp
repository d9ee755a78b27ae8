// HDF5 datasets, FILE:/GROUP/DATASET, read by a child, written through the module hdf5. Files of FLASH are their own
// format (hierarchical.cpp).
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/flash_module.h"
#include "libvkt/formats/foreign.h"
#include "libvkt/formats/hdf5_root.h"
#include "libvkt/formats/parsed_grids.h"

#include <cstring>

namespace vkt {
namespace {

bool begins_as_hdf5(std::span<std::byte const> head) {
    // Behind a user block of 512 bytes or more, as in MATLAB's files.
    for (std::size_t const at : {std::size_t{0}, std::size_t{512}, std::size_t{1024}, std::size_t{2048}})
        if (head.size() >= at + 8 && std::memcmp(head.data() + at, "\x89HDF\r\n\x1a\n", 8) == 0) return true;
    return false;
}

std::unique_ptr<Source> open_hdf5(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const what = text(bytes->name(), ": reading HDF5");
    ReadOptions own = options;
    if (std::string const dataset = dataset_in_name(bytes->name()); !dataset.empty()) {
        if (!own.variable.empty())
            throw Error(ErrorKind::usage, text("'", bytes->name(), "' names a dataset, and --variable another one"));
        own.variable = dataset;
    }
    // What the endings .nc and .mat also stand for.
    if (std::string const other = foreign_format(bytes->peek(64));
        other.find("before 7.3") != std::string::npos || other.find("version 3") != std::string::npos)
        throw Error(ErrorKind::data, text("'", bytes->name(), "' is ", other, ", which is not read"),
                    other.find("before 7.3") != std::string::npos ? "make HDF5 of it, in MATLAB: save -v7.3"
                                                                  : "make HDF5 of it: nccopy -k nc4 in.nc out.nc");
    std::shared_ptr<ByteSource const> const file = seekable_bytes(std::move(bytes));
    return parsed_grids("hdf5", what, file, file->size(), own);
}

std::unique_ptr<Sink> create_hdf5(std::string const& path, WriteOptions const& options) {
    void const* const functions = module_functions("hdf5", text(path, ": writing HDF5"));
    return slab_sink(static_cast<FlashFunctions const*>(functions)->writer(path, options));
}

} // namespace

std::string dataset_in_name(std::string const& name) {
    auto const [file, part] = file_part(name);
    if (!part.starts_with('/')) return {};
    return part;
}

bool is_flash(ByteSource const& bytes) {
    if (!dataset_in_name(bytes.name()).empty() || !bytes.seekable()) return bytes.seekable() ? false : true;
    return root_group_names(bytes, "refine level");
}

Format hdf5_format() {
    return {"hdf5",
            "HDF5 datasets, also of MATLAB 7.3, NetCDF-4 and ITK: FILE:/DATASET",
            {".h5", ".hdf5", ".mat", ".nc"},
            begins_as_hdf5,
            open_hdf5,
            create_hdf5};
}

} // namespace vkt
