// Non-local means: for each offset the differences of all patches of a tile at once, by sums along x, y and z.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/nlmeans.h"

#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/common/kernels/weights.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr Index3 tile_dims{64, 16, 16};

/// The voxels of one tile after the other. Every sum has an order of its own, so that tiles do not matter.
template <class C> class NlMeansTile {
public:
    NlMeansTile(ConstView in, AnyView out, NlMeansRule const& rule) : in_(in), out_(out), rule_(rule) {
        Index3 const p = rule.patch, around = p + rule.search;
        held_ = tile_dims + around + around;
        held_.x += lanes; // the last register reaches beyond
        values_.resize(static_cast<std::size_t>(held_.x * held_.y * held_.z));
        squares_.resize(static_cast<std::size_t>(tile_dims.x + 2 * p.x + lanes));
        lines_.resize(static_cast<std::size_t>(pitch * (tile_dims.y + 2 * p.y)));
        planes_.resize(static_cast<std::size_t>(pitch * tile_dims.y * (2 * p.z + 1)));
        auto const voxels = static_cast<std::size_t>(pitch * tile_dims.y * tile_dims.z);
        changes_.resize(voxels);
        weights_.resize(voxels);
        most_.resize(voxels);
        NlMeansFactors<C> const factors = factors_of<C>(rule);
        scale_ = factors.scale;
        free_ = factors.free;
    }

    Losses run(Box const& tile) {
        Index3 const n = tile.dims(), around = rule_.patch + rule_.search, s = rule_.search;
        for (std::int64_t z = 0; z < n.z + 2 * around.z; ++z)
            for (std::int64_t y = 0; y < n.y + 2 * around.y; ++y)
                for (std::int64_t x = 0; x < n.x + 2 * around.x; x += row_piece)
                    load_row(
                        in_.type,
                        in_.at(tile.lower.x - around.x + x, tile.lower.y - around.y + y, tile.lower.z - around.z + z),
                        values_.data() + (z * held_.y + y) * held_.x + x, std::min(row_piece, n.x + 2 * around.x - x));
        std::fill(changes_.begin(), changes_.end(), C(0));
        std::fill(weights_.begin(), weights_.end(), C(0));
        std::fill(most_.begin(), most_.end(), C(0));
        for (std::int64_t dz = -s.z; dz <= s.z; ++dz)
            for (std::int64_t dy = -s.y; dy <= s.y; ++dy)
                for (std::int64_t dx = -s.x; dx <= s.x; ++dx)
                    if (dx != 0 || dy != 0 || dz != 0) add_offset(n, (dz * held_.y + dy) * held_.x + dx);
        Losses losses;
        alignas(64) C results[pitch];
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y) {
                C const* const centre = value(0, y, z);
                std::size_t const at = static_cast<std::size_t>((z * tile_dims.y + y) * pitch);
                C const* const weight = weights_.data() + at;
                C const* const most = most_.data() + at;
                C const* const change = changes_.data() + at;
                for (std::int64_t x = 0; x < n.x; ++x)
                    results[x] = weight[x] > C(0) ? centre[x] + change[x] / (weight[x] + most[x]) : centre[x];
                losses += store_row(out_.type, static_cast<C const*>(results),
                                    out_.at(tile.lower.x, tile.lower.y + y, tile.lower.z + z), n.x);
            }
        return losses;
    }

