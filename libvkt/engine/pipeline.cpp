// Attaching, draining, reducing, loading.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/pipeline.h"

#include "libvkt/amr/apply.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/link.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace vkt {
namespace {

/// A slab this large for every four threads, up to sixteen, amortises system calls and hand-over and still stays in the
/// caches on its way (measured: on 2 processors 2 MiB are slower than 1, on 16 1 MiB is slower than 4).
constexpr std::size_t slab_bytes = std::size_t{1} << 20;

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

void tell_remarks(Operation const& operation, StageInfo const& info) {
    if (!info.listener) return;
    for (auto const& remark : operation.remarks()) info.listener(info.name, remark.message, remark.lossy);
}

} // namespace

BrickSequence Source::take_bricks() { throw Error(ErrorKind::failure, "the source yields no hierarchical volumes"); }

void Sink::put_bricks(BrickSequence) {
    throw Error(ErrorKind::usage, "this output cannot hold a hierarchical volume",
                "make a grid of it with 'vkt resample', or write a .vkt or .vdb file");
}

std::int64_t slab_height(Header const& header, std::int64_t hint, Execution const& execution) {
    std::int64_t const n = header.dims.z;
    if (execution.slab > 0) return std::min(execution.slab, n);
    std::size_t const slice = static_cast<std::size_t>(header.dims.x * header.dims.y) * size_of(header.dtype);
    auto const shares = static_cast<std::size_t>(std::min(share_of_threads(execution.threads), 4));
    auto const natural = static_cast<std::int64_t>(std::max<std::size_t>(1, shares * slab_bytes / slice));
    auto const most = static_cast<std::int64_t>(std::max<std::size_t>(1, execution.memory / 8 / slice));
    return std::clamp<std::int64_t>(hint > 0 ? hint : natural, 1, std::min(n, most));
}

std::unique_ptr<Source> attach(std::vector<std::unique_ptr<Source>> inputs, Operation& operation,
                               Execution const& execution, StageInfo info) {
    return std::make_unique<Link>(std::move(inputs), operation, execution, std::move(info));
}

void scan_volume(Source& source, Operation& operation, Execution const& execution, StageTimes* times) {
    Header const& header = source.header();
    std::int64_t const height = slab_height(header, source.natural_slab(), execution);
    Execution host = execution;
    host.device = Device::cpu; // scans read where the data arrives
    Buffer buffer;
    Box const part = operation.scanned(box_of(header.dims));
    source.expect(part);
    for (std::int64_t z = part.lower.z, end = 0; z < part.upper.z; z = end) {
        end = std::min((z / height + 1) * height, part.upper.z); // as slabs of the whole volume would lie
        Box const box{{part.lower.x, part.lower.y, z}, {part.upper.x, part.upper.y, end}};
        auto const begin = std::chrono::steady_clock::now();
        std::optional<ConstView> view;
        if (source.space() == Space::host) view = source.borrow(box);
        if (!view) {
            buffer.reserve(static_cast<std::size_t>(box.voxels()) * size_of(header.dtype));
            AnyView const slab = dense_view(buffer.write(Space::host), header.dtype, box);
            source.read(slab);
            view = slab;
        }
        auto const middle = std::chrono::steady_clock::now();
        operation.scan(*view, host);
        if (times != nullptr) {
            times->input += std::chrono::duration<double>(middle - begin).count();
            times->compute += std::chrono::duration<double>(std::chrono::steady_clock::now() - middle).count();
            times->voxels += box.voxels();
        }
    }
    operation.scan_end();
}

Execution beside_neighbours(Execution execution, Plan const& plan, StageInfo const& info) {
    constexpr double bound_by_memory = 4; // multiply-adds a voxel
    if (info.among_processes && plan.cost <= bound_by_memory) execution.threads = share_of_threads(execution.threads);
    return execution;
}

void reduce(Source& source, Operation& reduction, Execution const& execution, StageInfo const& info) {
    std::vector<Header> const headers{source.header()};
    Plan const plan = reduction.plan(headers);
    if (info.on_plan) info.on_plan(plan, headers);
    if (headers.front().dry_run) return;
    if (headers.front().kind == Kind::hierarchical) {
        reduce_hierarchical(reduction, load(source, execution), execution);
        return tell_remarks(reduction, info);
    }
    scan_volume(source, reduction, beside_neighbours(execution, plan, info), info.times.get());
    source.finish();
    tell_remarks(reduction, info);
}

void drain_volume(Source& source, Sink& sink, Execution const& execution) {
    Header const header = source.header();
    sink.begin(header);
    if (header.kind == Kind::hierarchical && !header.dry_run) {
        sink.put_bricks(source.take_bricks());
    } else if (!header.dry_run) {
        std::int64_t hint = source.natural_slab();
        if (hint == 0) hint = sink.natural_slab();
        std::int64_t const height = slab_height(header, hint, execution);
        source.expect(box_of(header.dims));
        for (std::int64_t z = 0; z < header.dims.z; z += height) {
            Box const box{{0, 0, z}, {header.dims.x, header.dims.y, std::min(z + height, header.dims.z)}};
            if (auto const lease = source.lease(box); lease && sink.pass_on(box, lease)) continue;
            source.read(sink.acquire(box));
            sink.commit();
        }
    }
    source.finish();
    sink.end();
}

void drain(Source& source, Sink& sink, Execution const& execution) {
    while (source.next_volume()) drain_volume(source, sink, execution);
    sink.close();
}

Volume load(Source& source, Execution const& execution) {
    Header header = source.header();
    std::size_t const bytes = header.bytes();
    if (bytes > execution.memory)
        throw Error(ErrorKind::resources,
                    text("the volume needs ", bytes_text(static_cast<double>(bytes)), " of memory, the budget is ",
                         bytes_text(static_cast<double>(execution.memory))),
                    "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
    if (header.kind == Kind::hierarchical) {
        Volume tree = source.take_bricks().whole();
        source.finish();
        return tree;
    }
    if (auto whole = source.take_whole()) return std::move(*whole);
    Volume volume(header);
    source.expect(box_of(header.dims));
    source.read(volume.mutable_view());
    source.finish();
    return volume;
}

std::unique_ptr<Source> volume_source(std::vector<Volume> volumes) {
    return std::make_unique<VolumeSource>(std::move(volumes));
}

Volume apply(Operation& operation, std::vector<Volume> const& inputs, Execution const& execution) {
    auto sources = collect(inputs, [](Volume const& input) { return volume_source({input}); });
    auto const result = attach(std::move(sources), operation, execution, {});
    result->next_volume();
    return load(*result, execution);
}

} // namespace vkt
