// Running a chain of invocations in one process: open, attach, drain or consume, report.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/invocation.h"
#include "shell/log.h"

#include <deque>

#include <string>
#include <vector>

namespace vkt::shell {

/// Runs stages that are joined within this process; usually one. Returns the exit code.
int run(std::deque<Invocation>& stages);

/// Parses and runs one command line (without the leading "vkt"); help requests are answered here.
int run_words(std::vector<std::string> const& words);

/// A stage that fails before it has opened its output tells the next one all the same, so that only one complains.
void say_downstream(Invocation const& stage, std::string const& message);

/// Runs a body, prints its error in one line, returns the exit code: the one place where errors end.
int guarded(std::string const& stage, std::function<int()> const& body);
/// The line of an error that there is no memory to put together, once; takes none itself.
void write_out_of_memory();

} // namespace vkt::shell
