// Permuting copies: rows where x stays, tiles transposed in registers where it does not.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/permute.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/kernel/stream.h"

#include <utility>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Tiles of some cache lines in both directions: what is read and what is written are whole lines. Lines of rows that
/// lie slices apart come from pages of their own, of which fewer are turned to if more of each is taken.
template <class U> constexpr std::int64_t tile_edge(int own) {
    return static_cast<std::int64_t>((own == 2 ? 256 : 128) / sizeof(U));
}
/// transpose_block() of any rectangle, ni by nj.
template <class U>
void transpose_tile(U const* from, std::int64_t from_row, U* to, std::int64_t to_row, std::int64_t ni,
                    std::int64_t nj) {
    constexpr std::int64_t n = block_edge<U>;
    std::int64_t const whole_i = ni / n * n, whole_j = nj / n * n;
    for (std::int64_t i = 0; i < whole_i; i += n)
        for (std::int64_t j = 0; j < whole_j; j += n)
            transpose_block(from + i * from_row + j, from_row, to + j * to_row + i, to_row);
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

/// The output's axis x is not the input's: `own` is the axis of the output that is.
template <class U>
void permute_tiles(Permutation<U> const& p, Index3 dims, int own, bool stream, Execution const& execution) {
    std::int64_t const edge = tile_edge<U>(own);
    int const other = 3 - own; // the third axis
    bool const back = p.step[static_cast<std::size_t>(own)] < 0;
    std::int64_t const across = (dims.x + edge - 1) / edge, down = (dims[own] + edge - 1) / edge;
    std::int64_t const to_own = p.to_step[static_cast<std::size_t>(own)],
                       to_other = p.to_step[static_cast<std::size_t>(other)];
    for_each_item(threads_for(execution, dims.x * dims.y * dims.z), across * down * dims[other],
                  [&](std::int64_t begin, std::int64_t end) {
                      alignas(64) U tile[tile_edge<U>(2) * tile_edge<U>(2)];
                      for (std::int64_t item = begin; item < end; ++item) {
                          // Along the input's rows first.
                          std::int64_t const j0 = item % down * edge, i0 = item / down % across * edge,
                                             k = item / down / across;
                          std::int64_t const ni = std::min(edge, dims.x - i0), nj = std::min(edge, dims[own] - j0);
                          U const* const first = p.from + i0 * p.step[0] + k * p.step[static_cast<std::size_t>(other)];
                          // The next tile along the input's rows: so many rows at once are not foreseen. Of rows that
                          // are slices apart it gains nothing.
                          for (std::int64_t i = 0; own == 1 && i < ni; ++i) {
                              U const* const next = first + i * p.step[0] + (back ? -(j0 + 2 * edge - 1) : j0 + edge);
                              __builtin_prefetch(next);
                              __builtin_prefetch(next + edge / 2);
                          }
                          transpose_tile(back ? first - (j0 + nj - 1) : first + j0, p.step[0], tile, edge, ni, nj);
                          U* const to = p.to + i0 + j0 * to_own + k * to_other;
                          for (std::int64_t j = 0; j < nj; ++j)
                              copy_row(to + j * to_own, tile + (back ? nj - 1 - j : j) * edge, ni, stream);
                      }
                      stream_fence();
                  });
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
        if (mirror.x) return driver::copy_rows<true>(execution, dims, copy);
        driver::copy_rows<false>(execution, dims, copy);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
