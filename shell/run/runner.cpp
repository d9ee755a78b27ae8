// A runner: inputs, stages, and who consumes them.
// SPDX-License-Identifier: MIT
#include "shell/run/runner.h"

#include "ipc/descriptor.h"
#include "ipc/input.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/divided.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/stack.h"
#include "libvkt/formats/stream_reader.h"
#include "libvkt/io/output_file.h"
#include "libvkt/operations/common/reference_volume.h"
#include "shell/machine/calibration.h"
#include "shell/named_files.h"
#include "shell/picture/pictures.h"
#include "shell/run/budget.h"
#include "shell/run/plan_text.h"
#include "shell/run/relabelled.h"
#include "shell/run/run.h"
#include "shell/run/stage_error.h"
#include "shell/run/timing.h"
#include "shell/short_number.h"
#include "shell/terminal.h"

#include <algorithm>
#include <filesystem>
#include <unistd.h>
#include <utility>

namespace vkt::shell {

Execution Runner::execution_of(Invocation const& stage) const {
    Execution execution = stage.common().execution();
    if (shares_ > 1) {
        execution = share_of(execution, shares_);
        execution.gpu = share_;
    }
    return execution;
}

bool Runner::feeds_gpu() const {
    return std::ranges::any_of(
        stages_, [](Invocation const& stage) { return stage.common().execution().device == Device::gpu; });
}

StageInfo Runner::stage_info(Invocation const& stage) {
    StageInfo info;
    info.name = stage.stage();
    if (!last_.common().no_history && !stage.common().no_history) info.words = stage.history_words();
    info.input_names = stage.inputs();
    if (share_ > 0) return info; // the first tells for all of them
    bool const strict = stage.common().strict || last_.common().strict;
    info.listener = [this, strict, label = stage.label()](std::string const& name, std::string const& message,
                                                          bool lossy) {
        lossy ? hold_remark(name, message) : log_.note(name, message);
        if (lossy && strict) lossy_ = {label, message};
    };
    if (!stage.common().report_file.empty()) {
        auto const collected = std::make_shared<std::vector<Report>>();
        auto const write = [&stage, collected, form = stage.common().report_form()] {
            if (collected->empty()) return;
            OutputFile file(stage.common().report_file, stage.common().force || collected->size() > 1);
            // It may have a row for every few voxels.
            Report::print_blocks(*collected, form,
                                 [&](std::string_view block) { file.write(block.data(), block.size()); });
            file.commit();
        };
        bool const replaced = is_replaced(stage.common().report_file);
        if (!replaced) late_reports_.push_back(write); // it cannot be said again with the next volume
        info.on_report = [collected, write, replaced](Report const& report) {
            collected->push_back(report);
            if (replaced) write();
        };
    }
    info.on_plan = [this, &stage](Plan const& plan, std::vector<Header> const& inputs) {
        print_plan(stage, plan, inputs);
    };
    bool const reads_pipe = std::ranges::count(stage.inputs(), "-") > 0 && ipc::is_pipe(STDIN_FILENO);
    bool const writes_pipe = stage.yields_volumes() && stage.common().output == "-" && ipc::is_pipe(STDOUT_FILENO);
    info.among_processes = stages_.size() == 1 && (reads_pipe || writes_pipe);
    return info;
}

void Runner::print_plan(Invocation const& stage, Plan const& plan, std::vector<Header> const& inputs) {
    bool const planned_only = dry_run_ || plan.output.dry_run || (!inputs.empty() && inputs.front().dry_run);
    // Other operations may read more than the region they are given.
    if (stage.verb().name == "crop" && plan.output.kind == Kind::structured)
        log_.detail(stage.stage(), text("region ", stage.operation()->footprint(box_of(plan.output.dims), 0)));
    bool const explain = stage.common().explain || last_.common().explain || log_.verbosity() == Verbosity::verbose;
    if (!planned_only && !explain) return;
    bool const reduction = stage.operation() == nullptr; // a consumer's own
    Execution const execution = stage.common().execution();
    log_.answer(plan_text(stage.stage(), stage.operation(), plan, inputs, execution, reduction));
    bool const trees =
        plan.output.kind != Kind::structured ||
        std::any_of(inputs.begin(), inputs.end(), [](Header const& h) { return h.kind != Kind::structured; });
    Calibration const* const known = calibration();
    if (known == nullptr) return;
    std::optional<double> seconds;
    if (!trees && execution.device != Device::gpu)
        seconds = known->seconds(stage.verb().name, plan, inputs, reduction, execution.threads);
    if (!seconds) {
        tell_unpredicted(stage);
        return;
    }
    bool const waits = plan.whole || plan.scans || plan.access == Access::random;
    prediction()->compute(*seconds, execution.threads, waits);
    tell_seconds(stage, "", *seconds);
    predicted_.insert(&stage);
}

Calibration const* Runner::calibration() {
    if (!std::exchange(asked_calibration_, true)) calibration_ = load_calibration();
    return calibration_ ? &*calibration_ : nullptr;
}

Prediction* Runner::prediction() {
    if (!prediction_ && calibration() != nullptr) prediction_.emplace(calibration()->threads);
    return prediction_ ? &*prediction_ : nullptr;
}

bool Runner::explains(Invocation const& stage) const {
    return dry_run_ || stage.common().explain || last_.common().explain;
}

void Runner::tell_seconds(Invocation const& stage, std::string const& what, double seconds) {
    log_.answer(text(stage.stage(), ":   ", what, "about ", short_number(seconds), " s on this machine\n"));
}

void Runner::tell_unpredicted(Invocation const& stage) { log_.answer(stage.stage() + ":   time not predicted\n"); }

void Runner::predict_reading(Invocation const& stage, Header const& header, std::int64_t parts) {
    Calibration const* const known = calibration();
    if (known == nullptr || header.kind != Kind::structured) return;
    double const seconds = static_cast<double>(parts) * known->reading(header);
    prediction()->read(seconds);
    bool const reads_only = stage.opener() != nullptr;
    if (reads_only) predicted_.insert(&stage);
    tell_seconds(stage, reads_only ? "" : "reading ", seconds);
}

void Runner::predict_writing(Invocation const& stage, Header const& header) {
    Calibration const* const known = calibration();
    if (known == nullptr || header.kind != Kind::structured) return;
    double const seconds = known->writing(header);
    prediction()->write(seconds);
    bool const writes_only = stage.consumer() != nullptr;
    if (writes_only) predicted_.insert(&stage);
    tell_seconds(stage, writes_only ? "" : "writing ", seconds);
}

void Runner::tell_prediction() const {
    if (!prediction_) return;
    std::vector<std::string> left_out;
    for (Invocation const& stage : stages_)
        if (!predicted_.contains(&stage)) left_out.push_back(stage.verb().name);
    log_.answer(text(last_.process(), ":   all stages", left_out.empty() ? "" : " but ", join(left_out, ", "),
                     ": about ", short_number(prediction_->seconds() + calibration_->start),
                     " s, the start of the program included\n"));
}

namespace {

/// A stage with --budget writes no volume, but the pipeline as text; whoever runs it may read that from a pipe, too.
void refuse_printed_pipeline(ByteSource& bytes) {
    constexpr std::string_view begins = "vkt ";
    auto const first = bytes.peek(begins.size());
    bool const same = std::ranges::equal(first, begins, {}, [](std::byte b) { return static_cast<char>(b); });
    if (same)
        throw Error(ErrorKind::usage, "what comes in is the pipeline that --budget printed, not a volume",
                    "--budget belongs to the last command of a dry run: leave it out before");
}

} // namespace

std::unique_ptr<Source> Runner::open(Invocation const& stage, std::string const& path, ReadOptions stated) {
    stated.trust_paths = stated.trust_paths || stage.common().trust_paths;
    if (!stage.describes_raw()) stated.asked_by = "vkt " + stage.verb().name;
    auto const open_one = [this, &stage, stated, path](std::string const& one) {
        auto source = open(stage, open_bytes(one), stated);
        formats_[path] = format_;
        return source;
    };
    return open_path(path, open_one, [this, &stage](std::string const& message) { log_.note(stage.stage(), message); });
}

std::unique_ptr<Source> Runner::open(Invocation const& stage, std::unique_ptr<ByteSource> bytes,
                                     ReadOptions const& stated) {
    std::unique_ptr<Source> source;
    std::string const name = bytes->name();
    format_ = "vkt";
    bool const directory = bytes->directory(); // there are no bytes to look at
    bool const file = directory || bytes->seekable();
    // What nobody described may be a stream as well as a file.
    bool const described = stated.describes();
    if (!described && holds_stream(bytes)) {
        ipc::StreamOptions options;
        options.stage = stage.stage();
        // A window shows what is there before all of it is.
        options.whole = stage.consumer() != nullptr && stage.consumer()->needs_whole() && !window_;
        if (&stage == &stages_.front() && !options.whole) options.gpu = gpu_in_;
        options.piece = piece_limit(execution_of(stage));
        bool const standard_input = bytes->descriptor() == STDIN_FILENO || bytes->name() == "standard input";
        auto stream = std::make_unique<ipc::StreamSource>(std::move(bytes), options);
        if (standard_input || stream_in_ == nullptr) stream_in_ = stream->record();
        source = std::move(stream);
    } else {
        if (!described && !directory && bytes->peek(1).empty() && !bytes->seekable())
            ipc::refuse_empty(bytes->name(), bytes->descriptor());
        if (!described && bytes->descriptor() == STDIN_FILENO) refuse_printed_pipeline(*bytes);
        if (stage.consumer() != nullptr && stage.consumer()->reads_pictures() && !directory && is_picture(*bytes))
            return picture_source(std::move(bytes));
        ReadOptions options = stated;
        options.memory = execution_of(stage).memory;
        options.notice = [this, &stage](std::string const& message) { log_.note(stage.stage(), message); };
        format_ = format_name(*bytes, options);
        source = open_volume(std::move(bytes), options);
        // A stage that only passes voxels on has nothing to compute meanwhile: its writer thread is overlap enough.
        // What lies in shared memory is there already.
        Execution execution = execution_of(stage);
        if (feeds_gpu()) execution.device = Device::gpu;
        bool const computes = stage.opener() == nullptr || execution.device == Device::gpu;
        if (computes && format_ != "shm") source = prefetch(std::move(source), execution);
    }
    if (stage.opener() == nullptr && file && format_ != "shm" && explains(stage) && share_ == 0)
        source = std::make_unique<Announced>(std::move(source), [this, &stage](Header const& h, std::int64_t parts) {
            predict_reading(stage, h, parts);
        });
    if (log_.verbosity() == Verbosity::verbose && share_ == 0)
        source = std::make_unique<Announced>(
            std::move(source), [this, &stage, name, format = format_](Header const& header, std::int64_t) {
                log_.detail(stage.stage(), text(name, ": format ", format, ", ", header.dims, " ", header.dtype));
            });
    if (dry_run_) source = std::make_unique<PlanOnly>(std::move(source));
    return source;
}

namespace {

bool is_regular(std::string const& path) {
    std::error_code error;
    return std::filesystem::is_regular_file(path, error);
}
/// Files, patterns of their names and shared memory are; pipes are not.
bool is_there_again(std::string const& path) {
    std::error_code error;
    auto const type = std::filesystem::status(path, error).type();
    return path != "-" && type != std::filesystem::file_type::fifo && type != std::filesystem::file_type::character &&
           type != std::filesystem::file_type::socket;
}

/// What an input that cannot be opened says when its turn comes.
class FailedSource : public Source {
public:
    explicit FailedSource(Error error) : error_(std::move(error)) {}
    bool next_volume() override { throw Error(error_); }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::forward; }
    void read(AnyView) override { throw Error(error_); }
    void finish() override {}

private:
    Error error_;
    Header header_;
};

} // namespace

