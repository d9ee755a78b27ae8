// From parsed stages to voxels that move.
// SPDX-License-Identifier: MIT
#include "shell/run.h"

#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/stack.h"
#include "libvkt/io/shared_memory.h"
#include "libvkt/io/system_error.h"
#include "libvkt/operations/reference_volume.h"
#include "shell/calibration.h"
#include "shell/help.h"
#include "shell/named_files.h"
#include "shell/pictures.h"
#include "shell/plan_text.h"
#include "shell/short_number.h"
#include "shell/terminal.h"
#include "shell/timing.h"
#include "shell/viewer/viewer.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <new>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace vkt::shell {
namespace {

/// A source whose headers are changed on the way.
class Relabelled : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;
    bool next_volume() override {
        if (!inner().next_volume()) return false;
        header_ = inner().header();
        relabel(header_);
        return true;
    }
    Header const& header() const override { return header_; }

private:
    virtual void relabel(Header& header) const = 0;
    Header header_;
};

/// Marks the volumes of a source as planned only; gives no voxels.
class PlanOnly : public Relabelled {
public:
    using Relabelled::Relabelled;
    void read(AnyView) override { throw PlannedOnly(); }
    std::optional<ConstView> borrow(Box const&) override { throw PlannedOnly(); }
    BrickSequence take_bricks() override { throw PlannedOnly(); }
    std::optional<Volume> take_whole() override { throw PlannedOnly(); }
    void finish() override {
        if (inner().header().dry_run) inner().finish();
    }

private:
    void relabel(Header& header) const override { header.dry_run = true; }
};

/// Tells of each volume of a source, for --dry-run, --explain and --verbose.
class Announced : public SourceDecorator {
public:
    Announced(std::unique_ptr<Source> source, std::function<void(Header const&)> tell)
        : SourceDecorator(std::move(source)), tell_(std::move(tell)) {}
    bool next_volume() override {
        if (!inner().next_volume()) return false;
        tell_(inner().header());
        return true;
    }

private:
    std::function<void(Header const&)> tell_;
};

/// Asks the stages downstream for their times.
class Timed : public Relabelled {
public:
    using Relabelled::Relabelled;

private:
    void relabel(Header& header) const override { header.timing = true; }
};

/// Adds the first step to the history of volumes that come from an opener (read).
class WithHistory : public Relabelled {
public:
    WithHistory(std::unique_ptr<Source> source, std::vector<std::string> words)
        : Relabelled(std::move(source)), words_(std::move(words)) {}

private:
    void relabel(Header& header) const override {
        // A file that knows its own past needs no step that says it was read.
        if (header.history) return;
        mark_as_given(header);
        header.history = History{words_, {}};
    }
    std::vector<std::string> words_;
};

/// Passes an error on to whoever reads our output. An empty stage means that the message names its origin already.
void tell(Sink& sink, std::string const& stage, std::string const& message) {
    try {
        std::size_t const colon = stage.empty() ? message.find(": ") : std::string::npos;
        if (colon == std::string::npos)
            sink.fail(stage.empty() ? "an upstream command" : stage, message);
        else
            sink.fail(message.substr(0, colon), message.substr(colon + 2));
    } catch (ipc::BrokenPipe const&) {
    } catch (std::exception const&) { // nobody can be told; the exit code remains
    }
}

class Runner;

/// What consumers see of a stage.
class StageContext : public Context {
public:
    StageContext(Runner& runner, Invocation& invocation, Execution execution,
                 std::unique_ptr<Source> previous = nullptr)
        : runner_(runner), invocation_(invocation), execution_(std::move(execution)), previous_(std::move(previous)) {}
    Execution const& execution() const override { return execution_; }
    StageInfo stage_info() const override;
    bool json() const override { return invocation_.common().json; }
    bool quiet() const override { return invocation_.common().quiet; }
    bool verbose() const override { return invocation_.common().verbose; }
    std::string const& output() const override { return invocation_.common().output; }
    bool force() const override { return invocation_.common().force; }
    bool trust_paths() const override { return invocation_.common().trust_paths; }
    bool window() const override;
    bool dry_run() const override;
    void print(std::string const& report) override;
    void note(std::string const& message) override;
    void plan(Header const& header, std::string const& output) override;
    void explain(Header const& header) const;
    void lossy(std::string const& message) override;
    std::function<void(std::string const&)> detail() override;
    std::string format(std::string const& input) const override;
    std::unique_ptr<Source> open(std::string const& path, ReadOptions const& stated) override;

private:
    Runner& runner_;
    Invocation& invocation_;
    Execution execution_;
    std::unique_ptr<Source> previous_; ///< what open("-") yields, if there is a stage before
};

