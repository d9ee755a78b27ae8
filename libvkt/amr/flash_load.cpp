// flash.h, through the module hdf5.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/flash_module.h"
#include "libvkt/core/text.h"

namespace vkt {
namespace {

FlashFunctions const& hdf5(std::string const& path) {
    return *static_cast<FlashFunctions const*>(module_functions("hdf5", text(path, ": reading and writing HDF5")));
}

} // namespace

bool built_with_hdf5() {
#ifdef VKT_HAVE_HDF5
    return true;
#else
    return false;
#endif
}

bool is_flash(std::string const& path) { return built_with_hdf5() && hdf5(path).recognises(path); }

std::shared_ptr<AmrFile> open_flash(std::string const& path) { return hdf5(path).open(path); }

AmrListing list_flash(std::string const& path) { return open_flash(path)->listing(); }

Volume read_flash(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return open_flash(path)->read(options, execution).whole();
}

void write_flash(Volume const& volume, std::string const& path, std::string const& variable,
                 FlashWriteOptions const& options) {
    hdf5(path).write(volume, path, variable, options);
}

} // namespace vkt
