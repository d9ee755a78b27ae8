// Views and single voxels as GPU kernels get them, and what all of them count and divide with.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_drivers.h"

#include <bit>
#include <type_traits>

namespace vkt::VKT_BACKEND {

namespace driver {

/// A view as kernels get it: its first byte is that of the output's first voxel.
struct DeviceRows {
    std::byte* data = nullptr;
    DataType type = DataType::uint8;
    int size = 1;
    int size_log = 0;                ///< of the size, to base 2
    std::int64_t row = 0, slice = 0; ///< bytes

    __device__ __forceinline__ std::byte* at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data + x * size + y * row + z * slice;
    }
    /// A row of so many; there is nothing to multiply with if it is the only one.
    __device__ __forceinline__ std::byte* row_at(std::int64_t rows, std::int64_t y, std::int64_t z) const {
        return rows == 1 ? data : data + y * row + z * slice;
    }
};
inline DeviceRows device_rows(ConstView view, Box const& box) {
    auto const size = static_cast<std::int64_t>(size_of(view.type));
    return {const_cast<std::byte*>(view.at(box.lower.x, box.lower.y, box.lower.z)),
            view.type,
            static_cast<int>(size),
            std::countr_zero(static_cast<unsigned>(size)),
            view.row * size,
            view.slice * size};
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

    __device__ __forceinline__ void operator+=(LossCounts const& more) {
        clipped += more.clipped, nan += more.nan, undefined += more.undefined;
    }
};

template <class R> __device__ __forceinline__ void store_value(DataType type, std::byte* to, R v, LossCounts& counts) {
    with_type(type, [&]<class T>(T) {
        counts.clipped += is_clipped<T>(v) ? 1 : 0;
        counts.nan += is_lost_nan<T>(v) ? 1 : 0;
        *reinterpret_cast<T*>(to) = round_to<T>(v);
    });
}

/// Counts of a block into three counters in global memory: one atomic each, if there is anything.
__device__ __forceinline__ void add_counts(LossCounts const& counts, unsigned long long* totals) {
    if (__syncthreads_or(static_cast<int>(counts.clipped | counts.nan | counts.undefined)) == 0) return;
    __shared__ unsigned sums[3];
    unsigned const thread = (threadIdx.z * blockDim.y + threadIdx.y) * blockDim.x + threadIdx.x;
    if (thread < 3) sums[thread] = 0;
    __syncthreads();
    unsigned const own[3] = {__reduce_add_sync(~0u, counts.clipped), __reduce_add_sync(~0u, counts.nan),
                             __reduce_add_sync(~0u, counts.undefined)};
    for (int i = 0; i < 3; ++i)
        if (thread % 32 == 0 && own[i] != 0) atomicAdd(&sums[i], own[i]);
    __syncthreads();
    if (thread < 3 && sums[thread] != 0) atomicAdd(totals + thread, static_cast<unsigned long long>(sums[thread]));
}

/// a / b for 0 <= a: in 32 bits where that will do, a fifth of the time.
__device__ __forceinline__ std::int64_t quotient_of(std::int64_t a, std::int64_t b) {
    if (((a | b) >> 32) == 0) return static_cast<unsigned>(a) / static_cast<unsigned>(b);
    return a / b;
}

/// Device memory for the time of one call.
class DeviceScratch {
public:
    explicit DeviceScratch(std::size_t bytes) : data_(device_allocate(bytes)) {}
    ~DeviceScratch() { device_free(data_); }
    DeviceScratch(DeviceScratch const&) = delete;
    DeviceScratch& operator=(DeviceScratch const&) = delete;
    std::byte* get() const { return data_; }

private:
    std::byte* data_;
};

} // namespace driver

} // namespace vkt::VKT_BACKEND
