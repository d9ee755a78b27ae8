// The error of a result, from those of its inputs and the plan of the operation.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"

#include <span>
#include <string_view>

namespace vkt {

/// Physical values that an operation reads: those of the input, and of what a constant border adds to them. None if
/// they are not limited.
std::optional<ValueInterval> values_read(Header const& input, Plan const& plan);

/// The error of plan.output, once its type and value map are settled: what the plan's ErrorPassing makes of the inputs'
/// errors, what the operation adds by the plan's ErrorBound, and what storing the result costs. Inputs are those that
/// the operation was planned for; `name` is what a lost error is blamed on. Of an operation without inputs the result
/// is given, if its plan knows.
VolumeError travelled(std::span<Header const> inputs, Plan const& plan, std::string_view name);

/// What the result does not inherit, once its type is settled: another's error, which is travelled() instead, and,
/// where values are calculated from labels, that they are labels, since 1.5 names nothing. A tree that is made of a
/// grid still stands for that.
void settle_header(std::span<Header const> inputs, Plan& plan, std::string_view name);

} // namespace vkt