std::vector<std::unique_ptr<Source>> Runner::open_inputs(Invocation& stage, std::unique_ptr<Source> previous) {
    std::vector<std::unique_ptr<Source>> sources;
    // Windows show the first volume again after the last.
    bool const draws = stage.consumer() != nullptr && stage.consumer()->needs_whole();
    bool const begins = &stage == &stages_.front() || (!twins_.empty() && &stage == &twins_.back().front());
    for (auto const& path : stage.inputs()) {
        if (previous && begins) { // opened already, for several
            sources.push_back(std::move(previous));
        } else if (path == "-" && previous) {
            sources.push_back(std::move(previous));
            formats_[path] = format_ = "vkt"; // what is computed has the format of a stream
        } else {
            bool const several = stage.inputs().size() > 1,
                       again = draws ? is_there_again(path) : several && is_regular(path);
            auto const one = [this, &stage, path] { return open(stage, path); };
            try {
                sources.push_back(again ? std::make_unique<ReopenedSource>(one) : one());
            } catch (Error const& e) {
                // Of several, what the others hold is told all the same.
                bool const told = several && stage.consumer() != nullptr;
                if (!told || (e.kind() != ErrorKind::data && e.kind() != ErrorKind::io)) throw;
                sources.push_back(std::make_unique<FailedSource>(e));
            }
        }
    }
    return sources;
}

