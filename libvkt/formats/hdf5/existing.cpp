// Copying a file, and what lies along a path in it.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/existing.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/hdf5/open.h"

#include <hdf5.h>

#include <filesystem>

namespace vkt::hdf5 {

void keep_quiet() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

Handle access_to_write() {
    H5dont_atexit();
    keep_quiet();
    Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_file_locking(access, false, true); // it is ours, and marked as such
    return access;
}

namespace {

namespace fs = std::filesystem;

/// 0 if there is no such file.
std::uintmax_t bytes_of(std::string const& name) {
    std::error_code failed;
    std::uintmax_t const bytes = fs::is_regular_file(name, failed) ? fs::file_size(name, failed) : 0;
    return failed ? 0 : bytes;
}

Handle opened(Handle copy, OutputFile const& file) {
    if (!copy)
        throw Error(ErrorKind::data, text("'", file.target(), "' is no HDF5 file that datasets can be added to"),
                    text("to replace all of it, name no dataset: -o ", shell_quoted(file.path()), " --force"));
    return copy;
}

} // namespace

std::optional<Handle> existing(OutputFile const& file) {
    std::string const& name = file.target();
    if (bytes_of(name) == 0) return {};
    return opened({H5Fopen(name.c_str(), H5F_ACC_RDONLY, access_to_write()), H5Fclose}, file);
}

std::optional<Handle> copy_of_existing(OutputFile const& file, std::size_t more) {
    std::string const& name = file.target();
    std::uintmax_t const bytes = bytes_of(name);
    if (bytes == 0) return {};
    std::error_code failed;
    file.expect(static_cast<std::size_t>(bytes) + more);
    if (!fs::copy_file(name, file.temporary(), fs::copy_options::overwrite_existing, failed))
        throw Error(ErrorKind::io, text("cannot copy '", name, "': ", failed.message()));
    return opened({H5Fopen(file.temporary().c_str(), H5F_ACC_RDWR, access_to_write()), H5Fclose}, file);
}

bool is_taken(std::int64_t copy, std::string const& path, OutputFile const& file) {
    std::string other;
    Handle const stay = within_file(other);
    for (std::size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
        std::string const part = path.substr(0, end);
        if (H5Lexists(copy, part.c_str(), stay) <= 0) return false;
        bool const last = end == std::string::npos;
        Handle const object(H5Oopen(copy, part.c_str(), stay), H5Oclose);
        // The link itself may be replaced; what it leads to stays.
        if (!other.empty() && !last)
            throw Error(ErrorKind::usage,
                        text("'", file.target(), "': '", part, "' leads to another file, in which nothing is changed"),
                        text("write it there: -o ", shell_quoted(other + path.substr(end))));
        bool const group = object && H5Iget_type(object) == H5I_GROUP;
        if (last && group)
            throw Error(ErrorKind::usage, text("'", file.target(), "': '", part, "' is a group"),
                        text("name a dataset in it: -o ", shell_quoted(text(file.path(), ":", part, "/data"))));
        if (!last && !group) throw Error(ErrorKind::usage, text("'", file.target(), "': '", part, "' is no group"));
        if (last) return true;
    }
}

} // namespace vkt::hdf5
