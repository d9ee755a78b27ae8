// Permuting copies: rows where x stays, tiles transposed in registers where it does not.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/permute.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/kernel/stream.h"

#include <cstdlib>
#include <utility>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Tiles of some cache lines in both directions, so that what is read and what is written are whole lines: so many
/// input rows, that is voxels along a row of the output, and so many of each. Measured.
template <class U> constexpr std::int64_t tile_rows = sizeof(U) == 1 ? 256 : 128;
template <class U> constexpr std::int64_t tile_columns = (sizeof(U) == 1 ? 64 : 128) / sizeof(U);

/// transpose_block() of any rectangle, ni by nj. Calls before(i) for the rows from i on, so many as a block has.
template <class U, class Before>
void transpose_tile(U const* from, std::int64_t from_row, U* to, std::int64_t to_row, std::int64_t ni, std::int64_t nj,
                    Before before) {
    constexpr std::int64_t n = block_edge<U>;
    std::int64_t const whole_i = ni / n * n, whole_j = nj / n * n;
    for (std::int64_t i = 0; i < whole_i; i += n) {
        before(i);
        for (std::int64_t j = 0; j < whole_j; j += n)
            transpose_block(from + i * from_row + j, from_row, to + j * to_row + i, to_row);
    }
    for (std::int64_t j = 0; j < nj; ++j)
        for (std::int64_t i = j < whole_j ? whole_i : 0; i < ni; ++i) to[j * to_row + i] = from[i * from_row + j];
}

/// Rows of a tile to where they belong. Whole cache lines go straight past the caches: for so few, looking for the ends
/// of a row would take as long as the copy.
template <class U> void copy_row(U* to, U const* from, std::int64_t n, bool stream) {
    bool const lines =
        n * static_cast<std::int64_t>(sizeof(U)) % 64 == 0 && reinterpret_cast<std::uintptr_t>(to) % 64 == 0;
    if (!stream || !lines) return driver::copy_forward(to, from, n, stream);
    for (std::int64_t i = 0; i < n; i += Register<U>::lanes) {
        typename Register<U>::type v;
        std::memcpy(&v, from + i, sizeof v);
        stream_register(to + i, v);
    }
}

/// Strides of the input along the axes of the output, and its voxel that becomes the first; strides of the output.
template <class U> struct Permutation {
    U const* from;
    std::array<std::int64_t, 3> step;
    U* to;
    std::array<std::int64_t, 3> to_step;
};

/// What of the output a tile is, and its first voxel in the input, in the order of memory.
template <class U> struct Tile {
    std::int64_t i, j, k, ni, nj;
    U const* corner;
};

/// The output's axis x is not the input's: `own` is the axis of the output that is.
template <class U>
void permute_tiles(Permutation<U> const& p, Index3 dims, int own, bool stream, Execution const& execution) {
    constexpr std::int64_t rows = tile_rows<U>, columns = tile_columns<U>, line = 64 / sizeof(U);
    int const other = 3 - own; // the third axis
    bool const back = p.step[static_cast<std::size_t>(own)] < 0;
    // Tiles begin where lines do, at least in the first of the input's rows: the first one may have less columns.
    auto const place = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(p.from) / sizeof(U) % columns);
    std::int64_t const lacking = back ? columns - 1 - place : place;
    std::int64_t const across = (dims.x + rows - 1) / rows, down = (dims[own] + lacking + columns - 1) / columns;
    std::int64_t const to_own = p.to_step[static_cast<std::size_t>(own)],
                       to_other = p.to_step[static_cast<std::size_t>(other)];
    auto const tile_at = [&](std::int64_t item) { // along the input's rows first
        std::int64_t const edge = item % down * columns - lacking, j = std::max<std::int64_t>(edge, 0),
                           i = item / down % across * rows, k = item / down / across;
        std::int64_t const nj = std::min(edge + columns, dims[own]) - j;
        U const* const first = p.from + i * p.step[0] + k * p.step[static_cast<std::size_t>(other)];
        return Tile<U>{i, j, k, std::min(rows, dims.x - i), nj, back ? first - (j + nj - 1) : first + j};
    };
    for_each_item(execution, threads_for(execution, dims.x * dims.y * dims.z), across * down * dims[other],
                  [&](std::int64_t begin, std::int64_t end) {
                      alignas(64) U buffer[rows * columns];
                      for (std::int64_t item = begin; item < end; ++item) {
                          Tile<U> const tile = tile_at(item), next = tile_at(std::min(item + 1, end - 1));
                          // So many rows at once are not foreseen. They go to the second cache: in the first, rows that
                          // are powers of two apart displace each other. If they begin within lines, the first ones are
                          // there already.
                          auto const ask = [&](std::int64_t i) {
                              for (std::int64_t r = i; r < i + block_edge<U>; ++r) {
                                  U const* const last = next.corner + r * p.step[0] + columns - 1;
                                  __builtin_prefetch(last, 0, 2);
                                  __builtin_prefetch(last - line, 0, 2);
                              }
                          };
                          transpose_tile(tile.corner, p.step[0], buffer, rows, tile.ni, tile.nj, ask);
                          U* const to = p.to + tile.i + tile.j * to_own + tile.k * to_other;
                          for (std::int64_t j = 0; j < tile.nj; ++j)
                              copy_row(to + j * to_own, buffer + (back ? tile.nj - 1 - j : j) * rows, tile.ni, stream);
                      }
                      stream_fence();
                  });
}

/// x stays. Rows are taken in the order of the input, whose slices processors foresee; those of the output lie apart,
/// which stores do not wait for.
template <bool Reverse, class U> void permute_rows(driver::RowCopy<U> copy, Index3 dims, Execution const& execution) {
    if (std::abs(copy.from_row) > std::abs(copy.from_slice)) {
        std::swap(copy.from_row, copy.from_slice);
        std::swap(copy.to_row, copy.to_slice);
        std::swap(dims.y, dims.z);
    }
    driver::copy_rows<Reverse>(execution, dims, copy.from_row < 0 ? copy.from_below(dims) : copy);
}

} // namespace

void permute_box(ConstView in, AnyView out, std::array<int, 3> axes, Mirror mirror, Execution const& execution) {
    if (out.box.empty()) return;
    for_each_size(size_of(in.type), [&]<class U>(U) {
        Index3 const from_dims = in.dims(), dims = out.dims();
        std::array<std::int64_t, 3> const strides{1, in.row, in.slice};
        std::array<bool, 3> const back{mirror.x, mirror.y, mirror.z};
        Permutation<U> p{
            reinterpret_cast<U const*>(in.data), {}, reinterpret_cast<U*>(out.data), {1, out.row, out.slice}};
        for (std::size_t k = 0; k < 3; ++k) {
            auto const axis = static_cast<std::size_t>(axes[k]);
            p.step[k] = back[axis] ? -strides[axis] : strides[axis];
            if (back[axis]) p.from += (from_dims[axes[k]] - 1) * strides[axis];
        }
        bool const stream = driver::is_large(out);
        if (axes[0] != 0) return permute_tiles(p, dims, axes[1] == 0 ? 1 : 2, stream, execution);
        driver::RowCopy<U> const copy{p.from, p.to, p.step[1], p.step[2], out.row, out.slice};
        mirror.x ? permute_rows<true>(copy, dims, execution) : permute_rows<false>(copy, dims, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
