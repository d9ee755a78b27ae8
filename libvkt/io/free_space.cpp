// Free space.
// SPDX-License-Identifier: MIT
#include "libvkt/io/free_space.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>

#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

namespace vkt {

void require_space(int descriptor, std::size_t bytes, std::string const& cannot, std::string const& hint) {
    struct stat file {};
    struct statvfs system {};
    if (::fstat(descriptor, &file) != 0 || !(S_ISREG(file.st_mode) || S_ISDIR(file.st_mode))) return;
    if (::fstatvfs(descriptor, &system) != 0 || system.f_blocks == 0) return; // some have no size, or do not tell
    double const blocks = static_cast<double>(::geteuid() == 0 ? system.f_bfree : system.f_bavail);
    double free = blocks * static_cast<double>(system.f_frsize);
    // What is written over needs no new room.
    if (S_ISREG(file.st_mode))
        free += std::max(0.0, 512.0 * static_cast<double>(file.st_blocks) -
                                  static_cast<double>(std::max<off_t>(0, ::lseek(descriptor, 0, SEEK_CUR))));
    if (static_cast<double>(bytes) <= free) return;
    throw Error(ErrorKind::io,
                text(cannot, ": no space left on device: ", bytes_text(static_cast<double>(bytes)), " are needed, ",
                     bytes_text(free), " are free"),
                hint);
}

} // namespace vkt
