// One output tile of a reconstruction: plain data that the kernels of every instruction set share.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <cstdint>

namespace vkt::tile {

/// Output samples of a tile at most: 64 x 16 x 16 keeps sums and weights in the second-level cache.
inline constexpr int extent_x = 64, extent_y = 16, extent_z = 16;
inline constexpr int samples = extent_x * extent_y * extent_z;

/// A brick as the kernels see it. `row` and `slice` are its strides in cells.
struct Source {
    std::byte const* cells = nullptr;
    std::int64_t lower[3] = {}, dims[3] = {}, width[3] = {};
    /// 64-bit integers: the least of the volume, and whether some lie 2^53 and more above it, where double has gaps.
    std::uint64_t base = 0;
    bool far = false;
};

/// What is loaded of a cell: its value; of 64-bit integers also the difference from the base, or half of its bits.
enum class Load : std::uint8_t { values, differences, low_halves, high_halves };

/// Sample i of axis a lies at lower[a] + (i + 1/2) * step[a] in finest cells.
struct Job {
    double lower[3] = {}, step[3] = {};
    std::int64_t begin[3] = {}; ///< first output index of the tile
    int count[3] = {};          ///< samples of the tile along each axis
    DataType type = DataType::float32;
    Load load = Load::values;          ///< other ones with 64-bit integers only
    Source const* sources = nullptr;   ///< all bricks
    std::int32_t const* ids = nullptr; ///< bricks that matter here, ascending
    std::int64_t id_count = 0;
};

/// Memory of one thread. Sums and weights are dense with x fastest, count[0] x count[1] x count[2].
template <class C> struct Scratch {
    alignas(64) C sum[samples];
    alignas(64) C weight[samples];
    alignas(64) C rows[(2 * extent_y + 1) * extent_x]; ///< cell rows interpolated along x; the last one is zero
    alignas(64) C planes[3][extent_y * extent_x];      ///< two cell planes interpolated along x and y; a zero plane
    alignas(64) C cells[4096];                         ///< one row of cells, or a block of partly averaged ones
};

using ScratchFloat = Scratch<float>;
using ScratchDouble = Scratch<double>;

} // namespace vkt::tile

/// The kernels of one back end. Each clears and fills sum and weight of the whole tile.
#define VKT_DECLARE_TILE_KERNELS(backend)                                                                              \
    namespace vkt::backend {                                                                                           \
    void basis_tile(tile::Job const& job, tile::ScratchFloat& scratch);                                                \
    void basis_tile(tile::Job const& job, tile::ScratchDouble& scratch);                                               \
    void average_tile(tile::Job const& job, tile::ScratchDouble& scratch);                                             \
    }
VKT_DECLARE_TILE_KERNELS(baseline)
VKT_DECLARE_TILE_KERNELS(avx2)
VKT_DECLARE_TILE_KERNELS(avx512)
