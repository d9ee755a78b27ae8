// Where a stage's time went, as one table that the last stage prints.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/stream.h"

#include <chrono>
#include <string>
#include <vector>

namespace vkt::shell {

class TimeMeter {
public:
    /// Wall time since construction, CPU time of the process, waits and bytes at both ends.
    ipc::StageReport report(std::string stage, ipc::Traffic const& in, ipc::Traffic const& out) const;

private:
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

std::string timing_table(std::vector<ipc::StageReport> const& stages);

} // namespace vkt::shell
