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
constexpr std::int32_t longest_row = 64, most_slices = 8;

std::vector<Span> spans_along(AxisBlend const& axis, std::int64_t lower, std::int64_t n, std::int32_t longest) {
    std::vector<Span> spans;
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        std::int32_t const brick = axis.at(static_cast<double>(lower + i)).first;
        if (spans.empty() || spans.back().brick != brick || spans.back().count == longest)
            spans.push_back({brick, i, 0});
        ++spans.back().count;
    }
    return spans;
}

/// Boxes of voxels that lie between the same eight bricks.
template <class C> struct Tiles {
    driver::DeviceRows in, out;
    Index3 lower;
    IntensityWindow<C> window;
    AxisBlend x, y, z;
    C const* curves;
    std::int32_t across, down, deep; ///< bricks along x, y and z
    Span const *columns, *rows, *layers;
    unsigned column_count, row_count;
};

/// A point of four curves side by side: of the bricks at 00, 10, 01 and 11 along x and y.
template <class C> using Four = driver::Pack<C, 4>;

/// A block a tile. The curves around it lie in shared memory, and blended along z those of the slice at hand and of the
/// next.
template <class C>
__global__ void __launch_bounds__(driver::block_threads)
    tiles_kernel(__grid_constant__ Tiles<C> const m, unsigned long long* totals) {
    constexpr int threads = driver::block_threads, ahead = 4;
    extern __shared__ __align__(32) unsigned char memory[];
    __shared__ C along_x[longest_row], along_y[longest_row], along_z[most_slices];
    Span const column = m.columns[blockIdx.x % m.column_count], row = m.rows[blockIdx.x / m.column_count % m.row_count],
               layer = m.layers[blockIdx.x / m.column_count / m.row_count];
    int const thread = static_cast<int>(threadIdx.x), points = m.window.bins + 1;
    auto* const below = reinterpret_cast<Four<C>*>(memory);
    Four<C>*const above = below + points, *const blended = above + points;
    auto const weights = [&](AxisBlend const& axis, std::int64_t lower, Span const& span, C* to) {
        if (thread < span.count)
            to[thread] = static_cast<C>(axis.at(static_cast<double>(lower + span.begin + thread)).weight);
    };
    weights(m.x, m.lower.x, column, along_x);
    weights(m.y, m.lower.y, row, along_y);
    weights(m.z, m.lower.z, layer, along_z);
    // Beyond the outermost centres there is no second brick.
    int const right = column.brick + 1 < m.across ? 1 : 0, back = row.brick + 1 < m.down ? 1 : 0,
              up = layer.brick + 1 < m.deep ? 1 : 0;
    C const* const curves =
        m.curves + ((static_cast<std::int64_t>(layer.brick) * m.down + row.brick) * m.across + column.brick) * points;
    std::int64_t const next_x = static_cast<std::int64_t>(right) * points,
                       next_y = static_cast<std::int64_t>(back) * m.across * points,
                       next_z = static_cast<std::int64_t>(up) * m.down * m.across * points;
    for (int p = thread; p < points; p += threads) {
        C const* const at = curves + p;
        below[p] = {at[0], at[next_x], at[next_y], at[next_x + next_y]};
        C const* const over = at + next_z;
        above[p] = {over[0], over[next_x], over[next_y], over[next_x + next_y]};
    }
    __syncthreads();
    auto const blend_slice = [&](int k) {
        C const weight = along_z[k];
        for (int p = thread; p < points; p += threads) {
            Four<C> const a = below[p], b = above[p];
            Four<C>& to = blended[k % 2 * points + p];
#pragma unroll
            for (int c = 0; c < 4; ++c) to.v[c] = blend(a.v[c], b.v[c], weight);
        }
    };
    blend_slice(0);
    __syncthreads();
    driver::LossCounts counts;
    int const log = 32 - __clz(column.count - 1), slots = row.count << log; // rows of a power of two of threads
    with_type(m.in.type, [&]<class T>(T) {
        for (int k = 0; k < layer.count; ++k) {
            if (k + 1 < layer.count) blend_slice(k + 1);
            Four<C> const* const table = blended + k % 2 * points;
            for (int first = thread; first < slots; first += ahead * threads) {
                T voxels[ahead];
                int x[ahead], y[ahead];
                bool valid[ahead];
#pragma unroll
                for (int i = 0; i < ahead; ++i) {
                    int const slot = first + i * threads;
                    x[i] = slot & ((1 << log) - 1), y[i] = slot >> log;
                    valid[i] = slot < slots && x[i] < column.count;
                    if (valid[i])
                        voxels[i] = *reinterpret_cast<T const*>(
                            m.in.at(column.begin + x[i], row.begin + y[i], layer.begin + k));
                }
#pragma unroll
                for (int i = 0; i < ahead; ++i) {
                    if (!valid[i]) continue;
                    C const v = driver::as_compute<C>(voxels[i]);
                    Place<C> const p = m.window.place(v);
                    Four<C> const a = table[p.bin], b = table[p.bin + 1];
                    C const wy = along_y[y[i]];
                    C const left = blend(blend(a.v[0], a.v[2], wy), blend(b.v[0], b.v[2], wy), p.rest),
                            other = blend(blend(a.v[1], a.v[3], wy), blend(b.v[1], b.v[3], wy), p.rest),
                            result = m.window.value(blend(left, other, along_x[x[i]]), v);
                    counts.undefined += m.window.outside(v) ? 1 : 0;
                    counts.clipped += is_clipped<T>(result) ? 1 : 0;
                    *reinterpret_cast<T*>(m.out.at(column.begin + x[i], row.begin + y[i], layer.begin + k)) =
                        round_to<T>(result);
                }
            }
            __syncthreads();
        }
    });
    driver::add_counts(counts, totals);
}

