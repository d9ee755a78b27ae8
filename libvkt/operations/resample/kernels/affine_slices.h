// Linear sampling on GPUs where slices stay slices: a place in the plane is looked up once for many of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/kernels/affine_linear.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

namespace vkt::VKT_BACKEND::affine {

/// Voxels of a block along both axes of a plane, and its warps; its slices, in groups that a thread has at once.
constexpr int plane_side = 32, plane_warps = 8, slices_at_once = 4, slice_groups = 8;
constexpr int plane_slices = slices_at_once * slice_groups;
constexpr int plane_paths = plane_side / plane_warps; ///< of a warp
constexpr int plane_size = plane_side * (plane_side + 1);

/// How a warp walks through a block's plane: a step of its lanes along one axis is `shear` of one along the other.
struct PlanePath {
    bool along_x; ///< lanes count x, not the plane's other axis
    float shear;

    __device__ __forceinline__ int2 place(int path, int lane) const { // in the block; each is met once
        int const aside = (path + __float2int_rn(shear * static_cast<float>(lane))) & (plane_side - 1);
        return along_x ? int2{lane, aside} : int2{aside, lane};
    }
    /// Floats from row to row of what warps write along their paths, into as many banks as there are.
    __device__ __forceinline__ int pitch() const { return along_x ? plane_side : plane_side + 1; }
};
/// Along rows of the input, of whose lines in the cache 32 voxels side by side would meet many.
inline PlanePath plane_path(StillAxis const& still, Affine const& map) {
    int const across = still.axis == 2 ? 1 : 2; // the plane's axis beside x
    double const dx = map.column[0][across], dw = map.column[static_cast<std::size_t>(across)][across];
    bool const along_x = std::abs(dx) <= std::abs(dw);
    double const shear = dx == 0 || dw == 0 ? 0 : along_x ? -dx / dw : -dw / dx;
    return {along_x, static_cast<float>(shear)};
}

/// What slices have in common.
template <class T> struct SlicesSample {
    LinearSample<T> sample;
    StillAxis still;
    PlanePath path;
    Index3 dims;       ///< of the output: x, the plane's other axis, slices
    bool aligned;      ///< rows of the output begin where four voxels may be stored at once
    float background;  ///< as the type has it
    bool clipped, nan; ///< the type has no room for it

    __device__ __forceinline__ bool by_z() const { return still.axis == 2; }
    __device__ __forceinline__ std::byte* out(std::int64_t x, std::int64_t row, std::int64_t slice) const {
        return by_z() ? sample.any.out.at(x, row, slice) : sample.any.out.at(x, slice, row);
    }
    /// Bytes from slice to slice.
    __device__ __forceinline__ std::int64_t step() const { return by_z() ? sample.any.out.slice : sample.any.out.row; }
    /// The slice of the input that lies at slice 0.
    __device__ __forceinline__ std::int64_t begin() const {
        return (by_z() ? sample.any.s.first.z : sample.any.s.first.y) + still.shift;
    }
};

/// Where a block's voxels begin.
struct PlaneBlock {
    std::int64_t x, row, slice;

