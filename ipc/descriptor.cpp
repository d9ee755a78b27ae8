// System calls around descriptors.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"

#include "ipc/waiting.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt::ipc {
namespace {

constexpr int largest_pipe = 1 << 20; // the limit for unprivileged users (fs.pipe-max-size)

struct Closer {
    int descriptor;
    ~Closer() { ::close(descriptor); }
};

[[noreturn]] void fail_write() {
    if (errno == EPIPE) throw BrokenPipe{};
    throw Error(ErrorKind::io, text("cannot write the stream: ", std::strerror(errno)));
}

void wait_until_writable(int descriptor, std::function<void()> const& waiting) {
    pollfd entry{descriptor, POLLOUT, 0};
    while (::poll(&entry, 1, waiting ? static_cast<int>(waiting_pause.count()) : -1) == 0) waiting();
}

/// Drops the first n bytes of a list of buffers.
void drop_front(std::span<iovec>& parts, std::size_t n) {
    while (n > 0 && !parts.empty()) {
        iovec& part = parts.front();
        std::size_t const step = std::min(n, part.iov_len);
        part.iov_base = static_cast<std::byte*>(part.iov_base) + step;
        part.iov_len -= step;
        n -= step;
        if (part.iov_len == 0) parts = parts.subspan(1);
    }
    while (!parts.empty() && parts.front().iov_len == 0) parts = parts.subspan(1);
}

} // namespace

void write_all(int descriptor, std::span<iovec> parts, std::function<void()> const& waiting) {
    drop_front(parts, 0);
    while (!parts.empty()) {
        ssize_t const n = ::writev(descriptor, parts.data(), static_cast<int>(parts.size()));
        if (n >= 0)
            drop_front(parts, static_cast<std::size_t>(n));
        else if (errno == EAGAIN)
            wait_until_writable(descriptor, waiting);
        else if (errno != EINTR)
            fail_write();
    }
}

void splice_all(int descriptor, std::byte const* data, std::size_t bytes, std::function<void()> const& waiting) {
    while (bytes > 0) {
        iovec part{const_cast<std::byte*>(data), bytes};
        ssize_t const n = ::vmsplice(descriptor, &part, 1, 0);
        if (n >= 0) {
            data += n;
            bytes -= static_cast<std::size_t>(n);
        } else if (errno == EAGAIN) {
            wait_until_writable(descriptor, waiting);
        } else if (errno != EINTR) {
            fail_write();
        }
    }
}

std::size_t discard_from_pipe(int descriptor, std::size_t bytes, std::function<void()> const& wait) {
    int const nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nowhere < 0) return 0;
    Closer const closer{nowhere};
    std::size_t done = 0;
    while (done < bytes) {
        wait();
        ssize_t const n = ::splice(descriptor, nullptr, nowhere, nullptr, bytes - done, SPLICE_F_MOVE);
        if (n > 0)
            done += static_cast<std::size_t>(n);
        else if (n == 0 || errno != EINTR)
            break;
    }
    return done;
}

int without_blocking(int pipe) {
    return ::open(text("/proc/self/fd/", pipe).c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
}

bool is_pipe(int descriptor) {
    struct stat status {};
    return ::fstat(descriptor, &status) == 0 && S_ISFIFO(status.st_mode);
}

std::size_t enlarge_pipe(int descriptor) {
    if (!is_pipe(descriptor)) return 0;
    int size = ::fcntl(descriptor, F_GETPIPE_SZ);
    for (int want = largest_pipe; want > size; want /= 2) {
        int const got = ::fcntl(descriptor, F_SETPIPE_SZ, want);
        if (got > 0) return static_cast<std::size_t>(got);
    }
    return size > 0 ? static_cast<std::size_t>(size) : 0;
}

} // namespace vkt::ipc
