// A runner: where the result goes, and what is told about it.
// SPDX-License-Identifier: MIT
#include "shell/run/runner.h"

#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/series.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/io/output_file.h"
#include "libvkt/io/shared_memory.h"
#include "shell/run/stage_error.h"
#include "shell/run/timing.h"
#include "shell/terminal.h"
#include "shell/viewer/viewer.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace vkt::shell {

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

namespace {

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

} // namespace

/// Refuses what would surprise before anything is read.
void Runner::check_ends() {
    for (std::size_t i = 0; i + 1 < stages_.size(); ++i)
        if (!stages_[i].yields_volumes())
            throw Error(ErrorKind::usage,
                        text("'", stages_[i].verb().name, "' yields no volume for the stage after it"));
    in_stage(last_.label(), [this] { check_output_end(); });
    Invocation const& first = stages_.front();
    bool const reads_stdin = std::find(first.inputs().begin(), first.inputs().end(), "-") != first.inputs().end();
    if (reads_stdin && input_is_terminal())
        throw Error(ErrorKind::usage, "no input: standard input is a terminal",
                    text("name a file, or pipe a volume in; see 'vkt ", first.verb().name, " --help'"));
}

void Runner::check_output_end() {
    Common const& c = last_.common();
    bool const volumes = last_.yields_volumes();
    bool const picture =
        last_.consumer() != nullptr && last_.consumer()->writes() && last_.own_parameters().find("output") == nullptr;
    bool const to_terminal = (volumes || picture) && c.output == "-" && !last_.common_parameters().given("output") &&
                             output_is_terminal() && !dry_run_ && !c.budget;
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
}

std::unique_ptr<Sink> Runner::make_sink() {
    Common const& c = last_.common();
    if (c.output == "-" && (c.format.empty() || c.format == "vkt")) {
        ipc::StreamOptions options;
        options.stage = last_.stage();
        options.checksum = !c.no_checksum;
        options.transport = c.resolved_transport();
        options.gpu = gpu_out_;
        options.notice = [this](std::string const& message) { log_.note(last_.stage(), message); };
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
    options.notice = [this](std::string const& message) { lose(message); };
    options.remark = [this](std::string const& message) { remark(message); };
    bool const checksum = !c.no_checksum, stream = ipc::is_stream_file(c.output, c.format);
    auto const create = [=](std::string const& path, WriteOptions const& own) {
        return stream ? ipc::create_stream_file(path, own.force, checksum) : create_volume(path, own);
    };
    if (last_.opener() != nullptr)
        if (auto sink =
                last_.opener()->sink(c.output, options, [=](std::string const& path) { return create(path, options); }))
            return sink;
    if (!is_numbered(c.output)) return create(numbered_path(c.output, 0), options);
    return numbered_sink(c.output, holds_slices(c.output, c.format), options, create);
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

void Runner::remark(std::string const& message) {
    if (std::exchange(lost_, message) != message) log_.note(last_.stage(), message); // of many files one line
}

void Runner::lose(std::string const& message) {
    if (last_.common().strict)
        lossy_ = {last_.label(), message}; // the error says it
    else
        remark(message);
}

void Runner::tell_held_remarks() {
    for (HeldRemark const& held : std::exchange(held_remarks_, {})) log_.note(held.stage, held.message);
}

void Runner::refuse_lossy() const {
    if (lossy_) in_stage(lossy_->label, [this] { throw Error(ErrorKind::data, text("--strict: ", lossy_->message)); });
}

void Runner::drain_all(Source& source, Sink& sink) {
    bool timing = false;
    Execution const execution = execution_of(last_);
    while (source.next_volume()) {
        timing = timing || source.header().timing;
        bool const to_file = last_.common().output != "-";
        if (to_file && (explains(last_) || source.header().dry_run)) predict_writing(last_, source.header());
        if (source.header().dry_run && stream_out_ == nullptr) {
            source.finish();
            continue;
        }
        drain_volume(source, sink, execution);
        refuse_lossy();
        tell_held_remarks();
    }
    // Parts of a volume come as volumes, whose stages end with the last.
    refuse_lossy();
    tell_held_remarks();
    for (auto const& write : late_reports_) write();
    sink.close();
    tell_prediction();
    tell_transport();
    bool const passes_on = stream_out_ != nullptr && ipc::is_pipe(STDOUT_FILENO);
    if (timing && !passes_on) log_.answer(timing_table(reports()));
}

void Runner::tell_transport() const {
    std::string where = (is_segment(last_.common().output) ? "segment " : "file ") + last_.common().output;
    if (last_.common().output == "-") {
        where = !ipc::is_pipe(STDOUT_FILENO) ? "standard output" : stream_out_ != nullptr ? stream_out_->way() : "pipe";
    }
    log_.detail(last_.stage(), "voxels left through " + where);
}

void Runner::foretell_output() const {
    Common const& c = last_.common();
    std::string const path = numbered_path(c.output, 0);
    std::error_code failed;
    bool const file = path != "-" && !is_segment(path) && file_part(path).part.empty() &&
                      !std::filesystem::is_directory(path, failed);
    if (file && last_.opener() == nullptr) in_stage(last_.label(), [&] { check_output(path, c.force); });
}

int Runner::drain(std::unique_ptr<Source> source) {
    if (dry_run_ && (last_.common().output != "-" || output_is_terminal())) {
        while (source->next_volume()) {
            if (last_.common().output != "-") predict_writing(last_, source->header());
            source->finish();
        }
        tell_prediction();
        foretell_output();
        return 0;
    }
    bool const last_in_line = last_.common().output != "-" || !ipc::is_pipe(STDOUT_FILENO);
    if (last_in_line && errors_are_terminal() && log_.verbosity() != Verbosity::quiet)
        source = with_progress(std::move(source), last_.stage());
    auto const sink = in_stage(last_.label(), [this] { return make_sink(); });
    // A file that standard output was redirected to has no reader to tell, unless it holds a part already.
    auto const tell_reader = [&](std::string const& stage, std::string const& message) {
        bool const reader = stream_out_ == nullptr || ipc::is_pipe(STDOUT_FILENO);
        if (reader || stream_out_->traffic().bytes > 0) tell(*sink, stage, message);
    };
    try {
        in_stage(last_.label(), [&] { drain_all(*source, *sink); });
    } catch (ipc::BrokenPipe const&) {
        throw;
    } catch (UpstreamError const& e) {
        tell_reader("", e.what());
        throw;
    } catch (std::exception const& e) {
        tell_reader(last_.process(), e.what());
        throw;
    }
    return 0;
}

} // namespace vkt::shell