void Runner::refuse_unread(Invocation const& stage) const {
    bool const opens = stage.consumer() != nullptr && stage.consumer()->opens_inputs();
    if (&stage == &stages_.front() || (!opens && std::ranges::count(stage.inputs(), "-") > 0)) return;
    std::string const name = text("'", stage.verb().name, "'");
    if (stage.opener() != nullptr || stage.inputs().empty())
        throw Error(ErrorKind::usage, text(name, " can only begin a pipeline"));
    throw Error(ErrorKind::usage, text(name, " does not read what the stage before it writes"),
                "let one of its inputs be '-'");
}

/// The library opens files of its formats; the volume that --like names may be a stream as well.
void Runner::look_at_like(Invocation const& stage) {
    ReferenceVolume* const like = stage.operation()->like();
    if (like == nullptr || like->file.empty()) return;
    auto const record = stream_in_; // what arrives here is not what the stage works on
    like->take(*open(stage, like->file));
    stream_in_ = record;
}

std::unique_ptr<Source> Runner::build(Invocation& stage, std::unique_ptr<Source> previous) {
    Execution const execution = execution_of(stage);
    std::unique_ptr<Source> source;
    if (stage.opener() != nullptr) {
        // Sources may open more files as long as they live.
        contexts_.push_back(std::make_unique<StageContext>(*this, stage, execution, std::move(previous)));
        source = stage.opener()->open(*contexts_.back());
        if (!stage.common().no_history) {
            StageInfo named;
            named.words = stage.history_words();
            named.input_names = stage.inputs();
            std::vector<Header> const files(named.input_names.size());
            source = std::make_unique<WithHistory>(std::move(source), history_step(named, files).command);
        }
        if (dry_run_) source = std::make_unique<PlanOnly>(std::move(source));
        // Of stacks, bricks and the like no line is made again.
        source = std::make_unique<WithPlannedStep>(
            std::move(source), stage.inputs().empty() ? stage.history_words() : std::vector<std::string>{});
        if (explains(stage) && share_ == 0)
            source = std::make_unique<Announced>(std::move(source),
                                                 [this, &stage, execution](Header const& h, std::int64_t parts) {
                                                     log_.answer(opener_plan_text(stage.stage(), h, parts, execution));
                                                     predict_reading(stage, h, parts);
                                                 });
    } else {
        auto inputs = open_inputs(stage, std::move(previous));
        look_at_like(stage);
        source = attach(std::move(inputs), *stage.operation(), execution, stage_info(stage));
        if (dry_run_ && stage.operation()->inputs() == 0)
            source =
                std::make_unique<WithPlannedStep>(std::make_unique<PlanOnly>(std::move(source)), stage.history_words());
    }
    if (stage.common().wants_timing()) source = std::make_unique<Timed>(std::move(source));
    if (!stage.label().empty()) source = std::make_unique<StageSource>(std::move(source), stage.label());
    if (stage.common().strict || last_.common().strict)
        source = std::make_unique<StrictSource>(std::move(source), [this] { refuse_lossy(); });
    return source;
}

