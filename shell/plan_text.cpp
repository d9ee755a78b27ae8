// Plans as text.
// SPDX-License-Identifier: MIT
#include "shell/plan_text.h"

#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"

#include <algorithm>
#include <array>
#include <cstdio>

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

bool is_tree(Header const& h) { return h.kind == Kind::hierarchical; }

constexpr double ring = 3; ///< slabs in flight at an input or an output

double in_flight(Header const& h, Execution const& execution) {
    return ring * static_cast<double>(h.bytes()) * static_cast<double>(slab_height(h, 0, execution)) /
           static_cast<double>(h.dims.z);
}

/// Trees are held whole; of grids slabs in flight at input and output, the window of a halo, a spooled volume, and
/// state: what a stage holds at most.
double peak_bytes(Operation const* operation, Plan const& plan, std::vector<Header> const& inputs,
                  Execution const& execution, bool reduction) {
    auto bytes = static_cast<double>(plan.state_bytes);
    std::int64_t height = 0;
    if (!reduction && is_tree(plan.output)) {
        bytes += static_cast<double>(plan.output.bytes());
    } else if (!reduction) {
        height = slab_height(plan.output, plan.slab_hint, execution);
        bytes += ring * static_cast<double>(plan.output.bytes()) * static_cast<double>(height) /
                 static_cast<double>(plan.output.dims.z);
    }
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        Header const& in = inputs[i];
        if (is_tree(in)) {
            bytes += static_cast<double>(in.bytes());
            continue;
        }
        if (is_tree(plan.output)) continue; // the plan's own state says it
        bytes += in_flight(in, execution);
        if (!reduction && !plan.shift) {
            Box const slab{{0, 0, 0}, {plan.output.dims.x, plan.output.dims.y, height}};
            bytes += static_cast<double>(operation->footprint(slab, static_cast<int>(i)).voxels()) *
                     static_cast<double>(size_of(in.dtype));
        }
        bool const whole = plan.scans || plan.access == Access::random;
        if (whole) bytes += std::min(static_cast<double>(in.bytes()), static_cast<double>(execution.memory));
    }
    return bytes;
}

} // namespace

std::string plan_text(std::string const& stage, Operation const* operation, Plan const& plan,
                      std::vector<Header> const& inputs, Execution const& execution, bool reduction) {
    std::string line = stage + ": ";
    if (!inputs.empty()) line += shape_text(inputs.front());
    if (!reduction)
        line += text(inputs.empty() ? "" : " -> ", shape_text(plan.output),
                     plan.output.bytes() == 0 ? "" : ", " + bytes_text(static_cast<double>(plan.output.bytes())));
    if (operation != nullptr || reduction)
        line += text(", peak memory about ", bytes_text(peak_bytes(operation, plan, inputs, execution, reduction)));
    bool const spools = plan.access == Access::random || (plan.scans && !reduction);
    bool const whole = is_tree(plan.output) || std::any_of(inputs.begin(), inputs.end(), is_tree);
    line += whole    ? ", holds the whole volume"
            : spools ? ", needs the whole input (re-reads a file, spools a pipe)"
                     : ", streaming";
    line += "\n";
    if (!plan.method.empty()) line += text(stage, ":   method ", printable(plan.method), "\n");
    std::string const error =
        plan.exact ? "exact"
                   : text(plan.error_is_estimate ? "error about " : "error at most ", scientific(plan.error_bound),
                          plan.error_is_physical ? "" : " of the value range");
    line += text(stage, ":   ", error, ", ", scientific(plan.cost), " multiply-adds a voxel\n");
    return line;
}

std::string opener_plan_text(std::string const& stage, Header const& output, Execution const& execution) {
    auto const bytes = static_cast<double>(output.bytes());
    return text(stage, ": -> ", shape_text(output), ", ", bytes_text(bytes), ", peak memory about ",
                bytes_text(is_tree(output) ? bytes : in_flight(output, execution)), ", streaming\n");
}

std::string consumer_plan_text(std::string const& stage, Header const& input, std::string const& output, bool whole,
                               Execution const& execution) {
    auto const bytes = static_cast<double>(input.bytes());
    bool const holds = whole || is_tree(input);
    return text(stage, ": ", shape_text(input), ", ", bytes_text(bytes), output.empty() ? "" : " -> ",
                output == "-" ? "standard output" : printable(output), ", peak memory about ",
                bytes_text(holds ? bytes : in_flight(input, execution)),
                holds ? ", holds the whole volume\n" : ", streaming\n");
}

} // namespace vkt::shell
