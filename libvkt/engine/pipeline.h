// The engine: chains operations onto sources, slides windows, fills borders, spools, prefetches, drains into sinks.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/source.h"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Notices of the engine and remarks of operations go here: (stage, message, lossy).
using Listener = std::function<void(std::string const& stage, std::string const& message, bool lossy)>;

/// Where a stage's time goes, in seconds, and what it moved.
struct StageTimes {
    double compute = 0; ///< in Operation::run and scan
    double input = 0;   ///< waiting for and copying input
    std::int64_t voxels = 0;
};

/// What a stage is to the engine besides its operation.
struct StageInfo {
    std::string name;                     ///< for messages: "vkt crop"
    std::vector<std::string> words;       ///< for the history: {"crop", "--roi", …}; empty leaves the history alone
    std::vector<std::string> input_names; ///< what input_placeholder words stand for
    Listener listener;                    ///< may be empty
    std::function<void(Plan const&, std::vector<Header> const& inputs)>
        on_plan;                                  ///< sees the plan of every volume; may be empty
    std::function<void(Report const&)> on_report; ///< the report of every volume; may be empty
    std::shared_ptr<StageTimes> times;            ///< filled in if set
    /// Format of the file that was opened last for the input of this name, "vkt" of a stream; may be empty: volumes in
    /// memory.
    std::function<std::string(std::string const& input)> format;
    bool among_processes = false; ///< the neighbours compute on the same processors at the same time
};

/// What a reduction reads, and where what it finds goes.
struct Measurement {
    std::vector<std::unique_ptr<Source>>& inputs;
    Execution execution;
    StageInfo info;
    ReportForm form;                    ///< in which the reports will be printed
    std::function<void(Report)> report; ///< takes the report of one volume after the other
    /// Takes text as it comes, which is what the command prints instead of reports.
    std::function<void(std::string_view)> print;
    bool named = true; ///< inputs have names, which reports of several tell
    /// Takes what one of several inputs failed with, whose others are reported all the same; empty: that ends it.
    std::function<void(Error const&)> failed{};

    /// Measures one of so many inputs.
    template <class F> void attempt(std::size_t of, F const& one) const {
        try {
            one();
        } catch (Error const& e) {
            if (!failed || of < 2 || (e.kind() != ErrorKind::data && e.kind() != ErrorKind::io)) throw;
            failed(e);
        }
    }
};

/// Plans a reduction for the current volumes of its inputs, begins them and tells the plan. True if they are only
/// planned (a dry run), and are finished: there is nothing to measure.
bool only_planned(Operation& reduction, Measurement& of);

/// Stands in StageInfo::words for input i. In the history it becomes the input's name if the input has no history of
/// its own; otherwise nothing (or "-" if `explicit_word`) for the first input and "<(…)" for the others.
std::string input_placeholder(std::size_t i, bool explicit_word);
/// The same stage with other inputs than its words were made for: patterns, say, name several files.
StageInfo with_inputs(StageInfo info, std::vector<std::string> names);
/// The history step of a stage: its words with the placeholders replaced, and the histories of its inputs.
History history_step(StageInfo const& info, std::vector<Header> const& inputs);
/// The same for Header::planned, out of those of the inputs; none unless they are only planned.
std::optional<History> planned_step(StageInfo const& info, std::vector<Header> inputs);

/// A source that computes `operation` on `inputs`. Inserts spools where the operation scans or jumps and the input
/// cannot be read again. The operation must outlive the result.
std::unique_ptr<Source> attach(std::vector<std::unique_ptr<Source>> inputs, Operation& operation,
                               Execution const& execution, StageInfo info);

/// Where to run an operation on a structured volume: on the device that was asked for, or, of both, on the one that is
/// sooner done. Throws Error{usage} if only a GPU may, and cannot.
Execution on_device(Execution execution, Operation const& operation, Plan const& plan);

/// How to run a plan among other stages: one that memory alone slows down takes its share_of_threads().
Execution beside_neighbours(Execution execution, Plan const& plan, StageInfo const& info);

/// How to run an operation whose inputs lie in memory and whose result is made there, both as a whole: what memory
/// alone slows down is worked on at once, or in few pieces within the budget, unless --slab says otherwise.
Execution on_whole_volumes(Execution execution, Operation const& operation, std::vector<Header> const& inputs);

/// Where voxels are looked at by what runs on both: on the GPU if that was asked for, or if they are there already.
Execution where_looked_at(Execution execution, bool on_gpu_already);

/// What --device gpu asks of a GPU is never done on the CPU without a word: throws Error{usage}.
[[noreturn]] void refuse_cpu(std::string const& what);

/// The scanning pass of an operation over the current volume of a source, slab by slab, without finishing it.
void scan_volume(Source& source, Operation& operation, Execution const& execution, StageTimes* times);

/// Runs a reduction over a source's current volume (spooled if need be): plan, begin, scan of every slab, scan_end,
/// finish.
void reduce(Source& source, Operation& reduction, Execution const& execution, StageInfo const& info);

/// Moves all volumes of a source into a sink and closes it. On failure the sink is told and nothing is closed.
void drain(Source& source, Sink& sink, Execution const& execution);
/// Moves the current volume only: begin, slabs, end.
void drain_volume(Source& source, Sink& sink, Execution const& execution);

/// Throws Error{resources} if a volume that takes so many bytes cannot be held within the budget.
void check_budget(std::size_t bytes, Execution const& execution);
/// Reads the rest of the current volume into memory and finishes it. Throws Error{resources} beyond the budget.
Volume load(Source& source, Execution const& execution);
/// A source over volumes in memory; random access, lends in place.
std::unique_ptr<Source> volume_source(std::vector<Volume> volumes);
/// A source over one hierarchical volume.
std::unique_ptr<Source> brick_source(BrickSequence bricks);
/// Wraps a random-access source so that a thread reads ahead, slab by slab, within what the consumer expects.
std::unique_ptr<Source> prefetch(std::unique_ptr<Source> source, Execution const& execution);
/// Convenience for library users: applies one operation to volumes in memory. Keeps freed memory for the next result
/// from then on, see keep_blocks().
Volume apply(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution);

} // namespace vkt
