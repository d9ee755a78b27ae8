// Distances on GPUs: a warp a row; then tiles of lines in shared memory, whose voxels search outwards. Where that takes
// long the nearest site of each voxel is looked for between those of the voxels around it, which are in the same order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/distance.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/shape/kernels/device_objects.h"

#include <algorithm>
#include <limits>
#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Row after row of voxels of 4 bytes; strides in voxels.
struct Volume4 {
    std::byte* data;
    Index3 n;
    std::int64_t row, slice;
};

constexpr int block_of_rows = 256;

/// What is known of 32 voxels of a row.
struct Chunk {
    unsigned objects;
    int last_object, last_other; ///< before it, or far below
};
constexpr int far_away = 1 << 29;

template <class T>
__global__ void __launch_bounds__(block_of_rows)
    rows_kernel(T const* in, std::int64_t in_row, std::int64_t in_slice, Volume4 out, IsObject<T> is_object, bool whole,
                bool both, int weight, int chunks, unsigned long long* totals) {
    extern __shared__ __align__(16) unsigned char memory[];
    Chunk* const kept = reinterpret_cast<Chunk*>(memory) + static_cast<std::int64_t>(threadIdx.y) * chunks;
    std::int64_t const r = static_cast<std::int64_t>(blockIdx.x) * blockDim.y + threadIdx.y;
    if (r >= out.n.y * out.n.z) return; // whole warps
    std::int64_t const z = driver::quotient_of(r, out.n.y), y = r - z * out.n.y;
    T const* const from = in + y * in_row + z * in_slice;
    auto const lane = static_cast<int>(threadIdx.x), n = static_cast<int>(out.n.x);
    int last_object = -far_away, last_other = -far_away;
    unsigned objects = 0, nan = 0;
    constexpr int together = 4;
    for (int c0 = 0; c0 < chunks; c0 += together) {
        T v[together];
#pragma unroll
        for (int k = 0; k < together; ++k) {
            int const x = (c0 + k) * 32 + lane;
            v[k] = x < n ? from[x] : T{};
        }
#pragma unroll
        for (int k = 0; k < together; ++k) {
            int const c = c0 + k, x = c * 32 + lane;
            if (c >= chunks) break;
            auto const value = static_cast<typename IsObject<T>::C>(v[k]);
            unsigned const bits = __ballot_sync(~0u, x < n && is_object(value));
            if constexpr (!std::is_integral_v<T>) nan += __popc(__ballot_sync(~0u, x < n && value != value));
            unsigned const others = ~bits & (n - c * 32 >= 32 ? ~0u : (1u << (n - c * 32)) - 1);
            if (lane == 0) kept[c] = {bits, last_object, last_other};
            objects += __popc(bits);
            if (bits != 0) last_object = c * 32 + 31 - __clz(static_cast<int>(bits));
            if (others != 0) last_other = c * 32 + 31 - __clz(static_cast<int>(others));
        }
    }
    __syncwarp();
    std::byte* const to = out.data + 4 * (y * out.row + z * out.slice);
    int next_object = far_away, next_other = far_away;
    for (int c = chunks - 1; c >= 0; --c) {
        Chunk const chunk = kept[c];
        unsigned const others = ~chunk.objects & (n - c * 32 >= 32 ? ~0u : (1u << (n - c * 32)) - 1);
        int const x = c * 32 + lane;
        bool const object = (chunk.objects >> lane & 1) != 0;
        unsigned const sites = object ? others : chunk.objects, below = sites & ((1u << lane) - 1),
                       above = sites & ~((2u << lane) - 1);
        int const left = below != 0 ? c * 32 + 31 - __clz(static_cast<int>(below))
                                    : (object ? chunk.last_other : chunk.last_object),
                  right =
                      above != 0 ? c * 32 + __ffs(static_cast<int>(above)) - 1 : (object ? next_other : next_object);
        int const steps = min(x - left, right - x);
        bool const none = steps >= far_away / 2;
        if (x < n) {
            bool const zero = !object && !both;
            if (whole) {
                int const square = zero ? 0 : none ? no_site : steps * steps * weight;
                reinterpret_cast<int*>(to)[x] = object ? square : -square;
            } else {
                float const length = zero   ? 0.0f
                                     : none ? std::numeric_limits<float>::infinity()
                                            : static_cast<float>(steps);
                reinterpret_cast<float*>(to)[x] = zero ? 0.0f : object ? length : -length;
            }
        }
        if (chunk.objects != 0) next_object = c * 32 + __ffs(static_cast<int>(chunk.objects)) - 1;
        if (others != 0) next_other = c * 32 + __ffs(static_cast<int>(others)) - 1;
    }
    if (lane == 0) {
        if (objects != 0) atomicAdd(totals, static_cast<unsigned long long>(objects));
        if (nan != 0) atomicAdd(totals + 1, static_cast<unsigned long long>(nan));
    }
}

