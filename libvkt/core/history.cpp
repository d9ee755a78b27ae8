// Folding histories, and writing them as shell lines.
// SPDX-License-Identifier: MIT
#include "libvkt/core/history.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <deque>

namespace vkt {
namespace {

/// What a step takes in a header, roughly.
std::size_t bytes_of(History const& step) {
    std::size_t bytes = 32;
    for (auto const& word : step.command) bytes += word.size() + 4;
    return bytes;
}

std::string command_line(History const& step) {
    if (step.command.empty() && step.earlier > 0) return earlier_text(step.earlier);
    std::string line = "vkt";
    std::size_t next_substitution = 1; // inputs[0] arrives on standard input, the others by substitution
    for (auto const& word : step.command) {
        if (word == "<(…)" && next_substitution < step.inputs.size())
            line += text(" <(", history_as_shell(step.inputs[next_substitution++]), ")");
        else
            line += text(" ", shell_quoted(word));
    }
    return line;
}

} // namespace

std::int64_t step_count(History const& history) {
    constexpr std::int64_t most = std::int64_t{1} << 50; // sums of many are integers still
    std::int64_t count = std::clamp<std::int64_t>(history.earlier, 0, most) + (history.command.empty() ? 0 : 1);
    for (auto const& input : history.inputs) count = std::min(most, count) + step_count(input);
    return std::min(most, count);
}

History folded(History history, std::size_t most_steps, std::size_t most_bytes) {
    // Level by level: what was done last is told first, on all branches alike.
    std::deque<History*> next{&history};
    std::size_t steps = 0, bytes = 0;
    for (bool full = false; !next.empty(); next.pop_front()) {
        History& step = *next.front();
        bytes += bytes_of(step);
        full = full || steps == most_steps || (steps > 0 && bytes > most_bytes);
        if (full) {
            step = History{{}, {}, step_count(step)};
            continue;
        }
        ++steps;
        for (auto& input : step.inputs) next.push_back(&input);
    }
    return history;
}

std::string earlier_text(std::int64_t steps) {
    return text("… ", steps, steps == 1 ? " earlier step" : " earlier steps");
}

std::string history_as_shell(History const& history) {
    std::string const line = command_line(history);
    bool const begins =
        history.inputs.empty() || (history.inputs.front().command.empty() && history.inputs.front().earlier == 0);
    return begins ? line : text(history_as_shell(history.inputs.front()), " | ", line);
}

} // namespace vkt
