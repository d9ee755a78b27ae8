// Pointwise operations and scans on hierarchical volumes, in bounded memory.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_work.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/ghost.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/stopwatch.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

namespace vkt {
namespace {

/// Cells are laid out in rows of this length when positions do not matter.
constexpr std::int64_t row_length = 4096;

std::vector<std::size_t> largest_bricks(std::vector<BrickSequence> const& inputs) {
    return collect(inputs, [](BrickSequence const& input) { return input.largest_brick(); });
}

/// Neighbouring bricks of one level.
struct LevelRun {
    std::size_t begin, end;
};

/// The bricks of [first, end) in runs of one level.
std::vector<LevelRun> level_runs(BrickTable const& bricks, std::size_t first, std::size_t end) {
    std::vector<LevelRun> runs;
    for (std::size_t b = first; b < end; ++b) {
        if (runs.empty() || bricks[runs.back().begin].level != bricks[b].level) runs.push_back({b, b});
        runs.back().end = b + 1;
    }
    return runs;
}

/// Calls visit(first cell, box) for a range of cells laid out in rows, and one of what is left.
template <class Visit> void for_rows(std::int64_t count, Visit visit) {
    std::int64_t const rows = count / row_length, left = count - rows * row_length;
    if (rows > 0) visit(std::int64_t{0}, box_of({row_length, rows, 1}));
    if (left > 0) visit(rows * row_length, box_of({left, 1, 1}));
}

/// Some bricks with their cells, which lie one after another.
struct Group {
    BrickTable const& bricks; ///< all of the tree
    std::size_t first, count;
    std::vector<std::byte const*> inputs;
    std::byte* output = nullptr; ///< none for scans
};

/// Runs or scans groups of bricks, level after level as they come.
class GroupRun {
public:
    GroupRun(Operation& operation, Header const& tree, std::vector<DataType> inputs, DataType output,
             Execution const& execution)
        : operation_(operation), dims_(tree.dims), inputs_(std::move(inputs)), output_(output), execution_(execution) {}

    Space space() const { return execution_.space(); } ///< of the cells

    void operator()(Group const& group) {
        std::int64_t at = 0;
        if (group.output != nullptr && !operation_.uses_position()) {
            std::int64_t const cells = group.bricks.cells(group.first, group.count);
            return for_rows(cells, [&](std::int64_t first, Box const& box) { work(group, first, box, execution_); });
        }
        for (LevelRun const& run : level_runs(group.bricks, group.first, group.first + group.count)) {
            LevelLattice const& lattice = enter(group.bricks[run.begin]);
            if (!operation_.uses_position()) {
                std::int64_t const cells = group.bricks.cells(run.begin, run.end - run.begin);
                for_rows(cells, [&](std::int64_t first, Box const& box) { work(group, at + first, box, execution_); });
                at += cells;
                continue;
            }
            for (std::size_t b = run.begin; b < run.end; ++b) {
                Box const box = lattice_box(lattice, group.bricks[b]);
                work(group, at, box, execution_for(box, execution_));
                at += group.bricks[b].cells();
            }
        }
    }

private:
    LevelLattice const& enter(Brick const& brick) {
        LevelLattice const& lattice = lattices_.try_emplace(brick.level, lattice_of(dims_, brick)).first->second;
        if (std::exchange(level_, brick.level) != brick.level) operation_.enter_level(lattice.width, lattice.lower);
        return lattice;
    }

    /// So many cells of a group from this one on.
    void work(Group const& group, std::int64_t first, Box const& box, Execution const& execution) {
        views_.clear();
        for (std::size_t i = 0; i < group.inputs.size(); ++i)
            views_.push_back(dense_view(group.inputs[i] + static_cast<std::size_t>(first) * size_of(inputs_[i]),
                                        inputs_[i], box, space()));
        if (group.output == nullptr) return operation_.scan(views_.front(), execution);
        std::byte* const to = group.output + static_cast<std::size_t>(first) * size_of(output_);
        operation_.run(views_, dense_view(to, output_, box, space()), execution);
    }

