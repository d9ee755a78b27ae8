// Threads that draw a picture together.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/passes.h"

#include <atomic>
#include <chrono>
#include <exception>
#include <omp.h>

namespace vkt::render {

/// Shares parts of work out to threads, unless it is time to end; keeps the first failure for its caller.
class Crew {
public:
    Crew(Drawing const& drawing, Counters& total) : drawing_(drawing), total_(total) {}

    bool stopped() const { return stopped_; }
    bool late() const { return late_; }
    bool over() const { return stopped_ || late_; }
    double seconds() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - drawing_.start).count();
    }
    /// body(i, counters) for i below count. `whole`: time that is up does not end it, a stop does. `share` and `width`:
    /// what it is of the whole work.
    template <class Body> void work(std::int64_t count, bool whole, double share, double width, Body const& body) {
        std::exception_ptr failure;
        std::atomic<std::int64_t> done{0};
        std::int64_t rays = 0, segments = 0, samples = 0, capped = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(drawing_.threads) reduction(+ : rays, segments, samples, capped)
        for (std::int64_t i = 0; i < count; ++i) {
            if (ends(whole)) continue;
            Counters counters;
            try {
                body(i, counters);
                ++done;
                if (omp_get_thread_num() == 0 && drawing_.watch.progress)
                    drawing_.watch.progress(
                        {share + width * static_cast<double>(done) / static_cast<double>(count), error_, seconds()});
            } catch (...) {
#pragma omp critical
                failure = std::current_exception();
            }
            rays += counters.rays, segments += counters.segments, samples += counters.samples;
            capped += counters.capped;
        }
        if (failure) std::rethrow_exception(failure);
        total_.rays += rays, total_.segments += segments, total_.samples += samples, total_.capped += capped;
    }
    /// What progress says from now on.
    void set_error(double error) { error_ = error; }

private:
    bool ends(bool whole) {
        if (drawing_.watch.stop && drawing_.watch.stop()) stopped_ = true;
        if (!whole && drawing_.goal.seconds > 0 && seconds() >= drawing_.goal.seconds) late_ = true;
        return stopped_ || (late_ && !whole);
    }

    Drawing const& drawing_;
    Counters& total_;
    double error_ = -1;
    std::atomic<bool> stopped_{false}, late_{false};
};

} // namespace vkt::render
