// Pipelines in memory: parsed like those of vkt pipe, attached to a volume, and asked for their error bounds.
// SPDX-License-Identifier: MIT
#include "shell/chain.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/engine/tunable.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::shell {
namespace {

/// Geometric operations with knobs interpolate: they may be exact, but for one rounding.
bool moves_only(Invocation const& stage, Plan const& plan) {
    if (!plan.error.exact() || plan.scans) return false;
    return plan.shift || (stage.operation()->shape() == Shape::geometric &&
                          dynamic_cast<Tunable const*>(stage.operation()) == nullptr);
}

} // namespace

Volume in_float64(Volume const& volume) { return vkt::apply({"convert", "--dtype", "float64"}, {volume}); }

Extremes extremes_of(Volume const& volume) {
    Volume const wide = in_float64(volume);
    auto const* const values = reinterpret_cast<double const*>(wide.view().data);
    Extremes found{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), 0};
    for (std::int64_t i = 0; i < wide.header().voxels(); ++i) {
        double const v = values[i];
        if (!std::isfinite(v)) continue;
        found.low = std::min(found.low, v);
        found.high = std::max(found.high, v);
        found.magnitude = std::max(found.magnitude, std::abs(v));
    }
    return found.low <= found.high ? found : Extremes{};
}

Chain::Chain(std::string const& line) {
    for (auto& words : shell_stages(line)) {
        if (!words.empty() && words.front() == "vkt") words.erase(words.begin());
        if (words.empty()) throw Error(ErrorKind::usage, text("an empty stage in '", line, "'"));
        Verb verb = find_verb(words);
        if (!verb.command->operation)
            throw Error(ErrorKind::usage, text("'", verb.name, "' is no operation on voxels"),
                        "the pipeline names operations only: the volume is given beside it");
        Invocation& stage = stages_.emplace_back(std::move(verb));
        stage.parse();
        if (stage.common().help || stage.common().examples)
            throw Error(ErrorKind::usage, "--help has no meaning within a pipeline");
        for (auto const& p : stage.common_parameters().all())
            if (p.given)
                throw Error(ErrorKind::usage, text("--", p.name, " of '", stage.verb().name, "' decides no voxel"),
                            "say beside the pipeline how it runs");
        if (stage.inputs() != std::vector<std::string>{"-"} || !stage.yields_volumes())
            throw Error(ErrorKind::usage, text("'", stage.verb().name, "' does not make one volume of one"),
                        "only pipelines from one volume to another can be charted");
    }
}

void Chain::set(std::size_t stage, std::string const& option, std::string const& value) {
    stages_[stage].own_parameters().set(option, {value});
    stages_[stage].operation()->check();
}

void Chain::set_exact() {
    for (std::size_t i = 0; i < stages_.size(); ++i)
        if (auto const* const tunable = dynamic_cast<Tunable const*>(stages_[i].operation()))
            for (auto const& knob : tunable->knobs())
                if (knob.bounded) set(i, knob.option, knob.best);
}

std::vector<std::string> Chain::lines() {
    std::vector<std::string> result;
    for (auto& stage : stages_) {
        std::vector<std::string> words{stage.verb().name};
        for (auto const& word : stage.own_parameters().words()) words.push_back(shell_quoted(word));
        result.push_back(join(words, " "));
    }
    return result;
}

std::unique_ptr<Source> Chain::attached(Volume const& input, Execution const& execution, std::size_t count) {
    plans_.assign(count, {});
    headers_.assign(count, {});
    lossy_ = false;
    auto source = volume_source({input});
    for (std::size_t i = 0; i < count; ++i) {
        StageInfo info;
        info.name = stages_[i].verb().name;
        info.listener = [this](std::string const&, std::string const&, bool loses) { lossy_ = lossy_ || loses; };
        info.on_plan = [this, i](Plan const& plan, std::vector<Header> const& inputs) {
            plans_[i] = plan;
            headers_[i] = inputs.front();
        };
        std::vector<std::unique_ptr<Source>> inputs;
        inputs.push_back(std::move(source));
        source = attach(std::move(inputs), *stages_[i].operation(), execution, std::move(info));
    }
    source->next_volume();
    if (source->header().kind != Kind::structured)
        throw Error(ErrorKind::usage, "the pipeline makes a hierarchical volume", "end it with vkt resample");
    return source;
}

Volume Chain::run(Volume const& input, Execution const& execution, std::size_t count) {
    return load(*attached(input, execution, count), execution);
}

std::string Chain::plan(Volume const& input, Execution const& execution) {
    attached(input, execution, stages_.size());
    std::string all;
    for (auto const& plan : plans_)
        all += text(plan.method.substr(0, plan.method.find(';')), " ", plan.output.dtype, " ", plan.cost, " ",
                    plan.error.range, " ", plan.error.magnitude, " ", plan.error.absolute, "\n");
    return all;
}

double Chain::cost() const {
    double sum = 0;
    for (auto const& plan : plans_) sum += plan.cost * static_cast<double>(plan.output.voxels());
    return sum;
}

std::optional<double> Chain::bound(Volume const& input, Volume const& output, Execution const& execution) {
    std::optional<std::size_t> computes;
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        if (moves_only(stages_[i], plans_[i])) continue;
        if (computes) return std::nullopt;
        computes = i;
    }
    if (!computes) return 0x1p-52 * std::abs(plans_.back().output.values.slope) * extremes_of(output).magnitude;
    Plan const plan = plans_[*computes];
    // What a pass before finds out may depend on the type that it looks at: bins, percentiles.
    if (plan.scans || plan.error.kind == ErrorBound::Kind::unknown || plan.error.kind == ErrorBound::Kind::estimate)
        return std::nullopt;
    Header const in = headers_[*computes];
    Extremes values{};
    if (*computes == 0) {
        values = extremes_of(input);
    } else {
        auto const plans = plans_;
        auto const headers = headers_;
        bool const lossy = lossy_;
        values = extremes_of(run(input, execution, *computes));
        plans_ = plans;
        headers_ = headers;
        lossy_ = lossy;
    }
    if (plan.boundary == Boundary::border) {
        values.low = std::min(values.low, plan.border_value);
        values.high = std::max(values.high, plan.border_value);
        values.magnitude = std::max(values.magnitude, std::abs(plan.border_value));
    }
    double const slope = std::abs(in.values.slope), step = std::abs(plan.output.values.slope);
    double bound = plan.error.over(slope * (values.high - values.low), slope * values.magnitude);
    if (is_integer(plan.output.dtype)) bound += 0.5 * step;
    double const largest = step * extremes_of(output).magnitude;
    // What is exact is still stored in a type of floats; a bound of what is not holds that already.
    if (plan.error.exact() && !plan.shift)
        bound += storing_error(plan.output.dtype) * largest + storing_floor(plan.output.dtype) * step;
    // What it is compared with went through float64, once as it came and once as it went.
    bound += 0x1p-52 * (slope * values.magnitude + largest);
    return bound;
}

} // namespace vkt::shell
