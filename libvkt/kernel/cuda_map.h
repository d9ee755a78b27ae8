// The pointwise driver on a GPU: packs of the widest type, converted in registers, several a thread, loads before
// stores. SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_drivers.h"
#include "libvkt/kernel/losses.h"

namespace vkt::VKT_BACKEND {

namespace driver {

/// Calls f(T{}) with the storage type, in device code.
template <class F> __device__ __forceinline__ void for_stored_type(DataType type, F const& f) {
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

__device__ __forceinline__ std::int64_t byte_size(DataType type) {
    std::int64_t size = 0;
    for_stored_type(type, [&]<class T>(T) { size = static_cast<std::int64_t>(sizeof(T)); });
    return size;
}

/// N voxels from `from` on, as values of C. Packs of at most 16 bytes are one access.
template <class C, int N> struct Values { C v[N]; };
template <class C, int N> __device__ __forceinline__ Values<C, N> load_values(DataType type, std::byte const* from) {
    Values<C, N> values;
    for_stored_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) * N <= 16) { // the host packs by the widest type
            Pack<T, N> const pack = load_pack<T, N>(reinterpret_cast<T const*>(from));
#pragma unroll
            for (int i = 0; i < N; ++i) values.v[i] = static_cast<C>(pack.v[i]);
        }
    });
    return values;
}
template <class C> __device__ __forceinline__ C load_value(DataType type, std::byte const* from) {
    C value{};
    for_stored_type(type, [&]<class T>(T) { value = static_cast<C>(*reinterpret_cast<T const*>(from)); });
    return value;
}

struct DeviceLosses {
    unsigned clipped = 0, nan = 0, undefined = 0;
};

template <class T, class C> __device__ __forceinline__ T stored(C value, DeviceLosses& losses) {
    losses.clipped += is_clipped<T>(value) ? 1 : 0;
    losses.nan += is_lost_nan<T>(value) ? 1 : 0;
    return round_to<T>(value);
}

template <bool At, class C, class F, class... In>
__device__ __forceinline__ C evaluate(F const& f, Index3 at, DeviceLosses& losses, In... in) {
    if constexpr (requires { f.undefined(in...); }) {
        if (f.undefined(in...)) {
            ++losses.undefined;
            return f.instead(in...);
        }
    }
    if constexpr (At)
        return f(at.x, at.y, at.z, in...);
    else
        return f(in...);
}

/// Adds up over the block first: one atomic a block, or a volume that is clipped throughout would wait for its counter.
__device__ __forceinline__ void add_losses(DeviceLosses const& mine, unsigned long long* counts) {
    __shared__ unsigned sums[3];
    unsigned const thread = threadIdx.y * blockDim.x + threadIdx.x;
    if (thread < 3) sums[thread] = 0;
    __syncthreads();
    unsigned const warp[3] = {__reduce_add_sync(~0u, mine.clipped), __reduce_add_sync(~0u, mine.nan),
                              __reduce_add_sync(~0u, mine.undefined)};
    if (thread % 32 == 0)
        for (int i = 0; i < 3; ++i)
            if (warp[i] != 0) atomicAdd(&sums[i], warp[i]);
    __syncthreads();
    if (thread < 3 && sums[thread] != 0) atomicAdd(counts + thread, static_cast<unsigned long long>(sums[thread]));
}

