// Progress within nested parts of a call, told now and then.
// SPDX-License-Identifier: MIT
#include "libvkt/core/progress_monitor.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <utility>

namespace vkt {
namespace {

constexpr std::chrono::milliseconds pause{20};

double share(std::int64_t done, std::int64_t of) {
    return of > 0 ? static_cast<double>(done) / static_cast<double>(of) : 0;
}

} // namespace

ProgressMonitor::ProgressMonitor(Listener listener)
    : listener_(std::move(listener)), owner_(std::this_thread::get_id()) {}

bool ProgressMonitor::called_by_owner() const { return std::this_thread::get_id() == owner_; }

void ProgressMonitor::poll(std::int64_t done, std::int64_t of) {
    if (!cancelled_ && called_by_owner()) {
        auto const now = std::chrono::steady_clock::now();
        if (now >= next_) {
            told_ = std::max(told_, from_ + (to_ - from_) * std::clamp(share(done, of), 0.0, 1.0));
            if (listener_(told_)) cancelled_ = true;
            next_ = std::chrono::steady_clock::now() + pause;
        }
    }
    if (cancelled_) throw Error(ErrorKind::cancelled, "cancelled");
}

ProgressPart::ProgressPart(ProgressMonitor* monitor, double done, double step)
    : monitor_(monitor != nullptr && monitor->called_by_owner() ? monitor : nullptr) {
    if (monitor_ != nullptr) {
        from_ = monitor_->from_;
        to_ = monitor_->to_;
        monitor_->from_ = from_ + (to_ - from_) * done;
        monitor_->to_ = from_ + (to_ - from_) * (done + step);
    }
    // After which the beginning of this part is what is told; who is ended by that asks nothing any more.
    if (monitor != nullptr) monitor->poll(0, 1);
}

ProgressPart::ProgressPart(ProgressMonitor* monitor, std::int64_t done, std::int64_t step, std::int64_t of)
    : ProgressPart(monitor, share(done, of), share(step, of)) {}

ProgressPart::ProgressPart(OfCall, ProgressMonitor* monitor, double done, double step)
    : ProgressPart(monitor, 0.0, 1.0) {
    if (monitor_ == nullptr) return;
    monitor_->from_ = done;
    monitor_->to_ = done + step;
}

ProgressPart::~ProgressPart() {
    if (monitor_ == nullptr) return;
    monitor_->from_ = from_;
    monitor_->to_ = to_;
}

} // namespace vkt
