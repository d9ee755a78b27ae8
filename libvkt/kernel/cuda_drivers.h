// The drivers on a GPU: whole 16-byte accesses, several per thread, all loads before the first store.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/kernel/numeric.h"

namespace vkt::VKT_BACKEND {

namespace driver {

inline constexpr int block_threads = 256;

/// Rows of a box as blocks of threads: `units` accesses per row, `per_thread` of them a thread, narrow rows several a
/// block.
struct Rows {
    std::int64_t nx = 0, ny = 1, rows = 0;
    unsigned blocks_per_row = 1;
    dim3 grid, block;
};

/// Blocks are whole warps, unless they may be `ragged`: then no thread is idle because rows are a little longer than a
/// power of two.
inline Rows rows_of(Index3 dims, std::int64_t units, int per_thread, bool ragged = false) {
    Rows r;
    r.nx = dims.x;
    r.ny = dims.y;
    r.rows = dims.y * dims.z;
    std::int64_t const threads = (units + per_thread - 1) / per_thread;
    unsigned across = 1;
    while (across < block_threads && across < threads) across *= 2;
    if (ragged) {
        std::int64_t const blocks = (threads + block_threads - 1) / block_threads;
        across = static_cast<unsigned>((threads + blocks - 1) / blocks);
    }
    r.block = dim3(across, block_threads / across);
    std::int64_t const per_row = (threads + across - 1) / across;
    std::int64_t const row_blocks = (r.rows + r.block.y - 1) / r.block.y;
    r.blocks_per_row = launch_blocks(per_row);
    r.grid = dim3(launch_blocks(per_row, row_blocks));
    return r;
}

template <class T, int N> struct alignas(sizeof(T) * N) Pack { T v[N]; };

template <class T, int N> __device__ __forceinline__ Pack<T, N> load_pack(T const* from) {
    if (reinterpret_cast<std::uintptr_t>(from) % sizeof(Pack<T, N>) == 0)
        return *reinterpret_cast<Pack<T, N> const*>(from);
    Pack<T, N> pack;
#pragma unroll
    for (int i = 0; i < N; ++i) pack.v[i] = from[i];
    return pack;
}

/// Calls the functor with or without the position, and rounds and counts if asked.
template <bool At, bool Rounded, class T, class F> struct Voxel {
    F f;
    unsigned clipped = 0, nan = 0;

    template <class... In>
    __device__ __forceinline__ T operator()(std::int64_t x, std::int64_t y, std::int64_t z, In... in) {
        if constexpr (Rounded) {
            auto const v = value(x, y, z, in...);
            clipped += is_clipped<T>(v) ? 1 : 0;
            nan += is_lost_nan<T>(v) ? 1 : 0;
            return round_to<T>(v);
        } else {
            return value(x, y, z, in...);
        }
    }
    template <class... In>
    __device__ __forceinline__ auto value(std::int64_t x, std::int64_t y, std::int64_t z, In... in) const {
        if constexpr (At)
            return f(x, y, z, in...);
        else
            return f(in...);
    }
};

/// N consecutive voxels a unit (aligned on the output), K units a thread, the block's width apart.
template <int N, int K, bool At, bool Rounded, class T, class F, class... In>
__global__ void __launch_bounds__(block_threads)
    map_kernel(Rows rows, Index3 lower, View<T> out, F f, unsigned long long* losses, View<In>... in) {
    std::int64_t const row = static_cast<std::int64_t>(blockIdx.x / rows.blocks_per_row) * blockDim.y + threadIdx.y;
    Voxel<At, Rounded, T, F> voxel{f};
    if (row < rows.rows) {
        std::int64_t const slice = row / rows.ny, y = lower.y + (row - slice * rows.ny), z = lower.z + slice;
        T* const to = &out(lower.x, y, z);
        auto const head = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(to) / sizeof(T) % N);
        std::int64_t const first =
            static_cast<std::int64_t>(blockIdx.x % rows.blocks_per_row) * (blockDim.x * K) + threadIdx.x;
        Pack<T, N> results[K];
#pragma unroll
        for (int k = 0; k < K; ++k) {
            std::int64_t const e = (first + static_cast<std::int64_t>(k) * blockDim.x) * N - head;
            if (e < 0 || e + N > rows.nx) continue;
            auto const evaluate = [&](auto const&... packs) {
#pragma unroll
                for (int i = 0; i < N; ++i) results[k].v[i] = voxel(lower.x + e + i, y, z, packs.v[i]...);
            };
            evaluate(load_pack<std::remove_const_t<In>, N>(&in(lower.x + e, y, z))...);
        }
#pragma unroll
        for (int k = 0; k < K; ++k) {
            std::int64_t const e = (first + static_cast<std::int64_t>(k) * blockDim.x) * N - head;
            if (e >= 0 && e + N <= rows.nx) {
                *reinterpret_cast<Pack<T, N>*>(to + e) = results[k];
            } else if (e < rows.nx) {
                for (std::int64_t i = e < 0 ? 0 : e; i < e + N && i < rows.nx; ++i)
                    to[i] = voxel(lower.x + i, y, z, in(lower.x + i, y, z)...);
            }
        }
    }
    if constexpr (Rounded) {
        unsigned const clipped = __reduce_add_sync(~0u, voxel.clipped), nan = __reduce_add_sync(~0u, voxel.nan);
        if ((threadIdx.y * blockDim.x + threadIdx.x) % 32 == 0) {
            if (clipped != 0) atomicAdd(losses, static_cast<unsigned long long>(clipped));
            if (nan != 0) atomicAdd(losses + 1, static_cast<unsigned long long>(nan));
        }
    }
}

template <int N, int K, bool At, bool Rounded, class T, class F, class... In>
void launch_map(Box const& box, View<T> out, F const& f, unsigned long long* losses, View<In>... in) {
    if (box.empty()) return;
    Rows const rows = rows_of(box.dims(), (box.dims().x + 2 * N - 2) / N, K);
    map_kernel<N, K, At, Rounded><<<rows.grid, rows.block>>>(rows, box.lower, out, f, losses, in...);
    check_launch(At ? "map_at" : "map");
}

/// Three counters in device memory for the time of one call.
class DeviceLosses {
public:
    DeviceLosses() : counts_(reinterpret_cast<unsigned long long*>(device_allocate(24))) { device_clear(counts_, 24); }
    ~DeviceLosses() { device_free(reinterpret_cast<std::byte*>(counts_)); }
    DeviceLosses(DeviceLosses const&) = delete;
    DeviceLosses& operator=(DeviceLosses const&) = delete;
    unsigned long long* get() const { return counts_; }
    void add_to(Losses& losses) const {
        unsigned long long counts[3];
        copy_to_host(counts, counts_, sizeof counts);
        losses += {static_cast<std::int64_t>(counts[0]), static_cast<std::int64_t>(counts[1]),
                   static_cast<std::int64_t>(counts[2])};
    }

private:
    unsigned long long* counts_;
};

template <class... V> bool dense(Box const& box, V const&... views) {
    Index3 const dims = box.dims();
    return ((views.row == dims.x && views.slice == dims.x * dims.y) && ...);
}
inline Box as_one_row(Box const& box) {
    return {box.lower, {box.lower.x + box.voxels(), box.lower.y + 1, box.lower.z + 1}};
}

template <class T, class... In> constexpr int pack_size() {
    std::size_t most = sizeof(T);
    ((most = sizeof(In) > most ? sizeof(In) : most), ...);
    return static_cast<int>(16 / most);
}

} // namespace driver

