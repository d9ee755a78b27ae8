// Reading and writing descriptors whole: interrupted and short calls are retried, errors carry the system's reason.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <sys/uio.h>

namespace vkt::ipc {

/// The reader of our output went away. main() turns this into a real SIGPIPE.
struct BrokenPipe {};

/// Writes everything. Throws BrokenPipe or Error{io}. Where a descriptor that does not block has no room, `waiting`, if
/// there is one, is called every 20 ms; what it throws ends the writing.
void write_all(int descriptor, std::span<iovec> parts, std::function<void()> const& waiting = {});
/// Maps the pages of `data` into the pipe instead of copying them; they must stay untouched until they are read.
void splice_all(int descriptor, std::byte const* data, std::size_t bytes, std::function<void()> const& waiting = {});
/// Moves bytes from a pipe to nowhere without copying them; stops early at the end of the stream or where the system
/// cannot. `wait` is called before each step and may throw. Returns how many bytes went.
std::size_t discard_from_pipe(int descriptor, std::size_t bytes, std::function<void()> const& wait);

bool is_pipe(int descriptor);
/// The writing end of the same pipe as another descriptor, which does not block; -1 if the system has no way to that.
int without_blocking(int pipe);
/// Enlarges a pipe's buffer up to 1 MiB; returns its size in bytes, 0 if it is no pipe.
std::size_t enlarge_pipe(int descriptor);

} // namespace vkt::ipc
