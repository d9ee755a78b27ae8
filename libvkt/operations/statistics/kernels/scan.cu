// Prefix sums on GPUs: a block of threads goes down the rows of a slice, then a thread up each column of voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/scan.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int block = 256;
constexpr int row_block = 512;
constexpr int each = 2; ///< neighbouring voxels of a thread, whose sums are stored at once

/// A sum in float64 and what its additions lost.
struct Pair {
    double sum, rest;
};
__device__ __forceinline__ Pair operator+(Pair const& a, Pair const& b) {
    double const sum = a.sum + b.sum, of_b = sum - a.sum; // without looking which is larger (Knuth)
    double const lost = (a.sum - (sum - of_b)) + (b.sum - of_b);
    return {sum, a.rest + b.rest + lost};
}

template <class A> __device__ __forceinline__ A from_lane(A const& mine, int lane) {
    constexpr int words = sizeof(A) / 8;
    static_assert(sizeof(A) % 8 == 0);
    unsigned long long w[words];
    memcpy(w, &mine, sizeof mine);
#pragma unroll
    for (int i = 0; i < words; ++i) w[i] = __shfl_sync(~0u, w[i], lane);
    A other;
    memcpy(&other, w, sizeof other);
    return other;
}

template <class A> __device__ __forceinline__ A zero_sum() {
    if constexpr (std::is_same_v<A, Pair>)
        return {0, 0};
    else
        return A(0);
}

/// A voxel as what is summed.
template <class A, class T> struct Value {
    bool mapped;
    double slope, intercept;

    __device__ __forceinline__ A operator()(T voxel) const {
        if constexpr (!std::is_same_v<A, double> && !std::is_same_v<A, Pair>) {
            return static_cast<A>(voxel);
        } else {
            auto v = static_cast<double>(voxel);
            if (mapped) v = slope * v + intercept;
            if constexpr (std::is_same_v<A, Pair>)
                return {v, 0};
            else
                return v;
        }
    }
};

/// A slab, and where it lies in the volume. Strides in voxels.
template <class T> struct Slab {
    T const* in;
    std::int64_t in_row, in_slice;
    std::int64_t nx, ny, nz;
    bool first_rows, exclusive;
};

/// The sum of all threads before this one; `total` becomes that of all. Calls one after the other take turns in
/// `memory`.
template <class A> __device__ __forceinline__ A sum_before(A const& mine, A& total, A* memory) {
    constexpr int warps = row_block / 32;
    auto const lane = static_cast<int>(threadIdx.x % 32), warp = static_cast<int>(threadIdx.x / 32);
    A sum = mine;
#pragma unroll
    for (int by = 1; by < 32; by *= 2) {
        A const below = from_lane(sum, lane - by);
        if (lane >= by) sum = below + sum;
    }
    if (lane == 31) memory[warp] = sum;
    A before = from_lane(sum, lane - 1);
    if (lane == 0) before = zero_sum<A>();
    __syncthreads();
    A all = lane < warps ? memory[lane] : zero_sum<A>();
#pragma unroll
    for (int by = 1; by < warps; by *= 2) {
        A const below = from_lane(all, lane - by);
        if (lane >= by) all = below + all;
    }
    total = from_lane(all, warps - 1);
    A const below = from_lane(all, warp - 1);
    return warp > 0 ? below + before : before;
}

/// What two neighbouring sums are stored as.
template <class A> struct alignas(2 * sizeof(A)) Both { A v[each]; };
template <> struct alignas(16) Both<Int128> { Int128 v[each]; };
template <> struct alignas(16) Both<Pair> { Pair v[each]; };

