// Operations on hierarchical volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_run.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/ghost.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/stopwatch.h"
#include "libvkt/engine/travelled.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

namespace vkt {

class TreeRun::Work {
public:
    Work() = default;
    virtual ~Work() = default;
    Work(Work const&) = delete;
    Work& operator=(Work const&) = delete;

    Plan plan;
    virtual BrickSequence bricks(Header header, std::shared_ptr<Work> const& self) = 0;
    virtual std::vector<Remark> remarks() const = 0;
};

namespace {

[[noreturn]] void refuse(Operation const& operation, std::string const& why) {
    throw Error(ErrorKind::usage, text(operation.name(), " has no meaning on a hierarchical volume: ", why),
                "make it a grid first: vkt resample --cells 50M");
}

/// Cells are laid out in rows of this length when positions do not matter.
constexpr std::int64_t row_length = 4096;

/// Threads pay from this many cells on; smaller bricks are run by the calling thread.
constexpr std::int64_t threaded_cells = std::int64_t{1} << 17;

Execution execution_for(Box const& box, Execution const& execution) {
    Execution result = execution;
    if (box.voxels() < threaded_cells) result.threads = 1;
    return result;
}

Execution on_host(Execution execution) {
    execution.device = Device::cpu;
    return execution;
}

std::vector<Header> headers_of(std::vector<BrickSequence> const& inputs) {
    return collect(inputs, [](BrickSequence const& input) { return input.header(); });
}

std::vector<std::size_t> largest_bricks(std::vector<BrickSequence> const& inputs) {
    return collect(inputs, [](BrickSequence const& input) { return input.largest_brick(); });
}

/// Bytes of cells that are worked on at once, unless a brick has more.
std::size_t group_limit(Execution const& execution) { return std::min(brick_group_bytes, piece_limit(execution)); }

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
            views_.push_back(
                dense_view(group.inputs[i] + static_cast<std::size_t>(first) * size_of(inputs_[i]), inputs_[i], box));
        if (group.output == nullptr) return operation_.scan(views_.front(), execution);
        std::byte* const to = group.output + static_cast<std::size_t>(first) * size_of(output_);
        operation_.run(views_, dense_view(to, output_, box), execution);
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

/// All bricks of a sequence once, for a scan.
void scan_bricks(Operation& operation, BrickSequence& bricks, Execution const& execution, StageTimes* times) {
    GroupRun scan(operation, bricks.header(), {bricks.header().dtype}, bricks.header().dtype, execution);
    std::size_t const all = bricks.bricks().size();
    for (std::size_t first = 0, n = 0; first < all; first += n) {
        if (execution.monitor != nullptr)
            execution.monitor->poll(static_cast<std::int64_t>(first), static_cast<std::int64_t>(all));
        n = bricks.group(first, group_limit(execution));
        Group group{bricks.bricks(), first, n, {}};
        {
            Stopwatch const watch(times != nullptr ? &times->input : nullptr);
            group.inputs = {bricks.cells(first, n)};
        }
        Stopwatch const watch(times != nullptr ? &times->compute : nullptr);
        scan(group);
        if (times != nullptr) times->voxels += bricks.bricks().cells(first, n);
    }
    operation.scan_end();
}

void require_equal_trees(Operation const& operation, std::vector<BrickSequence> const& inputs) {
    for (BrickSequence const& other : inputs) {
        Header const &a = inputs[0].header(), &b = other.header();
        if (!(a.dims == b.dims) || !same_place(a, b) || !(inputs[0].bricks() == other.bricks()))
            refuse(operation, "its inputs have different trees");
    }
}

/// What an operation without positions makes of the background: its result on one cell that holds it. An input that
/// names none has 0 in its holes.
void map_background(Operation& operation, std::vector<Header> const& inputs, Header& output,
                    Execution const& execution) {
    if (operation.uses_position() ||
        std::none_of(inputs.begin(), inputs.end(), [](Header const& h) { return stored_background(h); }))
        return;
    Box const cell = box_of({1, 1, 1});
    std::vector<std::array<std::byte, sizeof(double)>> stored(inputs.size());
    std::vector<ConstView> views;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        Header const& header = inputs[i];
        double const value = stored_background(header).value_or(header.values.stored(0));
        with_cell_type(header.dtype, [&]<class T>(T) {
            T const held = store_cell<T>(value);
            std::memcpy(stored[i].data(), &held, sizeof held);
        });
        views.push_back(dense_view(static_cast<std::byte const*>(stored[i].data()), header.dtype, cell));
    }
    std::array<std::byte, sizeof(double)> result{};
    operation.run(views, dense_view(result.data(), output.dtype, cell), execution);
    operation.forget_trial();
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
    header.brick_count = input.brick_count;
    header.cell_count = input.cell_count;
    header.level_count = input.level_count;
    return header;
}

/// Bricks handed through under another header.
class HeaderWork : public TreeRun::Work {
public:
    HeaderWork(Operation const& operation, BrickSequence input, Plan planned)
        : operation_(operation), input_(std::move(input)) {
        plan = std::move(planned);
        plan.output = tree_header(operation, plan, input_.header());
    }
    BrickSequence bricks(Header header, std::shared_ptr<Work> const&) override {
        return std::move(input_).with_header(std::move(header));
    }
    std::vector<Remark> remarks() const override { return operation_.remarks(); }

private:
    Operation const& operation_;
    BrickSequence input_;
};

class PointwiseWork : public TreeRun::Work {
public:
    PointwiseWork(Operation& operation, std::vector<BrickSequence> inputs, Plan planned, Execution const& execution,
                  StageInfo const& info)
        : operation_(operation), inputs_(std::move(inputs)), execution_(execution), times_(info.times) {
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
            BrickOrder::ascending);
        result.set_group_bytes(group_limit(execution_));
        return result;
    }

