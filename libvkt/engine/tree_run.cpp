// Which way of working a hierarchical volume goes through, and the ways that take few lines.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/tree_work.h"

#include "libvkt/amr/tree.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/stopwatch.h"
#include "libvkt/engine/travelled.h"

#include <utility>

namespace vkt {
namespace {

/// Threads pay from this many cells on; smaller bricks are run by the calling thread.
constexpr std::int64_t threaded_cells = std::int64_t{1} << 17;

void require_equal_trees(Operation const& operation, std::vector<BrickSequence> const& inputs) {
    for (BrickSequence const& other : inputs) {
        Header const &a = inputs[0].header(), &b = other.header();
        if (!(a.dims == b.dims) || !same_place(a, b) || !(inputs[0].bricks() == other.bricks()))
            refuse_tree(operation, "its inputs have different trees");
    }
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
                source->read(first, n, to, source->space());
            }
            count(seconds, source->bricks().cells(first, n));
        },
        source->order(), source->space());
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
        moved_ = operation.move_bricks(std::move(input), where_run(operation, execution));
        if (!moved_) refuse_tree(operation, "its cells have no common grid");
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
                                       Execution const& execution, StageInfo const& info, TreeOptions const& options) {
    if (inputs.empty()) refuse_tree(operation, "it has no input");
    if (operation.shape() == Shape::neighbourhood) {
        if (inputs.size() != 1) refuse_tree(operation, "it takes several inputs");
        return neighbourhood_work(operation, std::move(inputs[0]), execution, info, options);
    }
    bool const pointwise = operation.shape() == Shape::pointwise;
    if (!pointwise && (operation.shape() != Shape::geometric || inputs.size() != 1))
        refuse_tree(operation, "its cells have no common grid");
    if (pointwise) require_equal_trees(operation, inputs);
    Plan plan = begun(operation, headers_of(inputs));
    if (plan.shift && *plan.shift == Index3{} && !plan.scans)
        return std::make_shared<HeaderWork>(operation, std::move(inputs[0]), std::move(plan));
    if (pointwise) return pointwise_work(operation, std::move(inputs), std::move(plan), execution, info);
    return std::make_shared<GeometricWork>(operation, std::move(inputs[0]), std::move(plan), execution, info.times);
}

} // namespace

void refuse_tree(Operation const& operation, std::string const& why) {
    throw Error(ErrorKind::usage, text(operation.name(), " has no meaning on a hierarchical volume: ", why),
                "make it a grid first: vkt resample --cells 50M");
}

Header tree_header(Operation const& operation, Plan const& plan, Header const& input) {
    if (!(plan.output.dims == input.dims)) refuse_tree(operation, "it changes the extent");
    Header header = plan.output;
    header.kind = Kind::hierarchical;
    header.brick_count = input.brick_count;
    header.cell_count = input.cell_count;
    header.level_count = input.level_count;
    return header;
}

std::vector<Header> headers_of(std::vector<BrickSequence> const& inputs) {
    return collect(inputs, [](BrickSequence const& input) { return input.header(); });
}

Execution where_run(Operation const& operation, Execution execution) {
    if (execution.device == Device::gpu && operation.runs_on_gpu()) {
        select_gpu(execution);
        return execution;
    }
    if (execution.only_gpu) refuse_cpu(text(operation.name(), " of hierarchical volumes as it is asked for here"));
    execution.device = Device::cpu;
    return execution;
}

Execution where_scanned(Operation const& operation, Header const& tree, Execution execution) {
    if (execution.device == Device::gpu && (!operation.scans_on_gpu() || stored_background(tree))) {
        if (execution.only_gpu)
            refuse_cpu(text("the look that ", operation.name(), " takes at all cells",
                            stored_background(tree) ? " but those of a background" : ""));
        execution.device = Device::cpu;
    }
    return where_run(operation, std::move(execution));
}

Execution execution_for(Box const& box, Execution const& execution) {
    Execution result = execution;
    if (box.voxels() < threaded_cells) result.threads = 1;
    return result;
}

TreeRun::TreeRun(Operation& operation, std::vector<BrickSequence> inputs, Execution const& execution,
                 StageInfo const& info, TreeOptions const& options)
    : headers_(headers_of(inputs)), work_(work_of(operation, std::move(inputs), execution, info, options)) {
    settle_header(headers_, work_->plan, operation.name());
}

Plan const& TreeRun::plan() const { return work_->plan; }
BrickSequence TreeRun::bricks(Header header) { return work_->bricks(std::move(header), work_); }
std::vector<Remark> TreeRun::remarks() const { return work_->remarks(); }

Volume apply_hierarchical(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution,
                          TreeOptions const& options) {
    for (Volume const& input : inputs)
        if (input.header().kind != Kind::hierarchical) refuse_tree(operation, "its inputs are of both kinds");
    TreeRun run(operation, collect(inputs, [](Volume const& input) { return BrickSequence(input); }), execution, {},
                options);
    return run.bricks(run.plan().output).whole();
}

void reduce_hierarchical(Operation& reduction, BrickSequence bricks, Execution const& execution,
                         StageInfo const& info) {
    Header const header = bricks.header();
    Plan const plan = begun(reduction, {&header, 1});
    std::size_t const largest = bricks.largest_brick();
    TreeWork const work = tree_work(Shape::reduction, plan, {&header, 1}, {&largest, 1}, execution);
    if (plan.scans) bricks = spooled(std::move(bricks), work.keep, execution, info);
    do scan_bricks(reduction, bricks, execution, info.times.get());
    while (reduction.scans_again());
}

} // namespace vkt
