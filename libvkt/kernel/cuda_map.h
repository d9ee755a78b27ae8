// map and reduce on a GPU: one kernel a functor for all data types, in packs of 16 bytes of the widest type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_drivers.h"

#include <type_traits>
#include <utility>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

/// A view as kernels get it: its first byte is that of the output's first voxel.
struct DeviceRows {
    std::byte* data = nullptr;
    DataType type = DataType::uint8;
    int size = 1;
    std::int64_t row = 0, slice = 0; ///< bytes

    __device__ __forceinline__ std::byte* at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data + x * size + y * row + z * slice;
    }
};
inline DeviceRows device_rows(ConstView view, Box const& box) {
    auto const size = static_cast<std::int64_t>(size_of(view.type));
    return {const_cast<std::byte*>(view.at(box.lower.x, box.lower.y, box.lower.z)), view.type, static_cast<int>(size),
            view.row * size, view.slice * size};
}

/// Calls f(T{}) with the storage type, on the device.
template <class F> __device__ __forceinline__ void with_type(DataType type, F&& f) {
    switch (type) {
    case DataType::uint8:
        return f(std::uint8_t{});
    case DataType::int8:
        return f(std::int8_t{});
    case DataType::uint16:
        return f(std::uint16_t{});
    case DataType::int16:
        return f(std::int16_t{});
    case DataType::uint32:
        return f(std::uint32_t{});
    case DataType::int32:
        return f(std::int32_t{});
    case DataType::uint64:
        return f(std::uint64_t{});
    case DataType::int64:
        return f(std::int64_t{});
    case DataType::float16:
        return f(Half{});
    case DataType::float32:
        return f(float{});
    case DataType::float64:
        return f(double{});
    }
}

/// A voxel as C; Int128 is made of integers only.
template <class C, class T> __device__ __forceinline__ C as_compute(T v) {
    if constexpr (std::is_same_v<C, Int128> && !std::is_integral_v<T>)
        return C(0);
    else
        return static_cast<C>(v);
}
template <class C> __device__ __forceinline__ C load_value(DataType type, std::byte const* from) {
    C value{};
    with_type(type, [&]<class T>(T) { value = as_compute<C>(*reinterpret_cast<T const*>(from)); });
    return value;
}

struct LossCounts {
    unsigned clipped = 0, nan = 0, undefined = 0;
};

template <class R> __device__ __forceinline__ void store_value(DataType type, std::byte* to, R v, LossCounts& counts) {
    with_type(type, [&]<class T>(T) {
        counts.clipped += is_clipped<T>(v) ? 1 : 0;
        counts.nan += is_lost_nan<T>(v) ? 1 : 0;
        *reinterpret_cast<T*>(to) = round_to<T>(v);
    });
}

/// The bytes of N voxels, 16 at most.
struct alignas(16) RawPack {
    unsigned char bytes[16];
};

template <int N> __device__ __forceinline__ RawPack load_raw(std::byte const* from, int size) {
    RawPack raw;
    auto const address = reinterpret_cast<std::uintptr_t>(from);
    bool const aligned = address % static_cast<unsigned>(N * size) == 0;
    if (N * size == 16) {
        *reinterpret_cast<uint4*>(&raw) = load_16(from);
    } else if (aligned && N * size == 8) {
        *reinterpret_cast<uint2*>(&raw) = *reinterpret_cast<uint2 const*>(from);
    } else if (aligned && N * size == 4) {
        *reinterpret_cast<unsigned*>(&raw) = *reinterpret_cast<unsigned const*>(from);
    } else if (aligned && N * size == 2) {
        *reinterpret_cast<unsigned short*>(&raw) = *reinterpret_cast<unsigned short const*>(from);
    } else if (size == 1) {
#pragma unroll
        for (int i = 0; i < N; ++i) raw.bytes[i] = static_cast<unsigned char>(from[i]);
    } else if (size == 2) {
#pragma unroll
        for (int i = 0; i < N && i < 8; ++i)
            reinterpret_cast<unsigned short*>(&raw)[i] = reinterpret_cast<unsigned short const*>(from)[i];
    } else {
#pragma unroll
        for (int i = 0; i < N && i < 4; ++i)
            reinterpret_cast<unsigned*>(&raw)[i] = reinterpret_cast<unsigned const*>(from)[i];
    }
    return raw;
}

template <int N> __device__ __forceinline__ void store_raw(std::byte* to, int size, RawPack const& raw) {
    if (N * size == 16)
        *reinterpret_cast<uint4*>(to) = *reinterpret_cast<uint4 const*>(&raw);
    else if (N * size == 8)
        *reinterpret_cast<uint2*>(to) = *reinterpret_cast<uint2 const*>(&raw);
    else if (N * size == 4)
        *reinterpret_cast<unsigned*>(to) = *reinterpret_cast<unsigned const*>(&raw);
    else
        *reinterpret_cast<unsigned short*>(to) = *reinterpret_cast<unsigned short const*>(&raw);
}

