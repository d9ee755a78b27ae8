// One run of a shell line as a trial: its exit codes, whether it ended in time, and what it left.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

struct TrialOptions {
    std::string folder; ///< where the line runs
    std::string stdout_file, stderr_file;
    double seconds = 60;                    ///< after which it and all that it started are killed
    std::optional<std::int64_t> file_limit; ///< bytes that a file may have
};

struct TrialResult {
    std::vector<int> codes; ///< of the stages, as a shell tells them; above 128 for signals
    bool hung = false;
    bool ok() const;
    /// True if a stage ended with this code.
    bool says(int code) const;
    /// The first stage that was ended by a signal other than that of a closed pipe, or that no program was found for.
    std::optional<int> crash() const;
};

/// Runs a line with bash. Throws Error{resources} if no process can be started.
TrialResult try_line(std::string const& line, TrialOptions const& options);

} // namespace vkt::shell