template <class T, class F, class... In>
void map(Execution const&, Box const& box, View<T> out, F const& f, View<In>... in) {
    Box const rows = !box.empty() && driver::dense(box, out, in...) ? driver::as_one_row(box) : box;
    driver::launch_map<driver::pack_size<T, In...>(), 2, false, false>(rows, out, f, nullptr, in...);
}

template <class T, class F, class... In>
void map_at(Execution const&, Box const& box, View<T> out, F const& f, View<In>... in) {
    driver::launch_map<driver::pack_size<T, In...>(), 2, true, false>(box, out, f, nullptr, in...);
}

/// Four voxels a thread, a block's width apart: neighbouring threads read neighbouring voxels (measured best for
/// gathers).
template <class T, class F> void gather(Execution const&, Box const& box, View<T> out, F const& f) {
    driver::launch_map<1, 4, true, false>(box, out, f, nullptr);
}

template <class T, class F, class... In>
void map_rounded(Execution const&, Box const& box, View<T> out, Losses& losses, F const& f, View<In>... in) {
    driver::DeviceLosses const counts;
    Box const rows = !box.empty() && driver::dense(box, out, in...) ? driver::as_one_row(box) : box;
    driver::launch_map<driver::pack_size<T, In...>(), 2, false, true>(rows, out, f, counts.get(), in...);
    counts.add_to(losses);
}

