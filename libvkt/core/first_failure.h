// What is thrown in a loop that threads share, which nothing may leave: the first of it is thrown again afterwards.
// SPDX-License-Identifier: MIT
#pragma once

#include <exception>
#include <mutex>

namespace vkt {

/// One for a parallel loop. Parts that fail leave the others alone; what they were to make is missing then. All but the
/// template is compiled once: kernels for newer processors must leave no inline function behind that others may link.
class FirstFailure {
public:
    FirstFailure();
    ~FirstFailure();
    FirstFailure(FirstFailure const&) = delete;
    FirstFailure& operator=(FirstFailure const&) = delete;

    /// Runs a part of the loop, on any thread, and keeps what it throws if it is the first that does.
    template <class F> void catch_from(F const& part) noexcept {
        try {
            part();
        } catch (...) {
            keep();
        }
    }
    /// After the loop: throws what was kept.
    void rethrow() const;

private:
    void keep() noexcept; ///< what is being handled

    std::mutex mutex_;
    std::exception_ptr first_;
};

} // namespace vkt
