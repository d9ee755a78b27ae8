// vdb.h, through the module openvdb.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/vdb_module.h"
#include "libvkt/core/text.h"

namespace vkt {
namespace {

VdbFunctions const& openvdb(std::string const& path) {
    return *static_cast<VdbFunctions const*>(module_functions("openvdb", text(path, ": reading and writing OpenVDB")));
}

class VdbFile : public AmrFile {
public:
    explicit VdbFile(std::string path) : path_(std::move(path)), listing_(list_vdb(path_)) {}

    AmrListing const& listing() const override { return listing_; }
    BrickSequence read(AmrReadOptions const& options, Execution const& execution) override {
        return read_vdb(path_, options, execution);
    }

private:
    std::string path_;
    AmrListing listing_;
};

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

std::shared_ptr<AmrFile> open_vdb(std::string const& path) { return std::make_shared<VdbFile>(path); }

void write_vdb(Volume const& volume, std::string const& path, VdbWriteOptions const& options) {
    openvdb(path).write(volume, path, options);
}

} // namespace vkt
