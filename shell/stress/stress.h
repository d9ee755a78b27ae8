// Stress: a pipeline run on volumes made to break it, in every way that should not matter, and what went wrong.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/command.h"

#include <cstdint>
#include <string>
#include <vector>

namespace vkt::shell {

struct StressRequest {
    std::string pipeline;             ///< stages, from a volume on standard input on
    std::vector<std::string> volumes; ///< names of hard volumes; the first is damaged and written to full disks, too
    std::string program;              ///< path of the vkt that runs the stages; empty: the one that runs now
    double seconds = 60;              ///< what takes longer hangs
};

struct Finding {
    std::string kind, what;
    std::string repeat;    ///< line for a shell
    std::string volume;    ///< the first that showed it
    std::int64_t more = 0; ///< others that did
};

struct StressReport {
    std::int64_t trials = 0;
    std::vector<Finding> findings; ///< faults
    std::vector<Finding> refusals; ///< volumes that it ends at with an exit code that says so
};

/// Opens what the trials write through the context, and works below its temporary directory. Throws Error{usage} for
/// pipelines that cannot be parsed and unknown volumes.
StressReport stress(StressRequest const& request, Context& context);

} // namespace vkt::shell
