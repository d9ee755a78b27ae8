// How a volume came about: a tree of commands, folded where it grows long, and as a line for a shell.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vkt {

/// One step of the past: the words of a command and what it read. A tree, since commands may have several inputs.
/// Without words it is a past that is not known, or `earlier` steps that are only counted.
struct History {
    std::vector<std::string> command;
    std::vector<History> inputs;
    std::int64_t earlier = 0;
    friend bool operator==(History const&, History const&) = default;
};

/// Longer histories are folded wherever one is made, written or read: in steps, and in bytes of their words. As JSON a
/// step is two levels, and Python's parser gives up at 1000.
inline constexpr std::size_t most_history_steps = 400;
inline constexpr std::size_t most_history_bytes = std::size_t{256} << 10;

/// The newest steps, as many as both limits allow (the newest one always); what is older is only counted.
History folded(History history, std::size_t most_steps = most_history_steps,
               std::size_t most_bytes = most_history_bytes);

/// Steps that a history tells and those that it counts; at most 2^50.
std::int64_t step_count(History const& history);

/// "… 17 earlier steps".
std::string earlier_text(std::int64_t steps);

/// The pipeline that a history tree describes, as a line a POSIX shell (with process substitution) runs; where steps
/// are only counted, earlier_text() stands instead, which none runs.
std::string history_as_shell(History const& history);

} // namespace vkt
