// A picture that is being drawn: progress on a terminal, and Ctrl-C that ends it where it is.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/goal.h"
#include "shell/command.h"
#include "shell/terminal.h"

#include <csignal>
#include <memory>

namespace vkt::shell {

/// While one of these lives, the first SIGINT only makes its watch stop; the next one ends the process as before. There
/// is one at a time.
class Watching {
public:
    static constexpr int exit_code = 130; ///< of a command that SIGINT ended early, as shells have it

    explicit Watching(Context& context);
    ~Watching();
    Watching(Watching const&) = delete;
    Watching& operator=(Watching const&) = delete;

    render::Watch watch() const;

private:
    std::unique_ptr<ProgressLine> line_; ///< where there is a terminal to draw it on
    struct sigaction before_ {};
    bool caught_ = false; ///< false where SIGINT is ignored, and stays so
};

} // namespace vkt::shell
