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
    TimeMeter();
    /// Wall time since construction, CPU time of the process, waits and bytes at both ends. An end that is no stream is
    /// a file: its bytes are what the system counted for the process.
    ipc::StageReport report(std::string stage, ipc::Traffic const* in, ipc::Traffic const* out) const;

private:
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    std::uint64_t read_ = 0, written_ = 0; ///< by the process before
};

std::string timing_table(std::vector<ipc::StageReport> const& stages);

} // namespace vkt::shell
