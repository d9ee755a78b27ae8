// Objects of the C API that several calls use one after another: who calls, and what went wrong before.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"

#include <atomic>
#include <functional>
#include <optional>
#include <thread>

namespace vkt::ipc {

/// The thread that calls, and who watches its call; threads that read ahead or write behind are nobody's.
struct Caller {
    std::atomic<std::thread::id> thread{};
    ProgressMonitor* monitor = nullptr;
};

/// Names the caller for as long as its call lasts.
class Calling {
public:
    Calling(Caller& caller, ProgressMonitor* monitor) : caller_(caller) {
        caller_.monitor = monitor;
        caller_.thread = std::this_thread::get_id();
    }
    ~Calling() { caller_.thread = std::thread::id(); }
    Calling(Calling const&) = delete;
    Calling& operator=(Calling const&) = delete;

private:
    Caller& caller_;
};

/// For StreamOptions::waiting: who called may end the call.
inline std::function<void()> ended_by(Caller& caller) {
    return [&caller] {
        if (caller.thread.load() == std::this_thread::get_id() && caller.monitor != nullptr) caller.monitor->poll(0, 1);
    };
}

/// The first failure, which every later call repeats: what would follow means nothing.
class Failure {
public:
    /// `what`: of what it is, "the stream".
    explicit Failure(char const* what) : what_(what) {}
    template <class F> void guard(F const& body) {
        if (failed_) throw Error(failed_->kind(), text(what_, " failed before: ", failed_->what()), failed_->hint());
        try {
            body();
        } catch (Error const& e) {
            failed_ = e;
            throw;
        } catch (...) {
            failed_ = Error(ErrorKind::io, "it broke off");
            throw;
        }
    }
    explicit operator bool() const { return failed_.has_value(); }

private:
    char const* what_;
    std::optional<Error> failed_{};
};

} // namespace vkt::ipc
