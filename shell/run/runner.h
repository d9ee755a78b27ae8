// Running stages within one process: what a Runner knows, and what consumers see of their stage.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/stream.h"
#include "shell/invocation.h"
#include "shell/log.h"
#include "shell/machine/calibration.h"
#include "shell/run/timing.h"

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace vkt::shell {

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
    void refuse_lossy() override;
    std::function<void(std::string const&)> detail() override;
    std::string format(std::string const& input) const override;
    std::unique_ptr<Source> open(std::string const& path, ReadOptions const& stated) override;

private:
    Runner& runner_;
    Invocation& invocation_;
    Execution execution_;
    std::unique_ptr<Source> previous_; ///< what open("-") yields, if there is a stage before
};

/// Opens what the stages read, joins them, and drains or consumes what comes of it. Used once.
class Runner {
public:
    explicit Runner(std::deque<Invocation>& stages)
        : stages_(stages), last_(stages.back()), log_(verbosity(last_.common())) {}
    int run();

    StageInfo stage_info(Invocation const& stage);
    std::unique_ptr<Source> open(Invocation const& stage, std::string const& path, ReadOptions stated = {});
    std::unique_ptr<Source> open(Invocation const& stage, std::unique_ptr<ByteSource> bytes, ReadOptions const& stated);
    Log const& log() const { return log_; }
    void refuse_lossy() const;
    /// Remarks are told once what they are about is there: after an error they would be of nothing.
    void hold_remark(std::string const& stage, std::string const& message) {
        held_remarks_.push_back({stage, message});
    }
    /// Tells how long a stage will take to read or write a volume, and counts it; nothing without a calibration.
    void predict_reading(Invocation const& stage, Header const& header, std::int64_t parts);
    void predict_writing(Invocation const& stage, Header const& header);
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
    bool feeds_gpu() const; ///< some stage was told to compute on one
    void check_ends();
    void check_output_end();
    std::unique_ptr<Source> build(Invocation& stage, std::unique_ptr<Source> previous);
    /// How many GPUs the stages that make volumes work on at once.
    int gpus() const;
    /// The stages that make volumes, once for each GPU; null if there are no several.
    std::unique_ptr<Source> build_divided();
    std::vector<std::unique_ptr<Source>> open_inputs(Invocation& stage, std::unique_ptr<Source> previous);
    void look_at_like(Invocation const& stage);
    /// What no stage reads must not be written.
    void refuse_unread(Invocation const& stage) const;
    int consume(Invocation& stage, std::unique_ptr<Source> previous);
    int drain(std::unique_ptr<Source> source);
    /// What a consumer would read. Throws Error{usage} if that is not one volume after the other from one input.
    std::unique_ptr<Source> only_input(Invocation& stage, std::unique_ptr<Source> previous);
    /// --budget: prints the pipeline that was planned, with knobs that keep the error of its result within the budget.
    int tell_budget(Source& source);
    void take_gpus();
    std::unique_ptr<Sink> make_sink();
    void drain_all(Source& source, Sink& sink);
    void print_plan(Invocation const& stage, Plan const& plan, std::vector<Header> const& inputs);
    bool explains(Invocation const& stage) const; ///< or is only planned
    /// Of the stages that were planned so far; null without a calibration.
    Prediction* prediction();
    /// None without one that was kept of this machine and build.
    Calibration const* calibration();
    void tell_seconds(Invocation const& stage, std::string const& what, double seconds);
    void tell_unpredicted(Invocation const& stage);
    void tell_prediction() const;
    /// Refuses the name of the output as writing would; of parts of files and of directories only their writers know.
    void foretell_output() const;
    void remark(std::string const& message);
    void tell_held_remarks();
    void lose(std::string const& message); ///< of what the output's format does not hold
    void tell_transport() const;
    ipc::StageReport own_report() const;
    std::vector<ipc::StageReport> reports() const;

    std::deque<Invocation>& stages_;
    Invocation& last_;
    std::deque<std::deque<Invocation>> twins_; ///< of the stages that make volumes, for each further GPU
    int shares_ = 1, share_ = 0;               ///< while they are built: how many there are, and whose turn it is
    Log log_;
    bool dry_run_ = false, window_ = false;
    bool asked_calibration_ = false;
    std::optional<Calibration> calibration_;
    std::optional<Prediction> prediction_;
    std::set<Invocation const*> predicted_; ///< stages that are in it
    /// What --strict refuses, and whose it is.
    struct Loss {
        std::string label, message;
    };
    std::optional<Loss> lossy_;
    struct HeldRemark {
        std::string stage, message;
    };
    std::vector<HeldRemark> held_remarks_;
    std::string lost_;                                ///< what was told last
    std::vector<std::function<void()>> late_reports_; ///< to what takes them once
    std::string format_;                              ///< of the file opened last
    std::map<std::string, std::string> formats_;      ///< of the files opened last for inputs, by their names
    std::shared_ptr<ipc::StreamRecord const> stream_in_;
    ipc::StreamSink* stream_out_ = nullptr;
    std::vector<std::unique_ptr<StageContext>> contexts_; ///< of openers
    /// Where streams that arrive and leave may have their voxels; null: not on a GPU.
    std::shared_ptr<ipc::GpuMemory> gpu_in_, gpu_out_;
    TimeMeter meter_;
};

/// Passes an error on to whoever reads our output. An empty stage means that the message names its origin already.
void tell(Sink& sink, std::string const& stage, std::string const& message);

} // namespace vkt::shell
