// Pipelines in memory: parsed like those of vkt pipe, attached to a volume, and asked for their error bounds.
// SPDX-License-Identifier: MIT
#include "shell/chart/chain.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::shell {
namespace {

/// Geometric operations with knobs interpolate: they may be exact, but for one rounding.
bool moves_only(Invocation const& stage, Plan const& plan) {
    if (!plan.error.exact() || plan.scans) return false;
    // The mean of the two middle ones of an even number of voxels is none of them.
    if (plan.passing.known && plan.passing.storing == ErrorPassing::Storing::computes && !plan.shift) return false;
    return plan.shift || (stage.operation()->shape() == Shape::geometric &&
                          dynamic_cast<Tunable const*>(stage.operation()) == nullptr);
}

/// A region in voxels, not in shares of what there is.
bool names_voxels(Parameter const& roi) {
    std::string const words = join(roi.get(), ",");
    for (std::size_t at = words.find_first_of("0123456789"); at != std::string::npos;
         at = words.find_first_of("0123456789", at)) {
        at = std::min(words.find_first_not_of("0123456789.", at), words.size());
        if (at == words.size() || words[at] != '%') return true;
    }
    return false;
}

/// The extent of the output is in proportion to that of the input, but for rounding.
bool same_share(Index3 whole, Index3 of_whole, Index3 part, Index3 of_part) {
    for (int axis = 0; axis < 3; ++axis) {
        double const share = static_cast<double>(of_whole[axis]) / static_cast<double>(whole[axis]);
        double const wanted = share * static_cast<double>(part[axis]);
        if (std::abs(wanted - static_cast<double>(of_part[axis])) > 1) return false;
    }
    return true;
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
        if (picturing() != nullptr)
            throw Error(ErrorKind::usage,
                        text("nothing comes after '", stages_.back().verb().name, "', which makes a picture"));
        Verb verb = find_verb(words);
        auto const misfit = [name = verb.name] {
            return Error(ErrorKind::usage, text("'", name, "' is no operation on voxels, and makes no picture"),
                         "the pipeline names what is done to the volume, which is given beside it");
        };
        if (!verb.command->operation && !verb.command->consumer) throw misfit();
        Invocation& stage = stages_.emplace_back(std::move(verb));
        if (stage.operation() == nullptr && picturing() == nullptr) throw misfit();
        stage.parse();
        if (stage.common().help || stage.common().examples)
            throw Error(ErrorKind::usage, "--help has no meaning within a pipeline");
        for (auto const& p : stage.common_parameters().all())
            if (p.given)
                throw Error(ErrorKind::usage, text("--", p.name, " of '", stage.verb().name, "' decides no voxel"),
                            "say beside the pipeline how it runs");
        if (stage.inputs() != std::vector<std::string>{"-"} || !(stage.yields_volumes() || picturing() != nullptr))
            throw Error(ErrorKind::usage, text("'", stage.verb().name, "' does not make one volume of one"),
                        "only pipelines from one volume to another can be charted");
    }
}

void Chain::set(std::size_t stage, std::string const& option, std::string const& value) {
    Parameters& parameters = stages_[stage].own_parameters();
    Parameter const* const parameter = parameters.find(option);
    bool const flag = parameter != nullptr && parameter->flag;
    parameters.set(option, flag ? std::vector<std::string>{} : std::vector{value});
    if (stages_[stage].operation() != nullptr)
        stages_[stage].operation()->check();
    else
        stages_[stage].consumer()->check();
}

Tunable const* Chain::tunable(std::size_t stage) const {
    Operation const* const operation = stages_[stage].operation();
    return operation != nullptr ? dynamic_cast<Tunable const*>(operation)
                                : dynamic_cast<Tunable const*>(stages_[stage].consumer());
}

Picturing const* Chain::picturing() const {
    return stages_.empty() ? nullptr : dynamic_cast<Picturing const*>(stages_.back().consumer());
}

