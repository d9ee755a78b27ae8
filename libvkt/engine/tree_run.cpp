// Operations on hierarchical volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_run.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/ghost.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>

namespace vkt {

namespace {

[[noreturn]] void refuse(Operation const& operation, std::string const& why) {
    throw Error(ErrorKind::usage, text(operation.name(), " has no meaning on a hierarchical volume: ", why),
                "make it a grid first: vkt resample --cells 50M");
}

/// Cells are laid out in rows of this length when positions do not matter.
constexpr std::int64_t row_length = 4096;
/// … and handed over in pieces of this many, which stay in cache.
constexpr std::int64_t piece_length = std::int64_t{1} << 20;

/// Threads pay from this many cells on; smaller bricks are run by the calling thread.
constexpr std::int64_t threaded_cells = std::int64_t{1} << 17;

Execution execution_for(Box const& box, Execution const& execution) {
    Execution result = execution;
    if (box.voxels() < threaded_cells) result.threads = 1;
    return result;
}

std::vector<Header> headers_of(std::vector<Volume> const& inputs) {
    return collect(inputs, [](Volume const& volume) { return volume.header(); });
}

/// Neighbouring bricks of one level.
struct LevelRun {
    std::size_t begin, end;
};

std::vector<LevelRun> level_runs(std::vector<Brick> const& bricks) {
    std::vector<LevelRun> runs;
    for (std::size_t b = 0; b < bricks.size(); ++b) {
        if (runs.empty() || bricks[runs.back().begin].level != bricks[b].level) runs.push_back({b, b});
        runs.back().end = b + 1;
    }
    return runs;
}

/// Calls visit(first cell, box) for pieces of a range of cells laid out in rows.
template <class Visit> void for_pieces(std::int64_t begin, std::int64_t end, Visit visit) {
    while (begin < end) {
        std::int64_t const n = std::min(end - begin, piece_length);
        std::int64_t const rows = n / row_length;
        Box const box = rows > 0 ? box_of({row_length, rows, 1}) : box_of({n, 1, 1});
        visit(begin, box);
        begin += box.voxels();
    }
}

std::int64_t first_cell(Volume const& volume, std::size_t b) {
    return b < volume.bricks().size() ? volume.brick_offset(b) : volume.header().cell_count;
}

ConstView piece_view(Volume const& volume, std::int64_t first, Box const& box) {
    DataType const type = volume.header().dtype;
    return dense_view(volume.buffer().read(Space::host) + static_cast<std::size_t>(first) * size_of(type), type, box);
}

void scan_cells(Operation& operation, Volume const& volume, Execution const& execution) {
    auto const& bricks = volume.bricks();
    for (LevelRun const& run : level_runs(bricks)) {
        LevelLattice const lattice = lattice_of(volume.header().dims, bricks[run.begin]);
        operation.enter_level(lattice.width, lattice.lower);
        if (!operation.uses_position()) {
            for_pieces(
                first_cell(volume, run.begin), first_cell(volume, run.end),
                [&](std::int64_t first, Box const& box) { operation.scan(piece_view(volume, first, box), execution); });
            continue;
        }
        for (std::size_t b = run.begin; b < run.end; ++b) {
            Box const box = lattice_box(lattice, bricks[b]);
            operation.scan(volume.brick_view(b).moved_to(box.lower), execution_for(box, execution));
        }
    }
    operation.scan_end();
}

void require_equal_trees(Operation const& operation, std::vector<Volume> const& inputs) {
    for (Volume const& other : inputs) {
        Header const &a = inputs[0].header(), &b = other.header();
        if (b.kind != Kind::hierarchical) refuse(operation, "its inputs are of both kinds");
        if (!(a.dims == b.dims) || !same_place(a, b) || inputs[0].bricks() != other.bricks())
            refuse(operation, "its inputs have different trees");
    }
}

/// What an operation without positions makes of the background: its result on one cell that holds it. An input that
/// names none has 0 in its holes.
void map_background(Operation& operation, std::vector<Volume> const& inputs, Header& output,
                    Execution const& execution) {
    if (operation.uses_position() ||
        std::none_of(inputs.begin(), inputs.end(), [](Volume const& v) { return stored_background(v.header()); }))
        return;
    Box const cell = box_of({1, 1, 1});
    std::vector<std::array<std::byte, sizeof(double)>> stored(inputs.size());
    std::vector<ConstView> views;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        Header const& header = inputs[i].header();
        double const value = stored_background(header).value_or(header.values.stored(0));
        with_cell_type(header.dtype, [&]<class T>(T) {
            T const held = store_cell<T>(value);
            std::memcpy(stored[i].data(), &held, sizeof held);
        });
        views.push_back(dense_view(static_cast<std::byte const*>(stored[i].data()), header.dtype, cell));
    }
    std::array<std::byte, sizeof(double)> result{};
    operation.run(views, dense_view(result.data(), output.dtype, cell), execution);
    with_cell_type(output.dtype, [&]<class T>(T) {
        T held;
        std::memcpy(&held, result.data(), sizeof held);
        output.attributes["background"] = to_text(output.values.physical(static_cast<double>(held)));
    });
}

/// The header of a result on the input's tree.
Header tree_header(Operation const& operation, Plan const& plan, Header const& input) {
    if (!(plan.output.dims == input.dims)) refuse(operation, "it changes the extent");
    Header header = plan.output;
    header.kind = Kind::hierarchical;
    return header;
}

Volume apply_pointwise(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                       TreeRun* report) {
    require_equal_trees(operation, inputs);
    std::vector<Header> const headers = headers_of(inputs);
    Plan const plan = operation.plan(headers);
    if (report != nullptr) report->plan = plan;
    Header header = tree_header(operation, plan, inputs[0].header());
    if (plan.scans) {
        do scan_cells(operation, inputs[0], execution);
        while (operation.scans_again());
        operation.after_scan(header);
    }
    if (plan.shift && *plan.shift == Index3{}) { // the cells are handed through
        Volume result = inputs[0];
        header.brick_count = result.header().brick_count;
        header.cell_count = result.header().cell_count;
        header.level_count = result.header().level_count;
        result.header() = header;
        return result;
    }
    Volume result(header, inputs[0].bricks());
    auto const& bricks = result.bricks();
    std::byte* const to = result.buffer().write(Space::host);
    std::size_t const bytes = size_of(header.dtype);
    std::vector<ConstView> views(inputs.size());
    if (!operation.uses_position()) {
        for_pieces(0, result.header().cell_count, [&](std::int64_t first, Box const& box) {
            for (std::size_t i = 0; i < inputs.size(); ++i) views[i] = piece_view(inputs[i], first, box);
            operation.run(views, dense_view(to + static_cast<std::size_t>(first) * bytes, header.dtype, box),
                          execution);
        });
    } else {
        std::map<int, LevelLattice> lattices;
        int level = -1;
        for (std::size_t b = 0; b < bricks.size(); ++b) {
            LevelLattice const& lattice =
                lattices.try_emplace(bricks[b].level, lattice_of(header.dims, bricks[b])).first->second;
            if (bricks[b].level != level) operation.enter_level(lattice.width, lattice.lower);
            level = bricks[b].level;
            Box const box = lattice_box(lattice, bricks[b]);
            for (std::size_t i = 0; i < inputs.size(); ++i) views[i] = inputs[i].brick_view(b).moved_to(box.lower);
            std::byte* const at = to + static_cast<std::size_t>(result.brick_offset(b)) * bytes;
            operation.run(views, dense_view(at, header.dtype, box), execution_for(box, execution));
        }
    }
    if (report != nullptr) report->remarks = operation.remarks();
    map_background(operation, inputs, result.header(), execution);
    return result;
}

/// The header of a level's lattice as a structured volume.
Header level_header(Header const& tree, LevelLattice const& lattice) {
    SampleGrid grid;
    for (int a = 0; a < 3; ++a) {
        grid.lower[a] = static_cast<double>(lattice.lower[a]);
        grid.step[a] = static_cast<double>(lattice.width[a]);
    }
    grid.dims = lattice.dims;
    return gridded_header(tree, grid);
}

/// How ghost cells are made: holes hold the background, however near they are to a coarse cell.
TileRule ghost_rule(Volume const& tree, TreeOptions const& options, Execution const& execution) {
    Header const& header = tree.header();
    TileRule rule = tile_rule(header, options.ghosts, stored_background(header).value_or(header.values.stored(0)),
                              united(brick_ranges(tree, execution)));
    Box const region = region_of(header);
    SampleGrid cells;
    for (int a = 0; a < 3; ++a) cells.lower[a] = static_cast<double>(region.lower[a]);
    cells.dims = region.dims();
    rule.holes = leaves_holes(header, tree.bricks(), cells);
    return rule;
}

class NeighbourhoodRun {
public:
    NeighbourhoodRun(Operation& operation, Volume const& input, Execution const& execution, TreeOptions const& options)
        : operation_(operation), input_(input), execution_(execution), index_(input.header().dims, input.bricks()),
          sources_(tile_sources(input)),
          filler_(input_, index_, sources_, ghost_rule(input, options, execution), execution.instructions) {}

