// Sliding windows.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/window.h"

#include "libvkt/engine/cut.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vkt {

namespace {

/// The first slices of a region that lie in memory, as many as a few questions find.
std::optional<ConstView> first_lent(Source& source, Box region) {
    for (std::int64_t slices = region.dims().z; slices > 0; slices /= 2) {
        region.upper.z = region.lower.z + slices;
        if (auto lent = source.borrow(region)) return lent;
    }
    return std::nullopt;
}

} // namespace

void read_across(Source& source, AnyView to, Buffer& staging, Execution const& execution) {
    if (source.space() == to.space) {
        if (auto const lent = source.borrow(to.box))
            copy_region(*lent, to, execution);
        else
            source.read(to);
        return;
    }
    // To a GPU, or from one, in pieces: those that a source hands out, of which it may hold other slabs.
    Header piece;
    piece.dims = to.box.dims();
    piece.dtype = to.type;
    for_each_piece(to.box, cut_of(piece, source.natural_slab(), execution), [&](Box rest) {
        while (!rest.empty()) {
            auto const lent = first_lent(source, rest);
            if (!lent) break;
            copy_region(*lent, to.part(lent->box), execution);
            rest.lower.z = lent->box.upper.z;
        }
        if (rest.empty()) return;
        AnyView const small = to.part(rest);
        staging.reserve(small.bytes());
        AnyView const staged = dense_view(staging.write(source.space()), to.type, rest, source.space());
        source.read(staged);
        copy_region(staged, small, execution);
    });
}

Box Window::with_fold_sources(Box region) const {
    for (int axis = 0; axis < (rule_.boundary == Boundary::wrap ? 1 : 2); ++axis) {
        std::int64_t const n = rule_.volume_dims[axis];
        Box const asked = region;
        auto const include = [&](std::int64_t from, std::int64_t to) {
            for (std::int64_t i = from; i < to; ++i) {
                std::int64_t const source = fold(i, n, rule_.boundary);
                if (source < 0) continue;
                region.lower[axis] = std::min(region.lower[axis], source);
                region.upper[axis] = std::max(region.upper[axis], source + 1);
            }
        };
        include(asked.lower[axis], std::min<std::int64_t>(0, asked.upper[axis]));
        include(std::max(n, asked.lower[axis]), asked.upper[axis]);
    }
    return region;
}

ConstView Window::fetch(Source& source, Box const& asked, Execution const& execution) {
    Box const region = rule_.with_mirrored(with_fold_sources(asked));
    Box kept{};
    bool const same_columns = held_.lower.x == region.lower.x && held_.upper.x == region.upper.x &&
                              held_.lower.y == region.lower.y && held_.upper.y == region.upper.y;
    if (same_columns) kept = intersect(held_, region);
    if (kept.empty()) kept = {region.lower, {region.upper.x, region.upper.y, region.lower.z}};
    shift_to(region, kept, execution.space());

    // Slices inside the volume that are new, below and above those kept.
    std::int64_t const first = std::max<std::int64_t>(region.lower.z, 0);
    std::int64_t const last = std::min(region.upper.z, rule_.volume_dims.z);
    if (kept.lower.z == kept.upper.z) {
        read_slices(source, first, last, first, execution);
    } else {
        read_slices(source, first, std::min(kept.lower.z, last), first, execution);
        std::int64_t const next = std::max(kept.upper.z, first);
        read_slices(source, next, last, next, execution);
    }
    fill_outer_slices(source, kept.lower.z, kept.upper.z, execution);
    held_ = region;
    return whole_.part(asked);
}