template <int N, class C> __device__ __forceinline__ void widen(DataType type, RawPack const& raw, C (&v)[N]) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) * N <= 16) {
#pragma unroll
            for (int i = 0; i < N; ++i) v[i] = as_compute<C>(reinterpret_cast<T const*>(&raw)[i]);
        }
    });
}

template <int N, class R>
__device__ __forceinline__ RawPack narrow(DataType type, R const (&v)[N], LossCounts& counts) {
    RawPack raw;
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) * N <= 16) {
#pragma unroll
            for (int i = 0; i < N; ++i) {
                counts.clipped += is_clipped<T>(v[i]) ? 1 : 0;
                counts.nan += is_lost_nan<T>(v[i]) ? 1 : 0;
                reinterpret_cast<T*>(&raw)[i] = round_to<T>(v[i]);
            }
        }
    });
    return raw;
}

template <class F, class... C>
concept CountsUndefined = requires(F const& f, C... values) {
    f.undefined(values...);
};

/// Counts of a block into three counters in global memory: one atomic each, if there is anything.
__device__ __forceinline__ void add_counts(LossCounts const& counts, unsigned long long* totals) {
    __shared__ unsigned sums[3];
    unsigned const thread = threadIdx.y * blockDim.x + threadIdx.x;
    if (thread < 3) sums[thread] = 0;
    __syncthreads();
    unsigned const own[3] = {__reduce_add_sync(~0u, counts.clipped), __reduce_add_sync(~0u, counts.nan),
                             __reduce_add_sync(~0u, counts.undefined)};
    for (int i = 0; i < 3; ++i)
        if (thread % 32 == 0 && own[i] != 0) atomicAdd(&sums[i], own[i]);
    __syncthreads();
    if (thread < 3 && sums[thread] != 0) atomicAdd(totals + thread, static_cast<unsigned long long>(sums[thread]));
}

template <int inputs> struct Inputs { DeviceRows rows[inputs > 0 ? inputs : 1]; };

/// What a functor makes of one voxel at (x, y, z), whose values are v.
template <class C, bool At, class F, std::size_t... k>
__device__ __forceinline__ auto evaluate(F const& f, double x, double y, double z, C const* v, LossCounts& counts,
                                         std::index_sequence<k...>) {
    if constexpr (CountsUndefined<F, decltype(v[k])...>) counts.undefined += f.undefined(v[k]...) ? 1 : 0;
    if constexpr (At)
        return f(x, y, z, v[k]...);
    else
        return f(v[k]...);
}
template <class C, bool At, int inputs, class F>
using ResultOf = decltype(evaluate<C, At>(std::declval<F const&>(), 0.0, 0.0, 0.0, std::declval<C const*>(),
                                          std::declval<LossCounts&>(), std::make_index_sequence<inputs>{}));

/// N consecutive voxels a pack (aligned on the output), K packs a thread, the block's width apart; all loads come
/// first.
template <class C, int N, int inputs, bool At, class F>
__global__ void __launch_bounds__(block_threads)
    map_any(Rows rows, Index3 lower, DeviceRows out, Inputs<inputs> in, F f, unsigned long long* totals) {
    using Result = ResultOf<C, At, inputs, F>;
    constexpr int K = inputs > 1 ? 2 : 4;
    constexpr auto all = std::make_index_sequence<inputs>{};
    std::int64_t const row = static_cast<std::int64_t>(blockIdx.x / rows.blocks_per_row) * blockDim.y + threadIdx.y;
    LossCounts counts;
    if (row < rows.rows) {
        std::int64_t const z = row / rows.ny, y = row - z * rows.ny;
        std::byte* const to = out.at(0, y, z);
        auto const head =
            static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(to) / static_cast<unsigned>(out.size) % N);
        std::int64_t const first =
            static_cast<std::int64_t>(blockIdx.x % rows.blocks_per_row) * (blockDim.x * K) + threadIdx.x;
        auto const x0 = static_cast<double>(lower.x), at_y = static_cast<double>(lower.y + y),
                   at_z = static_cast<double>(lower.z + z);
        RawPack raw[K][inputs + 1]; // one more, lest there is none
#pragma unroll
        for (int j = 0; j < K; ++j) {
            std::int64_t const x = (first + static_cast<std::int64_t>(j) * blockDim.x) * N - head;
            if (x < 0 || x + N > rows.nx) continue;
#pragma unroll
            for (int i = 0; i < inputs; ++i) raw[j][i] = load_raw<N>(in.rows[i].at(x, y, z), in.rows[i].size);
        }
#pragma unroll
        for (int j = 0; j < K; ++j) {
            std::int64_t const x = (first + static_cast<std::int64_t>(j) * blockDim.x) * N - head;
            if (x >= 0 && x + N <= rows.nx) {
                C values[inputs + 1][N];
#pragma unroll
                for (int i = 0; i < inputs; ++i) widen<N>(in.rows[i].type, raw[j][i], values[i]);
                Result results[N];
#pragma unroll
                for (int n = 0; n < N; ++n) {
                    C voxel[inputs + 1];
#pragma unroll
                    for (int i = 0; i < inputs; ++i) voxel[i] = values[i][n];
                    results[n] = evaluate<C, At>(f, x0 + static_cast<double>(x + n), at_y, at_z, voxel, counts, all);
                }
                store_raw<N>(to + x * out.size, out.size, narrow<N>(out.type, results, counts));
            } else if (x < rows.nx) {
                for (std::int64_t n = x < 0 ? 0 : x; n < x + N && n < rows.nx; ++n) {
                    C voxel[inputs + 1];
#pragma unroll
                    for (int i = 0; i < inputs; ++i) voxel[i] = load_value<C>(in.rows[i].type, in.rows[i].at(n, y, z));
                    store_value(out.type, to + n * out.size,
                                evaluate<C, At>(f, x0 + static_cast<double>(n), at_y, at_z, voxel, counts, all),
                                counts);
                }
            }
        }
    }
    add_counts(counts, totals);
}