/// False where the curves have no room, or more points than a slice of a tile has voxels.
template <class C>
bool map_tiles(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    BrickGrid const& grid = field.grid;
    std::int64_t const points = field.bins + 1,
                       area = grid.box.dims().x / grid.bricks.x * (grid.box.dims().y / grid.bricks.y);
    std::size_t const bytes = 4 * static_cast<std::size_t>(points) * sizeof(Four<C>);
    constexpr std::size_t room = 96 << 10;
    if (bytes > room || 2 * area < points) return false;
    AxisBlend const x(grid, 0), y(grid, 1), z(grid, 2);
    std::vector<Span> const columns = spans_along(x, out.box.lower.x, out.dims().x, longest_row),
                            rows = spans_along(y, out.box.lower.y, out.dims().y, longest_row),
                            layers = spans_along(z, out.box.lower.z, out.dims().z, most_slices);
    std::size_t const blocks = columns.size() * rows.size() * layers.size();
    if (blocks > 0x7fffffff) return false;
    std::vector<Span> all = columns;
    all.insert(all.end(), rows.begin(), rows.end());
    all.insert(all.end(), layers.begin(), layers.end());
    driver::DeviceList<Span> const spans(all);
    driver::DeviceLosses const counts;
    Tiles<C> const tiles{driver::device_rows(in, out.box),
                         driver::device_rows(ConstView(out), out.box),
                         out.box.lower,
                         IntensityWindow<C>(field),
                         x,
                         y,
                         z,
                         reinterpret_cast<C const*>(curves.read(execution.space())),
                         static_cast<std::int32_t>(grid.bricks.x),
                         static_cast<std::int32_t>(grid.bricks.y),
                         static_cast<std::int32_t>(grid.bricks.z),
                         spans.get(),
                         spans.get() + columns.size(),
                         spans.get() + columns.size() + rows.size(),
                         static_cast<unsigned>(columns.size()),
                         static_cast<unsigned>(rows.size())};
    cudaFuncSetAttribute(tiles_kernel<C>, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(room));
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
