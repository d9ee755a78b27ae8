// map on a GPU: one kernel a functor for all data types, in packs of 16 bytes of the widest type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_packs.h"

#include <algorithm>
#include <concepts>
#include <type_traits>
#include <utility>

namespace vkt::VKT_BACKEND {

namespace driver {

template <class F, class... C>
concept CountsUndefined = requires(F const& f, C... values) {
    f.undefined(values...);
};

template <int inputs> struct Inputs { DeviceRows rows[inputs > 0 ? inputs : 1]; };

/// A functor whose code is long, by its own word: `static constexpr bool is_long = true`.
template <class F>
concept IsLong = requires {
    requires F::is_long;
};

/// A functor that takes all voxels that a thread has in registers together, so that what it does is chosen once for
/// them: pack(in, out) with in[inputs][N], if its takes_packs() is true, and may_be_undefined(). Host code asks, too,
/// where device functions have no bodies: nothing here may depend on what one of them returns as auto.
template <class F, class C, int inputs, int N>
concept TakesPacks = (inputs > 0) && requires(F const& f, C const (&in)[inputs > 0 ? inputs : 1][N], C (&out)[N]) {
    f.pack(in, out);
    { f.takes_packs() } -> std::same_as<bool>;
};

/// There is one copy of a long functor in a kernel, not one for each of the thread's voxels.
template <class F, class... V> __device__ __noinline__ auto called(F const& f, V... v) { return f(v...); }

/// What a functor makes of one voxel at (x, y, z), whose values are v.
template <class C, bool At, class F, std::size_t... k>
__device__ __forceinline__ auto evaluate(F const& f, double x, double y, double z, C const* v, LossCounts& counts,
                                         std::index_sequence<k...>) {
    if constexpr (CountsUndefined<F, decltype(v[k])...>) counts.undefined += f.undefined(v[k]...) ? 1 : 0;
    if constexpr (IsLong<F> && At)
        return called(f, x, y, z, v[k]...);
    else if constexpr (IsLong<F>)
        return called(f, v[k]...);
    else if constexpr (At)
        return f(x, y, z, v[k]...);
    else
        return f(v[k]...);
}
template <class C, bool At, int inputs, class F>
using ResultOf = decltype(evaluate<C, At>(std::declval<F const&>(), 0.0, 0.0, 0.0, std::declval<C const*>(),
                                          std::declval<LossCounts&>(), std::make_index_sequence<inputs>{}));

/// Counts the voxels of valid packs of which a functor says that they have no result.
template <class C, class F, int all, int K, int N, std::size_t... i>
__device__ __forceinline__ void count_undefined(F const& f, C const (&values)[all][K][N], bool const (&valid)[K],
                                                LossCounts& counts, std::index_sequence<i...>) {
#pragma unroll
    for (int k = 0; k < K; ++k)
#pragma unroll
        for (int n = 0; n < N; ++n) counts.undefined += valid[k] && f.undefined(values[i][k][n]...) ? 1 : 0;
}

/// Packs that a thread has in registers at once: the switches over the types and the arithmetic of addresses are paid
/// by many voxels.
template <class C, int N, int inputs, bool Together = false> constexpr int packs_at_once() {
    int const voxels = (sizeof(C) == 4 ? 32 : sizeof(C) == 8 ? 16 : 8) / (inputs > 1 ? 2 : 1) / (Together ? 2 : 1);
    return std::clamp(voxels / N, 1, 4);
}

/// Voxels of a row before its first pack, which is aligned on the output.
__device__ __forceinline__ int head_of(std::byte const* to, int size_log, int N, std::int64_t nx) {
    int const phase = static_cast<int>(reinterpret_cast<std::uintptr_t>(to) >> size_log) & (N - 1);
    int const head = -phase & (N - 1);
    return head < nx ? head : static_cast<int>(nx);
}

/// Rounds of a thread: what comes before the first voxel, some hundred instructions, is paid by more of them. With 16
/// voxels a pack there are not enough registers for a loop.
template <int N> inline constexpr int most_rounds = N == 16 ? 1 : 4;

/// The whole packs of rows: N consecutive voxels each, those of a thread the block's width apart, and so in each round.
/// `aligned` are the inputs if their packs are where those of the output are; `Together` a functor takes all of a
/// round.
template <class C, int N, int inputs, bool At, bool Together, class F>
__global__ void __launch_bounds__(block_threads, sizeof(C) == 4 ? 4 : 3)
    map_packs(Rows rows, int rounds, bool aligned, Index3 lower, DeviceRows out, Inputs<inputs> in,
              __grid_constant__ F const f, unsigned long long* totals) {
    using Result = ResultOf<C, At, inputs, F>;
    constexpr int K = packs_at_once<C, N, inputs, Together>();
    constexpr auto all = std::make_index_sequence<inputs>{};
    std::int64_t const row =
        (static_cast<std::int64_t>(blockIdx.z) * gridDim.y + blockIdx.y) * blockDim.y + threadIdx.y;
    LossCounts counts;
    if (row < rows.rows) {
        std::int64_t const z = rows.rows == rows.ny ? 0 : quotient_of(row, rows.ny), y = row - z * rows.ny;
        std::byte* const to = out.row_at(rows.rows, y, z);
        int const step = static_cast<int>(blockDim.x) * K * N;
        int const passes = most_rounds<N> == 1 ? 1 : rounds;
        std::int64_t x = head_of(to, out.size_log, N, rows.nx) + static_cast<std::int64_t>(blockIdx.x) * passes * step;
#pragma unroll 1
        for (int pass = 0; pass < passes && x + N <= rows.nx; ++pass, x += step) {
            std::int64_t const left = rows.nx - x;
            int const last = left >= step ? step : static_cast<int>(left & ~std::int64_t{N - 1}) - N;
            int at[K];
            bool valid[K];
#pragma unroll
            for (int k = 0; k < K; ++k) {
                at[k] = static_cast<int>(threadIdx.x + k * blockDim.x) * N;
                valid[k] = at[k] <= last;
                at[k] = valid[k] ? at[k] : last;
            }
            C values[inputs + 1][K][N]; // one more, lest there is none
#pragma unroll
            for (int i = 0; i < inputs; ++i)
                load_packs(in.rows[i].type, aligned, in.rows[i].row_at(rows.rows, y, z) + x * in.rows[i].size, at,
                           values[i]);
            Result results[K][N];
            if constexpr (Together) {
                if (f.may_be_undefined()) count_undefined<C>(f, values, valid, counts, all);
                C voxels[inputs][K * N];
                Result made[K * N];
#pragma unroll
                for (int n = 0; n < K * N; ++n)
#pragma unroll
                    for (int i = 0; i < inputs; ++i) voxels[i][n] = values[i][n / N][n % N];
                f.pack(voxels, made);
#pragma unroll
                for (int n = 0; n < K * N; ++n) results[n / N][n % N] = made[n];
            } else {
#pragma unroll
                for (int k = 0; k < K; ++k) {
                    auto const begin = static_cast<double>(lower.x + x + at[k]);
                    LossCounts own;
#pragma unroll
                    for (int n = 0; n < N; ++n) {
                        C voxel[inputs + 1];
#pragma unroll
                        for (int i = 0; i < inputs; ++i) voxel[i] = values[i][k][n];
                        results[k][n] = evaluate<C, At>(f, begin + n, static_cast<double>(lower.y + y),
                                                        static_cast<double>(lower.z + z), voxel, own, all);
                    }
                    counts.undefined += valid[k] ? own.undefined : 0;
                }
            }
            store_packs(out.type, to + x * out.size, at, valid, results, counts);
        }
    }
    add_counts(counts, totals);
}

/// The voxels of rows before and after their whole packs, one a thread: 2 * N threads a row.
template <class C, int inputs, bool At, class F>
__global__ void __launch_bounds__(block_threads)
    map_edges(Rows rows, int N, Index3 lower, DeviceRows out, Inputs<inputs> in, __grid_constant__ F const f,
              unsigned long long* totals) {
    std::int64_t const item = static_cast<std::int64_t>(blockIdx.x) * block_threads + threadIdx.x;
    std::int64_t const row = item / (2 * N);
    LossCounts counts;
    if (row < rows.rows) {
        std::int64_t const z = quotient_of(row, rows.ny), y = row - z * rows.ny;
        std::int64_t const head = head_of(out.at(0, y, z), out.size_log, N, rows.nx);
        std::int64_t const tail = head + (rows.nx - head) / N * N;
        std::int64_t const slot = item - row * (2 * N);
        std::int64_t const x = slot < N ? slot : tail + slot - N;
        if (slot < N ? x < head : x < rows.nx) {
            C voxel[inputs + 1];
#pragma unroll
            for (int i = 0; i < inputs; ++i) voxel[i] = load_value<C>(in.rows[i].type, in.rows[i].at(x, y, z));
            auto const result =
                evaluate<C, At>(f, static_cast<double>(lower.x + x), static_cast<double>(lower.y + y),
                                static_cast<double>(lower.z + z), voxel, counts, std::make_index_sequence<inputs>{});
            store_value(out.type, out.at(x, y, z), result, counts);
        }
    }
    add_counts(counts, totals);
}

/// Voxels between the rows of a view and another's, and from a place where a pack begins.
inline bool same_packs(DeviceRows const& a, DeviceRows const& b, int N) {
    auto const phase = [N](DeviceRows const& r) {
        return static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(r.data) / static_cast<unsigned>(r.size)) % N;
    };
    return phase(a) == phase(b) && (a.row / a.size - b.row / b.size) % N == 0 &&
           (a.slice / a.size - b.slice / b.size) % N == 0;
}

// Kernels are launched from function templates: those that only a generic lambda instantiates are not found.
template <class C, int N, bool At, bool Together, int inputs, class F>
void launch_rounds(Index3 dims, bool aligned, Index3 lower, DeviceRows to, Inputs<inputs> const& in, F const& f,
                   unsigned long long* totals) {
    constexpr int K = packs_at_once<C, N, inputs, Together>();
    std::int64_t const packs = (dims.x + N - 1) / N;
    int const rounds = static_cast<int>(std::clamp<std::int64_t>(packs / (block_threads * K), 1, most_rounds<N>));
    Rows rows = rows_of(dims, packs, K * rounds);
    std::int64_t const row_blocks = rows.grid.x / rows.blocks_per_row;
    rows.grid.x = rows.blocks_per_row;
    rows.grid.y = static_cast<unsigned>(std::min<std::int64_t>(row_blocks, 32768));
    rows.grid.z = static_cast<unsigned>((row_blocks + rows.grid.y - 1) / rows.grid.y);
    map_packs<C, N, inputs, At, Together, F>
        <<<rows.grid, rows.block>>>(rows, rounds, aligned, lower, to, in, f, totals);
}

template <class C, int N, bool At, int inputs, class F>
void launch_packs(Box const& box, AnyView out, Inputs<inputs> const& in, F const& f, unsigned long long* totals) {
    DeviceRows const to = device_rows(ConstView(out), out.box);
    bool aligned = true;
    for (int i = 0; i < inputs; ++i) aligned = aligned && same_packs(in.rows[i], to, N);
    Index3 const dims = box.dims();
    if (dims.x >= N) {
        bool together = false;
        if constexpr (!At && TakesPacks<F, C, inputs, N>) {
            together = f.takes_packs();
            if (together) launch_rounds<C, N, At, true>(dims, aligned, out.box.lower, to, in, f, totals);
        }
        if (!together) launch_rounds<C, N, At, false>(dims, aligned, out.box.lower, to, in, f, totals);
    }
    bool const whole = dims.x % N == 0 && reinterpret_cast<std::uintptr_t>(to.data) % (N * to.size) == 0 &&
                       (dims.y * dims.z == 1 || (to.row % (N * to.size) == 0 && to.slice % (N * to.size) == 0));
    if (whole) return;
    Rows edges = rows_of({2 * N, dims.y, dims.z}, 1, 1);
    edges.nx = dims.x;
    unsigned const blocks = launch_blocks((edges.rows * 2 * N + block_threads - 1) / block_threads);
    map_edges<C, inputs, At, F><<<blocks, block_threads>>>(edges, N, out.box.lower, to, in, f, totals);
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

} // namespace driver

template <class C, class F, class... In>
void map(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, false>(out, losses, f, in...);
}

template <class C, class F, class... In>
void map_at(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, true>(out, losses, f, in...);
}

} // namespace vkt::VKT_BACKEND
