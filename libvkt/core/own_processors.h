// Threads of kernels kept on a processor each, for measurements that are too short for the system to spread them out.
// SPDX-License-Identifier: MIT
#pragma once

#include <sched.h>

namespace vkt {

/// While this lives, thread i of the teams that this thread begins runs on the i-th processor that this one may use;
/// the operating system may otherwise keep two of them on one for milliseconds. Nothing is done where there are fewer
/// processors than threads.
class OwnProcessors {
public:
    explicit OwnProcessors(int threads);
    ~OwnProcessors();
    OwnProcessors(OwnProcessors const&) = delete;
    OwnProcessors& operator=(OwnProcessors const&) = delete;

private:
    int threads_;
    cpu_set_t before_{};
};

} // namespace vkt