    Operation& operation_;
    Index3 dims_;
    std::vector<DataType> inputs_;
    DataType output_;
    Execution execution_;
    std::map<int, LevelLattice> lattices_;
    int level_ = -1; ///< that the operation was told of
    std::vector<ConstView> views_;
};

/// What an operation without positions makes of the background: its result on one cell that holds it. An input that
/// names none has 0 in its holes.
void map_background(Operation& operation, std::vector<Header> const& inputs, Header& output, Execution execution) {
    execution.device = Device::cpu;
    if (operation.uses_position() ||
        std::none_of(inputs.begin(), inputs.end(), [](Header const& h) { return stored_background(h); }))
        return;
    Box const cell = box_of({1, 1, 1});
    std::vector<std::array<std::byte, sizeof(double)>> stored(inputs.size());
    std::vector<ConstView> views;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        Header const& header = inputs[i];
        double const value = stored_background(header).value_or(header.values.stored(0));
        with_type(header.dtype, [&]<class T>(T) {
            T const held = store_cell<T>(value);
            std::memcpy(stored[i].data(), &held, sizeof held);
        });
        views.push_back(dense_view(static_cast<std::byte const*>(stored[i].data()), header.dtype, cell));
    }
    std::array<std::byte, sizeof(double)> result{};
    operation.run(views, dense_view(result.data(), output.dtype, cell), execution);
    for (std::int64_t* const counter : operation.counters()) *counter = 0;
    with_type(output.dtype, [&]<class T>(T) {
        T held;
        std::memcpy(&held, result.data(), sizeof held);
        output.attributes["background"] = to_text(output.values.physical(static_cast<double>(held)));
    });
}

class PointwiseWork : public TreeRun::Work {
public:
    PointwiseWork(Operation& operation, std::vector<BrickSequence> inputs, Plan planned, Execution const& execution,
                  StageInfo const& info)
        : operation_(operation), inputs_(std::move(inputs)), execution_(where_run(operation, execution)),
          times_(info.times) {
        std::vector<Header> const headers = headers_of(inputs_);
        plan = std::move(planned);
        plan.output = tree_header(operation_, plan, headers.front());
        TreeWork const work = tree_work(Shape::pointwise, plan, headers, largest_bricks(inputs_), execution_);
        if (plan.scans) {
            inputs_[0] = spooled(std::move(inputs_[0]), work.keep, execution_, info);
            do scan_bricks(operation_, inputs_[0], execution_, times_.get());
            while (operation_.scans_again());
            operation_.after_scan(plan);
        }
        map_background(operation_, headers, plan.output, execution_);
        run_ = std::make_unique<GroupRun>(operation_, headers.front(),
                                          collect(headers, [](Header const& h) { return h.dtype; }), plan.output.dtype,
                                          execution_);
    }

    BrickSequence bricks(Header header, std::shared_ptr<Work> const& self) override {
        BrickSequence result(
            std::move(header), inputs_[0].bricks(),
            [this, self](std::size_t first, std::size_t count, std::byte* to) { run(first, count, to); },
            BrickOrder::ascending, execution_.space());
        result.set_group_bytes(group_limit(execution_));
        return result;
    }

    std::vector<Remark> remarks() const override { return operation_.remarks(); }

private:
    void run(std::size_t first, std::size_t count, std::byte* to) {
        select_gpu(execution_);
        auto const& bricks = inputs_[0].bricks();
        for (std::size_t end = first + count, n = 0; first < end; first += n) {
            n = end - first;
            if (execution_.monitor != nullptr)
                execution_.monitor->poll(static_cast<std::int64_t>(first), static_cast<std::int64_t>(bricks.size()));
            for (BrickSequence const& input : inputs_) n = std::min(n, input.group(first, group_limit(execution_)));
            Group group{bricks, first, n, {}, to};
            {
                Stopwatch const watch(times_ ? &times_->input : nullptr);
                for (BrickSequence& input : inputs_) group.inputs.push_back(input.cells(first, n, run_->space()));
            }
            Stopwatch const watch(times_ ? &times_->compute : nullptr);
            (*run_)(group);
            std::int64_t const cells = bricks.cells(first, n);
            to += static_cast<std::size_t>(cells) * size_of(plan.output.dtype);
            if (times_) times_->voxels += cells;
        }
    }

    Operation& operation_;
    std::vector<BrickSequence> inputs_;
    Execution execution_;
    std::shared_ptr<StageTimes> times_;
    std::unique_ptr<GroupRun> run_;
};

} // namespace

void scan_bricks(Operation& operation, BrickSequence& bricks, Execution const& execution, StageTimes* times) {
    Execution const on = where_scanned(operation, bricks.header(), execution);
    GroupRun scan(operation, bricks.header(), {bricks.header().dtype}, bricks.header().dtype, on);
    std::size_t const all = bricks.bricks().size();
    for (std::size_t first = 0, n = 0; first < all; first += n) {
        if (execution.monitor != nullptr)
            execution.monitor->poll(static_cast<std::int64_t>(first), static_cast<std::int64_t>(all));
        n = bricks.group(first, group_limit(on));
        Group group{bricks.bricks(), first, n, {}};
        {
            Stopwatch const watch(times != nullptr ? &times->input : nullptr);
            group.inputs = {bricks.cells(first, n, on.space())};
        }
        Stopwatch const watch(times != nullptr ? &times->compute : nullptr);
        scan(group);
        if (times != nullptr) times->voxels += bricks.bricks().cells(first, n);
    }
    operation.scan_end();
}

std::shared_ptr<TreeRun::Work> pointwise_work(Operation& operation, std::vector<BrickSequence> inputs, Plan plan,
                                              Execution const& execution, StageInfo const& info) {
    return std::make_shared<PointwiseWork>(operation, std::move(inputs), std::move(plan), execution, info);
}

} // namespace vkt
