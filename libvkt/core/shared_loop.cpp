// Ranges of about the same length, one a thread.
// SPDX-License-Identifier: MIT
#include "libvkt/core/shared_loop.h"

#include "libvkt/core/first_failure.h"
#include "libvkt/core/progress_monitor.h"

#include <omp.h>

#include <algorithm>

namespace vkt {
namespace {

void run_range(std::int64_t begin, std::int64_t end, LoopBody body, ProgressMonitor* monitor) {
    if (monitor == nullptr) return body.call(body.object, begin, end);
    constexpr std::int64_t parts = 32;
    std::int64_t const part = (end - begin + parts - 1) / parts;
    for (std::int64_t item = begin; item < end; item += part) {
        monitor->poll(item - begin, end - begin);
        body.call(body.object, item, std::min(item + part, end));
    }
}

} // namespace

void run_shared_loop(int threads, std::int64_t count, LoopBody body, ProgressMonitor* monitor) {
    FirstFailure failure;
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        std::int64_t const share = omp_get_num_threads(), me = omp_get_thread_num();
        std::int64_t const each = count / share, more = count % share;
        std::int64_t const begin = me * each + std::min(me, more);
        std::int64_t const end = begin + each + (me < more ? 1 : 0);
        failure.catch_from([&] { run_range(begin, end, body, monitor); });
    }
    failure.rethrow();
}

} // namespace vkt