template <class T, class F>
void gather_rounded(Execution const&, Box const& box, View<T> out, Losses& losses, F const& f) {
    driver::DeviceLosses const counts;
    driver::launch_map<1, 4, true, true>(box, out, f, counts.get());
    counts.add_to(losses);
}

namespace driver {

template <class T> struct Constant {
    T value;
    __device__ __forceinline__ T operator()() const { return value; }
};

} // namespace driver

template <class T> void fill(Execution const& execution, Box const& box, View<T> out, T value) {
    map(execution, box, out, driver::Constant<T>{value});
}

namespace driver {

/// A copy of rows of bytes. Strides in bytes; those of the source are negative along mirrored axes.
struct RowCopy {
    std::byte const* from;
    std::byte* to;
    std::int64_t bytes; ///< of a row
    std::int64_t from_row, from_slice, to_row, to_slice;
};

/// 16 bytes from anywhere: one access if aligned, else the aligned words around them, shifted. Every word that is
/// touched holds at least one of the bytes wanted.
__device__ __forceinline__ uint4 load_16(std::byte const* from) {
    auto const address = reinterpret_cast<std::uintptr_t>(from);
    if (address % 16 == 0) return *reinterpret_cast<uint4 const*>(from);
    auto const* const words = reinterpret_cast<unsigned const*>(address & ~std::uintptr_t{3});
    auto const shift = static_cast<unsigned>(address & 3) * 8;
    unsigned w[5] = {words[0], words[1], words[2], words[3], 0};
    if (shift != 0) w[4] = words[4];
    return {__funnelshift_r(w[0], w[1], shift), __funnelshift_r(w[1], w[2], shift), __funnelshift_r(w[2], w[3], shift),
            __funnelshift_r(w[3], w[4], shift)};
}

template <class U> __device__ __forceinline__ unsigned reverse_word(unsigned word) {
    if constexpr (sizeof(U) == 1) return __byte_perm(word, 0, 0x0123);
    if constexpr (sizeof(U) == 2) return __byte_perm(word, 0, 0x1032);
    return word;
}

template <class U> __device__ __forceinline__ uint4 reversed(uint4 v) {
    if constexpr (sizeof(U) == 8) return {v.z, v.w, v.x, v.y};
    return {reverse_word<U>(v.w), reverse_word<U>(v.z), reverse_word<U>(v.y), reverse_word<U>(v.x)};
}

template <int K, bool Reverse, class U>
__global__ void __launch_bounds__(block_threads) copy_kernel(Rows rows, RowCopy copy) {
    std::int64_t const row = static_cast<std::int64_t>(blockIdx.x / rows.blocks_per_row) * blockDim.y + threadIdx.y;
    if (row >= rows.rows) return;
    std::int64_t const z = row / rows.ny, y = row - z * rows.ny;
    std::byte const* const from = copy.from + y * copy.from_row + z * copy.from_slice;
    std::byte* const to = copy.to + y * copy.to_row + z * copy.to_slice;
    auto const head = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(to) % 16);
    std::int64_t const first =
        static_cast<std::int64_t>(blockIdx.x % rows.blocks_per_row) * (blockDim.x * K) + threadIdx.x;
    uint4 values[K];
#pragma unroll
    for (int k = 0; k < K; ++k) {
        std::int64_t const b = (first + static_cast<std::int64_t>(k) * blockDim.x) * 16 - head;
        if (b < 0 || b + 16 > copy.bytes) continue;
        values[k] = Reverse ? reversed<U>(load_16(from + (copy.bytes - 16 - b))) : load_16(from + b);
    }
#pragma unroll
    for (int k = 0; k < K; ++k) {
        std::int64_t const b = (first + static_cast<std::int64_t>(k) * blockDim.x) * 16 - head;
        if (b >= 0 && b + 16 <= copy.bytes) {
            *reinterpret_cast<uint4*>(to + b) = values[k];
        } else if (b < copy.bytes) {
            constexpr auto size = static_cast<std::int64_t>(sizeof(U));
            for (std::int64_t i = b < 0 ? 0 : b; i < b + 16 && i < copy.bytes; i += size)
                *reinterpret_cast<U*>(to + i) =
                    *reinterpret_cast<U const*>(from + (Reverse ? copy.bytes - size - i : i));
        }
    }
}

