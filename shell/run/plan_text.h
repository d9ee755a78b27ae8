// The plan of a stage as text, for --dry-run and --explain.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"

#include <string>
#include <vector>

namespace vkt::shell {

std::string plan_text(std::string const& stage, Operation* operation, Plan const& plan,
                      std::vector<Header> const& inputs, Execution const& execution, bool reduction);
/// Of a stage that opens a file.
std::string opener_plan_text(std::string const& stage, Header const& output, std::int64_t parts,
                             Execution const& execution);
/// Of a stage that makes something else of volumes; `held`: the bytes that it holds of each at once, if it does not
/// stream. Throws Error{resources} if these are beyond the budget.
std::string consumer_plan_text(std::string const& stage, Header const& input, std::string const& output,
                               std::optional<std::size_t> held, Execution const& execution);

} // namespace vkt::shell