/// Sums along x and y of each slice to `sums`, rows of nx. `above` holds the sums of the rows before, a row a slice.
/// Those of rows that a block takes at once are in registers.
template <class A, class T, bool at_once>
__global__ void __launch_bounds__(row_block) slices_kernel(Slab<T> slab, Value<A, T> value, A* above, A* sums) {
    __shared__ alignas(16) unsigned char memory[2 * (row_block / 32) * sizeof(A)];
    A* const kept = above + blockIdx.x * slab.nx;
    std::int64_t const first = static_cast<std::int64_t>(threadIdx.x) * each;
    // A thread reads and writes its own columns only.
    A column[each];
    if constexpr (at_once) {
#pragma unroll
        for (int i = 0; i < each; ++i)
            column[i] = slab.first_rows || first + i >= slab.nx ? zero_sum<A>() : kept[first + i];
    } else if (slab.first_rows) {
        for (std::int64_t x0 = first; x0 < slab.nx; x0 += row_block * each)
            for (std::int64_t x = x0; x < x0 + each && x < slab.nx; ++x) kept[x] = zero_sum<A>();
    }
    T const* row = slab.in + blockIdx.x * slab.in_slice;
    A* to = sums + blockIdx.x * slab.ny * slab.nx;
    auto const load = [&](T const* from, std::int64_t x0, T(&v)[each]) {
        if (x0 + each <= slab.nx) {
            driver::Pack<T, each> const pack = driver::load_pack<T, each>(from + x0);
#pragma unroll
            for (int i = 0; i < each; ++i) v[i] = pack.v[i];
        } else {
#pragma unroll
            for (int i = 0; i < each; ++i) v[i] = x0 + i < slab.nx ? from[x0 + i] : T{};
        }
    };
    T next[each];
    if constexpr (at_once) load(row, first, next);
    int turn = 0;
    for (std::int64_t y = 0; y < slab.ny; ++y, row += slab.in_row, to += slab.nx) {
        A before_part = zero_sum<A>();
        for (std::int64_t begin = 0; begin < slab.nx; begin += row_block * each) {
            std::int64_t const x0 = begin + first;
            T v[each];
            if constexpr (at_once) {
#pragma unroll
                for (int i = 0; i < each; ++i) v[i] = next[i];
                if (y + 1 < slab.ny) load(row + slab.in_row, first, next);
            } else {
                load(row, x0, v);
#pragma unroll
                for (int i = 0; i < each; ++i) column[i] = x0 + i < slab.nx ? kept[x0 + i] : zero_sum<A>();
            }
            A sum[each];
#pragma unroll
            for (int i = 0; i < each; ++i) {
                A const own = x0 + i < slab.nx ? value(v[i]) : zero_sum<A>();
                sum[i] = i > 0 ? sum[i - 1] + own : own;
            }
            A total;
            A const before =
                before_part + sum_before(sum[each - 1], total, reinterpret_cast<A*>(memory) + turn * (row_block / 32));
            turn ^= 1;
            Both<A> stored;
#pragma unroll
            for (int i = 0; i < each; ++i) {
                A const old = column[i];
                A const along = slab.exclusive ? (i > 0 ? before + sum[i - 1] : before) : before + sum[i];
                column[i] = old + along;
                stored.v[i] = slab.exclusive ? old : column[i];
            }
            if (x0 + each <= slab.nx && reinterpret_cast<std::uintptr_t>(to + x0) % alignof(Both<A>) == 0) {
                *reinterpret_cast<Both<A>*>(to + x0) = stored;
            } else {
#pragma unroll
                for (int i = 0; i < each; ++i)
                    if (x0 + i < slab.nx) to[x0 + i] = stored.v[i];
            }
            if constexpr (!at_once) {
#pragma unroll
                for (int i = 0; i < each; ++i)
                    if (x0 + i < slab.nx) kept[x0 + i] = column[i];
            }
            before_part = before_part + total;
        }
    }
    if constexpr (at_once) {
#pragma unroll
        for (int i = 0; i < each; ++i)
            if (first + i < slab.nx) kept[first + i] = column[i];
    }
}

/// The sums along z. `below` holds those of the slices before, rows of nx; the output may be the same memory as `sums`.
template <class A> struct Columns {
    A const* sums;
    A* below;
    driver::DeviceRows out;
    std::int64_t nx, ny, nz, first_row;
    bool first, exclusive;
};

template <class A>
__device__ __forceinline__ void store_sum(driver::DeviceRows const& out, std::byte* to, A const& sum,
                                          driver::LossCounts& counts) {
    if constexpr (std::is_same_v<A, Pair>) {
        bool const finite = sum.sum - sum.sum == 0;
        counts.undefined += finite ? 0 : 1;
        *reinterpret_cast<double*>(to) = finite ? sum.sum + sum.rest : sum.sum;
    } else if constexpr (std::is_same_v<A, double>) {
        counts.undefined += sum - sum == 0 ? 0 : 1;
        *reinterpret_cast<double*>(to) = sum;
    } else if constexpr (sizeof(A) == 8) {
        *reinterpret_cast<A*>(to) = sum;
    } else if (out.type == DataType::int64) {
        counts.clipped += is_clipped<std::int64_t>(sum) ? 1 : 0;
        *reinterpret_cast<std::int64_t*>(to) = round_to<std::int64_t>(sum);
    } else {
        counts.clipped += is_clipped<std::uint64_t>(sum) ? 1 : 0;
        *reinterpret_cast<std::uint64_t*>(to) = round_to<std::uint64_t>(sum);
    }
}

