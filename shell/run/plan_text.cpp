// Plans as text.
// SPDX-License-Identifier: MIT
#include "shell/run/plan_text.h"

#include "libvkt/core/device.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/tree_run.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

namespace vkt::shell {
namespace {

std::string shape_text(Header const& h) {
    std::string result = text(h.dims.x, "x", h.dims.y, "x", h.dims.z, " ", h.dtype);
    if (h.kind == Kind::hierarchical)
        result += h.brick_count == 0 ? ", hierarchical"
                                     : text(" in ", h.brick_count, " bricks on ", h.level_count, " levels");
    return result;
}

std::string scientific(double value) {
    std::array<char, 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%.2g", value);
    return buffer.data();
}

/// Two digits that are not below the value.
std::string at_least(double value) {
    for (double v = value;; v *= 1.01) {
        std::string digits = scientific(v);
        if (!(std::strtod(digits.c_str(), nullptr) < value)) return digits;
    }
}

/// "exact" or the terms of a bound. Of absolute ones only those that can matter beside others: not what becomes of
/// numbers too small to be normal.
std::string error_text(ErrorBound const& error) {
    if (error.exact()) return "exact";
    if (error.kind == ErrorBound::Kind::unknown) return "no bound of the error";
    std::string terms;
    auto const add = [&](double value, char const* of) {
        if (value > 0) terms += text(terms.empty() ? "" : " + ", at_least(value), of);
    };
    add(error.range, " of the value range");
    add(error.magnitude, " of the largest magnitude");
    if (terms.empty() || error.absolute > 1e-30) add(error.absolute, text(" in ", error.quantity).c_str());
    return text(error.kind == ErrorBound::Kind::estimate ? "error about " : "error at most ",
                terms.empty() ? "0" : terms.c_str(),
                error.in_values ? text(" (", at_least(*error.in_values), " in values)") : std::string());
}

bool is_tree(Header const& h) { return h.kind == Kind::hierarchical; }

constexpr double ring = 3; ///< pieces in flight at an input or an output

double in_flight(Header const& h, Execution const& execution, std::int64_t hint = 0) {
    if (is_tree(h)) return static_cast<double>(bricks_in_flight(h, execution));
    Cut const cut = cut_of(h, hint, execution);
    return ring * static_cast<double>(h.dims.x * cut.rows * cut.slices) * static_cast<double>(size_of(h.dtype));
}

/// Of an operation's result, which comes in slabs as high as suit the operation, or as the input's, if it computes them
/// voxel by voxel.
double result_in_flight(Operation const* operation, Plan const& plan, std::vector<Header> const& inputs,
                        Execution const& execution) {
    double const bytes = in_flight(plan.output, execution, plan.slab_hint);
    bool const in_step = operation != nullptr && operation->shape() == Shape::pointwise && plan.slab_hint == 0;
    if (!in_step || inputs.empty() || is_tree(inputs.front()) || is_tree(plan.output)) return bytes;
    return std::max(bytes, in_flight(plan.output, execution, cut_of(inputs.front(), 0, execution).slices));
}

/// How an operation on trees works.
std::optional<TreeWork> tree_work_of(Operation const* operation, Plan const& plan, std::vector<Header> const& inputs,
                                     Execution const& execution, bool reduction) {
    if (inputs.empty() || !std::all_of(inputs.begin(), inputs.end(), is_tree)) return {};
    if (!reduction && operation == nullptr) return {};
    return tree_work(reduction ? Shape::reduction : operation->shape(), plan, inputs, {}, execution);
}

char const* text_of(TreeAccess access) {
    switch (access) {
    case TreeAccess::streaming:
        return ", streaming";
    case TreeAccess::again:
        return ", needs the whole input (re-reads a file, spools a pipe)";
    case TreeAccess::window:
        return ", holds a window of bricks (re-reads a file, spools a pipe) and spools its result";
    case TreeAccess::whole:
        break;
    }
    return ", holds the whole volume";
}

/// What an operation looks at instead of its first input, and what computing that takes besides.
struct Preparation {
    Header made;
    double bytes = 0;
};
std::optional<Preparation> preparation_of(Operation* operation, Plan const& plan, std::vector<Header> const& inputs,
                                          Execution const& execution) {
    auto* const prepared = dynamic_cast<Prepared*>(operation);
    if (prepared == nullptr || is_tree(plan.output) || std::any_of(inputs.begin(), inputs.end(), is_tree)) return {};
    Operation* const first = prepared->preparation();
    if (first == nullptr) return {};
    std::span<Header const> const read{inputs.data(), 1};
    Plan const made = begun(*first, read);
    WorkPlan const work = work_plan(*first, made, read, {}, 0, execution);
    return Preparation{made.output, static_cast<double>(work.bytes)};
}

/// How an operation on grids works, as if nothing lay in memory already but what was prepared for it; nothing of trees
/// and reductions.
std::optional<WorkPlan> work_of(Operation* operation, Plan const& plan, std::vector<Header> const& looked_at,
                                bool prepared, Execution const& execution) {
    if (operation == nullptr || is_tree(plan.output) || std::any_of(looked_at.begin(), looked_at.end(), is_tree))
        return {};
    std::vector<bool> lent;
    if (prepared) lent.push_back(looked_at.front().bytes() <= spool_limit(looked_at.size(), execution));
    return work_plan(*operation, plan, looked_at, lent, 0, execution);
}

/// True if input i is scanned and then read once more; what is needed for the scan alone is not kept.
bool scans_before(Plan const& plan, std::optional<WorkPlan> const& work, std::size_t i) {
    return plan.scans && !(work && i < work->window.size() && work->window[i] == 0);
}

/// Of trees what is said of them; of grids pieces in flight at input and output, windows, what the operation keeps, and
/// a spooled volume: what a stage holds at most.
double peak_bytes(Operation const* operation, std::optional<TreeWork> const& tree, std::optional<WorkPlan> const& work,
                  Plan const& plan, std::vector<Header> const& inputs, Execution const& execution, bool reduction) {
    double const result = reduction ? 0 : result_in_flight(operation, plan, inputs, execution);
    auto bytes = static_cast<double>(tree ? tree->bytes : work ? work->bytes : plan.state_bytes);
    if (work && plan.whole && !work->lines) // its inputs are in it
        return bytes + static_cast<double>(plan.output.bytes()) + result;
    if (tree) return bytes + (is_tree(plan.output) ? 0 : result);
    if (!reduction) bytes += is_tree(plan.output) ? static_cast<double>(plan.output.bytes()) : result;
    if (is_tree(plan.output)) return bytes; // the plan's own state says what it holds of its input
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        Header const& in = inputs[i];
        bytes += in_flight(in, execution);
        bool const again = scans_before(plan, work, i) || plan.access == Access::random;
        if (again && in.bytes() <= spool_limit(inputs.size(), execution)) bytes += static_cast<double>(in.bytes());
    }
    return bytes;
}

} // namespace

