// Slabs as they are asked for: what they need is fetched, and they are computed in pieces, on the device of the stage.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/operation_source.h"

#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/stopwatch.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <utility>

namespace vkt {

namespace {

double bytes_of(Box const& box, Header const& header) {
    return static_cast<double>(box.voxels()) * static_cast<double>(size_of(header.dtype));
}

} // namespace

ConstView OperationSource::fetch(std::size_t i, Box const& footprint) {
    Stopwatch const watch(info_.times ? &info_.times->input : nullptr);
    Input& input = *inputs_[i];
    if (input.space() == execution_.space() && box_of(input.header().dims).contains(footprint))
        if (auto const lent = input.borrow(footprint)) return *lent;
    // Who jumps comes back: whole slices stay in the window where columns of them would be read again.
    Box slices = box_of(input.header().dims);
    slices.lower.z = footprint.lower.z;
    slices.upper.z = footprint.upper.z;
    if (plan_.access == Access::random && slices.contains(footprint) && box_of(input.header().dims).contains(slices) &&
        bytes_of(slices, input.header()) <= share_of_memory())
        return input.window.fetch(input, slices, execution_).part(footprint);
    return input.window.fetch(input, footprint, execution_);
}

void OperationSource::read(AnyView out) {
    if (made_) return copy_region(made_->view().part(out.box), out, execution_);
    if (plan_.shift) {
        AnyView const to = out.moved_to(out.box.lower + *plan_.shift);
        if (auto const lent = inputs_.front()->borrow(to.box))
            copy_region(*lent, to, execution_);
        else
            inputs_.front()->read(to);
        return;
    }
    if (work_.bands && !result_) {
        if (work_.lines)
            compute_lines(dynamic_cast<LinePasses&>(operation_));
        else
            compute_bands();
    }
    if (result_) return result_->read(out);
    if (plan_.carries) return run_in_order(out);
    if (execution_.device == Device::gpu && (out.space == Space::host || out.dims().z < work_.cut.slices))
        return run_on_gpu(out);
    begins_ = false;
    compute(out);
}

void OperationSource::compute(AnyView out) {
    // Large requests (a consumer that wants the whole volume) are still worked in pieces, so windows stay small.
    std::int64_t const height = work_.cut.slices;
    bool const down = descends(out.box);
    std::int64_t const count = (out.dims().z + height - 1) / height;
    for (std::int64_t i = 0; i < count; ++i) {
        std::int64_t const z = out.box.lower.z + (down ? count - 1 - i : i) * height;
        Box slab = out.box;
        slab.lower.z = z;
        slab.upper.z = std::min(z + height, out.box.upper.z);
        ProgressPart const share(execution_.monitor, i, 1, count);
        for_each_piece(slab, {slab.upper.z, work_.cut.rows}, [&](Box const& box) { run_in_pieces(out.part(box)); });
    }
}

/// Consumers on the host ask for slabs that suit their caches, and those on the GPU for slabs that suit them; the GPU
/// computes larger ones, of which these are copied.
void OperationSource::run_on_gpu(AnyView out) {
    Index3 const n = plan_.output.dims;
    bool const slabs = out.box.lower.x == 0 && out.box.lower.y == 0 && out.box.upper.x == n.x && out.box.upper.y == n.y;
    // Who asks for slices from above comes to those at 0 last.
    bool const begins = std::exchange(begins_, false) && out.box.lower.z == 0;
    bool const follows = begins || (out.box.lower.z >= ahead_box_.lower.z && out.box.lower.z <= ahead_box_.upper.z &&
                                    !ahead_box_.empty());
    if (!slabs || !follows || inputs_.empty() || descends(box_of(n))) return compute(out);
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z;) {
        if (z < ahead_box_.lower.z || z >= ahead_box_.upper.z) {
            std::int64_t const end = std::min(std::max(expected_end_, out.box.upper.z), n.z);
            ahead_box_ = {{0, 0, z}, {n.x, n.y, std::min(z + work_.cut.slices, end)}};
            ahead_.reserve(static_cast<std::size_t>(ahead_box_.voxels()) * size_of(out.type));
            compute(dense_view(ahead_.write(Space::device), out.type, ahead_box_, Space::device));
        }
        Box part = out.box;
        part.lower.z = z;
        part.upper.z = z = std::min(out.box.upper.z, ahead_box_.upper.z);
        ConstView const made = dense_view(ahead_.read(Space::device), out.type, ahead_box_, Space::device);
        copy_region(made.part(part), out.part(part), execution_);
    }
}

/// True if slices further up are made of slices of the first input further down, as in flips: these are computed from
/// above, so that the input's slices are asked for in ascending order always. Stages before may keep what came last.
bool OperationSource::descends(Box const& region) const {
    if (plan_.access != Access::random || inputs_.empty()) return false;
    Box first = region, last = region;
    first.upper.z = first.lower.z + 1;
    last.lower.z = last.upper.z - 1;
    return operation_.footprint(first, 0).lower.z > operation_.footprint(last, 0).lower.z;
}

