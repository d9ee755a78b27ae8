// Budgets of pipelines: stages are planned again and again, and nothing is read but the first header.
// SPDX-License-Identifier: MIT
#include "shell/run/budget.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/budget.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/stack.h"
#include "shell/command.h"
#include "shell/run/stage_error.h"

#include <cmath>

namespace vkt::shell {
namespace {

/// Lets what begins a pipeline open its files, to look at the first header.
class FirstLook : public Context {
public:
    FirstLook(Invocation const& stage, std::string option) : common_(stage.common()), option_(std::move(option)) {}
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
                        text(option_, ": the pipeline begins with no file, so that nobody knows its type"),
                        "write what comes in to a file first, or begin with vkt read FILE");
        ReadOptions options = stated;
        options.trust_paths = options.trust_paths || trust_paths();
        return open_path(path, [options](std::string const& one) { return open_volume(open_bytes(one), options); });
    }

private:
    Common const& common_;
    std::string option_;
    Execution execution_ = default_execution();
};

struct SetKnob {
    std::size_t place; ///< of its stage in the pipeline
    Invocation* stage;
    Knob knob;
};

/// The pipeline's operations, and what the first of them reads.
class Planner {
public:
    struct Stage {
        std::size_t place;
        Invocation* stage;
    };

    Planner(std::deque<Invocation>& stages, std::string option) : option_(std::move(option)) {
        for (std::size_t i = 0; i < stages.size(); ++i) {
            Invocation& stage = stages[i];
            bool const first = i == 0;
            if (stage.operation() == nullptr) { // read and write, or what reports
                if (first) input_ = in_stage(stage.label(), [&] { return read(stage); });
                if (first || &stage == &stages.back()) continue;
                refuse(stage);
            }
            std::size_t const inputs = stage.inputs().size();
            if (stage.operation()->inputs() > 1 || inputs > 1) refuse(stage);
            if (first && stage.operation()->inputs() == 1)
                input_ = in_stage(stage.label(), [&] { return read(stage); });
            operations_.push_back({i, &stage});
        }
    }

    /// The error of the result, and the multiply-adds of all stages.
    Outcome outcome() {
        double cost = 0;
        Header const last = planned([&](Operation const&, std::vector<Header> const&, Plan const& plan) {
            cost += plan.cost * static_cast<double>(plan.output.voxels());
        });
        last_ = last.error;
        return {last_.known() ? last_.at_most : HUGE_VAL, cost};
    }
    /// All stages begin the volumes that would come to them: they then tell of their knobs.
    void begin() const {
        planned([](Operation& operation, std::vector<Header> const& inputs, Plan const& plan) {
            operation.begin(inputs, plan);
        });
    }
    VolumeError const& last() const { return last_; }
    /// True if nobody knows between which values the volume of floats that it begins with lies.
    bool reads_unlimited() const { return !operations_.empty() && !values_of(input_); }
    std::vector<Stage> const& operations() const { return operations_; }

private:
    /// Plans one stage after the other and calls visit(operation, inputs, plan). Returns what comes out of the last.
    template <class Visit> Header planned(Visit const& visit) const {
        Header header = input_;
        for (auto const& [place, stage] : operations_) {
            Operation& operation = *stage->operation();
            std::vector<Header> inputs;
            if (operation.inputs() == 1) inputs.push_back(header);
            Plan plan = in_stage(stage->label(), [&] { return operation.plan(inputs); });
            plan.output.error = travelled(inputs, plan, operation.name());
            visit(operation, inputs, plan);
            header = plan.output;
        }
        return header;
    }

    Header read(Invocation const& stage) const {
        FirstLook look(stage, option_);
        auto const source = stage.opener() != nullptr
                                ? stage.opener()->open(look)
                                : look.open(stage.inputs().empty() ? "-" : stage.inputs().front(), {});
        if (!source->next_volume()) throw Error(ErrorKind::data, text(option_, ": the pipeline begins with no volume"));
        Header header = source->header();
        mark_as_given(header);
        return header;
    }
    [[noreturn]] void refuse(Invocation const& stage) const {
        throw Error(ErrorKind::usage, text(option_, ": '", stage.verb().name, "' takes more than what comes to it"),
                    "budgets are for stages of one input");
    }

    std::string option_; ///< that asked for it
    Header input_;
    std::vector<Stage> operations_;
    VolumeError last_;
};

/// Knobs that trade a bound for cost, and leave the types as they are.
std::vector<SetKnob> knobs_of(Planner& planner) {
    std::vector<SetKnob> result;
    planner.begin();
    for (auto const& [place, stage] : planner.operations())
        if (auto const* const tunable = dynamic_cast<Tunable const*>(stage->operation()))
            for (Knob knob : tunable->knobs()) {
                if (!knob.bounded || knob.option == "dtype" || stage->own_parameters().given(knob.option)) continue;
                if (knob.option == "method") continue; // what is cheapest for a tolerance is chosen by the operation
                knob.values.push_back(knob.best);
                result.push_back({place, stage, std::move(knob)});
            }
    return result;
}

void set(SetKnob const& knob, std::size_t setting) {
    knob.stage->own_parameters().set(knob.knob.option, {knob.knob.values[setting]});
    knob.stage->operation()->check();
}

} // namespace

DividedBudget divide_budget(std::deque<Invocation>& stages, double tolerance, std::string const& option) {
    if (!(tolerance >= 0) || !std::isfinite(tolerance))
        throw Error(ErrorKind::usage, text(option, " ", tolerance, " is not a finite number >= 0"));
    Planner planner(stages, option);
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
            throw Error(ErrorKind::usage, text(option, ": the error of the result is ", to_sentence(least, "")),
                        planner.reads_unlimited()
                            ? "vkt stats tells between which values the volume lies: 'arith clamp - LOW HIGH' before "
                              "the filters makes them known"
                            : "");
        throw Error(ErrorKind::usage,
                    text(option, " ", tolerance, ": the result can be had ", to_sentence(least, ""), " at best"),
                    "integers between stages cost half a step each: begin with vkt convert --dtype float32");
    }
    evaluate(*chosen);
    DividedBudget divided;
    for (std::size_t k = 0; k < knobs.size(); ++k)
        divided.choices.push_back({knobs[k].place, knobs[k].knob.option, knobs[k].knob.values[(*chosen)[k]]});
    divided.result = text("the result is ", to_sentence(planner.last(), ""));
    return divided;
}

BudgetedLine line_within(History planned, double tolerance) {
    std::deque<History*> steps;
    for (History* step = &planned; step != nullptr; step = step->inputs.empty() ? nullptr : &step->inputs.front()) {
        if (step->command.empty()) // folded, or of no known command
            throw Error(ErrorKind::usage, "--budget: not all commands of the pipeline are known",
                        text("a dry run tells of ", static_cast<std::int64_t>(most_history_steps), " at most"));
        steps.push_front(step);
    }
    std::deque<Invocation> stages;
    for (History* const step : steps) stages.emplace_back(find_verb(step->command)).parse();
    DividedBudget const divided = divide_budget(stages, tolerance, "--budget");
    for (auto const& choice : divided.choices)
        for (auto const& word : {"--" + choice.option, choice.value}) steps[choice.stage]->command.push_back(word);
    return {history_as_shell(planned), divided.result};
}

} // namespace vkt::shell