template <bool Reverse, class U> void launch_copy(Index3 dims, RowCopy const& copy) {
    constexpr int per_thread = 2;
    Rows const rows = rows_of(dims, (copy.bytes + 30) / 16, per_thread, sizeof(U) >= 4);
    copy_kernel<per_thread, Reverse, U><<<rows.grid, rows.block>>>(rows, copy);
    check_launch("copy_box");
}

/// The 16 bytes that begin `within` bytes after the begin of `a`, of which `b` is the continuation.
__device__ __forceinline__ uint4 join(uint4 a, uint4 b, unsigned within) {
    unsigned const shift = (within & 3) * 8;
    auto const shifted = [shift](unsigned p, unsigned q, unsigned r, unsigned s, unsigned t) -> uint4 {
        return {__funnelshift_r(p, q, shift), __funnelshift_r(q, r, shift), __funnelshift_r(r, s, shift),
                __funnelshift_r(s, t, shift)};
    };
    switch (within >> 2) {
    case 0:
        return shifted(a.x, a.y, a.z, a.w, b.x);
    case 1:
        return shifted(a.y, a.z, a.w, b.x, b.y);
    case 2:
        return shifted(a.z, a.w, b.x, b.y, b.z);
    default:
        return shifted(a.w, b.x, b.y, b.z, b.w);
    }
}

/// The first n bytes of a, the rest of b.
__device__ __forceinline__ unsigned spliced(int n, unsigned a, unsigned b) {
    unsigned const mask = n <= 0 ? 0u : n >= 4 ? ~0u : (1u << (8 * n)) - 1;
    return (a & mask) | (b & ~mask);
}

/// What a dense copy of rows needs besides: bytes in [first, last) of the source may be touched.
struct DenseCopy {
    unsigned rows, ny;
    std::byte const *first, *last;
};

