// A pipeline and the error that its result may have: the knobs of its stages are set so that the whole is cheapest.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/invocation.h"

#include <deque>
#include <string>
#include <vector>

namespace vkt::shell {

/// Sets the knobs that bound an error (Tunable) and that nobody has set so that the error of the result, as headers
/// carry it, is at most `tolerance` (a physical value) and the stages' multiply-adds are least. The pipeline begins
/// with a file or an operation without inputs. Returns what was chosen, a line for each knob. Throws Error{usage} if no
/// setting is within the tolerance, or the error is not known, and says why.
std::vector<std::string> divide_budget(std::deque<Invocation>& stages, double tolerance);

} // namespace vkt::shell
