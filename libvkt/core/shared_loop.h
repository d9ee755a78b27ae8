// Loops that threads share, each a range of the items: the one place where they are started.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace vkt {

class ProgressMonitor;

/// A function of a range of items, by address: what starts threads is compiled once, not once a loop.
struct LoopBody {
    void const* object;
    void (*call)(void const* object, std::int64_t begin, std::int64_t end);
};

/// Calls the body once per thread, on contiguous ranges that cover 0 <= item < count; with a monitor in parts of them,
/// between which it is told how far the thread is. Throws what a body throws first, and Error{cancelled}.
void run_shared_loop(int threads, std::int64_t count, LoopBody body, ProgressMonitor* monitor = nullptr);

} // namespace vkt