void Window::shift_to(Box const& region, Box const& kept, Space space) {
    Index3 const n = region.dims();
    std::size_t const size = size_of(rule_.type);
    std::size_t const bytes = static_cast<std::size_t>(n.x * n.y * n.z) * size;
    bool const keep = kept.lower.z < kept.upper.z;
    if (!keep) buffer_.reserve(std::max(bytes, rule_.most_bytes)); // once, not growing: no second one beside it then
    if (keep && bytes <= buffer_.bytes() && space == Space::host) {
        // Whole slices: one move of contiguous memory.
        std::size_t const slice = static_cast<std::size_t>(n.x * n.y) * size;
        std::byte* const data = buffer_.update(space);
        std::memmove(data + static_cast<std::size_t>(kept.lower.z - region.lower.z) * slice,
                     data + static_cast<std::size_t>(kept.lower.z - held_.lower.z) * slice,
                     static_cast<std::size_t>(kept.upper.z - kept.lower.z) * slice);
    } else if (keep) {
        spare_.reserve(std::max(bytes, rule_.most_bytes));
        AnyView const next = dense_view(spare_.write(space), rule_.type, region, space);
        Execution on{};
        on.device = space == Space::device ? Device::gpu : Device::cpu;
        copy_region(whole_.part(kept), next.part(kept), on);
        std::swap(buffer_, spare_);
        if (space == Space::host) spare_ = Buffer(); // moved within the new one from now on
    }
    whole_ = dense_view(keep ? buffer_.update(space) : buffer_.write(space), rule_.type, region, space);
}

/// Fills the window's slices z0…z1 with those of the volume from from_z on, and what lies beside these.
void Window::read_slices(Source& source, std::int64_t z0, std::int64_t z1, std::int64_t from_z,
                         Execution const& execution) {
    if (z0 >= z1) return;
    Box slices = whole_.box;
    slices.lower.z = z0;
    slices.upper.z = z1;
    Index3 const n = rule_.volume_dims;
    Box filled = intersect(slices, {{0, 0, z0}, {n.x, n.y, z1}});       // with voxels of the volume
    bool const all_rows = slices.lower.y <= 0 && slices.upper.y >= n.y; // what lies outside has its twins here
    if (rule_.boundary == Boundary::wrap && !all_rows) {
        filled.lower.y = slices.lower.y;
        filled.upper.y = slices.upper.y;
    }
    std::int64_t const end = filled.empty() ? filled.lower.y : filled.upper.y;
    for (std::int64_t y = filled.lower.y, next = y; y < end; y = next) { // a part for each time that it wraps around
        std::int64_t const from = fold(y, n.y, rule_.boundary);
        next = std::min(end, y + n.y - from);
        Box const part{{filled.lower.x, from, from_z}, {filled.upper.x, from + next - y, from_z + z1 - z0}};
        read_part(source, part, {filled.lower.x, y, z0}, execution);
    }
    if (!(filled == slices)) fill_border(view(slices), filled, n, rule_.boundary, rule_.border_value, execution);
}

/// Reads `part` of the source to the window's voxels from `target` on.
void Window::read_part(Source& source, Box const& part, Index3 target, Execution const& execution) {
    read_across(source, view({target, target + part.dims()}).moved_to(part.lower), staging_, execution);
}

/// Slices of the window that lie below or above the volume and were not kept.
void Window::fill_outer_slices(Source& source, std::int64_t kept0, std::int64_t kept1, Execution const& execution) {
    Box const region = whole_.box;
    for (std::int64_t z = region.lower.z; z < region.upper.z; ++z) {
        if (z >= 0 && z < rule_.volume_dims.z) {
            z = rule_.volume_dims.z - 1;
            continue;
        }
        if (z >= kept0 && z < kept1) continue;
        Box slice = region;
        slice.lower.z = z;
        slice.upper.z = z + 1;
        std::int64_t const from = fold(z, rule_.volume_dims.z, rule_.boundary);
        if (from >= 0 && from >= region.lower.z && from < region.upper.z) {
            Box twin = slice;
            twin.lower.z = from;
            twin.upper.z = from + 1;
            copy_region(view(twin), view(slice).moved_to(twin.lower), execution);
            continue;
        }
        if (from >= 0)
            read_slices(source, z, z + 1, from, execution);
        else
            fill_border(view(slice), {}, rule_.volume_dims, rule_.boundary, rule_.border_value, execution);
    }
}

} // namespace vkt
