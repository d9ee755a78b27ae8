// Operations by name: what commands, C API and Python look them up in, and one call that applies them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution_options.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// All operations by name; generated from the VKT_OPERATION lines in operations/.
std::vector<RegisteredOperation> const& operations();
/// Another name that people look for.
struct OperationAlias {
    std::string_view name, operation;
};
/// Names that the commands, C API and Python know besides: "reorient" is "permute".
std::vector<OperationAlias> const& operation_aliases();
/// The name of the operation that an alias stands for; any other name as it is.
std::string_view operation_name(std::string_view name);
/// By name or alias. Throws Error{usage}, with a suggestion, for unknown names.
std::unique_ptr<Operation> make_operation(std::string_view name);

/// The words that the history keeps of an operation, with placeholders for its inputs (see StageInfo).
std::vector<std::string> history_words(std::string_view name, Parameters const& own,
                                       std::vector<std::string> const& inputs, bool inputs_are_parameters);

/// How apply() and measure() run, where their words say nothing else.
struct CallOptions {
    ExecutionOptions execution{};
    ProgressMonitor* monitor = nullptr; ///< see Execution
    Listener listener{};                ///< takes remarks
    /// Takes an operation that has a report, since writing it down may take longer than the work.
    std::unique_ptr<Operation>* reporter = nullptr;
};

/// Applies the operation that the words of a command line name, {"filter", "gaussian", "--sigma", "2"}, to volumes in
/// memory. "-" stands for the next volume where the operation takes it as an argument, {"arith", "sub", "-", "-"}, and
/// may be left out elsewhere, of operations that take any number of them, too. One more volume than there are inputs
/// stands for the file that --like or the kernel of a filter names: {"resample", "--like", "-"}. --device, --threads,
/// --memory and --slab are understood. Throws Error{usage} for operations that make no volume.
Volume apply(std::vector<std::string> words, std::vector<Volume> const& inputs, CallOptions const& options = {});

/// The same of operations that make no volume but report: stats, diff, info. One report for each volume that was
/// measured. What the command prints as text alone is a report of one field, "text".
std::vector<Report> measure(std::vector<std::string> words, std::vector<Volume> const& inputs,
                            CallOptions const& options = {});

} // namespace vkt
