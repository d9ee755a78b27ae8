// Attaching, draining, reducing, loading.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/pipeline.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/engine/operation_source.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/tree_run.h"
#include "libvkt/engine/window.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace vkt {
namespace {

class VolumeSource : public Source {
public:
    explicit VolumeSource(std::vector<Volume> volumes) : volumes_(std::move(volumes)) {}

    bool next_volume() override { return ++next_ <= volumes_.size(); }
    Header const& header() const override { return current().header(); }
    Access access() const override { return Access::random; }
    void read(AnyView out) override { copy_region(current().view().part(out.box), out, {}); }
    std::optional<ConstView> borrow(Box const& region) override { return current().view().part(region); }
    BrickSequence take_bricks() override { return current(); }
    void finish() override {}

private:
    Volume const& current() const { return volumes_[next_ - 1]; }

    std::vector<Volume> volumes_;
    std::size_t next_ = 0;
};

class BrickSource : public Source {
public:
    explicit BrickSource(BrickSequence bricks) : header_(bricks.header()), bricks_(std::move(bricks)) {}

    bool next_volume() override { return !std::exchange(begun_, true); }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void read(AnyView) override { throw Error(ErrorKind::failure, "bricks are not read region by region"); }
    BrickSequence take_bricks() override { return std::move(bricks_); }
    void finish() override {}

private:
    Header header_;
    BrickSequence bricks_;
    bool begun_ = false;
};

/// Multiply-adds a voxel up to which memory is what slows an operation down.
constexpr double bound_by_memory = 4;

/// All passes that a reduction wants.
void scan_passes(Source& source, Operation& reduction, Execution const& execution, StageTimes* times) {
    do scan_volume(source, reduction, execution, times);
    while (reduction.scans_again());
}

/// Pieces after which somebody who watches is told: a sixty-fourth of the volume, or what suits the source; and large
/// enough for stores past the caches, without which copying takes twice as long. What is slow tells more by itself.
Cut watched_cut(Header const& header, std::int64_t hint, Execution const& execution) {
    constexpr std::size_t least = std::size_t{128} << 20;
    Cut cut = cut_of(header, hint, execution);
    if (cut.rows < header.dims.y) return cut;
    std::size_t const slice = static_cast<std::size_t>(header.dims.x * header.dims.y) * size_of(header.dtype);
    std::int64_t const slices = std::max(header.dims.z / 64, static_cast<std::int64_t>(least / slice));
    cut.slices *= std::max<std::int64_t>(1, slices / cut.slices);
    return cut;
}

void tell_remarks(Operation const& operation, StageInfo const& info) {
    if (!info.listener) return;
    for (auto const& remark : operation.remarks()) info.listener(info.name, remark.message, remark.lossy);
}

} // namespace

void Operation::measure(Measurement& to) {
    Source& source = *to.inputs.front();
    while (source.next_volume()) {
        reduce(source, *this, to.execution, to.info);
        if (!source.header().dry_run) to.report(report());
    }
}

bool only_planned(Operation& reduction, Measurement& of) {
    auto const headers = collect(of.inputs, [](auto const& input) { return input->header(); });
    Plan plan = begun(reduction, headers);
    plan.output.dry_run = std::ranges::any_of(headers, [](Header const& header) { return header.dry_run; });
    if (of.info.on_plan) of.info.on_plan(plan, headers);
    if (!plan.output.dry_run) return false;
    for (auto const& input : of.inputs) input->finish();
    return true;
}

BrickSequence Source::take_bricks() { throw Error(ErrorKind::failure, "the source yields no hierarchical volumes"); }

void Sink::put_bricks(BrickSequence) {
    throw Error(ErrorKind::usage, "this output cannot hold a hierarchical volume",
                "make a grid of it with 'vkt resample', or write a .vkt or .vdb file");
}

std::unique_ptr<Source> attach(std::vector<std::unique_ptr<Source>> inputs, Operation& operation,
                               Execution const& execution, StageInfo info) {
    return std::make_unique<OperationSource>(std::move(inputs), operation, execution, std::move(info));
}