class Runner {
public:
    explicit Runner(std::deque<Invocation>& stages)
        : stages_(stages), last_(stages.back()), log_(verbosity(last_.common())) {}
    int run();

    StageInfo stage_info(Invocation const& stage);
    std::unique_ptr<Source> open(Invocation const& stage, std::string const& path, ReadOptions stated = {});
    std::unique_ptr<Source> open(Invocation const& stage, std::unique_ptr<ByteSource> bytes, ReadOptions const& stated);
    Log const& log() const { return log_; }
    /// None without one that was kept of this machine and build.
    Calibration const* calibration();
    /// Tells how long a stage will take.
    void predict(std::string const& stage, double seconds);
    bool dry_run() const { return dry_run_; }
    bool window() const { return window_; }
    std::string format(std::string const& input) const {
        auto const found = formats_.find(input);
        return found == formats_.end() ? format_ : found->second;
    }

private:
    static Verbosity verbosity(Common const& c) {
        return c.quiet ? Verbosity::quiet : c.verbose ? Verbosity::verbose : Verbosity::normal;
    }
    Execution execution_of(Invocation const& stage) const;
    void check_ends();
    std::unique_ptr<Source> build(Invocation& stage, std::unique_ptr<Source> previous);
    std::vector<std::unique_ptr<Source>> open_inputs(Invocation& stage, std::unique_ptr<Source> previous);
    void look_at_like(Invocation const& stage);
    int consume(Invocation& stage, std::unique_ptr<Source> previous);
    int drain(std::unique_ptr<Source> source);
    std::unique_ptr<Sink> make_sink();
    void drain_all(Source& source, Sink& sink);
    void print_plan(Invocation const& stage, Plan const& plan, std::vector<Header> const& inputs);
    void tell_prediction() const;
    void refuse_lossy();
    void tell_transport() const;
    ipc::StageReport own_report() const;
    std::vector<ipc::StageReport> reports() const;

    std::deque<Invocation>& stages_;
    Invocation& last_;
    Log log_;
    bool dry_run_ = false, window_ = false;
    bool went_inline_ = false; ///< voxels that were to go through shared memory
    bool asked_calibration_ = false;
    std::optional<Calibration> calibration_;
    int predictions_ = 0;
    double predicted_ = 0; ///< seconds of all stages
    std::string lossy_;
    std::string format_;                         ///< of the file opened last
    std::map<std::string, std::string> formats_; ///< of the files opened last for inputs, by their names
    std::shared_ptr<ipc::StreamRecord const> stream_in_;
    ipc::StreamSink* stream_out_ = nullptr;
    std::vector<std::unique_ptr<StageContext>> contexts_; ///< of openers
    TimeMeter meter_;
};

bool StageContext::dry_run() const { return runner_.dry_run(); }
bool StageContext::window() const { return runner_.window(); }
StageInfo StageContext::stage_info() const { return runner_.stage_info(invocation_); }
void StageContext::note(std::string const& message) { runner_.log().note(invocation_.stage(), message); }
void StageContext::lossy(std::string const& message) {
    note(message);
    if (invocation_.common().strict) throw Error(ErrorKind::data, text("--strict: ", message));
}
std::function<void(std::string const&)> StageContext::detail() {
    return
        [log = runner_.log(), stage = invocation_.stage()](std::string const& message) { log.detail(stage, message); };
}
std::string StageContext::format(std::string const& input) const { return runner_.format(input); }
std::unique_ptr<Source> StageContext::open(std::string const& path, ReadOptions const& stated) {
    if (path == "-" && previous_ && !stated.describes()) return std::move(previous_);
    return runner_.open(invocation_, path, stated);
}

