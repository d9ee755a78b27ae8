// Stopwatch: the time of a scope, added to a counter.
// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>

namespace vkt {

/// Adds the seconds of its scope to a counter, if there is one.
class Stopwatch {
public:
    explicit Stopwatch(double* seconds) : seconds_(seconds), begin_(Clock::now()) {}
    ~Stopwatch() {
        if (seconds_ != nullptr) *seconds_ += std::chrono::duration<double>(Clock::now() - begin_).count();
    }
    Stopwatch(Stopwatch const&) = delete;
    Stopwatch& operator=(Stopwatch const&) = delete;

private:
    using Clock = std::chrono::steady_clock;

    double* seconds_;
    Clock::time_point begin_;
};

} // namespace vkt
