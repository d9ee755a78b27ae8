// Input: the bytes of a stream as they arrive, with a way to stop waiting for them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace vkt::ipc {

/// Thrown by a read that was cancelled.
struct Cancelled {};

/// Throws Error{data} for an input that ended before anything came.
[[noreturn]] void refuse_empty(std::string const& name, int descriptor);

/// Descriptor plus the bytes that format detection already took from it.
class Input {
public:
    /// Takes the source over and enlarges its pipe, if it is one. Throws Error{resources} without a descriptor left.
    /// `waiting`, if there is one, is called every 20 ms while nothing arrives, and may throw.
    explicit Input(std::unique_ptr<ByteSource> bytes, std::function<void()> waiting = {});
    ~Input();
    Input(Input const&) = delete;
    Input& operator=(Input const&) = delete;

    std::string const& name() const { return bytes_->name(); }
    int descriptor() const { return bytes_->descriptor(); }
    bool is_file() const { return bytes_->seekable(); } ///< nobody writes it any more
    std::uint64_t taken() const { return taken_; }      ///< bytes so far

    /// Makes a read that waits in another thread, and every later one, throw Cancelled.
    void cancel() const;
    /// Reads up to n bytes until the end of the stream; returns how many. Throws Error{io}.
    std::size_t read(void* to, std::size_t n);
    /// Drops n bytes; returns how many there were. Pages of a pipe are dropped without being copied.
    std::size_t discard(std::size_t n);

private:
    void wait() const;

    std::unique_ptr<ByteSource> bytes_;
    int cancel_ = -1;
    std::vector<std::byte> ahead_;
    std::size_t ahead_used_ = 0;
    std::uint64_t taken_ = 0;
    bool pipe_;
    std::function<void()> waiting_;
};

} // namespace vkt::ipc
