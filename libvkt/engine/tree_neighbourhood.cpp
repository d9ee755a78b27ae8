// Neighbourhood operations on hierarchical volumes: levels one after the other, bricks with ghost cells.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_work.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/ghost.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/stopwatch.h"

#include <algorithm>
#include <map>
#include <utility>

namespace vkt {
namespace {

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
        : operation_(operation), input_(std::move(input)), requested_(execution), execution_(execution), info_(info),
          options_(options) {
        execution_.device = Device::cpu; // where ghost cells are made, whatever works on bricks
        Header const& header = input_.header();
        for (std::size_t b = 0; b < input_.bricks().size(); ++b) levels_[input_.bricks()[b].level].push_back(b);
        for (auto const& [level, bricks] : levels_) plans_[level] = plan_level(lattice(level));
        plan = levels_.empty() ? begun(operation_, {&header, 1}) : plans_.begin()->second;
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

    Plan plan_level(LevelLattice const& at) const {
        Plan level = operation_.plan_level(level_header(input_.header(), at), at.width);
        if (level.scans) refuse_tree(operation_, "it looks at all values first, and levels would differ");
        if (level.access == Access::random || !(level.output.dims == at.dims))
            refuse_tree(operation_, "it needs more than a neighbourhood");
        return level;
    }

    /// The operation works on one level at a time.
    LevelLattice enter(int level) {
        LevelLattice const at = lattice(level);
        level_plan_ = &plans_.at(level);
        operation_.begin_level(level_header(input_.header(), at), at.width, *level_plan_);
        operation_.enter_level(at.width, at.lower);
        on_ = where_run(operation_, requested_);
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
            if (output_.dtype != type) refuse_tree(operation_, "cells outside of its region cannot change type");
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
        grown_.reserve(static_cast<std::size_t>(needed.voxels()) * size_of(type));
        AnyView const grown = dense_view(grown_.write(Space::host), type, needed);
        if (!needed.empty()) filler.fill(lattice, grown, level_plan_->boundary, level_plan_->border_value);
        ConstView const view = dense_view(grown_.read(on_.space()), type, needed, on_.space());
        if (on_.device == Device::cpu) return operation_.run({&view, 1}, out, execution_for(out.box, on_));
        made_.reserve(static_cast<std::size_t>(out.box.voxels()) * size_of(out.type));
        operation_.run({&view, 1}, dense_view(made_.write(Space::device), out.type, out.box, Space::device), on_);
        copy(dense_view(made_.read(Space::host), out.type, out.box), out);
    }

    Operation& operation_;
    BrickSequence input_;
    Execution requested_, execution_;
    Execution on_; ///< of the operation, on the level that is worked on
    StageInfo info_;
    TreeOptions options_;
    Header output_;
    std::map<int, std::vector<std::size_t>> levels_; ///< and their bricks
    std::map<int, Plan> plans_;                      ///< of them
    Plan const* level_plan_ = nullptr;               ///< of the level that is worked on
    std::optional<BrickIndex> index_;
    std::size_t window_ = 0; ///< bytes that a brick with its neighbours may take
    bool whole_ = true;      ///< all is done in memory
    bool computed_ = false;
    std::optional<Volume> memory_;     ///< the result, there
    std::unique_ptr<BrickSpool> file_; ///< or there
    Buffer result_;                    ///< of a brick
    Buffer grown_, made_;              ///< the same on the way to the operation and, from a GPU, back
    std::vector<Remark> remarks_;
};

} // namespace

std::shared_ptr<TreeRun::Work> neighbourhood_work(Operation& operation, BrickSequence input, Execution const& execution,
                                                  StageInfo const& info, TreeOptions const& options) {
    return std::make_shared<NeighbourhoodWork>(operation, std::move(input), execution, info, options);
}

} // namespace vkt
