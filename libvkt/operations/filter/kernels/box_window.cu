// Sums and extremes of boxes and balls on GPUs: windows along one axis after the other; balls from all their voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/box_window.h"

#include "libvkt/kernel/cuda_stencil.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/operations/filter/kernels/device_large_values.h"
#include "libvkt/operations/filter/kernels/window_parts.h"

#include <algorithm>
#include <bit>
#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// A voxel as what is summed up, or as its key.
template <class Op, class S, class T> __device__ __forceinline__ S value_of(T const* from) {
    if constexpr (std::is_same_v<Op, Sum>)
        return static_cast<S>(driver::as_compute<double>(*from));
    else
        return driver::neighbour_of<S, T>(from);
}

/// Windows of so many values, of which at least K, that begin at each of the first `count` <= K values of load(0),
/// load(1), …: store(j, window). The values that all K windows have are joined once, so that a window takes (width + K)
/// / K of them or hardly more, however wide it is, and only values of its own.
template <int K, class Op, class S, class Load, class Store>
__device__ __forceinline__ void windows_of_run(int width, int count, Load load, Store store) {
    S before[K]; // of what comes before the common values, from the j-th on
    if constexpr (K > 1) {
#pragma unroll
        for (int j = 0; j < K - 1; ++j) before[j] = load(j);
#pragma unroll
        for (int j = K - 3; j >= 0; --j) before[j] = Op::of(before[j], before[j + 1]);
    }
    S common = load(K - 1), beyond{};
#pragma unroll 4
    for (int i = K; i < width; ++i) common = Op::of(common, load(i));
#pragma unroll
    for (int j = 0; j < K; ++j) {
        if (j >= count) continue;
        if (j > 0) beyond = j == 1 ? load(width) : Op::of(beyond, load(width + j - 1));
        S const value = j == 0 ? common : Op::of(common, beyond);
        store(j, j < K - 1 ? Op::of(before[j], value) : value);
    }
}

/// Calls f with how many windows are best made at once.
template <class F> void with_run(std::int64_t width, F const& f) {
    if (width >= 16)
        f(std::integral_constant<int, 16>{});
    else if (width >= 8)
        f(std::integral_constant<int, 8>{});
    else if (width >= 4)
        f(std::integral_constant<int, 4>{});
    else
        f(std::integral_constant<int, 1>{});
}

/// The first pass, along x, from voxels of any type, and how it is divided into blocks.
template <class Op, class S> struct Rows {
    driver::DeviceRows in;
    S* out = nullptr;         ///< dense
    std::int64_t columns = 0; ///< of the result
    // Of few bits: dividing by numbers of 64 took as long as all else.
    unsigned height = 1, rows = 0;     ///< rows along y and all of them
    unsigned pieces = 1;               ///< of a row
    int piece_log = 0, block_rows = 1; ///< columns of a piece, to base 2; rows of a block
    int width = 1;
    S scale = 1; ///< of what is summed up
};

/// A block: pieces of some rows, in shared memory. There is room after every K values, so that the threads, which have
/// K windows each, reach for different banks.
template <int K, class Op, class S>
__global__ void __launch_bounds__(driver::block_threads) rows_kernel(__grid_constant__ Rows<Op, S> const m) {
    constexpr int threads = driver::block_threads;
    extern __shared__ __align__(16) unsigned char memory[];
    auto* const values = reinterpret_cast<S*>(memory);
    auto const place = [](int i) { return K > 1 ? i + i / K : i; };
    int const thread = static_cast<int>(threadIdx.x), piece = 1 << m.piece_log, length = piece + m.width - 1,
              pitch = place(length - 1) + 1;
    unsigned const first_row = blockIdx.x / m.pieces * static_cast<unsigned>(m.block_rows);
    std::int64_t const column = static_cast<std::int64_t>(blockIdx.x % m.pieces) << m.piece_log;
    with_type(m.in.type, [&]<class T>(T) {
        if constexpr (std::is_same_v<Op, Sum> || sizeof(T) == sizeof(S)) {
            for (int r = 0; r < m.block_rows && first_row + static_cast<unsigned>(r) < m.rows; ++r) {
                unsigned const at = first_row + static_cast<unsigned>(r);
                auto const* const from = reinterpret_cast<T const*>(m.in.at(column, at % m.height, at / m.height));
                auto const n = static_cast<int>(min(std::int64_t{length}, m.columns + m.width - 1 - column));
                for (int i = thread; i < n; i += threads) {
                    S value = value_of<Op, S>(from + i);
                    if constexpr (std::is_same_v<Op, Sum>) value *= m.scale;
                    values[r * pitch + place(i)] = value;
                }
            }
        }
    });
    __syncthreads();
    int const runs = piece / K, row = thread / runs, first = thread % runs * K;
    bool const works = row < m.block_rows;
    S made[K];
    if (works)
        windows_of_run<K, Op, S>(
            m.width, K, [&](int i) { return values[row * pitch + place(first + i)]; },
            [&](int j, S window) { made[j] = window; });
    __syncthreads();
    if (works)
#pragma unroll
        for (int j = 0; j < K; ++j) values[row * pitch + place(first + j)] = made[j];
    __syncthreads();
    for (int i = thread; i < m.block_rows << m.piece_log; i += threads) {
        int const r = i >> m.piece_log, x = i & (piece - 1);
        unsigned const at = first_row + static_cast<unsigned>(r);
        if (at < m.rows && column + x < m.columns) m.out[at * m.columns + column + x] = values[r * pitch + place(x)];
    }
}

