// What is thrown in a loop that threads share, which nothing may leave: the first of it is thrown again afterwards.
// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <mutex>

namespace vkt {

/// One for a parallel loop. Parts that fail leave the others alone; what they were to make is missing then.
class FirstFailure {
public:
    /// Runs a part of the loop, on any thread, and keeps what it throws if it is the first that does.
    template <class F> void catch_from(F const& part) noexcept {
        try {
            part();
        } catch (...) {
            std::lock_guard const lock(mutex_);
            if (!first_) first_ = std::current_exception();
        }
    }
    /// After the loop: throws what was kept.
    void rethrow() const {
        if (first_) std::rethrow_exception(first_);
    }

private:
    std::mutex mutex_;
    std::exception_ptr first_;
};

} // namespace vkt
