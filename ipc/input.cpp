// Reading and dropping bytes.
// SPDX-License-Identifier: MIT
#include "ipc/input.h"

#include "ipc/descriptor.h"
#include "ipc/waiting.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace vkt::ipc {

void refuse_empty(std::string const& name, int descriptor) {
    throw Error(ErrorKind::data, text("no volume on ", name, ": it is empty"),
                is_pipe(descriptor)
                    ? "the command before it wrote no volume: it failed, or writes none to standard output"
                    : "");
}

Input::Input(std::unique_ptr<ByteSource> bytes, std::function<void()> waiting)
    : bytes_(std::move(bytes)), ahead_(bytes_->take_lookahead()), pipe_(is_pipe(bytes_->descriptor())),
      waiting_(std::move(waiting)) {
    enlarge_pipe(bytes_->descriptor());
    cancel_ = ::eventfd(0, EFD_CLOEXEC);
    if (cancel_ < 0) throw Error(ErrorKind::resources, text("cannot create an event: ", std::strerror(errno)));
}

Input::~Input() { ::close(cancel_); }

void Input::cancel() const {
    std::uint64_t const one = 1;
    [[maybe_unused]] ssize_t const n = ::write(cancel_, &one, sizeof one);
}

std::size_t Input::read(void* to, std::size_t n) {
    auto* target = static_cast<std::byte*>(to);
    std::size_t done = std::min(n, ahead_.size() - ahead_used_);
    if (done > 0) std::memcpy(target, ahead_.data() + ahead_used_, done);
    ahead_used_ += done;
    while (done < n) {
        wait();
        // What was compressed as a whole has no descriptor.
        ssize_t const got = bytes_->decoded() ? static_cast<ssize_t>(bytes_->read(target + done, n - done))
                                              : ::read(bytes_->descriptor(), target + done, n - done);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw Error(ErrorKind::io, text("cannot read ", name(), ": ", std::strerror(errno)));
        if (got == 0) break;
        done += static_cast<std::size_t>(got);
    }
    taken_ += done;
    return done;
}

std::size_t Input::discard(std::size_t n) {
    std::size_t done = std::min(n, ahead_.size() - ahead_used_);
    ahead_used_ += done;
    taken_ += done;
    if (pipe_ && done < n) {
        std::size_t const moved = discard_from_pipe(bytes_->descriptor(), n - done, [this] { wait(); });
        done += moved;
        taken_ += moved;
    }
    std::vector<std::byte> scratch(std::min<std::size_t>(n - done, std::size_t{1} << 18));
    while (done < n) {
        std::size_t const step = read(scratch.data(), std::min(scratch.size(), n - done));
        if (step == 0) break;
        done += step;
    }
    return done;
}

/// Blocks until there is something to read (or the end), or until cancelled.
void Input::wait() const {
    if (!pipe_) return;
    std::array<pollfd, 2> entries{{{bytes_->descriptor(), POLLIN, 0}, {cancel_, POLLIN, 0}}};
    int const pause = waiting_ ? static_cast<int>(waiting_pause.count()) : -1;
    for (int n = 0; n <= 0;) {
        n = ::poll(entries.data(), entries.size(), pause);
        if (n < 0 && errno != EINTR) break;
        if (n <= 0 && waiting_) waiting_();
    }
    if (entries[1].revents != 0) throw Cancelled{};
}

} // namespace vkt::ipc