template <class Op, class S> void windows_of_rows(Rows<Op, S> m) {
    with_run(m.width, [&]<int K>(std::integral_constant<int, K>) {
        constexpr int most = driver::block_threads * K; // windows of a block
        constexpr std::size_t room = 96 << 10;
        // Wide windows are worth long pieces: what pieces have in common is loaded for each.
        auto const longest = static_cast<std::uint64_t>(std::min(most, m.width > 1024 ? 4096 : 1024));
        auto const piece = static_cast<int>(
            std::clamp(std::bit_ceil(static_cast<std::uint64_t>(m.columns)), std::uint64_t{K}, longest));
        int const length = piece + m.width - 1, pitch = length + length / K;
        std::size_t const row_bytes = static_cast<std::size_t>(pitch) * sizeof(S);
        m.piece_log = std::countr_zero(static_cast<unsigned>(piece));
        m.block_rows = std::max(1, std::min(most / piece, static_cast<int>(room / row_bytes)));
        std::int64_t const pieces = (m.columns + piece - 1) / piece,
                           blocks = pieces * ((m.rows + m.block_rows - 1) / m.block_rows);
        m.pieces = static_cast<unsigned>(pieces);
        std::size_t const bytes = static_cast<std::size_t>(m.block_rows) * row_bytes;
        (void)cudaFuncSetAttribute(rows_kernel<K, Op, S>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                   static_cast<int>(bytes));
        rows_kernel<K, Op, S><<<static_cast<unsigned>(blocks), driver::block_threads, bytes>>>(m);
        check_launch("box windows along x");
    });
}

/// The second pass, along y: a thread has K windows of a column.
template <int K, class Op, class S> struct AlongRows {
    S const* in;
    S* out; ///< slices of `count` rows
    std::int64_t row, in_slice, slice, count;
    int width;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t run, std::int64_t z,
                                               driver::LossCounts&) const {
        std::int64_t const first = run * K;
        S const* const from = in + x + first * row + z * in_slice;
        S* const to = out + x + first * row + z * slice;
        windows_of_run<K, Op, S>(
            width, static_cast<int>(min(std::int64_t{K}, count - first)), [&](int i) { return from[i * row]; },
            [&](int j, S window) { to[j * row] = window; });
    }
};

/// The last one, along z: stores voxels. Rows and slices have changed places, so that the runs of a column are one
/// block's, which shares what they have in common.
template <int K, class Op, class S> struct AlongSlices {
    S const* in;
    std::int64_t row, slice;
    driver::DeviceRows out;
    std::int64_t count; ///< slices
    int width;
    double voxels; ///< of a box
    S scale;       ///< not 1: only means of float64 that are not finite are stored

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t run, std::int64_t y,
                                               driver::LossCounts& counts) const {
        std::int64_t const first = run * K;
        S const* const from = in + x + y * row + first * slice;
        auto const n = static_cast<int>(min(std::int64_t{K}, count - first));
        S made[K];
        windows_of_run<K, Op, S>(
            width, n, [&](int i) { return from[i * slice]; }, [&](int j, S window) { made[j] = window; });
        std::byte* const to = out.at(x, y, first);
        if constexpr (std::is_same_v<Op, Sum>)
            if (scale != S(1)) return mend(to, made, n);
        with_type(out.type, [&]<class T>(T) {
            if constexpr (std::is_same_v<Op, Sum> || sizeof(T) == sizeof(S)) {
#pragma unroll
                for (int j = 0; j < K; ++j)
                    if (j < n) *reinterpret_cast<T*>(to + j * out.slice) = voxel_of<T>(made[j], counts);
            }
        });
    }
    template <class T> __device__ __forceinline__ T voxel_of(S window, driver::LossCounts& counts) const {
        if constexpr (std::is_same_v<Op, Sum>) {
            double const mean = static_cast<double>(window) / voxels;
            if (std::is_same_v<T, double> && !is_finite(mean)) ++counts.undefined;
            counts.clipped += is_clipped<T>(mean) ? 1 : 0;
            counts.nan += is_lost_nan<T>(mean) ? 1 : 0;
            return round_to<T>(mean);
        } else {
            S const bits = from_key<T>(window);
            return *reinterpret_cast<T const*>(&bits);
        }
    }
    __device__ void mend(std::byte* to, S const (&made)[K], int n) const {
        for (int j = 0; j < n; ++j)
            if (double& mean = *reinterpret_cast<double*>(to + j * out.slice); !is_finite(mean))
                mean = mean_of_scaled(static_cast<double>(made[j]), voxels, static_cast<double>(scale));
    }
};