template <class A>
__global__ void __launch_bounds__(block) columns_kernel(Columns<A> columns, unsigned long long* totals) {
    constexpr int together = sizeof(A) == 8 ? 8 : 4;
    std::int64_t const i = static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x,
                       pixels = columns.nx * columns.ny;
    driver::LossCounts counts;
    if (i < pixels) {
        std::int64_t const y = driver::quotient_of(i, columns.nx), x = i - y * columns.nx;
        A* const below = columns.below + columns.first_row * columns.nx + i;
        A sum = columns.first ? zero_sum<A>() : *below;
        auto const take = [&](A const& v, std::int64_t z) {
            A const all = sum + v;
            store_sum(columns.out, columns.out.at(x, y, z), columns.exclusive ? sum : all, counts);
            sum = all;
        };
        std::int64_t z = 0;
        for (; z + together <= columns.nz; z += together) {
            A v[together];
#pragma unroll
            for (int k = 0; k < together; ++k) v[k] = columns.sums[(z + k) * pixels + i];
#pragma unroll
            for (int k = 0; k < together; ++k) take(v[k], z + k);
        }
        for (; z < columns.nz; ++z) take(columns.sums[z * pixels + i], z);
        *below = sum;
    }
    driver::add_counts(counts, totals);
}

template <class A, class T> void scan_slab_of(ScanState& state, ConstView in, AnyView out, Losses& losses) {
    Index3 const n = in.dims();
    auto const columns_of = static_cast<std::size_t>(state.dims.x * state.dims.y);
    state.along_z.reserve(columns_of * sizeof(A));
    A* const below = reinterpret_cast<A*>(state.along_z.update(Space::device));
    bool const cut = n.y < state.dims.y; // rows of one slice: what is above them is kept
    state.above.reserve(static_cast<std::size_t>(n.x * n.z) * sizeof(A));
    A* const above = reinterpret_cast<A*>(cut ? state.above.update(Space::device) : state.above.write(Space::device));
    bool const in_place = sizeof(A) == 8 && out.contiguous();
    if (!in_place) state.rows.reserve(static_cast<std::size_t>(in.box.voxels()) * sizeof(A));
    A* const sums = reinterpret_cast<A*>(in_place ? out.data : state.rows.write(Space::device));
    Slab<T> const slab{
        reinterpret_cast<T const*>(in.data), in.row, in.slice, n.x, n.y, n.z, in.box.lower.y == 0, state.exclusive};
    Value<A, T> const value{!(state.map == ValueMap{}), state.map.slope, state.map.intercept};
    unsigned const blocks = launch_blocks((n.x * n.y + block - 1) / block), slices = launch_blocks(n.z);
    if (n.x <= row_block * each)
        slices_kernel<A, T, true><<<slices, row_block>>>(slab, value, above, sums);
    else
        slices_kernel<A, T, false><<<slices, row_block>>>(slab, value, above, sums);
    check_launch("scan");
    Columns<A> const columns{
        sums,           below, driver::device_rows(out, out.box), n.x, n.y, n.z, in.box.lower.y, in.box.lower.z == 0,
        state.exclusive};
    driver::DeviceLosses const counts;
    columns_kernel<A><<<blocks, block>>>(columns, counts.get());
    check_launch("scan");
    counts.add_to(losses);
}

} // namespace

void scan_slab(ScanState& state, ConstView in, AnyView out, Losses& losses, Execution const&) {
    if (out.box.empty()) return;
    with_type(in.type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) {
            if (state.sums == ScanSums::whole) return scan_slab_of<std::uint64_t, T>(state, in, out, losses);
            if (state.sums == ScanSums::wide) return scan_slab_of<Int128, T>(state, in, out, losses);
        }
        if (state.sums == ScanSums::real) return scan_slab_of<double, T>(state, in, out, losses);
        scan_slab_of<Pair, T>(state, in, out, losses);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
