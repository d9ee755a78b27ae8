// Waiting for another thread while somebody may end the call that waits.
// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>

namespace vkt::ipc {

/// How often whoever waits is told so.
inline constexpr std::chrono::milliseconds waiting_pause{20};

/// Waits under the lock for the condition; meanwhile calls `waiting`, if there is one, without the lock. What it throws
/// ends the wait.
template <class Condition>
void wait_for(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Condition const& condition,
              std::function<void()> const& waiting) {
    while (waiting && !changed.wait_for(lock, waiting_pause, condition)) {
        lock.unlock();
        waiting();
        lock.lock();
    }
    changed.wait(lock, condition);
}

} // namespace vkt::ipc
