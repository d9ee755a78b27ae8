// vdb.h, through the module openvdb.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/vdb_module.h"
#include "libvkt/core/text.h"

namespace vkt {
namespace {

VdbFunctions const& openvdb(std::string const& path) {
    return *static_cast<VdbFunctions const*>(module_functions("openvdb", text(path, ": reading and writing OpenVDB")));
}

} // namespace

bool built_with_openvdb() {
#ifdef VKT_HAVE_OPENVDB
    return true;
#else
    return false;
#endif
}

AmrListing list_vdb(std::string const& path) { return openvdb(path).list(path); }

Volume read_vdb(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return openvdb(path).read(path, options, execution);
}

void write_vdb(Volume const& volume, std::string const& path, VdbWriteOptions const& options) {
    openvdb(path).write(volume, path, options);
}

} // namespace vkt