template <class Op, class S> void windows(ConstView in, AnyView out, Index3 radius, Losses& losses, S scale = 1) {
    if (out.box.empty()) return;
    Index3 const n = out.dims(), w{2 * radius.x + 1, 2 * radius.y + 1, 2 * radius.z + 1};
    Index3 const first{n.x, n.y + 2 * radius.y, n.z + 2 * radius.z}, second{n.x, n.y, first.z};
    auto const bytes = [](Index3 dims) { return static_cast<std::size_t>(dims.x * dims.y * dims.z) * sizeof(S); };
    driver::DeviceScratch const rows(bytes(first)), planes(bytes(second));
    auto* const along_x = reinterpret_cast<S*>(rows.get());
    auto* const along_y = reinterpret_cast<S*>(planes.get());
    Box const seen{out.box.lower - radius, out.box.upper + radius};
    windows_of_rows<Op, S>({.in = driver::device_rows(in, seen),
                            .out = along_x,
                            .columns = n.x,
                            .height = static_cast<unsigned>(first.y),
                            .rows = static_cast<unsigned>(first.y * first.z),
                            .width = static_cast<int>(w.x),
                            .scale = scale});
    with_run(w.y, [&]<int K>(std::integral_constant<int, K>) {
        driver::for_each_voxel(
            {n.x, (n.y + K - 1) / K, second.z},
            AlongRows<K, Op, S>{along_x, along_y, n.x, n.x * first.y, n.x * n.y, n.y, static_cast<int>(w.y)}, nullptr,
            "box windows along y");
    });
    driver::DeviceLosses const counts;
    with_run(w.z, [&]<int K>(std::integral_constant<int, K>) {
        driver::for_each_voxel(
            {n.x, (n.z + K - 1) / K, n.y},
            AlongSlices<K, Op, S>{along_y, n.x, n.x * n.y, driver::device_rows(ConstView(out), out.box), n.z,
                                  static_cast<int>(w.z), static_cast<double>(w.x * w.y * w.z), scale},
            counts.get(), "box windows along z");
    });
    counts.add_to(losses);
}

/// Sums of float64 that overflow are made again of smaller voxels.
void means_in_double(ConstView in, AnyView out, Index3 radius, Losses& losses) {
    Losses mine;
    windows<Sum, double>(in, out, radius, mine);
    if (in.type == DataType::float64) {
        Index3 const w{2 * radius.x + 1, 2 * radius.y + 1, 2 * radius.z + 1};
        double const scale = scale_of_boxes(static_cast<double>(w.x * w.y * w.z));
        if (mine.undefined > 0 && any_large_on_device(in, {out.box.lower - radius, out.box.upper + radius}, scale))
            windows<Sum, double>(in, out, radius, mine, scale);
        mine.undefined = 0;
    }
    losses += mine;
}

/// Half of the row of a ball at (dy, dz), -1 where there is none.
template <class Op, class K> struct Ball {
    driver::DeviceRows in, out; ///< in at the first of the window
    int const* half;
    int rx, ry, rz;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        K value = driver::load_neighbour<K>(in.type, in.at(x + rx, y + ry, z + rz));
        for (int k = 0; k <= 2 * rz; ++k)
            for (int j = 0; j <= 2 * ry; ++j) {
                int const h = half[k * (2 * ry + 1) + j];
                for (int i = rx - h; i <= rx + h; ++i)
                    value = Op::of(value, driver::load_neighbour<K>(in.type, in.at(x + i, y + j, z + k)));
            }
        driver::store_result(out.type, out.at(x, y, z), value, counts);
    }
};

template <class Op, class K> void balls(ConstView in, AnyView out, Index3 radius) {
    std::vector<int> const halves = halves_of(radius);
    driver::DeviceList const table(halves);
    Box const seen{out.box.lower - radius, out.box.upper + radius};
    driver::for_each_voxel(out.dims(),
                           Ball<Op, K>{driver::device_rows(in, seen), driver::device_rows(ConstView(out), out.box),
                                       table.get(), static_cast<int>(radius.x), static_cast<int>(radius.y),
                                       static_cast<int>(radius.z)},
                           nullptr, "balls");
}

} // namespace

void mean_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const&, Losses& losses, Execution const&) {
    if (box_sum_bytes(in.type, radius) == 4)
        windows<Sum, std::int32_t>(in, out, radius, losses);
    else
        means_in_double(in, out, radius, losses);
}

void extreme_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const&, WindowExtreme extreme,
                      Execution const&) {
    Losses none;
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) { windows<Op, K>(in, out, radius, none); });
}

void extreme_of_balls(ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const&) {
    if (out.box.empty()) return;
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) { balls<Op, K>(in, out, radius); });
}

void difference_of(ConstView a, ConstView b, AnyView out, Losses& losses, Execution const& execution) {
    if (is_integer(a.type) && size_of(a.type) == 8)
        return map<Int128>(execution, out, losses, Subtract<Int128>{}, a, b);
    with_compute_type(a.type, [&]<class C>(C) { map<C>(execution, out, losses, Subtract<C>{}, a, b); });
}

} // namespace vkt::VKT_BACKEND
