// How operations on hierarchical volumes keep the budget.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_work.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/spool.h"

#include <algorithm>

namespace vkt {

std::size_t group_limit(Execution const& execution) {
    // A GPU has no use for small groups: there is nothing between them and its memory that they would stay in.
    constexpr std::size_t on_gpu = std::size_t{64} << 20;
    return std::min(execution.device == Device::gpu ? on_gpu : brick_group_bytes, piece_limit(execution));
}

TreeWork tree_work(Shape shape, Plan const& plan, std::span<Header const> inputs, std::span<std::size_t const> largest,
                   Execution const& execution) {
    bool const reduces = shape == Shape::reduction;
    double const budget = 16 * static_cast<double>(piece_limit(execution));
    auto const whole_of = [](Header const& h) { return static_cast<double>(h.bytes()); };
    auto const group_of = [&](Header const& h, std::size_t i) {
        std::size_t const most = std::max(group_limit(execution), i < largest.size() ? largest[i] : 0);
        return static_cast<double>(std::min(most, h.bytes()));
    };
    double tables = 0, groups = 0, cells = 0;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        tables += static_cast<double>(inputs[i].brick_count) * BrickTable::most_bytes_per_brick;
        groups += group_of(inputs[i], i);
        cells += whole_of(inputs[i]);
    }
    if (!reduces) {
        double const ratio =
            static_cast<double>(size_of(plan.output.dtype)) / static_cast<double>(size_of(inputs[0].dtype));
        groups += std::max(group_of(plan.output, largest.size()),
                           ratio * (largest.empty() ? 0 : static_cast<double>(largest[0])));
        if (plan.output.kind == Kind::hierarchical) cells += whole_of(plan.output);
    }
    TreeWork work;
    double bytes = static_cast<double>(plan.state_bytes) + tables;
    if (shape == Shape::neighbourhood) {
        constexpr double index = 64, lists = sizeof(std::size_t), workspace = 0x1p20;
        bytes += static_cast<double>(inputs[0].brick_count) * (index + lists) + workspace;
        if (bytes + cells + budget / 16 <= budget) {
            work.access = TreeAccess::whole;
            bytes += cells;
            work.keep = static_cast<std::size_t>(budget - bytes);
        } else {
            work.access = TreeAccess::window;
            bytes += groups;
            double const room = std::max(budget - bytes, 0.0), most = 4 * static_cast<double>(piece_limit(execution));
            work.keep =
                static_cast<std::size_t>(std::min(most, room / 2)); // of neighbours, and of what is made of them
            bytes += 2 * static_cast<double>(work.keep);
        }
    } else if (!reduces && plan.output.kind == Kind::structured) {
        work.access = TreeAccess::whole;
        bytes += cells;
    } else {
        if (shape == Shape::geometric) bytes += tables; // the result has bricks of its own
        bytes += groups;
        if (plan.scans) work.access = TreeAccess::again;
    }
    if (bytes > budget)
        throw Error(
            ErrorKind::resources,
            text(work.access == TreeAccess::whole ? "the volume needs " : "the table of bricks and some of them need ",
                 bytes_text(bytes), " of memory, the budget is ", bytes_text(static_cast<double>(execution.memory))),
            "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
    work.bytes = static_cast<std::size_t>(bytes);
    // Tables that an operation needs have precedence over cells that may as well lie in a file.
    if (work.access == TreeAccess::again && plan.state_bytes <= execution.memory / 8)
        work.keep = std::min(spool_limit(inputs.size(), execution), static_cast<std::size_t>(budget - bytes));
    if (work.access == TreeAccess::again && work.keep >= inputs[0].bytes()) work.bytes += inputs[0].bytes();
    return work;
}

std::size_t bricks_in_flight(Header const& header, Execution const& execution) {
    return static_cast<std::size_t>(header.brick_count) * BrickTable::most_bytes_per_brick +
           std::min(group_limit(execution), header.bytes());
}

} // namespace vkt