// Kernels are launched from function templates: those that only a generic lambda instantiates are not found.
template <class C, int N, bool At, int inputs, class F>
void launch_packs(Box const& box, AnyView out, Inputs<inputs> const& in, F const& f, unsigned long long* totals) {
    Rows const rows = rows_of(box.dims(), (box.dims().x + 2 * N - 2) / N, inputs > 1 ? 2 : 4);
    map_any<C, N, inputs, At, F>
        <<<rows.grid, rows.block>>>(rows, out.box.lower, device_rows(ConstView(out), out.box), in, f, totals);
}

template <class C, bool At, class F, class... In>
void launch_map_any(AnyView out, Losses& losses, F const& f, In const&... in) {
    if (out.box.empty()) return;
    Box const box = !At && dense(out.box, out, in...) ? as_one_row(out.box) : out.box;
    constexpr int count = static_cast<int>(sizeof...(In));
    Inputs<count> inputs;
    int i = 0;
    ((inputs.rows[i++] = device_rows(in, out.box)), ...);
    std::size_t widest = size_of(out.type);
    ((widest = std::max(widest, size_of(in.type))), ...);
    DeviceLosses const counts;
    if (widest == 8)
        launch_packs<C, 2, At, count>(box, out, inputs, f, counts.get());
    else if (widest == 4)
        launch_packs<C, 4, At, count>(box, out, inputs, f, counts.get());
    else if (widest == 2)
        launch_packs<C, 8, At, count>(box, out, inputs, f, counts.get());
    else
        launch_packs<C, 16, At, count>(box, out, inputs, f, counts.get());
    check_launch("map");
    counts.add_to(losses);
}

/// One partial result a block, of rows that follow one another; merged in order on the host.
template <class C, class R>
__global__ void __launch_bounds__(block_threads) reduce_any(DeviceRows in, Index3 dims, R zero, R* parts) {
    std::int64_t const rows = dims.y * dims.z;
    R mine = zero;
    for (std::int64_t row = blockIdx.x; row < rows; row += gridDim.x) {
        std::int64_t const z = row / dims.y, y = row - z * dims.y;
        for (std::int64_t x = threadIdx.x; x < dims.x; x += block_threads)
            mine.add(load_value<C>(in.type, in.at(x, y, z)));
    }
    extern __shared__ __align__(16) unsigned char memory[];
    R* const all = reinterpret_cast<R*>(memory);
    all[threadIdx.x] = mine;
    for (unsigned half = block_threads / 2; half > 0; half /= 2) {
        __syncthreads();
        if (threadIdx.x < half) all[threadIdx.x].merge(all[threadIdx.x + half]);
    }
    if (threadIdx.x == 0) parts[blockIdx.x] = all[0];
}

} // namespace driver

template <class C, class F, class... In>
void map(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, false>(out, losses, f, in...);
}

template <class C, class F, class... In>
void map_at(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, true>(out, losses, f, in...);
}

template <class C, class R> R reduce(Execution const&, ConstView in, R const& zero) {
    static_assert(std::is_trivially_copyable_v<R>);
    R result = zero;
    if (in.box.empty()) return result;
    Index3 dims = in.dims();
    if (in.contiguous()) { // short rows would leave threads idle
        std::int64_t const voxels = in.box.voxels(), length = std::min<std::int64_t>(voxels, 4096);
        if (voxels % length == 0) {
            DataType const type = in.type;
            in = dense_view(in.data, type, box_of({length, voxels / length, 1}), Space::device);
            dims = in.dims();
        }
    }
    auto const blocks = static_cast<unsigned>(std::min<std::int64_t>(dims.y * dims.z, 4096));
    R* const parts = reinterpret_cast<R*>(device_allocate(blocks * sizeof(R)));
    driver::reduce_any<C><<<blocks, driver::block_threads, driver::block_threads * sizeof(R)>>>(
        driver::device_rows(in, in.box), dims, zero, parts);
    std::vector<R> host(blocks, zero);
    try {
        check_launch("reduce");
        copy_to_host(host.data(), parts, blocks * sizeof(R));
    } catch (...) {
        device_free(reinterpret_cast<std::byte*>(parts));
        throw;
    }
    device_free(reinterpret_cast<std::byte*>(parts));
    for (R const& part : host) result.merge(part);
    return result;
}

} // namespace vkt::VKT_BACKEND