constexpr int block_of_lines = 512;
constexpr int most_steps = 20; ///< of a search

template <class V> __device__ __forceinline__ V none_yet() {
    if constexpr (std::is_same_v<V, int>)
        return no_site;
    else
        return std::numeric_limits<V>::infinity();
}

/// What a pass along one axis goes by.
template <class V> struct Rule {
    std::int64_t stride, other_stride, others; ///< voxels along the lines and from plane to plane, of which so many are
    int n, across;                             ///< voxels of a line, and of a row
    unsigned tiles;                            ///< in a row
    int columns, columns_log;                  ///< of a tile
    int steps;                                 ///< of a search
    V weight, weight_before;
    double unit;
};

template <class V, bool both> struct Lines {
    using S = std::conditional_t<std::is_same_v<V, int>, int, float>;
    Rule<V> rule;
    V* tile; ///< squares, negative for the other side
    unsigned short* nearest;
    std::byte* data;
    int width;

    __device__ V at(int r, int c) const { return tile[r << rule.columns_log | c]; }
    /// The square of a voxel as those of one side see it.
    __device__ static V seen(V square, bool object) {
        if constexpr (!both) return square;
        V const own = object ? square : -square;
        return own > V(0) ? own : V(0);
    }
    __device__ V step(int d) const { return rule.weight * static_cast<V>(d * d); }

    /// False if a nearer site may lie beyond the steps of the search.
    __device__ bool search(int r, int c, V own, V& best) const {
        bool const object = own > V(0);
        V const* const here = tile + ((r << rule.columns_log) | c);
        best = object ? own : -own;
        for (int d = 1; d <= rule.steps; ++d) {
            V const add = step(d);
            if (!(best > add)) return true;
            int const away = d << rule.columns_log;
            V const left = both && r < d ? none_yet<V>() : seen(here[-away], object),
                    right = both && r + d >= rule.n ? none_yet<V>() : seen(here[away], object);
            V const nearer = (left < right ? left : right) + add;
            best = nearer < best ? nearer : best;
        }
        return rule.steps == rule.n - 1 || !(best > step(rule.steps + 1));
    }

    /// All voxels of one side: of every second voxel between those that are known, again and again.
    __device__ void divide(bool object) const {
        int s = 1;
        while (s <= rule.n / 2) s *= 2;
        for (; s >= 1; s /= 2) {
            int const count = (rule.n / s + 1) / 2 << rule.columns_log;
            for (int i = static_cast<int>(threadIdx.x); i < count; i += block_of_lines) {
                int const c = i & (rule.columns - 1), above = s * (2 * (i >> rule.columns_log) + 1), r = above - 1;
                int const low = above == s ? 0 : nearest[(r - s) << rule.columns_log | c];
                int const high = above + s > rule.n ? rule.n - 1 : nearest[(r + s) << rule.columns_log | c];
                int site = low;
                V best = seen(at(low, c), object) + step(r - low);
                V const* next = tile + ((low + 1) << rule.columns_log | c);
                for (int j = low + 1; j <= high; ++j, next += rule.columns) {
                    V const other = seen(*next, object) + step(r - j);
                    if (other < best) {
                        best = other;
                        site = j;
                    }
                }
                nearest[r << rule.columns_log | c] = static_cast<unsigned short>(site);
                V const own = at(r, c);
                if (c < width && (object ? own > V(0) : own < V(0)))
                    store(r, c, own, best < none_yet<V>() ? best : none_yet<V>());
            }
            __syncthreads();
        }
    }

    __device__ void store(int r, int c, V own, V best) const {
        std::byte* const to = data + 4 * (r * rule.stride + c);
        if (rule.unit == 0) {
            *reinterpret_cast<S*>(to) = static_cast<S>(own < V(0) ? -best : best);
            return;
        }
        float const length = best < none_yet<V>() ? static_cast<float>(sqrt(static_cast<double>(best)) * rule.unit)
                                                  : std::numeric_limits<float>::infinity();
        *reinterpret_cast<float*>(to) = own < V(0) ? -length : length;
    }
};