/// Rows of small voxels that follow one another without gaps and whose lengths are no multiple of 16 bytes. A warp a
/// row, so that the source is off alignment by the same for all its lanes; the unit in which one row ends and the next
/// begins is put together by the warp of the former. Measured on an H200 at 1024^3, share of a plain copy: uint8 0.91,
/// uint16 0.93; with units that end with their row 0.47 to 0.61 and 0.80 to 0.86.
template <bool Reverse, class U>
__global__ void __launch_bounds__(block_threads) dense_copy_kernel(DenseCopy dense, RowCopy copy) {
    unsigned const row = blockIdx.x * blockDim.y + threadIdx.y;
    if (row >= dense.rows) return;
    auto const begin_of = [&](unsigned r) {
        unsigned const z = r / dense.ny, y = r - z * dense.ny;
        return copy.from + y * copy.from_row + z * copy.from_slice;
    };
    std::byte const* const from = begin_of(row);
    std::byte* const to = copy.to + static_cast<std::int64_t>(row) * copy.bytes;
    int const bytes = static_cast<int>(copy.bytes);
    int const skip = static_cast<int>(-reinterpret_cast<std::uintptr_t>(to) % 16); // the row before writes those
    auto const source = [&](std::byte const* begin, int b) { return begin + (Reverse ? bytes - 16 - b : b); };
    auto const load = [&](std::byte const* at) { return Reverse ? reversed<U>(load_16(at)) : load_16(at); };
    auto const within = static_cast<unsigned>(reinterpret_cast<std::uintptr_t>(source(from, skip)) % 16);
    auto const one_by_one = [&](int b, int end, std::byte const* begin, int shift) {
        constexpr int size = sizeof(U);
        for (int i = b; i < end; i += size)
            *reinterpret_cast<U*>(to + i) =
                *reinterpret_cast<U const*>(begin + (Reverse ? bytes - size - (i - shift) : i - shift));
    };
    if (row == 0 && threadIdx.x == 0) one_by_one(0, skip, from, 0);
    for (int b = skip + static_cast<int>(threadIdx.x) * 16; b < bytes; b += 32 * 16) {
        std::byte const* const here = source(from, b);
        if (b + 16 <= bytes) {
            auto const* const units = reinterpret_cast<uint4 const*>(here - within);
            uint4 const v = within == 0 ? units[0] : join(units[0], units[1], within);
            *reinterpret_cast<uint4*>(to + b) = Reverse ? reversed<U>(v) : v;
            continue;
        }
        int const own = bytes - b;
        bool const another = row + 1 < dense.rows;
        std::byte const* const next = begin_of(another ? row + 1 : row);
        std::byte const* const there = source(next, -own);
        auto const inside = [&](std::byte const* at) { return at >= dense.first && at + 16 <= dense.last; };
        if (another && inside(here) && inside(there)) {
            uint4 const v = load(here), w = load(there);
            *reinterpret_cast<uint4*>(to + b) = {spliced(own, v.x, w.x), spliced(own - 4, v.y, w.y),
                                                 spliced(own - 8, v.z, w.z), spliced(own - 12, v.w, w.w)};
        } else {
            one_by_one(b, bytes, from, 0);
            if (another) one_by_one(bytes, b + 16, next, bytes);
        }
    }
}

template <bool Reverse, class U> void launch_dense_copy(DenseCopy const& dense, RowCopy const& copy) {
    dim3 const block(32, block_threads / 32);
    dense_copy_kernel<Reverse, U><<<(dense.rows + block.y - 1) / block.y, block>>>(dense, copy);
    check_launch("copy_box");
}

} // namespace driver

inline void copy_box(Execution const&, ConstView from, AnyView to, Mirror mirror = {}) {
    if (to.box.empty()) return;
    auto const size = static_cast<std::int64_t>(size_of(to.type));
    Index3 dims = to.dims();
    if (!mirror.x && !mirror.y && !mirror.z && from.contiguous() && to.contiguous())
        dims = {dims.x * dims.y * dims.z, 1, 1};
    driver::RowCopy const copy{from.at(from.box.lower.x, mirror.y ? from.box.upper.y - 1 : from.box.lower.y,
                                       mirror.z ? from.box.upper.z - 1 : from.box.lower.z),
                               to.data,
                               dims.x * size,
                               (mirror.y ? -1 : 1) * from.row * size,
                               (mirror.z ? -1 : 1) * from.slice * size,
                               to.row * size,
                               to.slice * size};
    std::int64_t const rows = dims.y * dims.z;
    bool const odd = size < 4 && copy.bytes % 16 != 0 && copy.bytes >= 16 && copy.bytes < 1 << 30;
    driver::DenseCopy const dense{static_cast<unsigned>(rows), static_cast<unsigned>(dims.y), from.data,
                                  from.at(from.box.upper.x - 1, from.box.upper.y - 1, from.box.upper.z - 1) + size};
    for_each_size(size_of(to.type), [&]<class U>(U) {
        if (odd && to.contiguous() && rows > 1 && rows < 1LL << 32)
            mirror.x ? driver::launch_dense_copy<true, U>(dense, copy)
                     : driver::launch_dense_copy<false, U>(dense, copy);
        else if (mirror.x)
            driver::launch_copy<true, U>(dims, copy);
        else
            driver::launch_copy<false, U>(dims, copy);
    });
}

} // namespace vkt::VKT_BACKEND
