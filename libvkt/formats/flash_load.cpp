// flash.h: reading by a child, writing through the module hdf5.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/formats/flash_module.h"

namespace vkt {

bool built_with_hdf5() { return module_built("hdf5"); }

std::shared_ptr<AmrFile> open_flash(std::shared_ptr<ByteSource const> bytes, std::size_t memory) {
    std::string const what = text(bytes->name(), ": reading and writing HDF5");
    return parsed_file("hdf5", what, std::move(bytes), memory);
}

std::shared_ptr<AmrFile> open_flash(std::string const& path) { return open_flash(open_bytes(path), default_memory()); }

AmrListing list_flash(std::string const& path) { return open_flash(path)->listing(); }

Volume read_flash(std::string const& path, AmrReadOptions const& options, Execution const& execution) {
    return open_flash(path)->read(options, execution).whole();
}

void write_flash(Volume const& volume, std::string const& path, std::string const& variable,
                 FlashWriteOptions const& options) {
    void const* const functions = module_functions("hdf5", text(path, ": reading and writing HDF5"));
    static_cast<FlashFunctions const*>(functions)->write(volume, path, variable, options);
}

} // namespace vkt