    Volume run(TreeRun* report) {
        std::map<int, std::vector<std::size_t>> levels;
        for (std::size_t b = 0; b < input_.bricks().size(); ++b) levels[input_.bricks()[b].level].push_back(b);
        Volume result;
        for (auto const& [level, bricks] : levels) {
            LevelLattice const lattice =
                within(region_of(input_.header()), lattice_of(input_.header().dims, input_.bricks()[bricks.front()]));
            Header const header = level_header(input_.header(), lattice);
            Plan const plan = operation_.plan_level(header, lattice.width);
            if (plan.scans) refuse(operation_, "it looks at all values first, and levels would differ");
            if (plan.access == Access::random || !(plan.output.dims == lattice.dims))
                refuse(operation_, "it needs more than a neighbourhood");
            operation_.enter_level(lattice.width, lattice.lower);
            if (result.bricks().empty()) {
                result = Volume(output_header(plan.output), input_.bricks());
                if (report != nullptr) report->plan = plan;
                if (report != nullptr && !is_uniform(input_.header())) report->plan.error = ErrorBound::none_known();
            }
            for (std::size_t const b : bricks) run_brick(lattice, plan, b, result);
            if (report != nullptr)
                for (Remark const& remark : operation_.remarks()) report->remarks.push_back(remark);
        }
        if (levels.empty()) { // nothing to run, but a header to make
            Header const& header = input_.header();
            Plan const plan = operation_.plan({&header, 1});
            result = Volume(output_header(plan.output), std::vector<Brick>{});
            if (report != nullptr) report->plan = plan;
        }
        return result;
    }

private:
    Header output_header(Header const& planned) const {
        Header header = planned;
        header.kind = Kind::hierarchical;
        header.dims = input_.header().dims;
        header.geometry = input_.header().geometry;
        if (auto const roi = input_.header().attributes.find("roi"); roi != input_.header().attributes.end())
            header.attributes["roi"] = roi->second;
        return header;
    }