private:
    static constexpr std::int64_t lanes = lane_count<C>, pitch = tile_dims.x;
    static_assert(pitch % lanes == 0 && pitch <= row_piece);

    /// The value of a voxel of the tile, or near it.
    C const* value(std::int64_t x, std::int64_t y, std::int64_t z) const {
        Index3 const around = rule_.patch + rule_.search;
        return values_.data() + ((z + around.z) * held_.y + y + around.y) * held_.x + x + around.x;
    }

    /// to[x] = sum of k rows, `step` apart.
    static void sum(C* to, C const* from, std::int64_t k, std::int64_t step, std::int64_t n) {
        for (std::int64_t x = 0; x < n; x += lanes) {
            Lanes<C> total = load_lanes(from + x);
            for (std::int64_t i = 1; i < k; ++i) total = total + load_lanes(from + i * step + x);
            store_lanes(to + x, total);
        }
    }

    void add_offset(Index3 n, std::int64_t offset) {
        Index3 const p = rule_.patch;
        std::int64_t const deep = 2 * p.z + 1;
        for (std::int64_t z = -p.z; z < n.z + p.z; ++z) {
            C* const plane = planes_.data() + (z + p.z) % deep * (pitch * tile_dims.y);
            for (std::int64_t y = -p.y; y < n.y + p.y; ++y) {
                C const* const here = value(-p.x, y, z);
                for (std::int64_t x = 0; x < n.x + 2 * p.x; x += lanes) {
                    Lanes<C> const d = (load_lanes(here + x) - load_lanes(here + offset + x)) * scale_;
                    store_lanes(squares_.data() + x, d * d);
                }
                sum(lines_.data() + (y + p.y) * pitch, squares_.data(), 2 * p.x + 1, 1, n.x);
            }
            for (std::int64_t y = 0; y < n.y; ++y)
                sum(plane + y * pitch, lines_.data() + y * pitch, 2 * p.y + 1, pitch, n.x);
            if (z >= p.z)
                for (std::int64_t y = 0; y < n.y; ++y) add_weights(n.x, y, z - p.z, offset);
        }
    }

    void add_weights(std::int64_t n, std::int64_t y, std::int64_t z, std::int64_t offset) {
        using V = Lanes<C>;
        std::int64_t const deep = 2 * rule_.patch.z + 1;
        std::size_t const at = static_cast<std::size_t>((z * tile_dims.y + y) * pitch);
        C const* const here = value(0, y, z);
        for (std::int64_t x = 0; x < n; x += lanes) {
            V distance{};
            for (std::int64_t k = 0; k < deep; ++k) // from the patch's first slice on, wherever that lies
                distance = distance + load_lanes(planes_.data() + (((z + k) % deep) * tile_dims.y + y) * pitch + x);
            V exponent = V{} + free_ - distance;
            exponent = exponent > V{} ? V{} : exponent;
            auto const near = exponent > V{} + C(weight_floor); // false for NaN
            V const weight = near ? exp2_of<C>(exponent) : V{};
            V const change = load_lanes(here + offset + x) - load_lanes(here + x);
            std::size_t const i = at + static_cast<std::size_t>(x);
            V const most = load_lanes(most_.data() + i);
            store_lanes(changes_.data() + i, madd(weight, near ? change : V{}, load_lanes(changes_.data() + i)));
            store_lanes(weights_.data() + i, load_lanes(weights_.data() + i) + weight);
            store_lanes(most_.data() + i, weight > most ? weight : most);
        }
    }

    ConstView in_;
    AnyView out_;
    NlMeansRule rule_;
    Index3 held_; ///< of the tile and its surroundings
    C scale_, free_;
    std::vector<C> values_, squares_, lines_, planes_, changes_, weights_, most_;
};

} // namespace

void nlmeans_box(ConstView in, AnyView out, NlMeansRule const& rule, Losses& losses, Execution const& execution) {
    with_compute_type(in.type, [&]<class C>(C) {
        for_each_tile(execution, execution.threads, out.box, tile_dims, [&](auto const& each) {
            NlMeansTile<C> means(in, out, rule);
            Losses mine;
            each([&](Box const& tile) { mine += means.run(tile); });
            driver::add(losses, mine);
        });
    });
}

void count_noise(ConstView in, NoiseCounts& counts, Execution const&) {
    counts.counts.resize(std::size_t{1} << 16);
    Index3 const n = in.dims();
    std::vector<double> upper(static_cast<std::size_t>(row_piece)), lower(upper.size());
    for (std::int64_t z = in.box.lower.z; z < in.box.upper.z; ++z)
        for (std::int64_t y = in.box.lower.y; y + 1 < in.box.upper.y; y += 2)
            for (std::int64_t x = 0; x + 1 < n.x; x += row_piece) {
                std::int64_t const m = std::min(row_piece, n.x - x);
                load_row(in.type, in.at(in.box.lower.x + x, y, z), upper.data(), m);
                load_row(in.type, in.at(in.box.lower.x + x, y + 1, z), lower.data(), m);
                for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(m); i += 2) {
                    double const a = upper[i], b = upper[i + 1], c = lower[i], d = lower[i + 1];
                    double const size = std::abs((a - b) - (c - d)) / 2;
                    if (!(size <= 1e38) || (a == b && b == c && c == d)) continue;
                    ++counts.counts[std::bit_cast<std::uint32_t>(static_cast<float>(size)) >> 16];
                }
            }
}

} // namespace VKT_BACKEND
} // namespace vkt
