// Loaded before the C library: a file system without unnamed files.
// SPDX-License-Identifier: MIT
#include <cerrno>
#include <cstdarg>
#include <dlfcn.h>
#include <fcntl.h>

extern "C" int open(char const* path, int flags, ...) {
    static auto* const real = reinterpret_cast<decltype(::open)*>(::dlsym(RTLD_NEXT, "open"));
    if ((flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    va_list rest;
    va_start(rest, flags);
    mode_t const mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return real(path, flags, mode);
}