template <class V, bool both>
__global__ void __launch_bounds__(block_of_lines, 3)
    lines_kernel(std::byte* data, __grid_constant__ Rule<V> const rule) {
    extern __shared__ __align__(16) unsigned char memory[];
    using S = typename Lines<V, both>::S;
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % rule.tiles) << rule.columns_log;
    int const voxels = rule.n << rule.columns_log, ends = rule.steps << rule.columns_log;
    V* const padded = reinterpret_cast<V*>(memory);
    Lines<V, both> const lines{rule, padded + ends, reinterpret_cast<unsigned short*>(padded + voxels + 2 * ends),
                               data + 4 * (x + blockIdx.x / rule.tiles * rule.other_stride),
                               static_cast<int>(min(static_cast<std::int64_t>(rule.columns), rule.across - x))};
    for (int i = static_cast<int>(threadIdx.x); i < ends; i += block_of_lines)
        padded[i] = padded[ends + voxels + i] = none_yet<V>();
    int sites = 0; // bits: of objects, of the other side
    for (int i = static_cast<int>(threadIdx.x); i < voxels; i += block_of_lines) {
        int const c = i & (rule.columns - 1), r = i >> rule.columns_log;
        V v = c < lines.width ? static_cast<V>(*reinterpret_cast<S const*>(lines.data + 4 * (r * rule.stride + c)))
                              : none_yet<V>();
        if (rule.weight_before != V(0)) {
            V const square = v * v * rule.weight_before;
            v = v < V(0) ? -square : square;
        }
        sites |= (v < none_yet<V>() ? 1 : 0) | (v > -none_yet<V>() ? 2 : 0);
        lines.tile[i] = v;
    }
    // What is a site for one side is none for the other, unless there is nothing at all.
    bool const object_sites = __syncthreads_or(sites & 1) != 0, other_sites = __syncthreads_or(sites & 2) != 0;
    int far = 0; // bits as above
    auto const look = [&](int i, bool stores) {
        int const c = i & (rule.columns - 1), r = i >> rule.columns_log;
        if (c >= lines.width) return;
        V const own = lines.tile[i];
        V best = V(0);
        if (own != V(0)) {
            bool const some = own > V(0) ? object_sites : other_sites;
            if (!some) best = none_yet<V>();
            if (some && !lines.search(r, c, own, best)) {
                far |= own > V(0) ? 1 : 2;
                return;
            }
        }
        if (stores) lines.store(r, c, own, best);
    };
    // Some rows tell whether it is worth while to search from all of them.
    int const every = max(1, voxels / block_of_lines) << rule.columns_log;
    int const some = (static_cast<int>(threadIdx.x) >> rule.columns_log) * every +
                     (static_cast<int>(threadIdx.x) & (rule.columns - 1));
    if (some < voxels) look(some, false);
    bool const hopeless = __syncthreads_or(far) != 0 && !both;
    for (int i = static_cast<int>(threadIdx.x); i < voxels; i += block_of_lines)
        if (!hopeless) look(i, true);
    if (hopeless) { // what no division looks at
        for (int i = static_cast<int>(threadIdx.x); i < voxels; i += block_of_lines)
            if (lines.tile[i] == V(0) && (i & (rule.columns - 1)) < lines.width)
                lines.store(i >> rule.columns_log, i & (rule.columns - 1), V(0), V(0));
    }
    bool const objects = __syncthreads_or(far & 1) != 0, others = __syncthreads_or(far & 2) != 0;
    if (objects) lines.divide(true);
    if (both && others) lines.divide(false);
}