Execution where_looked_at(Execution execution, bool on_gpu_already) {
    bool const gpu = execution.device == Device::gpu || (execution.device == Device::automatic && on_gpu_already);
    execution.device = gpu ? Device::gpu : Device::cpu;
    select_gpu(execution);
    return execution;
}

namespace {

Execution scanning(Source& source, Operation const& operation, Execution execution) {
    if (!operation.scans_on_gpu()) {
        if (execution.only_gpu) refuse_cpu(text("the look at all voxels that ", operation.name(), " takes first"));
        execution.device = Device::cpu;
    }
    return where_looked_at(std::move(execution), source.space() == Space::device);
}

} // namespace

void scan_volume(Source& source, Operation& operation, Execution const& execution, StageTimes* times) {
    Header const& header = source.header();
    Execution const on = scanning(source, operation, execution);
    Buffer buffer;
    Window window;
    window.reset({.volume_dims = header.dims, .type = header.dtype});
    Box const part = operation.scanned(box_of(header.dims));
    Cut cut = cut_of(header, slab_hint_on(on, header, source.natural_slab()), execution);
    if (cut.rows < header.dims.y) {
        std::int64_t const step = operation.scan_step(part.dims());
        cut.rows = std::max(cut.rows / step, std::int64_t{1}) * step;
    } else if (source.space() == Space::host && source.borrow(part)) {
        // What lies in memory as a whole has no way through the caches to keep to: fewer, larger pieces.
        std::size_t const slice = static_cast<std::size_t>(header.dims.x * header.dims.y) * size_of(header.dtype);
        auto const most = static_cast<std::int64_t>(piece_limit(execution) / slice);
        cut.slices = std::max(cut.slices, std::min(8 * cut.slices, most));
    }
    source.expect(part);
    for_each_piece(part, cut, [&](Box const& box) {
        ProgressPart const share = part_of(execution.monitor, part, box);
        auto const begin = std::chrono::steady_clock::now();
        std::optional<ConstView> view;
        if (source.space() == on.space()) view = source.borrow(box);
        if (!view && on.device == Device::gpu) view = window.fetch(source, box, on);
        if (!view) {
            buffer.reserve(static_cast<std::size_t>(box.voxels()) * size_of(header.dtype));
            AnyView const slab = dense_view(buffer.write(Space::host), header.dtype, box);
            source.read(slab);
            view = slab;
        }
        auto const middle = std::chrono::steady_clock::now();
        operation.scan(*view, on);
        if (times != nullptr) {
            times->input += std::chrono::duration<double>(middle - begin).count();
            times->compute += std::chrono::duration<double>(std::chrono::steady_clock::now() - middle).count();
            times->voxels += box.voxels();
        }
    });
    operation.scan_end();
}

Execution beside_neighbours(Execution execution, Plan const& plan, StageInfo const& info) {
    if (info.among_processes && plan.cost <= bound_by_memory) execution.threads = share_of_threads(execution.threads);
    return execution;
}

Execution on_whole_volumes(Execution execution, Operation const& operation, std::vector<Header> const& inputs) {
    bool const hierarchical =
        std::ranges::any_of(inputs, [](Header const& header) { return header.kind == Kind::hierarchical; });
    if (execution.slab > 0 || execution.device == Device::gpu || inputs.empty() || hierarchical) return execution;
    // There is no way through the caches to keep to, and slabs that stay in them cost twice: threads that meet after
    // every one, and stores that read what they overwrite.
    Plan const plan = operation.plan(inputs);
    bool const streams = plan.cost <= bound_by_memory && !plan.scans && !plan.carries && !plan.whole;
    if (streams && plan.output.kind == Kind::structured) execution.slab = plan.output.dims.z;
    return execution;
}

void refuse_cpu(std::string const& what) {
    throw Error(ErrorKind::usage, text("--device gpu: ", what, " does not run on a GPU"),
                "leave the choice to vkt: --device auto");
}

