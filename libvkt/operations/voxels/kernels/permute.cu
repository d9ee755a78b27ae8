// Permuting copies on GPUs: rows where x stays, tiles turned round in shared memory where it does not.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/permute.h"

#include "libvkt/kernel/kernel.h"

#include <cstdlib>

namespace vkt::VKT_BACKEND {
namespace {

constexpr int tile_rows = 8;
/// Voxels along both edges of a tile: 64 bytes at least, so that what is read and written are whole sectors, and 256
/// where there is room.
template <class U> constexpr int tile_edge = sizeof(U) == 8 ? 32 : 64;
/// Tiles one behind the other that are turned at the same time where their rows lie nearer to one another than those of
/// a tile, which are in as many pages of memory.
constexpr unsigned tiles_deep = 8;

/// `own` is the axis of the output that is the input's x; `other` the third one. Strides in voxels.
template <class U> struct Tiles {
    U const* from;
    U* to;
    std::int64_t from_x, from_other, to_own, to_other; ///< the input's strides along output x and other
    std::int64_t nx, own, other;
    bool back;                   ///< the input's rows are reversed
    unsigned across, down, deep; ///< tiles; of them behind one another in a group
};

template <class U> __global__ void __launch_bounds__(tile_edge<U>* tile_rows) turn_kernel(Tiles<U> const t) {
    constexpr int edge = tile_edge<U>;
    __shared__ U tile[edge][edge + (sizeof(U) == 1 ? 4 : sizeof(U) == 2 ? 2 : 1)];
    unsigned const front = blockIdx.x / t.deep;
    std::int64_t const i0 = static_cast<std::int64_t>(front % t.across) * edge,
                       j0 = static_cast<std::int64_t>(front / t.across % t.down) * edge,
                       k = static_cast<std::int64_t>(front / t.across / t.down) * t.deep + blockIdx.x % t.deep;
    if (k >= t.other) return; // the whole block
    U const* const from = t.from + k * t.from_other;
    U* const to = t.to + k * t.to_other;
    int const column = static_cast<int>(threadIdx.x), row = static_cast<int>(threadIdx.y);
    std::int64_t const j = t.back ? -(j0 + column) : j0 + column;
    if (i0 + edge <= t.nx && j0 + edge <= t.own) { // the whole block
        constexpr int rounds = edge / tile_rows;
        U const* in = from + (i0 + row) * t.from_x + j;
        U voxels[rounds];
#pragma unroll
        for (int n = 0; n < rounds; ++n, in += tile_rows * t.from_x) voxels[n] = *in;
#pragma unroll
        for (int n = 0; n < rounds; ++n) tile[row + n * tile_rows][column] = voxels[n];
        __syncthreads();
        U* out = to + (j0 + row) * t.to_own + i0 + column;
#pragma unroll
        for (int n = 0; n < rounds; ++n, out += tile_rows * t.to_own) *out = tile[column][row + n * tile_rows];
        return;
    }
    for (int r = row; r < edge; r += tile_rows)
        if (i0 + r < t.nx && j0 + column < t.own) tile[r][column] = from[(i0 + r) * t.from_x + j];
    __syncthreads();
    for (int r = row; r < edge; r += tile_rows)
        if (j0 + r < t.own && i0 + column < t.nx) to[(j0 + r) * t.to_own + i0 + column] = tile[column][r];
}

template <class U> void turn(Tiles<U> tiles) {
    constexpr int edge = tile_edge<U>;
    std::int64_t const across = (tiles.nx + edge - 1) / edge, down = (tiles.own + edge - 1) / edge;
    tiles.deep = std::abs(tiles.from_other) < std::abs(tiles.from_x) ? tiles_deep : 1;
    std::int64_t const all = (tiles.other + tiles.deep - 1) / tiles.deep * tiles.deep;
    unsigned const blocks = launch_blocks(across, down, all);
    tiles.across = static_cast<unsigned>(across);
    tiles.down = static_cast<unsigned>(down);
    turn_kernel<U><<<blocks, dim3(edge, tile_rows)>>>(tiles);
    check_launch("permute_box");
}

template <class U> void permute(ConstView in, AnyView out, std::array<int, 3> axes, Mirror mirror) {
    std::int64_t const strides[3] = {1, in.row, in.slice};
    bool const mirrored[3] = {mirror.x, mirror.y, mirror.z};
    Index3 const n = in.dims(), m = out.dims();
    U const* from = reinterpret_cast<U const*>(in.data);
    std::int64_t step[3];
    for (int k = 0; k < 3; ++k) {
        int const axis = axes[static_cast<std::size_t>(k)];
        step[k] = mirrored[axis] ? -strides[axis] : strides[axis];
        if (mirrored[axis]) from += (n[axis] - 1) * strides[axis];
    }
    U* const to = reinterpret_cast<U*>(out.data);
    constexpr auto size = static_cast<std::int64_t>(sizeof(U));
    if (axes[0] == 0) { // a copy of rows takes them from their first byte, whichever way they go
        driver::RowCopy const copy{reinterpret_cast<std::byte const*>(mirror.x ? from - (m.x - 1) : from),
                                   reinterpret_cast<std::byte*>(to),
                                   m.x * size,
                                   step[1] * size,
                                   step[2] * size,
                                   out.row * size,
                                   out.slice * size};
        if (mirror.x) return driver::launch_copy<true, U>(m, copy);
        return driver::launch_copy<false, U>(m, copy);
    }
    bool const along_y = axes[1] == 0;
    turn<U>({from, to, step[0], along_y ? step[2] : step[1], along_y ? out.row : out.slice,
             along_y ? out.slice : out.row, m.x, along_y ? m.y : m.z, along_y ? m.z : m.y, mirror.x, 0, 0, 1});
}

} // namespace

void permute_box(ConstView in, AnyView out, std::array<int, 3> axes, Mirror mirror, Execution const&) {
    if (out.box.empty()) return;
    switch (size_of(in.type)) {
    case 1:
        return permute<std::uint8_t>(in, out, axes, mirror);
    case 2:
        return permute<std::uint16_t>(in, out, axes, mirror);
    case 4:
        return permute<std::uint32_t>(in, out, axes, mirror);
    default:
        return permute<std::uint64_t>(in, out, axes, mirror);
    }
}

} // namespace vkt::VKT_BACKEND
