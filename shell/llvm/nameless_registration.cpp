// Linked into programs that clang builds: LLVM's OpenMP registers each process under a name in /dev/shm, which would
// stay there after kill -9.
// SPDX-License-Identifier: MIT
#include <cerrno>
#include <string_view>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>

/// In place of the C library's: the registration, with which copies of the runtime in one process find each other, gets
/// memory without a name. A second copy does not find it then and is not warned about; there is none in our programs.
extern "C" int shm_open(char const* name, int flags, mode_t mode) {
    if (std::string_view(name).starts_with("/__KMP_REGISTERED_LIB_")) {
        if ((flags & O_CREAT) != 0) return ::memfd_create("openmp", MFD_CLOEXEC);
        errno = ENOENT; // nothing to take back when the program ends
        return -1;
    }
    static auto* const real = reinterpret_cast<int (*)(char const*, int, mode_t)>(::dlsym(RTLD_NEXT, "shm_open"));
    return real(name, flags, mode);
}