void StageContext::plan(Header const& header, std::string const& output) {
    bool const whole = (invocation_.consumer() != nullptr && invocation_.consumer()->needs_whole()) ||
                       format_of_name(output) == "vdb"; // OpenVDB's trees are made in memory
    std::optional<std::size_t> held;
    if (whole) held = invocation_.consumer()->bytes_held(header);
    runner_.log().answer(consumer_plan_text(invocation_.stage(), header, output, held, execution_));
    if (invocation_.verb().name == "write" && header.kind == Kind::structured)
        if (Calibration const* const known = runner_.calibration())
            runner_.predict(invocation_.stage(), known->writing(header));
    explain(header);
}

void StageContext::explain(Header const& header) const {
    for (auto const& line : invocation_.consumer()->explain(header))
        runner_.log().answer(text(invocation_.stage(), ":   ", printable(line)));
}

void StageContext::print(std::string const& report) {
    OutputFile file(output(), force());
    file.write(report.data(), report.size());
    file.commit();
}

Execution Runner::execution_of(Invocation const& stage) const { return stage.common().execution(); }

StageInfo Runner::stage_info(Invocation const& stage) {
    StageInfo info;
    info.name = stage.stage();
    if (stages_.size() > 1) info.label = stage.verb().name;
    if (!last_.common().no_history && !stage.common().no_history) info.words = stage.history_words();
    info.input_names = stage.inputs();
    bool const strict = stage.common().strict || last_.common().strict;
    info.listener = [this, strict](std::string const& name, std::string const& message, bool lossy) {
        log_.note(name, message);
        if (lossy && strict) lossy_ = message;
    };
    if (!stage.common().report_file.empty()) {
        auto const collected = std::make_shared<std::vector<Report>>();
        info.on_report = [&stage, collected](Report const& report) {
            collected->push_back(report);
            OutputFile file(stage.common().report_file, stage.common().force || collected->size() > 1);
            std::string const text = Report::json(*collected);
            file.write(text.data(), text.size());
            file.commit();
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
    if (!trees && execution.device != Device::gpu)
        if (Calibration const* const known = calibration())
            predict(stage.stage(), known->seconds(stage.verb().name, plan, inputs, reduction, execution.threads));
}

Calibration const* Runner::calibration() {
    if (!std::exchange(asked_calibration_, true)) calibration_ = load_calibration();
    return calibration_ ? &*calibration_ : nullptr;
}

void Runner::predict(std::string const& stage, double seconds) {
    ++predictions_;
    predicted_ += seconds;
    log_.answer(text(stage, ":   about ", short_number(seconds), " s on this machine\n"));
}

void Runner::tell_prediction() const {
    if (predictions_ > 1) log_.answer(text(last_.stage(), ":   all stages: about ", short_number(predicted_), " s\n"));
}

std::unique_ptr<Source> Runner::open(Invocation const& stage, std::string const& path, ReadOptions stated) {
    stated.trust_paths = stated.trust_paths || stage.common().trust_paths;
    auto const open_one = [this, &stage, stated, path](std::string const& one) {
        auto source = open(stage, open_bytes(one), stated);
        formats_[path] = format_;
        return source;
    };
    return open_path(path, open_one);
}

std::unique_ptr<Source> Runner::open(Invocation const& stage, std::unique_ptr<ByteSource> bytes,
                                     ReadOptions const& stated) {
    std::unique_ptr<Source> source;
    std::string const name = bytes->name();
    format_ = "vkt";
    bool const directory = bytes->directory(); // there are no bytes to look at
    // What nobody described may be a stream as well as a file.
    bool const described = stated.describes();
    if (!described && !directory && ipc::is_stream(bytes->peek(ipc::magic.size()))) {
        ipc::StreamOptions options;
        options.stage = stage.stage();
        options.transport = stage.common().resolved_transport();
        // A window shows what is there before all of it is.
        options.whole = stage.consumer() != nullptr && stage.consumer()->needs_whole() && !window_;
        options.piece = piece_limit(execution_of(stage));
        bool const standard_input = bytes->descriptor() == STDIN_FILENO || bytes->name() == "standard input";
        auto stream = std::make_unique<ipc::StreamSource>(std::move(bytes), options);
        if (standard_input || stream_in_ == nullptr) stream_in_ = stream->record();
        source = std::move(stream);
    } else {
        if (!described && !directory && bytes->peek(1).empty() && !bytes->seekable())
            throw Error(ErrorKind::data, text("no volume on ", bytes->name(), ": it is empty"),
                        ipc::is_pipe(bytes->descriptor()) ? "an upstream command failed before it wrote anything" : "");
        if (stage.consumer() != nullptr && stage.consumer()->reads_pictures() && !directory && is_picture(*bytes))
            return picture_source(std::move(bytes));
        ReadOptions options = stated;
        options.memory = execution_of(stage).memory;
        format_ = format_name(*bytes, options);
        source = open_volume(std::move(bytes), options);
        // A stage that only passes voxels on has nothing to compute meanwhile: its writer thread is overlap enough.
        // What lies in shared memory is there already.
        if (stage.opener() == nullptr && format_ != "shm") source = prefetch(std::move(source), execution_of(stage));
    }
    if (log_.verbosity() == Verbosity::verbose)
        source = std::make_unique<Announced>(
            std::move(source), [this, &stage, name, format = format_](Header const& header) {
                log_.detail(stage.stage(), text(name, ": format ", format, ", ", header.dims, " ", header.dtype));
            });
    if (dry_run_) source = std::make_unique<PlanOnly>(std::move(source));
    return source;
}

std::vector<std::unique_ptr<Source>> Runner::open_inputs(Invocation& stage, std::unique_ptr<Source> previous) {
    std::vector<std::unique_ptr<Source>> sources;
    for (auto const& path : stage.inputs()) {
        if (path == "-" && previous) {
            sources.push_back(std::move(previous));
            formats_[path] = format_ = "vkt"; // what is computed has the format of a stream
        } else if (std::error_code error; stage.inputs().size() > 1 && std::filesystem::is_regular_file(path, error)) {
            sources.push_back(std::make_unique<ReopenedSource>([this, &stage, path] { return open(stage, path); }));
        } else {
            sources.push_back(open(stage, path));
        }
    }
    if (previous)
        throw Error(ErrorKind::usage, text("'", stage.verb().name, "' does not read what the stage before it writes"),
                    "let one of its inputs be '-'");
    return sources;
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
        bool const reads_previous = std::ranges::count(stage.inputs(), "-") > 0;
        if (previous && !reads_previous)
            throw Error(ErrorKind::usage, text("'", stage.verb().name, "' can only begin a pipeline"));
        // Sources may open more files as long as they live.
        contexts_.push_back(std::make_unique<StageContext>(*this, stage, execution, std::move(previous)));
        source = stage.opener()->open(*contexts_.back());
        if (!stage.common().no_history)
            source = std::make_unique<WithHistory>(std::move(source), stage.history_words());
        if (dry_run_) source = std::make_unique<PlanOnly>(std::move(source));
        if (dry_run_ || stage.common().explain || last_.common().explain)
            source = std::make_unique<Announced>(
                std::move(source), [this, name = stage.stage(), execution](Header const& h) {
                    log_.answer(opener_plan_text(name, h, execution));
                    if (Calibration const* const known = calibration(); known != nullptr && h.kind == Kind::structured)
                        predict(name, known->reading(h));
                });
    } else {
        auto inputs = open_inputs(stage, std::move(previous));
        look_at_like(stage);
        source = attach(std::move(inputs), *stage.operation(), execution, stage_info(stage));
        if (dry_run_ && stage.operation()->inputs() == 0) source = std::make_unique<PlanOnly>(std::move(source));
    }
    if (stage.common().wants_timing()) source = std::make_unique<Timed>(std::move(source));
    return source;
}

/// A picture is what its name says.
void check_suffix(std::string const& path, std::vector<std::string> const& written) {
    std::string const name = path.substr(path.rfind('/') + 1);
    auto const dot = name.rfind('.');
    if (written.empty() || dot == std::string::npos || name.find_first_not_of('.') >= dot) return;
    std::string const suffix = lower_case(name.substr(dot));
    if (std::find(written.begin(), written.end(), suffix) != written.end()) return;
    throw Error(ErrorKind::usage, text("'", path, "': files of that kind are not written"),
                text("end the name in ", join(written, " or ")));
}

/// Refuses what would surprise before anything is read.
void Runner::check_ends() {
    for (std::size_t i = 0; i + 1 < stages_.size(); ++i)
        if (!stages_[i].yields_volumes())
            throw Error(ErrorKind::usage,
                        text("'", stages_[i].verb().name, "' yields no volume for the stage after it"));
    Common const& c = last_.common();
    bool const volumes = last_.yields_volumes();
    bool const picture =
        last_.consumer() != nullptr && last_.consumer()->writes() && last_.own_parameters().find("output") == nullptr;
    bool const to_terminal = (volumes || picture) && c.output == "-" && !last_.common_parameters().given("output") &&
                             output_is_terminal() && !dry_run_;
    bool const shows = last_.consumer() != nullptr && last_.consumer()->shows();
    bool const only_shows = shows && !last_.consumer()->writes();
    bool const forced = shows && picture && last_.own_parameters().given("window");
    if (forced && last_.common_parameters().given("output"))
        throw Error(ErrorKind::usage, "--window and -o exclude each other",
                    "s saves the picture that the window shows");
    window_ = shows && (to_terminal || ((forced || only_shows) && !dry_run_));
    if (window_)
        viewer::require_display();
    else if (to_terminal)
        throw Error(ErrorKind::usage,
                    text("refusing to write a binary ", volumes ? "volume" : "file", " to the terminal"),
                    "use -o FILE, or pipe it into another command, e.g. '| vkt info'");
    if (picture) check_suffix(c.output, last_.consumer()->suffixes());
    if (picture && !window_) last_.consumer()->check_file(c.output);
    if (picture && !window_) check_output(numbered_path(c.output, 0), c.force); // drawing may take long
    Invocation const& first = stages_.front();
    bool const reads_stdin = std::find(first.inputs().begin(), first.inputs().end(), "-") != first.inputs().end();
    if (reads_stdin && input_is_terminal())
        throw Error(ErrorKind::usage, "no input: standard input is a terminal",
                    text("name a file, or pipe a volume in; see 'vkt ", first.verb().name, " --help'"));
}

std::unique_ptr<Sink> Runner::make_sink() {
    Common const& c = last_.common();
    if (c.output == "-" && (c.format.empty() || c.format == "vkt")) {
        ipc::StreamOptions options;
        options.stage = last_.stage();
        options.checksum = !c.no_checksum;
        options.transport = c.resolved_transport();
        options.notice = [this](std::string const& message) {
            went_inline_ = true; // it is told about nothing else
            log_.note(last_.stage(), message);
        };
        auto sink = std::make_unique<ipc::StreamSink>(STDOUT_FILENO, options);
        stream_out_ = sink.get();
        sink->report_stages([this] { return reports(); });
        return sink;
    }
    WriteOptions options;
    options.format = c.format;
    options.force = c.force;
    options.compress = c.compress;
    options.memory = execution_of(last_).memory;
    options.threads = execution_of(last_).threads;
    bool const stream = ipc::is_stream_file(c.output, c.format);
    auto const create = [=](std::string const& path) {
        return stream ? ipc::create_stream_file(path, options.force, !c.no_checksum) : create_volume(path, options);
    };
    if (last_.opener() != nullptr)
        if (auto sink = last_.opener()->sink(c.output, options, create)) return sink;
    if (!is_numbered(c.output)) return create(numbered_path(c.output, 0));
    return holds_slices(c.output, c.format) ? slices_sink(c.output, create) : series_sink(c.output, create);
}

ipc::StageReport Runner::own_report() const {
    ipc::Traffic const out = stream_out_ != nullptr ? stream_out_->traffic() : ipc::Traffic{};
    std::string name = stages_.front().verb().name;
    for (std::size_t i = 1; i < stages_.size(); ++i) name += " | " + stages_[i].verb().name;
    return meter_.report(name, stream_in_ != nullptr ? &stream_in_->traffic : nullptr,
                         stream_out_ != nullptr ? &out : nullptr);
}

std::vector<ipc::StageReport> Runner::reports() const {
    std::vector<ipc::StageReport> rows;
    if (stream_in_ != nullptr) rows = stream_in_->stages;
    rows.push_back(own_report());
    return rows;
}

void Runner::refuse_lossy() {
    if (!lossy_.empty()) throw Error(ErrorKind::data, text("--strict: ", lossy_));
}

void Runner::drain_all(Source& source, Sink& sink) {
    bool timing = false;
    Execution const execution = execution_of(last_);
    while (source.next_volume()) {
        timing = timing || source.header().timing;
        if (source.header().dry_run && stream_out_ == nullptr) {
            source.finish();
            continue;
        }
        drain_volume(source, sink, execution);
        refuse_lossy();
    }
    sink.close();
    tell_prediction();
    tell_transport();
    bool const passes_on = stream_out_ != nullptr && ipc::is_pipe(STDOUT_FILENO);
    if (timing && !passes_on) log_.answer(timing_table(reports()));
}

void Runner::tell_transport() const {
    std::string where = (is_segment(last_.common().output) ? "segment " : "file ") + last_.common().output;
    if (last_.common().output == "-") {
        bool const shared = last_.common().resolved_transport() == ipc::Transport::shm && !went_inline_;
        where = !ipc::is_pipe(STDOUT_FILENO)       ? "standard output"
                : stream_out_ != nullptr && shared ? "shared memory"
                                                   : "pipe";
    }
    log_.detail(last_.stage(), "voxels left through " + where);
}

int Runner::drain(std::unique_ptr<Source> source) {
    if (dry_run_ && (last_.common().output != "-" || output_is_terminal())) {
        while (source->next_volume()) source->finish();
        tell_prediction();
        return 0;
    }
    bool const last_in_line = last_.common().output != "-" || !ipc::is_pipe(STDOUT_FILENO);
    if (last_in_line && errors_are_terminal() && log_.verbosity() != Verbosity::quiet)
        source = with_progress(std::move(source), last_.stage());
    auto const sink = make_sink();
    // A file that standard output was redirected to has no reader to tell, unless it holds a part already.
    auto const tell_reader = [&](std::string const& stage, std::string const& message) {
        bool const reader = stream_out_ == nullptr || ipc::is_pipe(STDOUT_FILENO);
        if (reader || stream_out_->traffic().bytes > 0) tell(*sink, stage, message);
    };
    try {
        drain_all(*source, *sink);
    } catch (ipc::BrokenPipe const&) {
        throw;
    } catch (UpstreamError const& e) {
        tell_reader("", e.what());
        throw;
    } catch (std::exception const& e) {
        tell_reader(last_.stage(), e.what());
        throw;
    }
    return 0;
}

int Runner::consume(Invocation& stage, std::unique_ptr<Source> previous) {
    if (!stage.consumer()->runs_on_gpu() && execution_of(stage).only_gpu) refuse_cpu(std::string(stage.verb().name));
    if (stage.consumer()->opens_inputs() && previous)
        throw Error(ErrorKind::usage, text("'", stage.verb().name, "' does not read what the stage before it writes"));
    auto inputs = stage.consumer()->opens_inputs() ? std::vector<std::unique_ptr<Source>>{}
                                                   : open_inputs(stage, std::move(previous));
    StageContext context(*this, stage, execution_of(stage));
    if (stage.common().explain && !inputs.empty())
        inputs.front() = std::make_unique<Announced>(std::move(inputs.front()),
                                                     [&context](Header const& header) { context.explain(header); });
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
    tell_prediction();
    bool timing =
        std::any_of(stages_.begin(), stages_.end(), [](Invocation const& s) { return s.common().wants_timing(); });
    if (stream_in_ != nullptr) timing = timing || !stream_in_->stages.empty();
    if (timing) log_.answer(timing_table(reports()));
    return code;
}

int Runner::run() {
    for (auto const& stage : stages_) dry_run_ = dry_run_ || stage.common().dry_run;
    check_ends();
    if (!dry_run_) spare_inputs(stages_);
    std::unique_ptr<Source> source;
    try {
        for (auto& stage : stages_) {
            if (stage.consumer() != nullptr) return consume(stage, std::move(source));
            source = build(stage, std::move(source));
        }
    } catch (std::exception const& e) {
        say_downstream(last_, e.what());
        throw;
    }
    return drain(std::move(source));
}

/// Whether words that could not be parsed name an output file: standard output is somebody else's then.
bool names_output(std::vector<std::string> const& words) {
    return std::any_of(words.begin(), words.end(), [](std::string const& word) {
        return word == "--output" || word.starts_with("--output=") || (word.starts_with("-o") && word != "-o-");
    });
}

} // namespace

