// Linear sampling on GPUs along rows of the input: warps walk through the output so that they meet few lines of the
// cache.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/kernels/affine_slices.h"

namespace vkt::VKT_BACKEND::affine {

/// A block of voxels and how warps walk through it: their lanes along one axis; path after path begins a voxel further
/// along another one, and then along the third.
template <int along> struct PathBlock {
    static constexpr int length = 32, warps = 8;
    static constexpr int inner = along == 0 ? 2 : 0, outer = 3 - along - inner; ///< axes
    static constexpr int inner_side = along == 0 ? 16 : 32, outer_side = along == 0 ? 16 : 8;
    static constexpr int outer_steps = outer_side / warps; ///< of a warp
    static_assert(outer_steps * inner_side == 32, "a bit for each path");
    static constexpr int side(int axis) { return axis == along ? length : axis == inner ? inner_side : outer_side; }
    static constexpr int rows = side(1) * side(2);
    // In shared memory lanes along x are in banks of their own; others are where rows begin in different ones.
    static constexpr int pitch = along == 0 ? length : length + 1;
    /// Rows there: what lanes count comes first.
    static __device__ __forceinline__ int row(int y, int z) { return along == 2 ? y * side(2) + z : z * side(1) + y; }
};

/// A step of a lane along the axis is so much of one along each of them.
struct PathShear {
    int along = 0;
    float x = 0, y = 0, z = 0;
};
/// Along rows of the input.
inline PathShear path_shear(Affine const& map) {
    auto const& c = map.column;
    auto const x_of = [](Vec3 const& u, Vec3 const& v) { return u.y * v.z - u.z * v.y; };
    double const row[3] = {x_of(c[1], c[2]), x_of(c[2], c[0]), x_of(c[0], c[1])};
    PathShear shear;
    for (int axis = 1; axis < 3; ++axis)
        if (std::abs(row[axis]) > std::abs(row[shear.along])) shear.along = axis;
    double const longest = row[shear.along];
    if (longest == 0 || !(longest - longest == 0)) return {}; // a map that flattens volumes
    shear.x = static_cast<float>(row[0] / longest);
    shear.y = static_cast<float>(row[1] / longest);
    shear.z = static_cast<float>(row[2] / longest);
    return shear;
}

template <class T> struct PathsSample {
    LinearSample<T> sample;
    PathShear shear;
    Index3 dims;       ///< of the output
    bool aligned;      ///< rows of the output begin where four voxels may be stored at once
    float background;  ///< as the type has it
    bool clipped, nan; ///< the type has no room for it
};

/// The voxels of a thread in its block, each of which is met once.
template <int along> struct PathPlace {
    using Block = PathBlock<along>;
    int lane, warp, inner_shift, outer_shift;

    __device__ __forceinline__ explicit PathPlace(PathShear const& shear)
        : lane(static_cast<int>(threadIdx.x) % 32), warp(static_cast<int>(threadIdx.x) / 32) {
        auto const shift = [&](int axis) {
            return __float2int_rn((axis == 0 ? shear.x : axis == 1 ? shear.y : shear.z) * static_cast<float>(lane));
        };
        inner_shift = shift(Block::inner), outer_shift = shift(Block::outer);
    }
    __device__ __forceinline__ int inner(int step) const { return (step + inner_shift) & (Block::inner_side - 1); }
    __device__ __forceinline__ int outer(int step) const {
        return (warp * Block::outer_steps + step + outer_shift) & (Block::outer_side - 1);
    }
    __device__ __forceinline__ int3 at(int inner, int outer) const {
        if constexpr (along == 0) return {lane, outer, inner};
        if constexpr (along == 1) return {inner, lane, outer};
        return {inner, outer, lane};
    }
    /// The voxel of a bit.
    __device__ __forceinline__ int3 of_bit(int bit) const {
        return at(inner(bit % Block::inner_side), outer(bit / Block::inner_side));
    }
};

__device__ __forceinline__ double component(Vec3 const& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// Positions along the paths of a thread, as row_of() and PositionLine have them: what does not change is kept.
template <int along> struct PathPositions {
    using Block = PathBlock<along>;
    Affine const& map;
    double first[3]; ///< of the block's voxels, less 2^52
    double of_lane;
    double kept[3], base[3];

    __device__ __forceinline__ PathPositions(Affine const& of, Index3 first_voxel, int lane) : map(of) {
        first[0] = static_cast<double>(first_voxel.x) - 0x1p52;
        first[1] = static_cast<double>(first_voxel.y) - 0x1p52;
        first[2] = static_cast<double>(first_voxel.z) - 0x1p52;
        of_lane = place(along, lane);
        for (int a = 0; a < 3; ++a) {
            kept[a] = component(map.column[along], a) * of_lane;
            if (along == 1) kept[a] = component(map.offset, a) + kept[a];
        }
    }
    /// A voxel's place along an axis: what two additions do takes fewer steps than a conversion.
    __device__ __forceinline__ double place(int axis, int n) const {
        return first[axis] + __hiloint2double(0x43300000, n);
    }
    __device__ __forceinline__ void step_outer(int n) {
        double const at = place(Block::outer, n);
        for (int a = 0; a < 3; ++a) {
            double const moved = component(map.column[Block::outer], a) * at;
            if (along == 0) base[a] = component(map.offset, a) + moved;
            if (along == 1) base[a] = kept[a] + moved;
            if (along == 2) base[a] = (component(map.offset, a) + moved) + kept[a];
        }
    }
    __device__ __forceinline__ void at_inner(int n, double* p) const {
        double const at = place(Block::inner, n);
        for (int a = 0; a < 3; ++a) {
            double const moved = component(map.column[Block::inner], a) * at;
            p[a] = along == 0 ? (base[a] + moved) + kept[a] : base[a] + moved;
        }
    }
};

/// Of a thread's paths those whose bits are set. Apart, as strips_left is.
template <class T, int along>
__device__ __noinline__ driver::LossCounts paths_left_in(PathsSample<T> const& all, std::uint32_t left, std::int64_t x0,
                                                         std::int64_t y0, std::int64_t z0) {
    PathPlace<along> const place(all.shear);
    DeviceSampling const& s = all.sample.any.s;
    driver::LossCounts counts;
    for (; left != 0; left &= left - 1) {
        int3 const at = place.of_bit(__ffs(static_cast<int>(left)) - 1);
        std::int64_t const x = x0 + at.x, y = y0 + at.y, z = z0 + at.z;
        if (x < all.dims.x && y < all.dims.y && z < all.dims.z)
            all.sample.at_last(row_of(s.map, {}, s.first.y + y, s.first.z + z), x, y, z, counts);
    }
    return counts;
}

/// Results go through shared memory, lest rows of the output be written in pieces. The same bits as CPUs; what is near
/// a face or beside a voxel that is not finite is left for the end.
template <class T, int along>
__global__ void __launch_bounds__(256, 4)
    paths_kernel(__grid_constant__ driver::Blocks const blocks, __grid_constant__ PathsSample<T> const all,
                 unsigned long long* totals) {
    using Block = PathBlock<along>;
    using Sampler = LinearSample<T>;
    __shared__ alignas(16) float made[Block::rows * Block::pitch];
    Sampler const& sample = all.sample;
    DeviceSampling const& s = sample.any.s;
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % blocks.across) * Block::side(0),
                       y0 = static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * Block::side(1),
                       z0 = static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * Block::side(2);
    PathPlace<along> const place(all.shear);
    PathPositions<along> positions(s.map, {s.first.x + x0, s.first.y + y0, s.first.z + z0}, place.lane);
    std::uint32_t left = 0, outside = 0;
    unsigned far = 0;
#pragma unroll 1
    for (int outer_step = 0; outer_step < Block::outer_steps; ++outer_step) {
        int const outer = place.outer(outer_step);
        positions.step_outer(outer);
        float odd = 0; // NaN if something is not finite
#pragma unroll 1
        for (int step = 0; step < Block::inner_side; ++step) {
            int const inner = place.inner(step);
            int3 const at = place.at(inner, outer);
            double p[3];
            positions.at_inner(inner, p);
            typename Sampler::Part part[3] = {Sampler::floor_of(p[0]), Sampler::floor_of(p[1]),
                                              Sampler::floor_of(p[2])};
            if (!(Sampler::is_apart(part[0]) && Sampler::is_apart(part[1]) && Sampler::is_apart(part[2])))
                for (int a = 0; a < 3; ++a) part[a] = Sampler::part_of(p[a]);
            float* const to = made + Block::row(at.y, at.z) * Block::pitch + at.x;
            if (static_cast<unsigned>(part[0].index) < sample.inner_x &&
                static_cast<unsigned>(part[1].index) < sample.inner_y &&
                static_cast<unsigned>(part[2].index) < sample.inner_z) {
                float const value = sample.among(part[0], part[1], part[2]);
                odd = __fmaf_rn(value, 0.0F, odd);
                *to = value;
            } else if (sample.is_far(part[0].index, sample.inner_x) || sample.is_far(part[1].index, sample.inner_y) ||
                       sample.is_far(part[2].index, sample.inner_z)) {
                *to = all.background;
                outside |= 1U << (outer_step * Block::inner_side + step);
                far += x0 + at.x < all.dims.x && y0 + at.y < all.dims.y && z0 + at.z < all.dims.z ? 1 : 0;
            } else {
                left |= 1U << (outer_step * Block::inner_side + step);
            }
        }
        constexpr std::uint32_t these = Block::inner_side == 32 ? ~0U : (1U << Block::inner_side) - 1;
        if (!std::is_integral_v<T> && odd != 0) left |= (these << (outer_step * Block::inner_side)) & ~outside;
    }
    __syncthreads();
    int const column = static_cast<int>(threadIdx.x) % 8 * 4;
    auto const columns = static_cast<int>(min(all.dims.x - x0 - column, std::int64_t{4}));
#pragma unroll 2
    for (int row = static_cast<int>(threadIdx.x) / 8; row < Block::rows; row += 32) {
        int const y = along == 2 ? row / Block::side(2) : row % Block::side(1),
                  z = along == 2 ? row % Block::side(2) : row / Block::side(1);
        if (columns <= 0 || y0 + y >= all.dims.y || z0 + z >= all.dims.z) continue;
        float const* const from = made + row * Block::pitch + column;
        FourVoxels<T> const four{
            {round_to<T>(from[0]), round_to<T>(from[1]), round_to<T>(from[2]), round_to<T>(from[3])}};
        std::byte* const to = sample.any.out.at(x0 + column, y0 + y, z0 + z);
        if (all.aligned && columns == 4)
            *reinterpret_cast<FourVoxels<T>*>(to) = four;
        else
            for (int i = 0; i < 4; ++i)
                if (i < columns) reinterpret_cast<T*>(to)[i] = four.v[i];
    }
    driver::LossCounts counts;
    counts.undefined = far;
    counts.clipped = all.clipped ? far : 0;
    counts.nan = all.nan ? far : 0;
    __syncthreads(); // what is left was stored as well, by other threads
    if (left != 0) counts += paths_left_in<T, along>(all, left, x0, y0, z0);
    driver::add_counts(counts, totals);
}

template <class T, int along> void launch_paths_along(Index3 n, PathsSample<T> const& all, unsigned long long* totals) {
    using Block = PathBlock<along>;
    using Shape = driver::BlockShape<Block::side(0), Block::side(1), Block::side(2), 1>;
    driver::Blocks const blocks = driver::blocks_of<Shape>(n);
    paths_kernel<T, along><<<blocks.all, 256>>>(blocks, all, totals);
    check_launch("affine_sample");
}

/// Results are of the voxels' type.
template <class T> void launch_paths(Index3 n, LinearSample<T> const& sample, unsigned long long* totals) {
    auto const background = static_cast<float>(sample.any.s.background);
    PathsSample<T> const all{sample,
                             path_shear(sample.any.s.map),
                             n,
                             holds_four_at_once<T>(sample.any.out),
                             static_cast<float>(round_to<T>(background)),
                             is_clipped<T>(background),
                             is_lost_nan<T>(background)};
    if (all.shear.along == 0) return launch_paths_along<T, 0>(n, all, totals);
    if (all.shear.along == 1) return launch_paths_along<T, 1>(n, all, totals);
    launch_paths_along<T, 2>(n, all, totals);
}

} // namespace vkt::VKT_BACKEND::affine
