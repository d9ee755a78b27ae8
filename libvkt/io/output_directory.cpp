// Directories that appear whole or not at all.
// SPDX-License-Identifier: MIT
#include "libvkt/io/output_directory.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/free_space.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/temporaries.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt {
namespace {

/// The path without slashes at its end, and what it leads to if it is a link.
std::string real_path(std::string path) {
    while (path.size() > 1 && path.back() == '/') path.pop_back();
    std::error_code failure;
    std::filesystem::path const real = std::filesystem::canonical(path, failure);
    return failure ? path : real.string();
}

Error directory_exists_already(std::string const& path) {
    return Error(ErrorKind::io, text("cannot write '", path, "': the directory exists"), "replace it with --force");
}

} // namespace

OutputDirectory::OutputDirectory(std::string path, bool force,
                                 std::function<bool(std::string const&)> const& replaceable, std::string const& what)
    : path_(real_path(std::move(path))) {
    struct stat status {};
    if (::lstat(path_.c_str(), &status) == 0) {
        if (!S_ISDIR(status.st_mode))
            throw Error(ErrorKind::io, text("cannot write '", path_, "': it is no directory"),
                        "name another one, or files: brick%04d.nrrd");
        std::error_code failure;
        replaces_ = !std::filesystem::is_empty(path_, failure);
        if (replaces_ && !force) throw directory_exists_already(path_);
        if (replaces_ && !replaceable(path_))
            throw Error(ErrorKind::io, text("cannot write '", path_, "': it holds files that are no ", what),
                        text("only directories of ", what, " are replaced"));
    }
    remove_leftovers(path_);
    temporary_ = temporary_name(path_);
    guard_ = std::make_unique<Guard>(temporary_);
    slot_ = remember_temporary(temporary_);
    if (::mkdir(temporary_.c_str(), 0777) != 0) {
        int const code = errno;
        forget_temporary(slot_);
        throw system_error(text("cannot write '", path_, "'"), code,
                           code == ENOENT ? text("make the directory '", directory_of(path_), "' first") : "");
    }
    descriptor_ = ::open(temporary_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor_ >= 0) mark_alive(descriptor_);
}

OutputDirectory::~OutputDirectory() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!temporary_.empty()) remove_directory(temporary_);
    forget_temporary(slot_);
}

std::string OutputDirectory::file(std::string const& name) const { return text(temporary_, "/", name); }

void OutputDirectory::expect(std::size_t bytes, std::string const& hint) const {
    require_space(descriptor_, bytes, text("cannot write '", path_, "'"), hint);
}

void OutputDirectory::commit() {
    // A directory may take the place of an empty one.
    int const done = replaces_ ? ::renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, path_.c_str(), RENAME_EXCHANGE)
                               : ::rename(temporary_.c_str(), path_.c_str());
    if (done != 0 && (errno == EEXIST || errno == ENOTEMPTY)) throw directory_exists_already(path_);
    if (done != 0) throw system_error(text("cannot write '", path_, "'"));
    if (replaces_) remove_directory(temporary_); // what was there before
    temporary_.clear();
    guard_.reset();
}

} // namespace vkt
