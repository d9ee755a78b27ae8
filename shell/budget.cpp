// Budgets of pipelines: stages are planned again and again, and nothing is read but the first header.
// SPDX-License-Identifier: MIT
#include "shell/budget.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/budget.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/stack.h"
#include "shell/command.h"

#include <cmath>

namespace vkt::shell {
namespace {

/// Lets what begins a pipeline open its files, to look at the first header.
class FirstLook : public Context {
public:
    explicit FirstLook(Invocation const& stage) : common_(stage.common()) {}
    Execution const& execution() const override { return execution_; }
    StageInfo stage_info() const override { return {}; }
    bool json() const override { return false; }
    bool quiet() const override { return true; }
    bool verbose() const override { return false; }
    std::string const& output() const override { return common_.output; }
    bool force() const override { return false; }
    bool dry_run() const override { return true; }
    bool trust_paths() const override { return common_.trust_paths; }
    bool window() const override { return false; }
    void print(std::string const&) override {}
    void note(std::string const&) override {}
    void plan(Header const&, std::string const&) override {}
    void lossy(std::string const&) override {}
    void refuse_lossy() override {}
    std::function<void(std::string const&)> detail() override {
        return [](std::string const&) {};
    }
    std::string format(std::string const&) const override { return {}; }
    std::unique_ptr<Source> open(std::string const& path, ReadOptions const& stated) override {
        if (path == "-")
            throw Error(ErrorKind::usage,
                        "--tolerance: the pipeline begins with no file, so that nobody knows its type",
                        "write what comes in to a file first, or begin with vkt read FILE");
        ReadOptions options = stated;
        options.trust_paths = options.trust_paths || trust_paths();
        return open_path(path, [options](std::string const& one) { return open_volume(open_bytes(one), options); });
    }

private:
    Common const& common_;
    Execution execution_ = default_execution();
};

struct SetKnob {
    Invocation* stage;
    Knob knob;
};

/// The pipeline's operations, and what the first of them reads.
class Planner {
public:
    explicit Planner(std::deque<Invocation>& stages) {
        for (auto& stage : stages) {
            bool const first = &stage == &stages.front();
            if (stage.operation() == nullptr) { // read and write, or what reports
                if (first) input_ = read(stage);
                if (first || &stage == &stages.back()) continue;
                refuse(stage);
            }
            std::size_t const inputs = stage.inputs().size();
            if (stage.operation()->inputs() > 1 || inputs > 1) refuse(stage);
            if (first && stage.operation()->inputs() == 1) input_ = read(stage);
            operations_.push_back(&stage);
        }
    }

    /// The error of the result, and the multiply-adds of all stages.
    Outcome outcome() {
        double cost = 0;
        Header header = input_;
        for (Invocation* const stage : operations_) {
            Operation& operation = *stage->operation();
            std::vector<Header> inputs;
            if (operation.inputs() == 1) inputs.push_back(header);
            Plan plan = operation.plan(inputs);
            plan.output.error = travelled(inputs, plan, operation.name());
            cost += plan.cost * static_cast<double>(plan.output.voxels());
            header = plan.output;
        }
        last_ = header.error;
        return {last_.known() ? last_.at_most : HUGE_VAL, cost};
    }
    VolumeError const& last() const { return last_; }
    std::vector<Invocation*> const& operations() const { return operations_; }

private:
    static Header read(Invocation const& stage) {
        FirstLook look(stage);
        auto const source = stage.opener() != nullptr
                                ? stage.opener()->open(look)
                                : look.open(stage.inputs().empty() ? "-" : stage.inputs().front(), {});
        if (!source->next_volume()) throw Error(ErrorKind::data, "--tolerance: the pipeline begins with no volume");
        Header header = source->header();
        mark_as_given(header);
        return header;
    }
    [[noreturn]] static void refuse(Invocation const& stage) {
        throw Error(ErrorKind::usage, text("--tolerance: '", stage.verb().name, "' takes more than what comes to it"),
                    "budgets are for stages of one input");
    }

    Header input_;
    std::vector<Invocation*> operations_;
    VolumeError last_;
};

/// Knobs that trade a bound for cost, and leave the types as they are.
std::vector<SetKnob> knobs_of(Planner& planner) {
    std::vector<SetKnob> result;
    planner.outcome(); // knobs are those of the volume last planned
    for (Invocation* const stage : planner.operations())
        if (auto const* const tunable = dynamic_cast<Tunable const*>(stage->operation()))
            for (Knob knob : tunable->knobs()) {
                if (!knob.bounded || knob.option == "dtype" || stage->own_parameters().given(knob.option)) continue;
                if (knob.option == "method") continue; // what is cheapest for a tolerance is chosen by the operation
                knob.values.push_back(knob.best);
                result.push_back({stage, std::move(knob)});
            }
    return result;
}

void set(SetKnob const& knob, std::size_t setting) {
    knob.stage->own_parameters().set(knob.knob.option, {knob.knob.values[setting]});
    knob.stage->operation()->check();
}

} // namespace

std::vector<std::string> divide_budget(std::deque<Invocation>& stages, double tolerance) {
    if (!(tolerance >= 0) || !std::isfinite(tolerance))
        throw Error(ErrorKind::usage, text("--tolerance ", tolerance, " is not a finite number >= 0"));
    Planner planner(stages);
    std::vector<SetKnob> const knobs = knobs_of(planner);
    std::vector<std::size_t> const counts = collect(knobs, [](SetKnob const& set) { return set.knob.values.size(); });
    VolumeError least = VolumeError::lost("");
    auto const evaluate = [&](Settings const& settings) {
        for (std::size_t k = 0; k < knobs.size(); ++k) set(knobs[k], settings[k]);
        Outcome const outcome = planner.outcome();
        if (!least.known() || (planner.last().known() && planner.last().at_most < least.at_most))
            least = planner.last();
        return outcome;
    };
    auto const chosen = cheapest_within(tolerance, counts, evaluate);
    if (!chosen) {
        if (!least.known())
            throw Error(ErrorKind::usage, text("--tolerance: the error of the result is ", to_sentence(least, "")));
        throw Error(ErrorKind::usage,
                    text("--tolerance ", tolerance, ": the result can be had ", to_sentence(least, ""), " at best"),
                    "integers between stages cost half a step each: begin with vkt convert --dtype float32");
    }
    evaluate(*chosen);
    std::vector<std::string> lines;
    for (std::size_t k = 0; k < knobs.size(); ++k)
        lines.push_back(
            text(knobs[k].stage->verb().name, " --", knobs[k].knob.option, " ", knobs[k].knob.values[(*chosen)[k]]));
    lines.push_back(text("the result is ", to_sentence(planner.last(), "")));
    return lines;
}

} // namespace vkt::shell