template <class V, bool both> void launch_lines(AnyView out, Rule<V> const& rule, unsigned blocks, std::int64_t bytes) {
    cudaFuncSetAttribute(lines_kernel<V, both>, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
    lines_kernel<V, both><<<blocks, block_of_lines, static_cast<std::size_t>(bytes)>>>(out.data, rule);
}

template <class V> void pass_of(AnyView out, DistancePass const& pass) {
    Index3 const n = out.dims();
    bool const along_y = pass.axis == Axis::y;
    Rule<V> rule{};
    rule.n = static_cast<int>(along_y ? n.y : n.z);
    rule.across = static_cast<int>(n.x);
    rule.steps = std::min(most_steps, rule.n - 1);
    rule.others = along_y ? n.z : n.y;
    rule.stride = along_y ? out.row : out.slice;
    rule.other_stride = along_y ? out.slice : out.row;
    rule.weight = static_cast<V>(pass.weight);
    rule.weight_before = static_cast<V>(pass.weight_before);
    rule.unit = pass.unit;
    int most = 0;
    cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device_current());
    auto const bytes = [&](int columns_log) {
        return (static_cast<std::int64_t>(rule.n) << columns_log) * static_cast<int>(sizeof(V) + sizeof(short)) +
               (static_cast<std::int64_t>(2 * rule.steps) << columns_log) * static_cast<int>(sizeof(V));
    };
    // Two tiles at least at a time, unless these would be narrower than what is read at once.
    rule.columns_log = 4;
    while (rule.columns_log > 0 && bytes(rule.columns_log) > (rule.columns_log > 3 ? most / 2 : most))
        --rule.columns_log;
    rule.columns = 1 << rule.columns_log;
    std::int64_t const tiles = (n.x + rule.columns - 1) / rule.columns;
    if (bytes(rule.columns_log) > most) refuse_launch();
    static_cast<void>(launch_blocks(tiles, rule.others));
    rule.tiles = static_cast<unsigned>(tiles);
    if (pass.both_sides)
        launch_lines<V, true>(out, rule, static_cast<unsigned>(tiles * rule.others), bytes(rule.columns_log));
    else
        launch_lines<V, false>(out, rule, static_cast<unsigned>(tiles * rule.others), bytes(rule.columns_log));
    check_launch("distance");
}

template <class T> void rows_of_type(ConstView in, AnyView out, DistanceRows& rows) {
    Index3 const n = in.dims();
    std::int64_t const chunks = (n.x + 31) / 32, each = chunks * static_cast<std::int64_t>(sizeof(Chunk));
    int most = 0;
    cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device_current());
    auto const warps = static_cast<unsigned>(std::clamp<std::int64_t>((48 << 10) / each, 1, block_of_rows / 32));
    unsigned const blocks = launch_blocks((n.y * n.z + warps - 1) / warps);
    if (each > most) refuse_launch();
    cudaFuncSetAttribute(rows_kernel<T>, cudaFuncAttributeMaxDynamicSharedMemorySize, most);
    IsObject<T> const is_object(rows.zero);
    driver::DeviceLosses const counts;
    rows_kernel<T><<<blocks, dim3(32, warps), static_cast<std::size_t>(each) * warps>>>(
        reinterpret_cast<T const*>(in.data), in.row, in.slice, Volume4{out.data, n, out.row, out.slice}, is_object,
        rows.whole, rows.both_sides, rows.whole ? static_cast<int>(rows.weight) : 1, static_cast<int>(chunks),
        counts.get());
    check_launch("distance");
    Losses found;
    counts.add_to(found);
    rows.objects = found.clipped;
    rows.nan = found.nan;
}

} // namespace

void distance_rows(ConstView in, AnyView out, DistanceRows& rows, Execution const&) {
    if (out.box.empty()) return;
    with_type(in.type, [&]<class T>(T) { rows_of_type<T>(in, out, rows); });
}

void distance_pass(AnyView out, DistancePass const& pass, Execution const&) {
    if (out.box.empty()) return;
    if (pass.whole)
        pass_of<int>(out, pass);
    else
        pass_of<double>(out, pass);
}

} // namespace VKT_BACKEND

} // namespace vkt
