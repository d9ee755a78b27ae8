// Loaded before the C library: calls that move bytes are interrupted, or move fewer than they were asked to.
// SPDX-License-Identifier: MIT
//
// VKT_SHORT_CALLS_LOG: a file to which each process adds how many calls it disturbed.
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <dlfcn.h>
#include <fcntl.h>
#include <string>
#include <sys/uio.h>
#include <unistd.h>

namespace {

std::atomic<long> disturbed{0};

std::uint32_t draw() {
    thread_local std::uint32_t state = static_cast<std::uint32_t>(::gettid()) * 2654435761u | 1u;
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

bool interrupted() {
    if (draw() % 4 != 0) return false;
    ++disturbed;
    errno = EINTR;
    return true;
}

std::size_t fewer(std::size_t n) {
    if (n < 2 || draw() % 2 != 0) return n;
    ++disturbed;
    return 1 + draw() % (n - 1);
}

template <class F> F* next(char const* name) { return reinterpret_cast<F*>(::dlsym(RTLD_NEXT, name)); }

/// The parts as they are, or some of the first one.
template <class Call> ssize_t some_of(iovec const* parts, int count, Call const& call) {
    if (interrupted()) return -1;
    if (count < 1 || draw() % 2 != 0) return call(parts, count);
    iovec const first{parts[0].iov_base, fewer(parts[0].iov_len)};
    return first.iov_len == 0 ? call(parts, count) : call(&first, 1);
}

struct Told {
    ~Told() {
        char const* const path = std::getenv("VKT_SHORT_CALLS_LOG");
        int const log = path != nullptr ? ::open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600) : -1;
        if (log < 0) return;
        std::string const line = std::to_string(disturbed) + "\n";
        static auto* const real = next<decltype(::write)>("write");
        [[maybe_unused]] ssize_t const n = real(log, line.data(), line.size());
        ::close(log);
    }
} const told;

} // namespace

extern "C" {

ssize_t read(int fd, void* to, size_t n) {
    static auto* const real = next<decltype(::read)>("read");
    return interrupted() ? -1 : real(fd, to, fewer(n));
}
ssize_t write(int fd, void const* from, size_t n) {
    static auto* const real = next<decltype(::write)>("write");
    return interrupted() ? -1 : real(fd, from, fewer(n));
}
ssize_t pread(int fd, void* to, size_t n, off_t at) {
    static auto* const real = next<decltype(::pread)>("pread");
    return interrupted() ? -1 : real(fd, to, fewer(n), at);
}
ssize_t pwrite(int fd, void const* from, size_t n, off_t at) {
    static auto* const real = next<decltype(::pwrite)>("pwrite");
    return interrupted() ? -1 : real(fd, from, fewer(n), at);
}
ssize_t pread64(int fd, void* to, size_t n, off_t at) { return pread(fd, to, n, at); }
ssize_t pwrite64(int fd, void const* from, size_t n, off_t at) { return pwrite(fd, from, n, at); }
ssize_t readv(int fd, iovec const* parts, int count) {
    static auto* const real = next<decltype(::readv)>("readv");
    return some_of(parts, count, [fd](iovec const* p, int n) { return real(fd, p, n); });
}
ssize_t writev(int fd, iovec const* parts, int count) {
    static auto* const real = next<decltype(::writev)>("writev");
    return some_of(parts, count, [fd](iovec const* p, int n) { return real(fd, p, n); });
}
ssize_t vmsplice(int fd, iovec const* parts, size_t count, unsigned flags) {
    static auto* const real = next<decltype(::vmsplice)>("vmsplice");
    return some_of(parts, static_cast<int>(count),
                   [=](iovec const* p, int n) { return real(fd, p, static_cast<size_t>(n), flags); });
}
ssize_t splice(int from, off64_t* from_at, int to, off64_t* to_at, size_t n, unsigned flags) {
    static auto* const real = next<decltype(::splice)>("splice");
    return interrupted() ? -1 : real(from, from_at, to, to_at, fewer(n), flags);
}

} // extern "C"
