// CLAHE on GPUs: a block of threads a brick's curve; every voxel blends the curves around it, in the order in which
// CPUs do.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/clahe.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/clahe_window.h"

#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// A voxel on its own. V is what it is given as.
template <class V, class C> struct Equalize {
    IntensityWindow<C> window;
    AxisBlend x, y, z;
    C const* curves;
    std::int32_t across, down; ///< bricks along x and y
    Int128 base;

    VKT_HD C share(double px, double py, double pz, C v) const {
        Place<C> const p = window.place(v);
        Between const bx = x.at(px), by = y.at(py), bz = z.at(pz);
        std::int64_t const points = window.bins + 1;
        auto const corner = [&](std::int32_t i, std::int32_t j, std::int32_t k) {
            return curves + ((static_cast<std::int64_t>(k) * down + j) * across + i) * points + p.bin;
        };
        auto const column = [&](std::int32_t i) {
            C ends[2];
            for (int e = 0; e < 2; ++e)
                ends[e] = blend(blend(corner(i, by.first, bz.first)[e], corner(i, by.first, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                blend(corner(i, by.second, bz.first)[e], corner(i, by.second, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                static_cast<C>(by.weight));
            return blend(ends[0], ends[1], p.rest);
        };
        return blend(column(bx.first), column(bx.second), static_cast<C>(bx.weight));
    }
    VKT_HD C own(V v) const {
        if constexpr (std::is_same_v<V, Int128>)
            return distance(v, base);
        else
            return v;
    }
    VKT_HD V operator()(double px, double py, double pz, V v) const {
        C const c = own(v), result = window.value(share(px, py, pz, c), c);
        if constexpr (std::is_same_v<V, Int128>)
            return from_distance(result, base);
        else
            return result;
    }
    VKT_HD bool undefined(V v) const { return window.outside(own(v)); }
};

template <class V, class C>
void map_all(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
             Execution const& execution) {
    BrickGrid const& grid = field.grid;
    Equalize<V, C> const equalize{IntensityWindow<C>(field),
                                  AxisBlend(grid, 0),
                                  AxisBlend(grid, 1),
                                  AxisBlend(grid, 2),
                                  reinterpret_cast<C const*>(curves.read(execution.space())),
                                  static_cast<std::int32_t>(grid.bricks.x),
                                  static_cast<std::int32_t>(grid.bricks.y),
                                  field.base};
    map_at<V>(execution, out, losses, equalize, in);
}

/// Voxels along an axis that lie between the same two bricks.
struct Span {
    std::int32_t brick, begin, count; ///< the first of the bricks; voxels from the output's first on
};
constexpr std::int32_t longest_span = 64;

std::vector<Span> spans_along(AxisBlend const& axis, std::int64_t lower, std::int64_t n) {
    std::vector<Span> spans;
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        std::int32_t const brick = axis.at(static_cast<double>(lower + i)).first;
        if (spans.empty() || spans.back().brick != brick || spans.back().count == longest_span)
            spans.push_back({brick, i, 0});
        ++spans.back().count;
    }
    return spans;
}

/// The parts of slices that lie between the same bricks.
template <class C> struct Tiles {
    driver::DeviceRows in, out;
    Index3 lower;
    IntensityWindow<C> window;
    AxisBlend x, y, z;
    C const* curves;
    std::int32_t across, down; ///< bricks along x and y
    Span const *columns, *rows;
    unsigned column_count, row_count;
};

/// A block a tile: the four curves around it are blended along z once, and lie side by side in shared memory.
template <class C>
__global__ void __launch_bounds__(driver::block_threads)
    tiles_kernel(__grid_constant__ Tiles<C> const m, unsigned long long* totals) {
    using Four = driver::Pack<C, 4>;
    extern __shared__ __align__(32) unsigned char memory[];
    auto* const table = reinterpret_cast<Four*>(memory); // 00, 10, 01 and 11 along x and y, for every edge
    __shared__ C along_x[longest_span], along_y[longest_span];
    Span const column = m.columns[blockIdx.x % m.column_count], row = m.rows[blockIdx.x / m.column_count % m.row_count];
    std::int64_t const z = blockIdx.x / m.column_count / m.row_count;
    int const thread = static_cast<int>(threadIdx.x);
    if (thread < column.count)
        along_x[thread] = static_cast<C>(m.x.at(static_cast<double>(m.lower.x + column.begin + thread)).weight);
    if (thread < row.count)
        along_y[thread] = static_cast<C>(m.y.at(static_cast<double>(m.lower.y + row.begin + thread)).weight);
    Between const between = m.z.at(static_cast<double>(m.lower.z + z));
    int const points = m.window.bins + 1, right = column.brick + 1 < m.across ? 1 : 0,
              above = row.brick + 1 < m.down ? 1 : 0;
    auto const curve = [&](int i, int j, int k) {
        return m.curves +
               ((static_cast<std::int64_t>(k) * m.down + row.brick + j) * m.across + column.brick + i) * points;
    };
    C const wz = static_cast<C>(between.weight);
    for (int p = thread; p < points; p += driver::block_threads) {
        Four four;
#pragma unroll
        for (int c = 0; c < 4; ++c) {
            int const i = (c & 1) * right, j = (c >> 1) * above;
            four.v[c] = blend(curve(i, j, between.first)[p], curve(i, j, between.second)[p], wz);
        }
        table[p] = four;
    }
    __syncthreads();
    driver::LossCounts counts;
    int const log = 32 - __clz(column.count - 1), slots = row.count << log; // rows of a power of two of threads
    with_type(m.in.type, [&]<class T>(T) {
        for (int slot = thread; slot < slots; slot += driver::block_threads) {
            int const x = slot & ((1 << log) - 1), y = slot >> log;
            if (x >= column.count) continue;
            C const v = driver::as_compute<C>(*reinterpret_cast<T const*>(m.in.at(column.begin + x, row.begin + y, z)));
            Place<C> const p = m.window.place(v);
            Four const a = table[p.bin], b = table[p.bin + 1];
            C const wy = along_y[y];
            C const first = blend(blend(a.v[0], a.v[2], wy), blend(b.v[0], b.v[2], wy), p.rest),
                    second = blend(blend(a.v[1], a.v[3], wy), blend(b.v[1], b.v[3], wy), p.rest),
                    result = m.window.value(blend(first, second, along_x[x]), v);
            counts.undefined += m.window.outside(v) ? 1 : 0;
            counts.clipped += is_clipped<T>(result) ? 1 : 0;
            *reinterpret_cast<T*>(m.out.at(column.begin + x, row.begin + y, z)) = round_to<T>(result);
        }
    });
    driver::add_counts(counts, totals);
}

/// False where tables would have no room, or more points than their tile has voxels.
template <class C>
bool map_tiles(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    BrickGrid const& grid = field.grid;
    std::int64_t const points = field.bins + 1,
                       area = grid.box.dims().x / grid.bricks.x * (grid.box.dims().y / grid.bricks.y);
    std::size_t const bytes = static_cast<std::size_t>(points) * sizeof(driver::Pack<C, 4>);
    constexpr std::size_t room = 40 << 10;
    if (bytes > room || 2 * area < points) return false;
    AxisBlend const x(grid, 0), y(grid, 1);
    std::vector<Span> const columns = spans_along(x, out.box.lower.x, out.dims().x),
                            rows = spans_along(y, out.box.lower.y, out.dims().y);
    auto const blocks = static_cast<std::int64_t>(columns.size() * rows.size()) * out.dims().z;
    if (blocks > 0x7fffffff) return false;
    driver::DeviceList<Span> const column_list(columns), row_list(rows);
    driver::DeviceLosses const counts;
    Tiles<C> const tiles{driver::device_rows(in, out.box),
                         driver::device_rows(ConstView(out), out.box),
                         out.box.lower,
                         IntensityWindow<C>(field),
                         x,
                         y,
                         AxisBlend(grid, 2),
                         reinterpret_cast<C const*>(curves.read(execution.space())),
                         static_cast<std::int32_t>(grid.bricks.x),
                         static_cast<std::int32_t>(grid.bricks.y),
                         column_list.get(),
                         row_list.get(),
                         static_cast<unsigned>(columns.size()),
                         static_cast<unsigned>(rows.size())};
    tiles_kernel<C><<<static_cast<unsigned>(blocks), driver::block_threads, bytes>>>(tiles, counts.get());
    check_launch("clahe");
    counts.add_to(losses);
    return true;
}

/// The curve of a brick a block; a thread has bins that follow one another.
template <class C>
__global__ void __launch_bounds__(driver::block_threads)
    curves_kernel(std::uint64_t const* counts, int bins, ClipLimit limit, C* curves) {
    constexpr int threads = driver::block_threads;
    __shared__ std::uint64_t first[threads], second[threads];
    counts += static_cast<std::size_t>(blockIdx.x) * static_cast<std::size_t>(bins + 3);
    curves += static_cast<std::size_t>(blockIdx.x) * static_cast<std::size_t>(bins + 1);
    int const thread = static_cast<int>(threadIdx.x), each = (bins + threads - 1) / threads,
              begin = min(thread * each, bins), end = min(begin + each, bins);
    auto const height = [&](int i) {
        return counts[i] + (i == 0 ? counts[bins] : 0) + (i == bins - 1 ? counts[bins + 1] : 0);
    };
    std::uint64_t sum = 0, tallest = 0;
    for (int i = begin; i < end; ++i) {
        std::uint64_t const h = height(i);
        sum += h;
        tallest = h > tallest ? h : tallest;
    }
    first[thread] = sum, second[thread] = tallest;
    for (int half = threads / 2; half > 0; half /= 2) {
        __syncthreads();
        if (thread >= half) continue;
        first[thread] += first[thread + half];
        std::uint64_t const other = second[thread + half];
        second[thread] = other > second[thread] ? other : second[thread];
    }
    __syncthreads();
    std::uint64_t const all = first[0];
    auto const voxels = static_cast<double>(all), n = static_cast<double>(bins);
    double const cut = height_to_cut(limit, voxels, n, static_cast<double>(second[0]));
    __syncthreads();
    if (thread == 0) curves[bins] = C(1);
    if (all == 0) {
        for (int i = begin; i < end; ++i) curves[i] = static_cast<C>(static_cast<double>(i) / n);
        return;
    }
    std::uint64_t whole = 0, cut_bins = 0;
    for (int i = begin; i < end; ++i) {
        std::uint64_t const h = height(i);
        bool const is_cut = static_cast<double>(h) > cut;
        whole += is_cut ? 0 : h;
        cut_bins += is_cut ? 1 : 0;
    }
    first[thread] = whole, second[thread] = cut_bins;
    for (int offset = 1; offset < threads; offset *= 2) { // sums of this thread's bins and of those before
        __syncthreads();
        std::uint64_t const a = thread >= offset ? first[thread - offset] : 0,
                            b = thread >= offset ? second[thread - offset] : 0;
        __syncthreads();
        first[thread] += a, second[thread] += b;
    }
    __syncthreads();
    CutHistogram const histogram = CutHistogram::of(voxels, cut, all - first[threads - 1], second[threads - 1], n);
    std::uint64_t whole_below = first[thread] - whole, cut_below = second[thread] - cut_bins;
    for (int i = begin; i < end; ++i) {
        curves[i] = static_cast<C>(histogram.share_below(static_cast<double>(i), cut_below, whole_below));
        std::uint64_t const h = height(i);
        bool const is_cut = static_cast<double>(h) > cut;
        whole_below += is_cut ? 0 : h;
        cut_below += is_cut ? 1 : 0;
    }
}

template <class C>
void launch_curves(std::uint64_t const* counts, ClaheField const& field, ClipLimit const& limit, std::byte* curves) {
    curves_kernel<C><<<static_cast<unsigned>(field.grid.count()), driver::block_threads>>>(
        counts, field.bins, limit, reinterpret_cast<C*>(curves));
    check_launch("clahe");
}

} // namespace

void clahe_curves(std::uint64_t const* counts, ClaheField const& field, ClipLimit const& limit, std::byte* curves,
                  Execution const&) {
    field.wide ? launch_curves<double>(counts, field, limit, curves)
               : launch_curves<float>(counts, field, limit, curves);
}

void clahe_map(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    if (out.box.empty()) return;
    clahe_in_type(field, losses, [&]<class V, class C>(V, C, Losses& found) {
        if constexpr (std::is_same_v<V, C>)
            if (map_tiles<C>(in, out, field, curves, found, execution)) return;
        map_all<V, C>(in, out, field, curves, found, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
