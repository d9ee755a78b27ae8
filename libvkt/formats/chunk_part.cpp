// Rows out of chunks.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/chunk_part.h"

#include <algorithm>
#include <cstring>

namespace vkt {
namespace {

constexpr std::int64_t piece = std::int64_t{256} << 10;  ///< that stays in a processor's own cache
constexpr std::int64_t together = std::int64_t{4} << 20; ///< bytes of slices

/// Rows of so many bytes, some from one to the next on either side. They are short: a call for each would cost as much
/// as its bytes.
void copy_rows(std::byte* to, std::int64_t to_step, std::byte const* from, std::int64_t from_step, std::int64_t bytes,
               std::int64_t count) {
    constexpr std::int64_t block = 64;
    if (bytes % block != 0 || bytes > 8 * block) {
        for (; count > 0; --count, to += to_step, from += from_step)
            std::memcpy(to, from, static_cast<std::size_t>(bytes));
        return;
    }
    for (; count > 0; --count, to += to_step, from += from_step)
        for (std::int64_t i = 0; i < bytes; i += block) std::memcpy(to + i, from + i, block);
}

/// Rows of a chunk, `row` bytes from one to the next, the first at byte `at`.
void read_rows(std::int64_t at, std::int64_t row, Box const& rows, AnyView const& out, std::vector<std::byte>& scratch,
               ReadChunk const& read) {
    std::int64_t const bytes = rows.dims().x * static_cast<std::int64_t>(size_of(out.type));
    std::int64_t const step = out.row * static_cast<std::int64_t>(size_of(out.type));
    std::int64_t const count = rows.dims().y * rows.dims().z;
    // Whole rows of the region that follow one another need no copy.
    bool const dense = bytes == row && step == row;
    std::int64_t const most = dense ? rows.dims().y : std::clamp<std::int64_t>(piece / row, 1, count);
    if (auto const room = static_cast<std::size_t>((most - 1) * row + bytes); !dense && scratch.size() < room)
        scratch.resize(room);
    std::int64_t y = rows.lower.y, z = rows.lower.z;
    for (std::int64_t i = 0; i < count; i += most) {
        std::int64_t const here = std::min(most, count - i);
        read(at + i * row, dense ? out.at(rows.lower.x, y, z) : scratch.data(),
             static_cast<std::size_t>((here - 1) * row + bytes));
        for (std::int64_t k = 0; k < here;) { // as far as the slice goes
            std::int64_t const n = std::min(here - k, rows.upper.y - y);
            if (!dense) copy_rows(out.at(rows.lower.x, y, z), step, scratch.data() + k * row, row, bytes, n);
            k += n;
            y += n;
            if (y == rows.upper.y) y = rows.lower.y, ++z;
        }
    }
}

} // namespace

void read_chunk_part(Index3 corner, Index3 extent, AnyView const& out, std::vector<std::byte>& scratch,
                     ReadChunk const& read) {
    auto const element = static_cast<std::int64_t>(size_of(out.type));
    Box const part = intersect(out.box, {corner, corner + extent});
    // Rows of whole slices follow one another.
    bool const slices = part.dims().y == extent.y;
    std::int64_t const runs = slices ? 1 : part.dims().z;
    for (std::int64_t r = 0; r < runs; ++r) {
        Box rows = part;
        if (!slices) rows.lower.z = part.lower.z + r, rows.upper.z = rows.lower.z + 1;
        std::int64_t const first = (rows.lower.z - corner.z) * extent.y + rows.lower.y - corner.y;
        read_rows((first * extent.x + part.lower.x - corner.x) * element, extent.x * element, rows, out, scratch, read);
    }
}

std::int64_t slices_together(std::int64_t depth, std::int64_t slice_bytes) {
    std::int64_t const wanted = std::clamp<std::int64_t>(together / std::max<std::int64_t>(slice_bytes, 1), 1, depth);
    std::int64_t const parts = (depth + wanted - 1) / wanted;
    return (depth + parts - 1) / parts;
}

} // namespace vkt