/// Computes all rows from the next one to the last that is asked for.
void OperationSource::run_in_order(AnyView out) {
    Index3 const n = plan_.output.dims;
    while (done_z_ < out.box.upper.z - 1 || (done_z_ == out.box.upper.z - 1 && done_y_ < out.box.upper.y)) {
        Box box{{0, done_y_, done_z_}, {n.x, n.y, done_z_ + 1}};
        bool const last = done_z_ == out.box.upper.z - 1;
        box.upper.y = std::min(done_y_ + work_.cut.rows, last ? out.box.upper.y : n.y);
        if (done_y_ == 0 && box.upper.y == n.y) {
            std::int64_t const slices = out.box.upper.y == n.y ? out.box.upper.z : out.box.upper.z - 1;
            box.upper.z = std::clamp(slices, done_z_ + 1, done_z_ + work_.cut.slices);
            // Slices before the first that is asked for on their own: the others need no copy.
            if (done_z_ < out.box.lower.z) box.upper.z = std::min(box.upper.z, out.box.lower.z);
        }
        if (out.box.contains(box)) {
            run(out.part(box));
        } else {
            passed_.reserve(static_cast<std::size_t>(box.voxels()) * size_of(out.type));
            AnyView const passed = dense_view(passed_.write(out.space), out.type, box, out.space);
            run(passed);
            Box const wanted = intersect(box, out.box);
            if (!wanted.empty()) copy_region(passed.part(wanted), out.part(wanted), execution_);
        }
        done_y_ = box.upper.y < n.y ? box.upper.y : 0;
        done_z_ = box.upper.y < n.y ? box.lower.z : box.upper.z;
    }
}

/// What jumps may look at much of its input for a slab: then it is worked in pieces whose footprints fit the memory.
void OperationSource::run_in_pieces(AnyView out) {
    Index3 const n = out.dims();
    if (plan_.access == Access::random && !out.box.empty() && n.x * n.y * n.z > 1) {
        double bytes = 0;
        for (std::size_t i = 0; i < inputs_.size(); ++i)
            bytes += bytes_of(operation_.footprint(out.box, static_cast<int>(i)), inputs_[i]->header());
        if (bytes > share_of_memory()) {
            int const axis = n.z > 1 ? 2 : n.y >= n.x ? 1 : 0;
            Box first = out.box, second = out.box;
            first.upper[axis] = second.lower[axis] = out.box.lower[axis] + n[axis] / 2;
            run_in_pieces(out.part(first));
            return run_in_pieces(out.part(second));
        }
    }
    run(out);
}

void OperationSource::run(AnyView out) {
    auto const slices = [&out](std::int64_t begin, std::int64_t end) {
        Box box = out.box;
        box.lower.z = std::clamp(begin, out.box.lower.z, out.box.upper.z);
        box.upper.z = std::clamp(end, box.lower.z, out.box.upper.z);
        return out.part(box);
    };
    Slices const count = counted_.value_or(Slices{out.box.lower.z, out.box.upper.z});
    Slices const all{out.box.lower.z, out.box.upper.z};
    std::int64_t const begin = std::max(count.begin, all.begin), end = std::min(std::max(count.end, begin), all.end);
    run_uncounted(slices(all.begin, begin));
    bool const met = seen_.begin < end && begin < seen_.end;
    run_counted(slices(begin, met ? seen_.begin : end));
    if (met) {
        run_uncounted(slices(std::max(begin, seen_.begin), std::min(end, seen_.end)));
        run_counted(slices(std::max(begin, seen_.end), end));
    }
    run_uncounted(slices(end, all.end));
    Index3 const n = plan_.output.dims;
    bool const whole = out.box.lower.x == 0 && out.box.lower.y == 0 && out.box.upper.x == n.x && out.box.upper.y == n.y;
    if (!whole || begin >= end) return;
    if (seen_.begin == seen_.end)
        seen_ = {begin, end};
    else if (begin <= seen_.end && end >= seen_.begin)
        seen_ = {std::min(seen_.begin, begin), std::max(seen_.end, end)};
}

void OperationSource::run_counted(AnyView out) {
    operation_.computed += out.box.voxels();
    compute_region(out);
}

void OperationSource::run_uncounted(AnyView out) {
    if (out.box.empty()) return;
    std::vector<std::int64_t> before;
    for (std::int64_t const* const counter : operation_.counters()) before.push_back(*counter);
    compute_region(out);
    std::vector<std::int64_t*> const counters = operation_.counters();
    for (std::size_t i = 0; i < counters.size(); ++i) *counters[i] = before[i];
}

void OperationSource::compute_region(AnyView out) {
    if (out.box.empty()) return;
    select_gpu(execution_);
    std::vector<ConstView> views;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        Box const footprint = operation_.footprint(out.box, static_cast<int>(i));
        // Empty: the operation has seen all that it needs.
        views.push_back(footprint.empty()
                            ? dense_view(static_cast<std::byte const*>(nullptr), inputs_[i]->header().dtype, footprint)
                            : fetch(i, footprint));
    }
    // What is computed once and for all does not belong to the part of it that is asked for first.
    bool const once = plan_.whole && out.box == box_of(plan_.output.dims);
    ProgressPart const share = once ? ProgressPart(ProgressPart::OfCall{}, execution_.monitor, 0.0, 0.95)
                                    : ProgressPart(execution_.monitor, 0.0, 1.0);
    Stopwatch const watch(info_.times ? &info_.times->compute : nullptr);
    if (info_.times) info_.times->voxels += out.box.voxels();
    if (out.space == execution_.space()) {
        operation_.run(views, out, execution_);
        return;
    }
    staging_.reserve(out.bytes());
    AnyView const staged = dense_view(staging_.write(execution_.space()), out.type, out.box, execution_.space());
    operation_.run(views, staged, execution_);
    copy_region(staged, out, execution_);
}

} // namespace vkt
