// vdb.h: reading by a child, writing through the module openvdb.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/vdb_module.h"

namespace vkt {

bool built_with_openvdb() { return module_built("openvdb"); }

std::shared_ptr<AmrFile> open_vdb(std::shared_ptr<ByteSource const> bytes, std::size_t memory) {
    std::string const what = text(bytes->name(), ": reading and writing OpenVDB");
    return parsed_file("openvdb", what, std::move(bytes), memory);
}

std::shared_ptr<AmrFile> open_vdb(std::string const& path) { return open_vdb(open_bytes(path), default_memory()); }

AmrListing list_vdb(std::string const& path) { return open_vdb(path)->listing(); }

Volume read_vdb(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return open_vdb(path)->read(options, execution).whole();
}

void write_vdb(Volume const& volume, std::string const& path, VdbWriteOptions const& options) {
    void const* const functions = module_functions("openvdb", text(path, ": reading and writing OpenVDB"));
    static_cast<VdbFunctions const*>(functions)->write(volume, path, options);
}

} // namespace vkt