std::string plan_text(std::string const& stage, Operation* operation, Plan const& plan,
                      std::vector<Header> const& inputs, Execution const& execution, bool reduction) {
    std::string line = stage + ": ";
    if (!inputs.empty()) line += shape_text(inputs.front());
    if (!reduction)
        line += text(inputs.empty() ? "" : " -> ", shape_text(plan.output),
                     plan.output.bytes() == 0 ? "" : ", " + bytes_text(static_cast<double>(plan.output.bytes())));
    std::optional<TreeWork> const tree = tree_work_of(operation, plan, inputs, execution, reduction);
    auto const preparation = reduction ? std::nullopt : preparation_of(operation, plan, inputs, execution);
    std::vector<Header> looked_at = inputs;
    if (preparation) looked_at.front() = preparation->made;
    std::optional<WorkPlan> const work =
        reduction ? std::nullopt : work_of(operation, plan, looked_at, preparation.has_value(), execution);
    if (is_tree(plan.output) && (inputs.empty() || !is_tree(inputs.front())))
        check_budget(std::max(plan.state_bytes, plan.output.bytes()), execution);
    if (operation != nullptr || reduction)
        line += text(", peak memory about ",
                     bytes_text((preparation ? preparation->bytes : 0) +
                                peak_bytes(operation, tree, work, plan, looked_at, execution, reduction)),
                     plan.grows_by.empty() ? "" : " and ", plan.grows_by);
    bool const jumps = work && work->jumps;
    bool const again = reduction ? plan.scans : scans_before(plan, work, 0);
    bool const spools = jumps || plan.access == Access::random || again;
    bool const lines = work && work->lines;
    bool const whole = plan.whole || is_tree(plan.output) || std::any_of(inputs.begin(), inputs.end(), is_tree);
    line += tree     ? text_of(tree->access)
            : lines  ? text(", works on lines along x, y and z of a spool of ",
                            bytes_text(static_cast<double>(plan.output.bytes())))
            : whole  ? ", holds the whole volume"
            : spools ? text(", needs the whole input (re-reads a file, spools a pipe)",
                            work && work->bands ? " and spools its result" : "")
                     : std::string(", streaming");
    line += "\n";
    if (!plan.method.empty()) line += text(stage, ":   method ", printable(plan.method), "\n");
    if (operation != nullptr && !is_tree(plan.output) && std::none_of(inputs.begin(), inputs.end(), is_tree) &&
        gpu_count() > 0)
        line += text(stage, ":   on the ", on_device(execution, *operation, plan).device == Device::gpu ? "GPU" : "CPU",
                     "\n");
    if (work && work->threads < execution.threads)
        line += text(stage, ":   ", work->threads, " of ", execution.threads,
                     " threads: the memory has no room for what more would hold\n");
    line += text(stage, ":   ", error_text(plan.error), ", ", scientific(plan.cost), " multiply-adds a voxel\n");
    if (!reduction && !plan.output.error.silent())
        line += text(stage, ":   result ", to_sentence(plan.output.error, printable(plan.output.units)), "\n");
    return line;
}

std::string opener_plan_text(std::string const& stage, Header const& output, std::int64_t parts,
                             Execution const& execution) {
    auto const bytes = static_cast<double>(output.bytes());
    return text(stage, ": -> ", parts > 1 ? text(parts, " parts, the first ") : "", shape_text(output), ", ",
                bytes_text(bytes), ", peak memory about ", bytes_text(in_flight(output, execution)), ", streaming\n");
}

std::string consumer_plan_text(std::string const& stage, Header const& input, std::string const& output,
                               std::optional<std::size_t> held, Execution const& execution) {
    auto const bytes = static_cast<double>(input.bytes());
    if (held) check_budget(*held, execution);
    return text(stage, ": ", shape_text(input), ", ", bytes_text(bytes), output.empty() ? "" : " -> ",
                output == "-" ? "standard output" : printable(output), ", peak memory about ",
                bytes_text(held ? static_cast<double>(*held) : in_flight(input, execution)),
                held ? ", holds the whole volume\n" : ", streaming\n");
}

} // namespace vkt::shell
