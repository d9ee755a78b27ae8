// The files that the stages of a command line name: what is read, and what may not be replaced meanwhile.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/invocation.h"

#include <deque>
#include <string>
#include <vector>

namespace vkt::shell {

/// The inputs of a parsed stage as it names them, "-" for what arrives on standard input.
std::vector<std::string> input_names(Invocation& stage);

/// The files that a parsed stage names as inputs, patterns as the files that match now, segments as theirs.
std::vector<std::string> named_inputs(Invocation& stage);

/// True for what is written as a file of that name; pipes, devices and standard output take bytes as they come.
bool is_replaced(std::string const& path);

/// One file is replaced in one step, when what it held has been read. What lies in several files is not: an input among
/// them could end as neither what it was nor what it was to become. Nor is an input replaced by what is no volume: a
/// report, a picture. And reports go elsewhere than the result. Throws Error{usage} if a stage would.
void spare_inputs(std::deque<Invocation>& stages);

} // namespace vkt::shell