/// N consecutive voxels a unit, aligned on the output; K units a thread, the block's width apart.
template <int N, int K, bool At, class C, class F, class... In>
__global__ void __launch_bounds__(block_threads)
    map_any_kernel(Rows rows, AnyView out, F f, unsigned long long* counts, bool counted, In... in) {
    std::int64_t const row = static_cast<std::int64_t>(blockIdx.x / rows.blocks_per_row) * blockDim.y + threadIdx.y;
    DeviceLosses losses;
    if (row < rows.rows) {
        std::int64_t const slice = row / rows.ny;
        Index3 const begin{out.box.lower.x, out.box.lower.y + (row - slice * rows.ny), out.box.lower.z + slice};
        auto const size = byte_size(out.type);
        auto const row_of = [&](auto const& view) {
            return view.data +
                   byte_size(view.type) * ((begin.x - view.box.lower.x) + (begin.y - view.box.lower.y) * view.row +
                                           (begin.z - view.box.lower.z) * view.slice);
        };
        std::byte* const to = row_of(out);
        auto const head = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(to) / size % N);
        std::int64_t const first =
            static_cast<std::int64_t>(blockIdx.x % rows.blocks_per_row) * (blockDim.x * K) + threadIdx.x;
        auto const begin_of = [&](int k) { return (first + static_cast<std::int64_t>(k) * blockDim.x) * N - head; };
        Values<C, N> results[K];
#pragma unroll
        for (int k = 0; k < K; ++k) {
            std::int64_t const e = begin_of(k);
            if (e < 0 || e + N > rows.nx) continue;
            [&](auto const&... values) {
#pragma unroll
                for (int i = 0; i < N; ++i)
                    results[k].v[i] =
                        evaluate<At, C>(f, Index3{begin.x + e + i, begin.y, begin.z}, losses, values.v[i]...);
            }(load_values<C, N>(in.type, row_of(in) + e * byte_size(in.type))...);
        }
        for_stored_type(out.type, [&]<class T>(T) {
            T* const typed = reinterpret_cast<T*>(to);
#pragma unroll
            for (int k = 0; k < K; ++k) {
                std::int64_t const e = begin_of(k);
                if (e >= 0 && e + N <= rows.nx) {
                    if constexpr (sizeof(T) * N <= 16) {
                        Pack<T, N> pack;
#pragma unroll
                        for (int i = 0; i < N; ++i) pack.v[i] = stored<T>(results[k].v[i], losses);
                        *reinterpret_cast<Pack<T, N>*>(typed + e) = pack;
                    }
                } else if (e < rows.nx) {
                    for (std::int64_t i = e < 0 ? 0 : e; i < e + N && i < rows.nx; ++i)
                        typed[i] =
                            stored<T>(evaluate<At, C>(f, Index3{begin.x + i, begin.y, begin.z}, losses,
                                                      load_value<C>(in.type, row_of(in) + i * byte_size(in.type))...),
                                      losses);
                }
            }
        });
    }
    if (counted) add_losses(losses, counts);
}

/// Three counters in device memory for the time of one call.
class DeviceCounts {
public:
    DeviceCounts() : counts_(reinterpret_cast<unsigned long long*>(device_allocate(bytes))) {
        device_clear(counts_, bytes);
    }
    ~DeviceCounts() { device_free(reinterpret_cast<std::byte*>(counts_)); }
    DeviceCounts(DeviceCounts const&) = delete;
    DeviceCounts& operator=(DeviceCounts const&) = delete;
    unsigned long long* get() const { return counts_; }
    Losses read() const {
        unsigned long long counts[3];
        copy_to_host(counts, counts_, bytes);
        return {static_cast<std::int64_t>(counts[0]), static_cast<std::int64_t>(counts[1]),
                static_cast<std::int64_t>(counts[2])};
    }

private:
    static constexpr std::size_t bytes = 3 * sizeof(unsigned long long);
    unsigned long long* counts_;
};

template <int N, bool At, class C, class F, class... In>
void launch_map_any(AnyView const& out, Losses& losses, F const& f, In const&... in) {
    constexpr int per_thread = 4;
    Rows const rows = rows_of(out.box.dims(), (out.box.dims().x + 2 * N - 2) / N, per_thread);
    bool const counted = is_integer(out.type) || sizeof(C) > size_of(out.type) || requires {
        f.undefined(C(in.box.lower.x)...);
    };
    if (!counted) {
        map_any_kernel<N, per_thread, At, C><<<rows.grid, rows.block>>>(rows, out, f, nullptr, false, in...);
        check_launch("map");
        return;
    }
    DeviceCounts const counts;
    map_any_kernel<N, per_thread, At, C><<<rows.grid, rows.block>>>(rows, out, f, counts.get(), true, in...);
    check_launch("map");
    losses += counts.read();
}

template <bool At, class C, class F, class... In>
void map_any(AnyView out, Losses& losses, F const& f, In const&... in) {
    if (out.box.empty()) return;
    if (!At && dense(out.box, out, in...)) {
        out.box = as_one_row(out.box);
        out.row = out.slice = out.box.dims().x;
    }
    std::size_t widest = size_of(out.type);
    ((widest = std::max(widest, size_of(in.type))), ...);
    switch (widest) {
    case 1:
        return launch_map_any<16, At, C>(out, losses, f, in...);
    case 2:
        return launch_map_any<8, At, C>(out, losses, f, in...);
    case 4:
        return launch_map_any<4, At, C>(out, losses, f, in...);
    default:
        return launch_map_any<2, At, C>(out, losses, f, in...);
    }
}

} // namespace driver

/// See kernel.h.
template <class C, class F, class... In>
void map(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_any<false, C>(out, losses, f, in...);
}

template <class C, class F, class... In>
void map_at(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_any<true, C>(out, losses, f, in...);
}

} // namespace vkt::VKT_BACKEND