void Chain::set_exact() {
    for (std::size_t i = 0; i < stages_.size(); ++i)
        if (auto const* const tunable = this->tunable(i))
            for (auto const& knob : tunable->knobs())
                if (knob.bounded && !knob.best.empty()) set(i, knob.option, knob.best);
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

bool Chain::fits_part(Header const& whole, Header const& part) {
    if (whole.dims == part.dims) return true;
    Header of_whole = whole, of_part = part;
    for (std::size_t i = 0; i < operations(); ++i) {
        Parameter const* const roi = stages_[i].own_parameters().find("roi");
        if (roi != nullptr && roi->given && names_voxels(*roi)) return false;
        Operation const& operation = *stages_[i].operation();
        try {
            Plan const a = operation.plan({&of_whole, 1}), b = operation.plan({&of_part, 1});
            if (a.scans || a.whole || b.scans || b.whole || a.output.kind != Kind::structured) return false;
            if (!same_share(of_whole.dims, a.output.dims, of_part.dims, b.output.dims)) return false;
            of_whole = a.output;
            of_part = b.output;
        } catch (Error const& e) {
            if (e.kind() != ErrorKind::usage) throw;
            return false; // the part has not what the stage asks for, or the whole has not and running it says so
        }
    }
    return true;
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
    if (source->header().kind != Kind::structured && picturing() == nullptr)
        throw Error(ErrorKind::usage, "the pipeline makes a hierarchical volume", "end it with vkt resample");
    return source;
}

Volume Chain::run_first(Volume const& input, Execution const& execution, std::size_t count) {
    return load(*attached(input, execution, count), execution);
}

Volume Chain::run(Volume const& input, Execution const& execution, PictureRequest const& request) {
    if (picturing() == nullptr) return run_first(input, execution, stages_.size());
    Volume const volume = operations() == 0 ? input : run_first(input, execution, operations());
    drawn_ = volume.header();
    DrawnPictures drawn = picturing()->pictures(volume, request, execution);
    drawing_ = drawn.seconds;
    drawn_on_gpu_ = drawn.on_gpu;
    return std::move(drawn.levels);
}

std::string Chain::plan(Volume const& input, Execution const& execution) {
    Header const last = attached(input, execution, operations())->header();
    std::string all = picturing() != nullptr ? join(stages_.back().consumer()->explain(last, ""), ", ") : "";
    for (auto const& plan : plans_)
        all += text(plan.method.substr(0, plan.method.find(';')), " ", plan.output.dtype, " ", plan.cost, " ",
                    plan.error.range, " ", plan.error.magnitude, " ", plan.error.absolute, "\n");
    return all;
}

Header Chain::output(Volume const& input, Execution const& execution) {
    return attached(input, execution, operations())->header();
}

Box Chain::part_read(Volume const& input, Execution const& execution) {
    Box part = box_of(output(input, execution).dims);
    for (std::size_t i = plans_.size(); i-- > 0;) {
        Box const whole = box_of(headers_[i].dims);
        Plan const& plan = plans_[i];
        // What is kept from one region to the next, or looked at before, is of the whole.
        bool const all = plan.whole || plan.carries || plan.scans;
        Box const wanted = all ? whole : stages_[i].operation()->footprint(part, 0);
        part = intersect(wanted, whole);
        for (int axis = 0; axis < 3; ++axis)
            if (plan.boundary == Boundary::wrap &&
                (wanted.lower[axis] < whole.lower[axis] || wanted.upper[axis] > whole.upper[axis])) {
                part.lower[axis] = whole.lower[axis];
                part.upper[axis] = whole.upper[axis];
            }
        if (part.empty()) part = whole;
    }
    return part;
}

double Chain::cost() const {
    double sum = picturing() != nullptr ? picturing()->picture_cost(drawn_) : 0;
    for (auto const& plan : plans_) sum += plan.cost * static_cast<double>(plan.output.voxels());
    return sum;
}

std::optional<double> Chain::seconds(Calibration const& calibration, int threads) const {
    if (picturing() != nullptr) return std::nullopt;
    double sum = 0;
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        Plan const& plan = plans_[i];
        if (headers_[i].kind != Kind::structured || plan.output.kind != Kind::structured) return std::nullopt;
        auto const seconds = calibration.seconds(stages_[i].verb().name, plan, {headers_[i]}, false, threads);
        if (!seconds) return std::nullopt;
        sum += *seconds;
    }
    return sum;
}

bool Chain::uses_gpu() const {
    return drawn_on_gpu_ || std::any_of(stages_.begin(), stages_.end(), [](Invocation const& stage) {
               return stage.operation() != nullptr && stage.operation()->runs_on_gpu();
           });
}

std::optional<double> Chain::bound(Volume const& input, Volume const& output, Execution const& execution) {
    if (picturing() != nullptr) return std::nullopt;
    std::optional<std::size_t> computes;
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        if (moves_only(stages_[i], plans_[i])) continue;
        if (computes) return std::nullopt;
        computes = i;
    }
    if (!computes) return 0x1p-52 * std::abs(plans_.back().output.values.slope) * extremes_of(output).magnitude;
    Plan const plan = plans_[*computes];
    if (plan.error.quantity != std::string_view(ErrorBound{}.quantity)) return std::nullopt; // not about values
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
        values = extremes_of(run_first(input, execution, *computes));
        plans_ = plans;
        headers_ = headers;
        lossy_ = lossy;
    }
    if (plan.boundary == Boundary::border) {
        values.low = std::min(values.low, plan.border_value);
        values.high = std::max(values.high, plan.border_value);
        values.magnitude = std::max(values.magnitude, std::abs(plan.border_value));
    }
    // Sums and differences of what is nearly the largest of a type need not be numbers in it.
    if (!is_integer(in.dtype) && in.dtype != DataType::float16 && values.magnitude > highest_of(in.dtype) * 0x1p-20)
        return std::nullopt;
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
