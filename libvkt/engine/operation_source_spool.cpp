// Results that are whole only at the end: made rows by rows, or line pass by line pass, in a spool.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/cut.h"
#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/operation_source.h"
#include "libvkt/engine/spool.h"
#include "libvkt/engine/stopwatch.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <optional>

namespace vkt {

/// Rows by rows through all slices, so that the inputs' slices come in order and what an operation keeps of them is
/// small; the result is whole only then.
void OperationSource::compute_bands() {
    // The budget has room for a result that is made at once.
    std::size_t const in_memory = plan_.whole ? plan_.output.bytes() : execution_.memory / 8;
    auto result = std::make_unique<Spool>(plan_.output, in_memory, execution_, info_);
    Index3 const n = plan_.output.dims;
    for_each_piece(box_of(n), {n.z, work_.cut.rows}, [&](Box const& band) {
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            inputs_[i]->expect(
                intersect(operation_.footprint(band, static_cast<int>(i)), box_of(inputs_[i]->header().dims)));
        for_each_piece(band, work_.cut, [&](Box const& box) {
            AnyView const to = result->place(box);
            run(to);
            result->store(to);
        });
    });
    result_ = std::move(result);
}

/// Lines along x as the input comes, along y with them if slices are whole, along z and all others from the spool.
void OperationSource::compute_lines(LinePasses& passes) {
    auto result = std::make_unique<Spool>(plan_.output, 0, execution_, info_);
    Box const whole = box_of(plan_.output.dims), region = passes.lines();
    bool const slices = work_.cut.rows == plan_.output.dims.y;
    std::optional<ProgressPart> share(std::in_place, ProgressPart::OfCall{}, execution_.monitor, 0.0, 0.5);
    inputs_.front()->expect(region);
    for_each_piece(whole, work_.cut, [&](Box const& box) {
        ProgressPart const part = part_of(execution_.monitor, whole, box);
        AnyView const to = result->place(box);
        Box const inside = intersect(box, region);
        on_lines(to, passes, Axis::x);
        if (slices && !inside.empty()) on_lines(to.part(inside), passes, Axis::y);
        result->store(to);
    });
    auto const pass = [&](Axis axis, Index3 block, double from, double step) {
        share.reset();
        share.emplace(ProgressPart::OfCall{}, execution_.monitor, from, step);
        Index3 const n = region.dims();
        std::int64_t const all =
            (n.x + block.x - 1) / block.x * ((n.y + block.y - 1) / block.y) * ((n.z + block.z - 1) / block.z);
        std::int64_t done = 0;
        for (std::int64_t z = region.lower.z; z < region.upper.z; z += block.z)
            for (std::int64_t y = region.lower.y; y < region.upper.y; y += block.y)
                for (std::int64_t x = region.lower.x; x < region.upper.x; x += block.x) {
                    ProgressPart const part(execution_.monitor, done++, 1, all);
                    AnyView const lines = result->take(intersect(region, {{x, y, z}, Index3{x, y, z} + block}));
                    on_lines(lines, passes, axis);
                    result->store(lines);
                }
    };
    if (!region.empty()) {
        if (!slices) pass(Axis::y, work_.lines->along_y, 0.5, 0.2);
        pass(Axis::z, work_.lines->along_z, 0.7, 0.25);
    }
    result_ = std::move(result);
}

/// One pass over voxels on the host, where it runs; along x from the input.
void OperationSource::on_lines(AnyView voxels, LinePasses& passes, Axis axis) {
    select_gpu(execution_);
    ConstView in = dense_view(static_cast<std::byte const*>(nullptr), inputs_.front()->header().dtype, Box{});
    if (axis == Axis::x) {
        Box const inside = intersect(voxels.box, passes.lines());
        if (!inside.empty()) in = fetch(0, inside);
        if (info_.times) info_.times->voxels += voxels.box.voxels();
    }
    AnyView at = voxels;
    if (execution_.space() != Space::host) {
        staging_.reserve(voxels.bytes());
        at = dense_view(staging_.write(execution_.space()), voxels.type, voxels.box, execution_.space());
        if (axis != Axis::x) copy_region(voxels, at, execution_);
    }
    Stopwatch const watch(info_.times ? &info_.times->compute : nullptr);
    if (axis == Axis::x)
        passes.pass_x(in, at, execution_);
    else
        passes.pass(axis, at, execution_);
    if (at.space != Space::host) copy_region(at, voxels, execution_);
}

} // namespace vkt