    __device__ __forceinline__ explicit PlaneBlock(driver::Blocks const& blocks)
        : x(static_cast<std::int64_t>(blockIdx.x % blocks.across) * plane_side),
          row(static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * plane_side),
          slice(static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * plane_slices) {}
};

/// Between the four voxels of a plane, as CPUs do: in double within a voxel of a face.
template <class C, class T> __device__ __forceinline__ C in_plane(T const (&v)[4], double x, double w) {
    auto const fx = static_cast<C>(x), fw = static_cast<C>(w);
    return between(between(static_cast<C>(v[0]), static_cast<C>(v[1]), fx),
                   between(static_cast<C>(v[2]), static_cast<C>(v[3]), fx), fw);
}

/// Of a thread's slices those whose bits are set, one after the other.
template <class T>
__device__ __noinline__ driver::LossCounts slices_left(LinearSample<T> const& sample, StillAxis const& still,
                                                       std::uint32_t left, std::int64_t x, std::int64_t row,
                                                       std::int64_t first, std::int64_t end) {
    using Sampler = LinearSample<T>;
    DeviceSampling const& s = sample.any.s;
    bool const by_z = still.axis == 2;
    PositionRow const centre = by_z ? row_of(s.map, {}, s.first.y + row, s.first.z + first)
                                    : row_of(s.map, {}, s.first.y + first, s.first.z + row);
    auto const column = static_cast<double>(s.first.x + x);
    typename Sampler::Pair const px = Sampler::pair(centre.x, column, s.end_x, s.inner_x, sizeof(T)),
                                 pw = by_z ? Sampler::pair(centre.y, column, s.end_y, s.inner_y, sample.row)
                                           : Sampler::pair(centre.z, column, s.end_z, s.inner_z, sample.slice);
    std::int64_t const along = by_z ? sample.slice : sample.row,
                       begin = (by_z ? s.first.z : s.first.y) + still.shift, // of the input, at slice 0
        there = by_z ? s.dims.z : s.dims.y;
    driver::LossCounts counts;
    for (; left != 0; left &= left - 1) {
        std::int64_t const slice = first + __ffs(static_cast<int>(left)) - 1, at = begin + slice;
        if (slice >= end) break;
        std::int64_t const y = by_z ? row : slice, z = by_z ? slice : row;
        bool const in_slice = at >= 0 && at < there, whole = in_slice && px.whole && pw.whole;
        if (s.bounded && !whole) {
            sample(x, y, z, counts);
            continue;
        }
        typename Sampler::Found found{0, in_slice && px.inside && pw.inside};
        if (found.inside) {
            T const v[4] = {
                sample.voxel(at * along + px.first + pw.first), sample.voxel(at * along + px.second + pw.first),
                sample.voxel(at * along + px.first + pw.second), sample.voxel(at * along + px.second + pw.second)};
            found.value = whole ? in_plane<float>(v, px.rest, pw.rest)
                                : static_cast<float>(in_plane<double>(v, px.rest, pw.rest));
        }
        sample.store_found(found, sample.any.out.at(x, y, z), counts);
    }
    return counts;
}

/// What a thread has left: of each of its paths the groups of slices whose bits are set, and those that are not done.
/// Apart, as strips_left is.
template <class T>
__device__ __noinline__ driver::LossCounts paths_left(SlicesSample<T> const& slices, driver::Blocks const& blocks,
                                                      std::uint32_t left, int done) {
    PlaneBlock const block(blocks);
    std::int64_t const end = min(block.slice + plane_slices, slices.dims.z);
    driver::LossCounts counts;
    for (int path = static_cast<int>(threadIdx.x) / 32; path < plane_side; path += plane_warps, left >>= slice_groups) {
        std::uint32_t all = done < plane_slices ? ~0U << done : 0;
        for (int group = 0; group < slice_groups; ++group)
            if ((left >> group & 1U) != 0) all |= ((1U << slices_at_once) - 1) << (group * slices_at_once);
        int2 const at = slices.path.place(path, static_cast<int>(threadIdx.x) % 32);
        if (all == 0 || block.x + at.x >= slices.dims.x || block.row + at.y >= slices.dims.y) continue;
        counts += slices_left(slices.sample, slices.still, all, block.x + at.x, block.row + at.y, block.slice, end);
    }
    return counts;
}

template <class T> struct alignas(4 * sizeof(T)) FourVoxels { T v[4]; };
/// True if every fourth voxel of all rows begins where four may be stored at once.
template <class T> bool holds_four_at_once(driver::DeviceRows const& out) {
    return (reinterpret_cast<std::uintptr_t>(out.data) | static_cast<std::uintptr_t>(out.row | out.slice)) %
               sizeof(FourVoxels<T>) ==
           0;
}
/// Four voxels of a row, or as many as it has there, in each of so many slices.
template <class T>
__device__ __forceinline__ void store_four(SlicesSample<T> const& slices, float const* from, int columns, int count,
                                           std::byte* to) {
    std::int64_t const step = slices.step();
    if (slices.path.along_x && slices.aligned && columns == 4) {
#pragma unroll
        for (int k = 0; k < slices_at_once; ++k, to += step, from += plane_size) {
            if (k >= count) break;
            float4 const v = *reinterpret_cast<float4 const*>(from);
            *reinterpret_cast<FourVoxels<T>*>(to) = {
                {round_to<T>(v.x), round_to<T>(v.y), round_to<T>(v.z), round_to<T>(v.w)}};
        }
        return;
    }
#pragma unroll 1
    for (int k = 0; k < count; ++k, to += step, from += plane_size) {
        FourVoxels<T> const four{
            {round_to<T>(from[0]), round_to<T>(from[1]), round_to<T>(from[2]), round_to<T>(from[3])}};
        if (slices.aligned && columns == 4)
            *reinterpret_cast<FourVoxels<T>*>(to) = four;
        else
#pragma unroll
            for (int i = 0; i < 4; ++i)
                if (i < columns) reinterpret_cast<T*>(to)[i] = four.v[i];
    }
}

/// Slices along the axis that stays: a thread looks up its places in the plane once for all slices of its block, of
/// which it needs four voxels each. Results go through shared memory, lest rows of the output be written in pieces. The
/// same bits as CPUs; what is near a face or beside a voxel that is not finite is left for the end.
template <class T>
__global__ void __launch_bounds__(32 * plane_warps, 3)
    slices_kernel(__grid_constant__ driver::Blocks const blocks, __grid_constant__ SlicesSample<T> const slices,
                  unsigned long long* totals) {
    using Sampler = LinearSample<T>;
    using Fraction = typename Sampler::Fraction;
    // Two groups of slices: while one is stored, the next is made.
    __shared__ alignas(16) float plane[2][slices_at_once][plane_size];
    Sampler const& sample = slices.sample;
    DeviceSampling const& s = sample.any.s;
    int const warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
    PlaneBlock const block(blocks);
    bool const by_z = slices.by_z();
    std::int64_t const across = by_z ? sample.row : sample.slice, along = by_z ? sample.slice : sample.row;
    constexpr std::uint32_t nowhere = ~0U;
    std::uint32_t near[plane_paths]; // bytes from the input's slice to the first of the four voxels, or `nowhere`
    float fx[plane_paths], fw[plane_paths];
    std::uint32_t left = 0;       // a bit for each group of slices of a path: near a face, or with what is not finite
    unsigned far = 0, stored = 0; // paths outside; slices
    int const shift = slices.path.place(0, lane).x + slices.path.place(0, lane).y - lane;
    auto const spot = [&](int path) { // where a voxel of a path lies in `plane`
        int const aside = (path + shift) & (plane_side - 1);
        return slices.path.along_x ? aside * plane_side + lane : lane * (plane_side + 1) + aside;
    };
#pragma unroll
    for (int p = 0; p < plane_paths; ++p) {
        int2 const at = slices.path.place(warp + p * plane_warps, lane);
        std::int64_t const x = block.x + at.x, row = block.row + at.y;
        near[p] = nowhere;
        if (x >= slices.dims.x || row >= slices.dims.y) continue;
        PositionRow const centre = by_z ? row_of(s.map, {}, s.first.y + row, s.first.z + block.slice)
                                        : row_of(s.map, {}, s.first.y + block.slice, s.first.z + row);
        auto const column = static_cast<double>(s.first.x + x);
        auto const px = Sampler::part(centre.x, column),
                   pw = by_z ? Sampler::part(centre.y, column) : Sampler::part(centre.z, column);
        unsigned const inner_w = by_z ? sample.inner_y : sample.inner_z;
        if (static_cast<unsigned>(px.index) < sample.inner_x && static_cast<unsigned>(pw.index) < inner_w) {
            near[p] = static_cast<std::uint32_t>(pw.index) * static_cast<std::uint32_t>(across) +
                      static_cast<std::uint32_t>(px.index) * static_cast<std::uint32_t>(sizeof(T));
        } else if (sample.is_far(px.index, sample.inner_x) || sample.is_far(pw.index, inner_w)) {
            for (int k = 0; k < 2 * slices_at_once; ++k)
                plane[0][0][k * plane_size + spot(warp + p * plane_warps)] = slices.background;
            ++far;
        } else {
            left |= ((1U << slice_groups) - 1) << (p * slice_groups);
        }
        fx[p] = px.rest;
        fw[p] = pw.rest;
    }
    int const row_here = static_cast<int>(threadIdx.x) / 8, x_here = static_cast<int>(threadIdx.x) % 8 * 4;
    int const columns = block.row + row_here < slices.dims.y
                            ? static_cast<int>(min(slices.dims.x - block.x - x_here, std::int64_t{4}))
                            : 0;
    std::byte* to = slices.out(block.x + x_here, block.row + row_here, block.slice);
    std::int64_t const step = slices.step(), there = by_z ? s.dims.z : s.dims.y,
                       at = slices.begin() + block.slice; // of the input
    std::byte const* from = sample.origin + at * along;
    int done = 0;                          // slices of which but those are left whose bits are set
    auto const count_at = [&](int group) { // slices that a group has in both volumes
        return static_cast<int>(
            min(min(slices.dims.z - block.slice - group * slices_at_once, there - at - group * slices_at_once),
                std::int64_t{slices_at_once}));
    };
    int group = 0;
    for (; at + group * slices_at_once < 0 && count_at(group) > 0 && group < slice_groups; ++group) {
        for (int p = 0; p < plane_paths; ++p) left |= 1U << (p * slice_groups + group);
        to += slices_at_once * step;
        from += slices_at_once * along;
    }
    int count = group < slice_groups ? count_at(group) : 0;
#pragma unroll 1
    while (count > 0) {
        done = group * slices_at_once + count;
        stored += static_cast<unsigned>(count);
        int const next = group + 1 < slice_groups ? count_at(group + 1) : 0;
        auto* const made = &plane[group % 2][0][0];
#pragma unroll
        for (int p = 0; p < plane_paths; ++p) {
            if (near[p] == nowhere) continue;
            float v[slices_at_once][4];
            std::byte const* here = from + near[p];
#pragma unroll
            for (int k = 0; k < slices_at_once; ++k) {
                auto const* const a = reinterpret_cast<T const*>(here);
                auto const* const b = reinterpret_cast<T const*>(here + across);
                v[k][0] = static_cast<float>(a[0]);
                v[k][1] = static_cast<float>(a[1]);
                v[k][2] = static_cast<float>(b[0]);
                v[k][3] = static_cast<float>(b[1]);
                if (k + 1 < count) here += along;
            }
            if (next == slices_at_once) {
#pragma unroll
                for (int k = 0; k < slices_at_once; ++k) asm volatile("prefetch.global.L2 [%0];" ::"l"(here += along));
            }
            float* const place = made + spot(warp + p * plane_warps);
            Fraction const x(fx[p]), w(fw[p]);
            float odd = 0;
#pragma unroll
            for (int k = 0; k < slices_at_once; ++k) {
                float const value = w.between(x.between(v[k][0], v[k][1]), x.between(v[k][2], v[k][3]));
                odd = __fmaf_rn(value, 0.0F, odd);
                place[k * plane_size] = value;
            }
            if (!std::is_integral_v<T> && odd != 0) left |= 1U << (p * slice_groups + group);
        }
        from += slices_at_once * along;
        __syncthreads();
        if (columns > 0) store_four(slices, made + row_here * slices.path.pitch() + x_here, columns, count, to);
        to += slices_at_once * step;
        ++group;
        count = next;
    }
    driver::LossCounts counts;
    counts.undefined = far * stored;
    counts.clipped = slices.clipped ? counts.undefined : 0;
    counts.nan = slices.nan ? counts.undefined : 0;
    __syncthreads(); // what is left was stored as well, by other threads
    if (left != 0 || block.slice + done < min(slices.dims.z, block.slice + plane_slices))
        counts += paths_left(slices, blocks, left, done);
    driver::add_counts(counts, totals);
}

/// Where results are of the voxels' type, and a plane of the input has no more bytes than 32 bits count.
template <class T> bool has_slices(StillAxis const& still, LinearSample<T> const& sample) {
    std::int64_t const plane = still.axis == 2 ? sample.slice : sample.any.s.dims.z * sample.slice;
    return still.axis >= 0 && sample.typed_out && plane < std::numeric_limits<std::uint32_t>::max();
}

template <class T>
void launch_slices(Index3 n, StillAxis still, LinearSample<T> const& sample, unsigned long long* totals) {
    using Shape = driver::BlockShape<plane_side, plane_side, plane_slices, 1>;
    Index3 const dims = still.axis == 2 ? n : Index3{n.x, n.z, n.y};
    driver::Blocks const blocks = driver::blocks_of<Shape>(dims);
    auto const background = static_cast<float>(sample.any.s.background);
    SlicesSample<T> const all{sample,
                              still,
                              plane_path(still, sample.any.s.map),
                              dims,
                              holds_four_at_once<T>(sample.any.out),
                              static_cast<float>(round_to<T>(background)),
                              is_clipped<T>(background),
                              is_lost_nan<T>(background)};
    slices_kernel<T><<<blocks.all, 32 * plane_warps>>>(blocks, all, totals);
    check_launch("affine_sample");
}

} // namespace vkt::VKT_BACKEND::affine