void say_downstream(Invocation const& stage, std::string const& message) {
    bool const streams = stage.yields_volumes() && stage.common().output == "-" && ipc::is_pipe(STDOUT_FILENO);
    if (!streams) return;
    ipc::StreamSink sink(STDOUT_FILENO, {});
    tell(sink, stage.stage(), message);
}

int run(std::deque<Invocation>& stages) {
    Runner runner(stages);
    return runner.run();
}

int run_words(std::vector<std::string> const& words) {
    Verb const verb = find_verb(words);
    if (verb.command->body) {
        bool const asks = std::find(verb.words.begin(), verb.words.end(), "--help") != verb.words.end();
        bool const examples = std::find(verb.words.begin(), verb.words.end(), "--examples") != verb.words.end();
        if (!asks && !examples) return verb.command->body(verb.words);
    }
    std::deque<Invocation> stages;
    stages.emplace_back(verb);
    Invocation& stage = stages.front();
    try {
        stage.parse();
    } catch (Error const& e) {
        if (!names_output(verb.words)) say_downstream(stage, e.what());
        throw;
    }
    if (stage.common().examples || stage.common().help) {
        std::string const answer = stage.common().examples ? command_examples(*verb.command) : command_help(stage);
        print_text(answer);
        return 0;
    }
    return run(stages);
}