    std::vector<Remark> remarks() const override { return operation_.remarks(); }

private:
    void run(std::size_t first, std::size_t count, std::byte* to) {
        auto const& bricks = inputs_[0].bricks();
        for (std::size_t end = first + count, n = 0; first < end; first += n) {
            n = end - first;
            if (execution_.monitor != nullptr)
                execution_.monitor->poll(static_cast<std::int64_t>(first), static_cast<std::int64_t>(bricks.size()));
            for (BrickSequence const& input : inputs_) n = std::min(n, input.group(first, group_limit(execution_)));
            Group group{bricks, first, n, {}, to};
            {
                Stopwatch const watch(times_ ? &times_->input : nullptr);
                for (BrickSequence& input : inputs_) group.inputs.push_back(input.cells(first, n));
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
TileRule ghost_rule(Header const& header, BrickTable const& bricks, TreeOptions const& options, ValueRange range) {
    TileRule rule =
        tile_rule(header, options.ghosts, stored_background(header).value_or(header.values.stored(0)), range);
    Box const region = region_of(header);
    SampleGrid cells;
    for (int a = 0; a < 3; ++a) cells.lower[a] = static_cast<double>(region.lower[a]);
    cells.dims = region.dims();
    rule.holes = leaves_holes(header, bricks, cells);
    return rule;
}

/// The part of a lattice that a region of finest cells meets.
LevelLattice within(Box const& region, LevelLattice lattice) {
    for (int a = 0; a < 3; ++a) {
        std::int64_t const w = lattice.width[a], whole = lattice.lower[a];
        std::int64_t const first = (region.lower[a] - whole) / w, end = (region.upper[a] - whole + w - 1) / w;
        lattice.lower[a] = whole + first * w;
        lattice.dims[a] = end - first;
    }
    return lattice;
}

class NeighbourhoodWork : public TreeRun::Work {
public:
    NeighbourhoodWork(Operation& operation, BrickSequence input, Execution const& execution, StageInfo const& info,
                      TreeOptions const& options)
        : operation_(operation), input_(std::move(input)), execution_(execution), info_(info), options_(options) {
        Header const& header = input_.header();
        for (std::size_t b = 0; b < input_.bricks().size(); ++b) levels_[input_.bricks()[b].level].push_back(b);
        plan = levels_.empty() ? operation_.plan({&header, 1})
                               : plan_level(levels_.begin()->first, lattice(levels_.begin()->first));
        output_ = plan.output;
        output_.kind = Kind::hierarchical;
        output_.dims = header.dims;
        output_.geometry = header.geometry;
        if (auto const roi = header.attributes.find("roi"); roi != header.attributes.end())
            output_.attributes["roi"] = roi->second;
        plan.output = output_ = with_counts(output_, input_.bricks());
        if (!is_uniform(header)) plan.error = ErrorBound::none_known();
        std::size_t const largest = input_.largest_brick();
        TreeWork const work = tree_work(Shape::neighbourhood, plan, {&header, 1}, {&largest, 1}, execution_);
        whole_ = work.access == TreeAccess::whole;
        window_ = work.keep;
        if (!whole_) require_room();
    }

    BrickSequence bricks(Header header, std::shared_ptr<Work> const& self) override {
        if (whole_) {
            compute();
            input_ = Volume(); // nobody needs it any more
            memory_->header() = with_counts(std::move(header), memory_->bricks());
            return *std::exchange(memory_, {});
        }
        BrickSequence result(std::move(header), input_.bricks(),
                             [this, self](std::size_t first, std::size_t count, std::byte* to) {
                                 if (!std::exchange(computed_, true)) compute();
                                 file_->read(first, count, to);
                             });
        result.set_group_bytes(group_limit(execution_));
        return result;
    }

    std::vector<Remark> remarks() const override { return remarks_; }

private:
    LevelLattice lattice(int level) const {
        Brick const& any = input_.bricks()[levels_.at(level).front()];
        return within(region_of(input_.header()), lattice_of(input_.header().dims, any));
    }

    /// The operation works on one level at a time, for which it was planned last.
    Plan const& plan_level(int level, LevelLattice const& at) {
        if (std::exchange(planned_, level) == level) return level_plan_;
        level_plan_ = operation_.plan_level(level_header(input_.header(), at), at.width);
        if (level_plan_.scans) refuse(operation_, "it looks at all values first, and levels would differ");
        if (level_plan_.access == Access::random || !(level_plan_.output.dims == at.dims))
            refuse(operation_, "it needs more than a neighbourhood");
        return level_plan_;
    }

    /// Prepares the operation for a level.
    LevelLattice enter(int level) {
        LevelLattice const at = lattice(level);
        plan_level(level, at);
        operation_.enter_level(at.width, at.lower);
        return at;
    }

    /// Throws Error{resources} if a brick with its neighbours needs more than there is for them.
    void require_room() {
        index_.emplace(input_.header().dims, input_.bricks());
        Index3 const dims = input_.header().dims;
        auto const size = static_cast<double>(size_of(input_.header().dtype));
        std::vector<std::int32_t> near;
        for (auto const& [level, bricks] : levels_) {
            LevelLattice const at = enter(level);
            for (std::size_t const b : bricks) {
                Box const box = intersect(lattice_box(at, input_.bricks()[b]), box_of(at.dims));
                if (box.empty()) continue;
                Box const needed = operation_.footprint(box, 0), inside = intersect(needed, box_of(at.dims));
                double bytes = volume_of(needed.dims()) * size;
                Vec3 lower, upper;
                for (int a = 0; a < 3; ++a) {
                    lower[a] = static_cast<double>(at.lower[a] + inside.lower[a] * at.width[a]);
                    upper[a] = static_cast<double>(at.lower[a] + inside.upper[a] * at.width[a]);
                }
                index_->query(lower, upper, near);
                double cells = 0;
                for (std::int32_t const id : near) {
                    Brick const& brick = input_.bricks()[static_cast<std::size_t>(id)];
                    if (domain_meets(brick, dims, lower, upper)) cells += static_cast<double>(brick.cells());
                }
                bytes = std::max(bytes, cells * size);
                if (bytes > static_cast<double>(window_)) refuse_neighbourhood(bytes);
            }
        }
    }

    [[noreturn]] void refuse_neighbourhood(double bytes) const {
        throw Error(ErrorKind::resources,
                    text(operation_.name(), ": a brick with its neighbours takes ", bytes_text(bytes),
                         " of memory, the budget of ", bytes_text(static_cast<double>(execution_.memory)),
                         " has no room for that"),
                    "raise --memory, or make the volume a grid first: vkt resample --cells 50M");
    }

    void compute() {
        CellSurvey const survey = look_at_all();
        if (!index_) index_.emplace(input_.header().dims, input_.bricks());
        BrickCells cells(input_, window_);
        GhostFiller filler(cells, *index_, survey.brick(),
                           ghost_rule(input_.header(), input_.bricks(), options_, survey.range()),
                           execution_.instructions);
        if (whole_)
            memory_.emplace(output_, input_.bricks());
        else
            file_ = std::make_unique<BrickSpool>(output_, input_.bricks(), execution_, info_);
        Stopwatch const watch(info_.times ? &info_.times->compute : nullptr);
        std::int64_t done = 0;
        for (auto const& [level, bricks] : levels_) {
            LevelLattice const at = enter(level);
            for (std::size_t const b : bricks) {
                if (execution_.monitor != nullptr)
                    execution_.monitor->poll(done++, static_cast<std::int64_t>(input_.bricks().size()));
                run_brick(at, b, cells, filler);
            }
            for (Remark const& remark : operation_.remarks()) remarks_.push_back(remark);
        }
        if (info_.times) info_.times->voxels += input_.header().voxels();
    }

    /// Every brick once; where they only come once they are kept.
    CellSurvey look_at_all() {
        Stopwatch const watch(info_.times ? &info_.times->input : nullptr);
        if (whole_)
            input_ = std::move(input_).whole();
        else
            input_ = spooled(std::move(input_), 0, execution_, info_);
        CellSurvey survey(input_.header().dtype);
        BrickTable const& all = input_.bricks();
        for (std::size_t first = 0, n = 0; first < all.size(); first += n) {
            n = input_.in_memory() ? all.size() : input_.group(first, group_limit(execution_));
            survey.add(all.part(first, n), input_.cells(first, n), execution_);
        }
        return survey;
    }

    void run_brick(LevelLattice const& lattice, std::size_t b, BrickCells& cells, GhostFiller& filler) {
        Box const whole = lattice_box(lattice, input_.bricks()[b]), box = intersect(whole, box_of(lattice.dims));
        DataType const type = input_.header().dtype;
        std::byte* at = nullptr;
        if (whole_) {
            at = memory_->buffer().update(Space::host) +
                 static_cast<std::size_t>(memory_->brick_offset(b)) * size_of(output_.dtype);
        } else {
            result_.reserve(static_cast<std::size_t>(whole.voxels()) * size_of(output_.dtype));
            at = result_.write(Space::host);
        }
        AnyView const to = dense_view(at, output_.dtype, whole);
        if (!(box == whole)) {
            if (output_.dtype != type) refuse(operation_, "cells outside of its region cannot change type");
            auto const id = static_cast<std::int32_t>(b);
            cells.want({&id, 1});
            copy(dense_view(cells.of(id), type, whole), to);
        }
        if (!box.empty()) run_inside(lattice, to.part(box), filler);
        if (!whole_) file_->store(b, 1, at);
    }

    void run_inside(LevelLattice const& lattice, AnyView out, GhostFiller& filler) {
        Box const needed = operation_.footprint(out.box, 0);
        DataType const type = input_.header().dtype;
        double const bytes = volume_of(needed.dims()) * static_cast<double>(size_of(type));
        if (bytes > static_cast<double>(window_)) refuse_neighbourhood(bytes);
        grown_.resize(static_cast<std::size_t>(needed.voxels()) * size_of(type));
        AnyView const grown = dense_view(grown_.data(), type, needed);
        if (!needed.empty()) filler.fill(lattice, grown, level_plan_.boundary, level_plan_.border_value);
        ConstView const view = grown;
        operation_.run({&view, 1}, out, execution_for(out.box, execution_));
    }

    Operation& operation_;
    BrickSequence input_;
    Execution execution_;
    StageInfo info_;
    TreeOptions options_;
    Header output_;
    std::map<int, std::vector<std::size_t>> levels_; ///< and their bricks
    int planned_ = -1;                               ///< level that the operation was planned for last,
    Plan level_plan_;                                ///< and how
    std::optional<BrickIndex> index_;
    std::size_t window_ = 0; ///< bytes that a brick with its neighbours may take
    bool whole_ = true;      ///< all is done in memory
    bool computed_ = false;
    std::optional<Volume> memory_;     ///< the result, there
    std::unique_ptr<BrickSpool> file_; ///< or there
    Buffer result_;                    ///< of a brick
    std::vector<std::byte> grown_;
    std::vector<Remark> remarks_;
};

/// The same bricks; count(seconds, cells) is told of every reading.
template <class Count> BrickSequence timed(BrickSequence bricks, Count count) {
    if (bricks.in_memory()) return bricks;
    auto const source = std::make_shared<BrickSequence>(std::move(bricks));
    BrickSequence result(
        source->header(), source->bricks(),
        [source, count](std::size_t first, std::size_t n, std::byte* to) {
            double seconds = 0;
            {
                Stopwatch const watch(&seconds);
                source->read(first, n, to);
            }
            count(seconds, source->bricks().cells(first, n));
        },
        source->order());
    result.set_group_bytes(source->group_bytes());
    return result;
}

/// By the operation's own move_bricks().
class GeometricWork : public TreeRun::Work {
public:
    GeometricWork(Operation& operation, BrickSequence input, Plan planned, Execution const& execution,
                  std::shared_ptr<StageTimes> const& times)
        : operation_(operation) {
        plan = std::move(planned);
        std::size_t const largest = input.largest_brick();
        Header const header = input.header();
        if (times)
            input = timed(std::move(input), [times](double seconds, std::int64_t) {
                times->input += seconds;
                times->compute -= seconds; // of the time that the result takes
            });
        moved_ = operation.move_bricks(std::move(input), execution);
        if (!moved_) refuse(operation, "its cells have no common grid");
        if (times)
            moved_ = timed(*std::move(moved_), [times](double seconds, std::int64_t cells) {
                times->compute += seconds;
                times->voxels += cells;
            });
        tree_work(Shape::geometric, plan, {&header, 1}, {&largest, 1}, execution);
        moved_->set_group_bytes(group_limit(execution));
        plan.output = moved_->header();
    }
    BrickSequence bricks(Header header, std::shared_ptr<Work> const&) override {
        return std::move(*moved_).with_header(std::move(header));
    }
    std::vector<Remark> remarks() const override { return operation_.remarks(); }

private:
    Operation& operation_;
    std::optional<BrickSequence> moved_;
};

std::shared_ptr<TreeRun::Work> work_of(Operation& operation, std::vector<BrickSequence> inputs,
                                       Execution const& execution, StageInfo const& info, TreeOptions const& options,
                                       std::optional<Plan> planned) {
    if (inputs.empty()) refuse(operation, "it has no input");
    if (operation.shape() == Shape::neighbourhood) {
        if (inputs.size() != 1) refuse(operation, "it takes several inputs");
        return std::make_shared<NeighbourhoodWork>(operation, std::move(inputs[0]), execution, info, options);
    }
    bool const pointwise = operation.shape() == Shape::pointwise;
    if (!pointwise && (operation.shape() != Shape::geometric || inputs.size() != 1))
        refuse(operation, "its cells have no common grid");
    if (pointwise) require_equal_trees(operation, inputs);
    Plan plan = planned ? *std::move(planned) : operation.plan(headers_of(inputs));
    if (plan.shift && *plan.shift == Index3{} && !plan.scans)
        return std::make_shared<HeaderWork>(operation, std::move(inputs[0]), std::move(plan));
    if (pointwise)
        return std::make_shared<PointwiseWork>(operation, std::move(inputs), std::move(plan), execution, info);
    return std::make_shared<GeometricWork>(operation, std::move(inputs[0]), std::move(plan), execution, info.times);
}

} // namespace

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

TreeRun::TreeRun(Operation& operation, std::vector<BrickSequence> inputs, Execution const& execution,
                 StageInfo const& info, TreeOptions const& options, std::optional<Plan> planned)
    : headers_(headers_of(inputs)),
      work_(work_of(operation, std::move(inputs), on_host(execution), info, options, std::move(planned))) {
    work_->plan.output.error = travelled(headers_, work_->plan, operation.name());
}

Plan const& TreeRun::plan() const { return work_->plan; }
BrickSequence TreeRun::bricks(Header header) { return work_->bricks(std::move(header), work_); }
std::vector<Remark> TreeRun::remarks() const { return work_->remarks(); }

Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options) {
    for (Volume const& input : inputs)
        if (input.header().kind != Kind::hierarchical) refuse(operation, "its inputs are of both kinds");
    TreeRun run(operation, collect(inputs, [](Volume const& input) { return BrickSequence(input); }), execution, {},
                options);
    return run.bricks(run.plan().output).whole();
}

void reduce_hierarchical(Operation& reduction, BrickSequence bricks, Execution const& execution,
                         StageInfo const& info) {
    Header const header = bricks.header();
    Execution const host = on_host(execution);
    Plan const plan = reduction.plan({&header, 1});
    std::size_t const largest = bricks.largest_brick();
    TreeWork const work = tree_work(Shape::reduction, plan, {&header, 1}, {&largest, 1}, host);
    if (plan.scans) bricks = spooled(std::move(bricks), work.keep, host, info);
    do scan_bricks(reduction, bricks, host, info.times.get());
    while (reduction.scans_again());
}

} // namespace vkt