void reduce(Source& source, Operation& reduction, Execution const& execution, StageInfo const& info) {
    std::vector<Header> const headers{source.header()};
    bool const tree = headers.front().kind == Kind::hierarchical;
    Plan const plan = reduction.plan(headers);
    if (!tree) reduction.begin(headers, plan);
    if (info.on_plan) info.on_plan(plan, headers);
    if (headers.front().dry_run) return;
    if (tree) {
        reduce_hierarchical(reduction, source.take_bricks(), execution, info);
        source.finish();
        return tell_remarks(reduction, info);
    }
    Execution const beside = beside_neighbours(execution, plan, info);
    if (plan.scans && source.access() == Access::forward) {
        auto const again = spooled(source, 1, execution, info);
        scan_passes(*again, reduction, beside, info.times.get());
    } else {
        scan_passes(source, reduction, beside, info.times.get());
        source.finish();
    }
    tell_remarks(reduction, info);
}

void drain_volume(Source& source, Sink& sink, Execution const& execution) {
    Header const header = source.header();
    sink.begin(header);
    if (header.kind == Kind::hierarchical && !header.dry_run) {
        sink.put_bricks(source.take_bricks());
    } else if (!header.dry_run) {
        std::int64_t hint = source.natural_slab();
        // What comes from the host's caches in small slabs is gathered to what suits a GPU.
        bool const gathered = sink.space() == Space::device && source.space() == Space::host;
        if (hint == 0 || gathered) hint = std::max(hint, sink.natural_slab());
        Buffer staging;
        Cut const cut = cut_of(header, hint, execution);
        source.expect(box_of(header.dims));
        for_each_piece(box_of(header.dims), cut, [&](Box const& box) {
            ProgressPart const share = part_of(execution.monitor, box_of(header.dims), box);
            if (auto const lease = source.lease(box); lease && sink.pass_on(box, lease)) return;
            AnyView const to = sink.acquire(box);
            if (to.space == Space::device)
                read_across(source, to, staging, execution);
            else
                source.read(to);
            sink.commit();
        });
    }
    source.finish();
    sink.end();
}

void drain(Source& source, Sink& sink, Execution const& execution) {
    while (source.next_volume()) drain_volume(source, sink, execution);
    sink.close();
}

void check_budget(std::size_t bytes, Execution const& execution) {
    if (bytes <= execution.memory) return;
    throw Error(ErrorKind::resources,
                text("the volume needs ", bytes_text(static_cast<double>(bytes)), " of memory, the budget is ",
                     bytes_text(static_cast<double>(execution.memory))),
                "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
}

Volume load(Source& source, Execution const& execution) {
    Header header = source.header();
    check_budget(header.bytes(), execution);
    if (header.kind == Kind::hierarchical) {
        Volume tree = source.take_bricks().whole();
        source.finish();
        return tree;
    }
    if (auto whole = source.take_whole()) return std::move(*whole);
    Volume volume(header);
    source.expect(box_of(header.dims));
    if (execution.monitor == nullptr) {
        source.read(volume.mutable_view());
    } else {
        for_each_piece(box_of(header.dims), watched_cut(header, source.natural_slab(), execution), [&](Box const& box) {
            ProgressPart const share = part_of(execution.monitor, box_of(header.dims), box);
            source.read(volume.mutable_view().part(box));
        });
    }
    source.finish();
    return volume;
}

std::unique_ptr<Source> brick_source(BrickSequence bricks) { return std::make_unique<BrickSource>(std::move(bricks)); }

std::unique_ptr<Source> volume_source(std::vector<Volume> volumes) {
    return std::make_unique<VolumeSource>(std::move(volumes));
}

Volume apply(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution) {
    keep_blocks(execution.memory);
    auto sources = collect(inputs, [](Volume const& input) { return volume_source({input}); });
    auto const headers = collect(inputs, [](Volume const& input) { return input.header(); });
    Execution const whole = on_whole_volumes(execution, operation, headers);
    auto const result = attach(std::move(sources), operation, whole, {});
    result->next_volume();
    return load(*result, whole);
}

} // namespace vkt
