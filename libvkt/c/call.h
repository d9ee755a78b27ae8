// What every function of the C API is made of: a call that throws nothing, knows its thread's policy and who watches.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/c/vkt.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/progress_monitor.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace vkt::c {

/// One call of this API while it runs: what its thread asked of calls.
class Call {
public:
    Call(ExecutionOptions policy, ProgressMonitor::Listener listener);

    /// The thread's policy; words of the call are read over it.
    ExecutionOptions const& policy() const { return policy_; }
    /// How to run: the policy, or what the words made of it. What an operation holds and what it leaves to the next is
    /// within one budget.
    Execution execution(ExecutionOptions const& options);
    Execution execution() { return execution(policy_); }
    ProgressMonitor* monitor() { return monitor_ ? &*monitor_ : nullptr; }

private:
    ExecutionOptions policy_;
    std::optional<ProgressMonitor> monitor_;
};

/// Runs the body of a function; what it throws becomes a status, and what vkt_error() says.
vkt_status guarded(std::function<void(Call&)> const& body) noexcept;
/// The same of what computes nothing: without policy and monitor. True if nothing was thrown.
bool attempted(std::function<void()> const& body) noexcept;

/// Other languages pass null where an object is missing. Throws Error{usage}.
void need(void const* pointer, char const* argument);
std::vector<std::string> words_of(char const* const* words, size_t count);
/// For functions whose words are options only.
void read_options(char const* const* words, size_t count, std::vector<Parameters*> const& lists);
/// For vkt_free_text().
char* copied(std::string const& text);

} // namespace vkt::c