int Runner::consume(Invocation& stage, std::unique_ptr<Source> previous) {
    if (!stage.consumer()->runs_on_gpu() && execution_of(stage).only_gpu) refuse_cpu(std::string(stage.verb().name));
    auto inputs = stage.consumer()->opens_inputs() ? std::vector<std::unique_ptr<Source>>{}
                                                   : open_inputs(stage, std::move(previous));
    StageContext context(*this, stage, execution_of(stage));
    if (stage.common().explain && !inputs.empty())
        inputs.front() = std::make_unique<Announced>(
            std::move(inputs.front()), [&context](Header const& header, std::int64_t) { context.explain(header); });
    if (errors_are_terminal() && log_.verbosity() != Verbosity::quiet && !inputs.empty())
        inputs.front() = with_progress(std::move(inputs.front()), stage.stage());
    int code = 0;
    try {
        code = stage.consumer()->consume(inputs, context);
    } catch (PlannedOnly const&) {
        std::string const target = stage.consumer()->writes() ? context.output() : "";
        Source& source = *inputs.front();
        do {
            context.plan(source.header(), target);
            source.finish();
        } while (source.next_volume());
    }
    refuse_lossy();
    for (auto const& write : late_reports_) write();
    tell_held_remarks();
    tell_prediction();
    bool timing =
        std::any_of(stages_.begin(), stages_.end(), [](Invocation const& s) { return s.common().wants_timing(); });
    if (stream_in_ != nullptr) timing = timing || !stream_in_->stages.empty();
    if (timing) log_.answer(timing_table(reports()));
    return code;
}

