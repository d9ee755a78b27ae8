// A brick tree as blocks of a few cells each way, every one at the level of the finest cells that reach it: where a
// position lies, and values and gradients at the points of a ray as lattices have them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/sampler.h"

namespace vkt::render {

/// Cells of a block each way, at most; around them are values for central differences.
inline constexpr int block_cells = 8, block_halo = 2, block_edge = block_cells + 2 * block_halo;
inline constexpr std::int32_t block_size = block_edge * block_edge * block_edge;

/// A cube of finest cells in which one lattice has the values. Cell i of it along an axis begins at
/// lower + i * (1 / per_finest), unless the volume is one cell thick there.
struct BlockLeaf {
    std::int32_t lower[3], edge; ///< finest cells
    std::int32_t level;
    std::int32_t block;        ///< the number of its values; below 0: there are none
    std::uint8_t visible;      ///< something in it may be seen
    std::uint8_t thickness[3]; ///< cells each way, without those around
};

/// An octree over cubes of 2^root_bits finest cells, and the blocks of its leaves.
struct BlocksView {
    void const* cells = nullptr; ///< null: there are no blocks
    BlockLeaf const* leaves;
    std::int32_t const* nodes; ///< a leaf, or, below 0, ~ where eight more begin, x fastest; first those of the cubes
    std::int32_t origin[3], count[3];
    int root_bits;
    bool thin[3]; ///< axes along which the volume is one cell thick

    /// The leaf at a position in finest cells, or the nearest one.
    VKT_HD BlockLeaf const& at(double const* position) const {
        std::int32_t cell[3];
        for (int a = 0; a < 3; ++a) {
            double const p = position[a] - static_cast<double>(origin[a]);
            std::int32_t const end = (count[a] << root_bits) - 1;
            auto const i = static_cast<std::int32_t>(p);
            cell[a] = p < 0 ? 0 : i > end ? end : i;
        }
        int bits = root_bits;
        std::int32_t node =
            nodes[(static_cast<std::int64_t>(cell[2] >> bits) * count[1] + (cell[1] >> bits)) * count[0] +
                  (cell[0] >> bits)];
        while (node < 0) {
            --bits;
            node = nodes[~node + ((cell[2] >> bits & 1) << 2 | (cell[1] >> bits & 1) << 1 | (cell[0] >> bits & 1))];
        }
        return leaves[node];
    }
};

/// The lattice of one of the blocks.
template <class T> VKT_HD LatticeSampler<T> block_sampler(T const* blocks, std::int32_t block) {
    return {blocks + std::int64_t{block_size} * block, block_edge, block_edge * block_edge, true};
}

/// The points of a batch of segments, and the middles of these, in the lattices of their blocks.
template <class T> struct BlockPoints {
    static constexpr int room = chunk + 1 + 2 * group; ///< lanes reach beyond the last one
    struct Places {
        alignas(64) float at[3][room];
        alignas(64) std::int32_t block[room];
        alignas(64) float per_finest[room]; ///< cells of the block per finest one

        VKT_HD void pad(int count) {
            for (int a = 0; a < 3; ++a)
                for (int k = 0; k < group; ++k) at[a][count + k] = at[a][count - 1];
            for (int k = 0; k < group; ++k) block[count + k] = block[count - 1];
            for (int k = 0; k < group; ++k) per_finest[count + k] = per_finest[count - 1];
        }
    };
    void const* cells;
    LatticeType type;
    Places points, middles; ///< middle k + 1 is that of segment k, which ends in point k + 1

    VKT_HD void values_of(int first, int count, float* out) const {
        with_voxel_type<T>(
            type, [&]<class V>(V) __attribute__((always_inline)) {
#ifdef VKT_LANES
                for (int k = 0; k < count; k += VKT_LANES) {
                    LaneCells const c = lanes_of<V>(points, first + k);
                    Lanes::store(out + k,
                                 lane_cell<V>(static_cast<char const*>(cells), c, row_bytes<V>, slice_bytes<V>));
                }
#else
            for (int k = 0; k < count; ++k)
                out[k] = block_sampler(static_cast<V const*>(cells), points.block[first + k])
                             .value({points.at[0][first + k], points.at[1][first + k], points.at[2][first + k]});
#endif
            });
    }
    template <int n> VKT_HD void gradients_of(int first, float* gx, float* gy, float* gz) const {
        with_voxel_type<T>(
            type, [&]<class V>(V) __attribute__((always_inline)) {
#ifdef VKT_LANES
                static_assert(n % VKT_LANES == 0);
                for (int k = 0; k < n; k += VKT_LANES)
                    lane_gradients<V>(static_cast<char const*>(cells), lanes_of<V>(middles, first + 1 + k),
                                      row_bytes<V>, slice_bytes<V>, gx + k, gy + k, gz + k);
#else
            for (int k = 0; k < n; ++k) {
                Float3 const g = block_sampler(static_cast<V const*>(cells), middles.block[first + 1 + k])
                                     .gradient({middles.at[0][first + 1 + k], middles.at[1][first + 1 + k],
                                                middles.at[2][first + 1 + k]});
                gx[k] = g.x, gy[k] = g.y, gz[k] = g.z;
            }
#endif
            });
        // Of a block they are differences over its own cells.
        float const* const per = middles.per_finest + first + 1;
        for (int k = 0; k < n; ++k) gx[k] *= per[k];
        for (int k = 0; k < n; ++k) gy[k] *= per[k];
        for (int k = 0; k < n; ++k) gz[k] *= per[k];
    }

private:
#ifdef VKT_LANES
    template <class V> static constexpr std::int64_t row_bytes = block_edge * sizeof(V);
    template <class V> static constexpr std::int64_t slice_bytes = std::int64_t{block_edge} * block_edge * sizeof(V);
    template <class V> VKT_HD static LaneCells lanes_of(Places const& places, int k) {
        Lanes::F const x = Lanes::load(places.at[0] + k), y = Lanes::load(places.at[1] + k),
                       z = Lanes::load(places.at[2] + k);
        Lanes::I const ix = Lanes::whole(x), iy = Lanes::whole(y), iz = Lanes::whole(z);
        Lanes::I const inside = Lanes::add(Lanes::mul(ix, Lanes::set(static_cast<int>(sizeof(V)))),
                                           Lanes::add(Lanes::mul(iy, Lanes::set(static_cast<int>(row_bytes<V>))),
                                                      Lanes::mul(iz, Lanes::set(static_cast<int>(slice_bytes<V>)))));
        Lanes::I const block =
            Lanes::mul(Lanes::load(places.block + k), Lanes::set(static_cast<int>(block_size * sizeof(V))));
        LaneCells cells;
        Lanes::store(cells.offset, Lanes::add(block, inside));
        cells.fx = Lanes::sub(x, Lanes::real(ix)), cells.fy = Lanes::sub(y, Lanes::real(iy));
        cells.fz = Lanes::sub(z, Lanes::real(iz));
        return cells;
    }
#endif
};

} // namespace vkt::render
