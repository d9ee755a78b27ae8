// A picture that is being drawn: the signal's handler, and the line of progress.
// SPDX-License-Identifier: MIT
#include "shell/picture/watching.h"

#include "libvkt/core/text.h"

#include <atomic>
#include <cmath>

namespace vkt::shell {

namespace {

/// Signal handlers reach nothing else.
std::atomic<bool>& interrupted() {
    static std::atomic<bool> flag{false};
    return flag;
}
static_assert(std::atomic<bool>::is_always_lock_free);

extern "C" void note_interrupt(int) { interrupted() = true; }

} // namespace

Watching::Watching(Context& context) {
    if (errors_are_terminal() && !context.quiet()) line_ = std::make_unique<ProgressLine>(context.stage_info().name);
    interrupted() = false;
    struct sigaction now {};
    if (::sigaction(SIGINT, nullptr, &before_) != 0 || before_.sa_handler == SIG_IGN) return;
    now.sa_handler = note_interrupt;
    now.sa_flags = SA_RESTART;
    ::sigaction(SIGINT, &now, nullptr);
    caught_ = true;
}

Watching::~Watching() {
    if (caught_) ::sigaction(SIGINT, &before_, nullptr);
}

render::Watch Watching::watch() const {
    render::Watch watch;
    if (caught_)
        watch.stop = [before = before_, again = std::make_shared<std::atomic<bool>>(false)] {
            if (!interrupted()) return false;
            // The next one does what it did before.
            if (!again->exchange(true)) ::sigaction(SIGINT, &before, nullptr);
            return true;
        };
    if (line_)
        watch.progress = [line = line_.get()](render::Progress const& p) {
            std::string const error =
                p.error >= 0 ? text(", error ", std::round(p.error * 100) / 100, " levels") : std::string();
            line->show(text(std::lround(100 * p.share), " %, ", std::round(p.seconds * 10) / 10, " s", error));
        };
    return watch;
}

} // namespace vkt::shell
