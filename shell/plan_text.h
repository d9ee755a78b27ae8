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
std::string opener_plan_text(std::string const& stage, Header const& output, Execution const& execution);
/// Of a stage that makes something else of volumes; `whole`: it holds each of them in memory.
std::string consumer_plan_text(std::string const& stage, Header const& input, std::string const& output, bool whole,
                               Execution const& execution);

} // namespace vkt::shell