std::unique_ptr<Source> Runner::only_input(Invocation& stage, std::unique_ptr<Source> previous) {
    if (stage.inputs().size() != 1 || stage.consumer()->opens_inputs())
        throw Error(ErrorKind::usage, text("--budget: '", stage.verb().name, "' has several inputs"),
                    "budgets are for stages of one input");
    return std::move(open_inputs(stage, std::move(previous)).front());
}

int Runner::tell_budget(Source& source) {
    if (!source.next_volume()) throw Error(ErrorKind::data, "--budget: there is no volume");
    Header const header = source.header();
    if (!header.dry_run)
        throw Error(ErrorKind::usage, "--budget is for pipelines that are only planned",
                    "give -n to the first command; within one process vkt pipe --tolerance divides an error");
    do source.finish();
    while (source.next_volume());
    std::optional<History> planned = header.planned;
    if (last_.consumer() != nullptr) {
        StageInfo info;
        info.words = last_.history_words();
        info.input_names = last_.inputs();
        planned = planned_step(info, {header});
    }
    if (!planned)
        throw Error(ErrorKind::usage, "--budget: a stage of the pipeline tells nothing of itself",
                    "leave out --no-history");
    for (auto const& p : last_.common_parameters().all()) {
        if (!p.given || p.positional || !(is_about_output(p.name) || p.name == "json" || p.name == "report")) continue;
        planned->command.push_back("--" + p.name);
        for (auto const& word : p.get()) planned->command.push_back(word);
    }
    BudgetedLine const line = line_within(*planned, *last_.common().budget);
    log_.answer(text(last_.stage(), ":   ", line.result, "\n"));
    print_text(line.line + "\n");
    return 0;
}

/// Before anything is waited for: all stages of a pipeline get hold of their GPUs at once.
void Runner::take_gpus() {
    Common const& c = last_.common();
    bool const streams = last_.yields_volumes() && c.output == "-" && c.streams();
    if (streams && c.resolved_transport() == ipc::Transport::gpu)
        gpu_out_ = ipc::cuda_memory(execution_of(last_).gpu, c.transport ? "--transport gpu" : "VKT_TRANSPORT=gpu");
    // Who computes nothing there is better served in the host's memory.
    Invocation const& first = stages_.front();
    Execution const execution = execution_of(first);
    bool const computes =
        first.operation() != nullptr
            ? first.operation()->runs_on_gpu()
            : first.consumer() != nullptr && first.consumer()->runs_on_gpu() && !first.consumer()->writes();
    bool const reads_pipe = std::ranges::count(first.inputs(), "-") > 0 && ipc::is_pipe(STDIN_FILENO);
    if (dry_run_ || execution.device != Device::gpu || !computes || !reads_pipe) return;
    if (gpus() > 1) return; // what arrives is read by several
    bool const same = gpu_out_ && execution.gpu == execution_of(last_).gpu;
    gpu_in_ = same ? gpu_out_ : ipc::cuda_memory(execution.gpu, "--device gpu");
}

int Runner::run() {
    for (auto const& stage : stages_) dry_run_ = dry_run_ || stage.common().dry_run;
    check_ends();
    if (!dry_run_) spare_inputs(stages_);
    for (auto const& stage : stages_) static_cast<void>(stage.common().report_form()); // refuses what none has
    std::unique_ptr<Source> source;
    try {
        take_gpus();
        source = build_divided();
        for (auto& stage : stages_) {
            refuse_unread(stage);
            if (stage.consumer() != nullptr && !last_.common().budget)
                return in_stage(stage.label(), [&] { return consume(stage, std::move(source)); });
            if (stage.consumer() != nullptr)
                source = in_stage(stage.label(), [&] { return only_input(stage, std::move(source)); });
            else if (twins_.empty())
                source = in_stage(stage.label(), [&] { return build(stage, std::move(source)); });
        }
        if (last_.common().budget) return in_stage(last_.label(), [&] { return tell_budget(*source); });
    } catch (std::exception const& e) {
        say_downstream(last_, e.what());
        throw;
    }
    return drain(std::move(source));
}

} // namespace vkt::shell