int guarded(std::string const& stage, std::function<int()> const& body) {
    Log const log;
    auto const report = [&](std::string const& message, std::string const& hint) {
        log.error(stage, message);
        if (!hint.empty()) log.error(stage, "hint: " + hint);
    };
    try {
        int const code = body();
        if (std::fflush(stdout) != 0) {
            report("cannot write to standard output", "");
            return static_cast<int>(ErrorKind::io);
        }
        return code;
    } catch (ipc::BrokenPipe const&) {
        // Nobody reads on: leave as any filter would, killed by the signal that says so.
        std::signal(SIGPIPE, SIG_DFL);
        std::raise(SIGPIPE);
        return 141;
    } catch (UpstreamError const&) {
        return static_cast<int>(ErrorKind::data);
    } catch (Error const& e) {
        report(e.what(), e.hint());
        return static_cast<int>(e.kind());
    } catch (std::bad_alloc const&) {
        report("out of memory", "lower --memory, or work on a part with 'vkt crop'");
        return static_cast<int>(ErrorKind::resources);
    } catch (std::system_error const& e) {
        bool const resources = is_shortage(e);
        report(resources ? text("cannot start a thread: ", e.code().message()) : e.what(),
               resources ? "the limits of this shell or job are tight (ulimit -a); fewer --threads need less" : "");
        return static_cast<int>(resources ? ErrorKind::resources : ErrorKind::failure);
    } catch (std::exception const& e) {
        report(e.what(), "");
        return static_cast<int>(ErrorKind::failure);
    }
}

} // namespace vkt::shell
