// A pipeline and the error that its result may have: the knobs of its stages are set so that the whole is cheapest.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/history.h"
#include "shell/invocation.h"

#include <cstddef>
#include <deque>
#include <string>
#include <vector>

namespace vkt::shell {

/// A knob and its value.
struct BudgetChoice {
    std::size_t stage = 0;
    std::string option, value;
};

struct DividedBudget {
    std::vector<BudgetChoice> choices;
    std::string result; ///< "the result is within 0.3 of exact"
};

/// Sets the knobs that bound an error (Tunable) and that nobody has set so that the error of the result, as headers
/// carry it, is at most `tolerance` (a physical value) and the stages' multiply-adds are least. The pipeline begins
/// with a file or an operation without inputs. Throws Error{usage} if no setting is within the tolerance, or the error
/// is not known, and says why, in the name of the option that asked.
DividedBudget divide_budget(std::deque<Invocation>& stages, double tolerance,
                            std::string const& option = "--tolerance");

struct BudgetedLine {
    std::string line;   ///< for a shell: a process for each stage
    std::string result; ///< as in DividedBudget
};

/// The same for the commands of a dry run (Header::planned).
BudgetedLine line_within(History planned, double tolerance);

} // namespace vkt::shell
