// Affinities are a thread's own, so each thread of a team sets its own.
// SPDX-License-Identifier: MIT
#include "libvkt/core/own_processors.h"

#include <omp.h>

namespace vkt {
namespace {

/// The n-th processor of a set.
cpu_set_t nth(cpu_set_t const& of, int n) {
    int processor = -1;
    for (int seen = -1; seen < n; seen += CPU_ISSET(processor, &of) ? 1 : 0) ++processor;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(processor, &one);
    return one;
}

} // namespace

OwnProcessors::OwnProcessors(int threads) : threads_(threads) {
    if (::sched_getaffinity(0, sizeof before_, &before_) != 0 || CPU_COUNT(&before_) < threads) threads_ = 0;
    if (threads_ < 1) return;
#pragma omp parallel num_threads(threads_)
    {
        cpu_set_t const own = nth(before_, omp_get_thread_num());
        ::sched_setaffinity(0, sizeof own, &own);
    }
}

OwnProcessors::~OwnProcessors() {
    if (threads_ < 1) return;
#pragma omp parallel num_threads(threads_)
    ::sched_setaffinity(0, sizeof before_, &before_);
}

} // namespace vkt