    /// The part of a lattice that a region of finest cells meets.
    static LevelLattice within(Box const& region, LevelLattice lattice) {
        for (int a = 0; a < 3; ++a) {
            std::int64_t const w = lattice.width[a], whole = lattice.lower[a];
            std::int64_t const first = (region.lower[a] - whole) / w, end = (region.upper[a] - whole + w - 1) / w;
            lattice.lower[a] = whole + first * w;
            lattice.dims[a] = end - first;
        }
        return lattice;
    }

    void run_brick(LevelLattice const& lattice, Plan const& plan, std::size_t b, Volume& result) {
        Box const whole = lattice_box(lattice, input_.bricks()[b]), box = intersect(whole, box_of(lattice.dims));
        DataType const output = result.header().dtype;
        std::size_t const offset = static_cast<std::size_t>(result.brick_offset(b)) * size_of(output);
        AnyView const to = dense_view(result.buffer().update(Space::host) + offset, output, whole);
        if (!(box == whole)) {
            if (output != input_.header().dtype) refuse(operation_, "cells outside of its region cannot change type");
            copy(input_.brick_view(b).moved_to(whole.lower), to);
        }
        if (box.empty()) return;
        Box const needed = operation_.footprint(box, 0);
        DataType const type = input_.header().dtype;
        double const bytes = volume_of(needed.dims()) * static_cast<double>(size_of(type));
        if (bytes > static_cast<double>(execution_.memory))
            refuse(operation_, text("a brick's neighbourhood takes ", bytes_text(bytes)));
        grown_.resize(static_cast<std::size_t>(needed.voxels()) * size_of(type));
        AnyView const grown = dense_view(grown_.data(), type, needed);
        if (!needed.empty()) filler_.fill(lattice, grown, plan.boundary, plan.border_value);
        ConstView const view = grown;
        operation_.run({&view, 1}, to.part(box), execution_for(box, execution_));
    }

    Operation& operation_;
    Volume const& input_;
    Execution const& execution_;
    BrickIndex index_;
    std::vector<tile::Source> sources_;
    GhostFiller filler_;
    std::vector<std::byte> grown_;
};

} // namespace

Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options, TreeRun* report) {
    Execution on_host = execution;
    on_host.device = Device::cpu;
    if (inputs.empty()) refuse(operation, "it has no input");
    if (inputs[0].header().kind != Kind::hierarchical) refuse(operation, "its inputs are of both kinds");
    switch (operation.shape()) {
    case Shape::pointwise:
        return apply_pointwise(operation, inputs, on_host, report);
    case Shape::neighbourhood:
        if (inputs.size() != 1) refuse(operation, "it takes several inputs");
        return NeighbourhoodRun(operation, inputs[0], on_host, options).run(report);
    case Shape::geometric: {
        if (inputs.size() != 1) break;
        Plan const plan = operation.plan(headers_of(inputs));
        Volume output;
        if (!operation.run_tree(inputs[0], output, on_host)) break;
        if (report != nullptr) *report = {plan, operation.remarks()};
        return output;
    }
    case Shape::source:
    case Shape::reduction:
        break;
    }
    refuse(operation, "its cells have no common grid");
}

void reduce_hierarchical(Operation& reduction, Volume const& volume, Execution const& execution) {
    Execution on_host = execution;
    on_host.device = Device::cpu;
    Header const& header = volume.header();
    reduction.plan({&header, 1});
    do scan_cells(reduction, volume, on_host);
    while (reduction.scans_again());
}

} // namespace vkt
