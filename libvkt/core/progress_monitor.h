// Who is told how far a call is, and may end it: polled by the engine between slabs and by drivers between rows.
// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>

namespace vkt {

/// Watches one call. The listener is called in the thread that made the monitor and nowhere else, at first when the
/// work begins and then as often as every 20 ms, with the share that is done: an estimate between 0 and 1 that never
/// goes back. When it returns true, every poll(), on whatever thread, throws Error{cancelled}. All but the constructor
/// is compiled once, see FirstFailure.
class ProgressMonitor {
public:
    using Listener = std::function<bool(double done)>;

    explicit ProgressMonitor(Listener listener);
    ProgressMonitor(ProgressMonitor const&) = delete;
    ProgressMonitor& operator=(ProgressMonitor const&) = delete;

    /// The work is here, and so much of the present part is done. Throws Error{cancelled}. Costs a few nanoseconds.
    void poll(std::int64_t done, std::int64_t of);

private:
    friend class ProgressPart;

    bool called_by_owner() const;

    Listener listener_;
    std::thread::id owner_;
    std::atomic<bool> cancelled_{false};
    double from_ = 0, to_ = 1, told_ = 0; ///< the owner's: the present part, and what was told last
    std::chrono::steady_clock::time_point next_{};
};

/// While it lives, what is polled is the share from `done` to `done + step` of what was the present part before. Null
/// monitors and threads other than the owner are left alone. Polls once, at the beginning.
class ProgressPart {
public:
    ProgressPart(ProgressMonitor* monitor, double done, double step);
    ProgressPart(ProgressMonitor* monitor, std::int64_t done, std::int64_t step, std::int64_t of);
    /// The same of the whole call, however small the part is that asked for it: of work that is done once, for all.
    struct OfCall {};
    ProgressPart(OfCall, ProgressMonitor* monitor, double done, double step);
    ~ProgressPart();
    ProgressPart(ProgressPart const&) = delete;
    ProgressPart& operator=(ProgressPart const&) = delete;

private:
    ProgressMonitor* monitor_;
    double from_ = 0, to_ = 1; ///< what was before
};

} // namespace vkt
