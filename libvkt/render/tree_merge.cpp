// Neighbouring bricks joined: along x, then y, then z.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tree_merge.h"

#include "libvkt/amr/tree.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <tuple>

namespace vkt::render {

namespace {

/// Joins along one axis; `into` follows.
void join_along(int axis, Index3 logical, std::vector<Brick>& bricks, std::vector<std::int32_t>& into) {
    int const one = (axis + 1) % 3, two = (axis + 2) % 3;
    std::vector<std::int32_t> order(bricks.size());
    std::iota(order.begin(), order.end(), 0);
    auto const key = [&](std::int32_t id) {
        Brick const& b = bricks[static_cast<std::size_t>(id)];
        return std::tuple(b.level, b.lower[one], b.lower[two], b.dims[one], b.dims[two], b.lower[axis]);
    };
    std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return key(a) < key(b); });
    std::vector<Brick> joined;
    std::vector<std::int32_t> to(bricks.size());
    for (std::int32_t const id : order) {
        Brick const& next = bricks[static_cast<std::size_t>(id)];
        bool fits = false;
        if (!joined.empty()) {
            Brick const& last = joined.back();
            std::int64_t const width = cell_width(logical, next.level)[axis];
            fits = last.level == next.level && last.lower[one] == next.lower[one] &&
                   last.lower[two] == next.lower[two] && last.dims[one] == next.dims[one] &&
                   last.dims[two] == next.dims[two] && last.lower[axis] + last.dims[axis] * width == next.lower[axis] &&
                   last.dims[axis] + next.dims[axis] <= widest_joined;
        }
        if (fits)
            joined.back().dims[axis] += next.dims[axis];
        else
            joined.push_back(next);
        to[static_cast<std::size_t>(id)] = static_cast<std::int32_t>(joined.size() - 1);
    }
    bricks = std::move(joined);
    for (std::int32_t& i : into) i = to[static_cast<std::size_t>(i)];
}

} // namespace

JoinedBricks join_bricks(Volume const& volume, Execution const& execution) {
    Header const& header = volume.header();
    BrickTable const& from = volume.bricks();
    std::vector<Brick> bricks = from.list();
    std::vector<std::int32_t> into(from.size());
    std::iota(into.begin(), into.end(), 0);
    for (int axis = 0; axis < 3; ++axis) join_along(axis, header.dims, bricks, into);
    if (2 * bricks.size() > from.size()) {
        std::iota(into.begin(), into.end(), 0);
        return {volume, std::move(into)};
    }
    Volume joined(header, bricks);
    std::byte const* const data = volume.buffer().read(Space::host);
    std::byte* const out = joined.buffer().write(Space::host);
    auto const size = size_of(header.dtype);
    auto const count = static_cast<std::int64_t>(from.size());
#pragma omp parallel for num_threads(execution.threads) schedule(static)
    for (std::int64_t i = 0; i < count; ++i) {
        auto const b = static_cast<std::size_t>(i);
        Brick const& brick = from[b];
        auto const m = static_cast<std::size_t>(into[b]);
        Brick const& whole = joined.bricks()[m];
        Index3 const w = cell_width(header.dims, brick.level);
        Index3 at;
        for (int a = 0; a < 3; ++a) at[a] = (brick.lower[a] - whole.lower[a]) / w[a];
        for (std::int64_t z = 0; z < brick.dims.z; ++z)
            for (std::int64_t y = 0; y < brick.dims.y; ++y) {
                std::int64_t const source = volume.brick_offset(b) + (z * brick.dims.y + y) * brick.dims.x;
                std::int64_t const target =
                    joined.brick_offset(m) + ((at.z + z) * whole.dims.y + at.y + y) * whole.dims.x + at.x;
                std::memcpy(out + static_cast<std::size_t>(target) * size,
                            data + static_cast<std::size_t>(source) * size,
                            static_cast<std::size_t>(brick.dims.x) * size);
            }
    }
    return {std::move(joined), std::move(into)};
}

} // namespace vkt::render
