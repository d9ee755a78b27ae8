// Gaussian, GPU: x and y fused through shared memory, then z, each with sliding windows in registers; the planes
// between them are few enough to stay in the L2 cache.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/gaussian.h"
#include "libvkt/operations/filter/kernels/gaussian_march.h"

#include <cuda_runtime.h>

namespace vkt::VKT_BACKEND {

namespace gaussian {

constexpr int outputs = 8; ///< consecutive voxels a thread computes from one window
constexpr int tile_x = 64, tile_y = 64;
constexpr int threads = 256;
constexpr std::int64_t shared_limit = 200 << 10;
constexpr std::int64_t middle_bytes = 24 << 20;   ///< of planes between the kernels, well below the L2's 50 MB
constexpr std::int64_t marched_bytes = 512 << 20; ///< of planes that kernels march through, which are read once

/// Shares of the pairs, in device memory.
template <class C> struct DeviceTaps {
    int radius;
    C const* shares;
};

template <class C> struct Pair { C a, b; };
template <class C> __device__ __forceinline__ Pair<C> operator+(Pair<C> p, Pair<C> q) { return {p.a + q.a, p.b + q.b}; }
template <class C> __device__ __forceinline__ Pair<C> blend(C share, Pair<C> pair, Pair<C> sum) {
    return {madd(share, pair.a - sum.a, sum.a), madd(share, pair.b - sum.b, sum.b)};
}

/// Nested averages (see GaussianTaps) of `outputs` neighbours. at(i) yields the value at offset i from the first
/// output, -radius <= i < outputs + radius. V is C or a small vector of C.
template <class V, class C, class At>
__device__ __forceinline__ void window_average(DeviceTaps<C> taps, At const& at, V (&sum)[outputs]) {
    int const r = taps.radius;
    V low[outputs], high[outputs];
#pragma unroll
    for (int j = 0; j < outputs; ++j) {
        low[j] = at(j - r);
        high[j] = at(j + r);
        sum[j] = low[j] + high[j];
    }
    int k = r;
    // One step: windows move by one voxel towards the middle, then each output takes in its pair.
    for (; k % outputs != 0; --k) {
#pragma unroll
        for (int j = 0; j + 1 < outputs; ++j) low[j] = low[j + 1];
#pragma unroll
        for (int j = outputs - 1; j > 0; --j) high[j] = high[j - 1];
        low[outputs - 1] = at(outputs - k);
        high[0] = at(k - 1);
        C const share = taps.shares[k - 1];
#pragma unroll
        for (int j = 0; j < outputs; ++j) sum[j] = blend(share, low[j] + high[j], sum[j]);
    }
    // The same in rounds of `outputs` steps: the windows rotate through the registers, nothing is moved.
    for (; k > 0; k -= outputs) {
#pragma unroll
        for (int s = 0; s < outputs; ++s) {
            low[s] = at(outputs - k + s);
            high[outputs - 1 - s] = at(k - 1 - s);
            C const share = taps.shares[k - 1 - s];
#pragma unroll
            for (int j = 0; j < outputs; ++j)
                sum[j] = blend(share, low[(j + s + 1) % outputs] + high[(j + 2 * outputs - s - 1) % outputs], sum[j]);
        }
    }
}

/// Filters one slice along x and y into the middle; a block makes tile_x * tile_y voxels of it.
template <class T, class C>
__global__ void __launch_bounds__(threads)
    filter_xy(View<T const> in, Box box, std::int64_t first_slice, DeviceTaps<C> x_taps, DeviceTaps<C> y_taps,
              Surroundings<C> rule, Middle<C> middle) {
    extern __shared__ unsigned char shared[];
    int const rx = x_taps.radius, ry = y_taps.radius;
    int const wide = tile_x + 2 * rx, high = tile_y + 2 * ry;
    int const in_pitch = wide | 1, out_pitch = tile_x + 1; // odd: lanes on different rows meet different banks
    C* const loaded = reinterpret_cast<C*>(shared);
    C* const filtered = loaded + high * in_pitch;
    int const across = static_cast<int>((box.upper.x - box.lower.x + tile_x - 1) / tile_x);
    std::int64_t const x0 = box.lower.x + static_cast<std::int64_t>(blockIdx.x % across) * tile_x;
    std::int64_t const y0 = box.lower.y + static_cast<std::int64_t>(blockIdx.x / across) * tile_y;
    std::int64_t const z = first_slice + blockIdx.y;

    bool const inner = x0 >= rx && y0 >= ry && x0 + tile_x + rx <= rule.dims.x && y0 + tile_y + ry <= rule.dims.y &&
                       x0 + tile_x <= box.upper.x && y0 + tile_y <= box.upper.y;
    int const lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    for (int j = warp; j < high; j += threads / 32) {
        C* const row = loaded + j * in_pitch;
        if (inner) {
            T const* const from = &in(x0 - rx, y0 - ry + j, z);
#pragma unroll 4
            for (int i = lane; i < wide; i += 32) row[i] = C(gaussian_scale) * static_cast<C>(from[i]);
        } else {
            // Rows and columns beyond the output's own halo are never used; the nearest that is keeps reads inside.
            std::int64_t const y = rule.row_of(min(y0 - ry + j, box.upper.y - 1 + ry));
            bool const border = !rule.holds(y);
            for (int i = lane; i < wide; i += 32) {
                std::int64_t const x = fold(min(x0 - rx + i, box.upper.x - 1 + rx), rule.dims.x, rule.boundary);
                row[i] = x < 0 || border ? rule.scaled_border : C(gaussian_scale) * static_cast<C>(in(x, y, z));
            }
        }
    }
    __syncthreads();

    C const* columns = loaded;
    int pitch = in_pitch;
    if (rx > 0) {
        for (int item = threadIdx.x; item < (tile_x / outputs) * ((high + 31) / 32 * 32); item += threads) {
            int const j = item / 32 / (tile_x / outputs) * 32 + item % 32, i = item / 32 % (tile_x / outputs) * outputs;
            if (j >= high) continue;
            C const* const row = loaded + j * in_pitch + i + rx;
            C sum[outputs];
            window_average<C>(
                x_taps, [row](int k) { return row[k]; }, sum);
#pragma unroll
            for (int s = 0; s < outputs; ++s) filtered[j * out_pitch + i + s] = C(0.5) * sum[s];
        }
        __syncthreads();
        columns = filtered;
        pitch = out_pitch;
    }

    C* const to = middle.slice(z) + (y0 - box.lower.y) * middle.pitch + (x0 - box.lower.x);
    for (int item = threadIdx.x; item < tile_x * (tile_y / outputs); item += threads) {
        int const i = item % tile_x, j = item / tile_x * outputs;
        if (x0 + i >= box.upper.x) continue;
        C const* const column = columns + (j + ry) * pitch + i;
        C sum[outputs];
        if (ry > 0) {
            window_average<C>(
                y_taps, [column, pitch](int k) { return column[k * pitch]; }, sum);
#pragma unroll
            for (int s = 0; s < outputs; ++s) sum[s] *= C(0.5);
        } else {
#pragma unroll
            for (int s = 0; s < outputs; ++s) sum[s] = column[s * pitch];
        }
#pragma unroll
        for (int s = 0; s < outputs; ++s)
            if (y0 + j + s < box.upper.y) to[(j + s) * middle.pitch + i] = sum[s];
    }
}

/// The same for radii whose tiles exceed shared memory: one pass along x (axis 0) from the input, or y from the middle.
template <int Axis, class From, class C>
__global__ void __launch_bounds__(threads) filter_line(From from, Box box, std::int64_t first_slice, std::int64_t rows,
                                                       DeviceTaps<C> taps, Surroundings<C> rule, Middle<C> middle) {
    std::int64_t const n = box.upper.x - box.lower.x;
    std::int64_t const item = static_cast<std::int64_t>(blockIdx.x) * threads + threadIdx.x;
    if (item >= n * rows) return;
    std::int64_t const row = item / n, x = item - row * n, z = first_slice + blockIdx.y;
    auto const at = [&](std::int64_t k) -> C { return from(x, row, z, k); };
    C sum = at(-taps.radius) + at(taps.radius);
    for (int k = taps.radius - 1; k >= 0; --k) sum = blend(taps.shares[k], at(-k) + at(k), sum);
    middle.slice(z)[row * middle.pitch + x] = taps.radius > 0 ? C(0.5) * sum : at(0);
}

/// The input, scaled, around a voxel, along x. Row 0 is the first row that the y pass needs.
template <class T, class C> struct AlongX {
    View<T const> in;
    Index3 lower; ///< of the output; y less the radius along y
    Surroundings<C> rule;
    __device__ C operator()(std::int64_t x, std::int64_t row, std::int64_t z, std::int64_t k) const {
        std::int64_t const fx = fold(lower.x + x + k, rule.dims.x, rule.boundary);
        std::int64_t const fy = rule.row_of(lower.y + row);
        return fx < 0 || !rule.holds(fy) ? rule.scaled_border : C(gaussian_scale) * static_cast<C>(in(fx, fy, z));
    }
};
/// Rows that AlongX filtered, along y.
template <class C> struct AlongY {
    Middle<C> rows;
    int radius;
    __device__ C operator()(std::int64_t x, std::int64_t row, std::int64_t z, std::int64_t k) const {
        return rows.slice(z)[(row + radius + k) * rows.pitch + x];
    }
};

/// Along z, out of the middle into the output: two voxels of a row and `outputs` slices a thread.
template <class T, class C>
__global__ void __launch_bounds__(threads)
    filter_z(Middle<C> middle, Box box, View<T> out, DeviceTaps<C> taps, Surroundings<C> rule) {
    extern __shared__ long long offsets[]; // of the slices that the block reads; -1 for the border value
    std::int64_t const z0 = box.lower.z + static_cast<std::int64_t>(blockIdx.y) * outputs;
    int const r = taps.radius;
    for (int i = threadIdx.x; i < outputs + 2 * r; i += threads) {
        // Slices beyond the output's halo belong to outputs that are not stored; the last one stands for them.
        std::int64_t const z = min(z0 - r + i, box.upper.z - 1 + r);
        std::int64_t const from = rule.boundary == Boundary::wrap ? z : fold(z, rule.dims.z, rule.boundary);
        bool const outside = from < 0 && rule.boundary != Boundary::wrap;
        offsets[i] = outside ? -1 : middle.slice(from) - middle.data;
    }
    __syncthreads();
    std::int64_t const item = static_cast<std::int64_t>(blockIdx.x) * threads + threadIdx.x;
    std::int64_t const y = item / (middle.pitch / 2), x = (item - y * (middle.pitch / 2)) * 2;
    if (y >= box.upper.y - box.lower.y || x >= box.upper.x - box.lower.x) return;
    C const* const column = middle.data + y * middle.pitch + x;
    auto const at = [&](int k) -> Pair<C> {
        long long const offset = offsets[k + r];
        if (offset < 0) return {rule.scaled_border, rule.scaled_border};
        using Two = driver::Pack<C, 2>;
        Two const two = *reinterpret_cast<Two const*>(column + offset);
        return {two.v[0], two.v[1]};
    };
    Pair<C> sum[outputs];
    if (r > 0) {
        window_average<Pair<C>>(taps, at, sum);
    } else {
#pragma unroll
        for (int s = 0; s < outputs; ++s) {
            Pair<C> const scaled = at(s);
            sum[s] = scaled + scaled;
        }
    }
    bool const both = x + 1 < box.upper.x - box.lower.x;
#pragma unroll
    for (int s = 0; s < outputs; ++s) {
        if (z0 + s >= box.upper.z) break;
        T* const to = &out(box.lower.x + x, box.lower.y + y, z0 + s);
        T const a = round_to<T>(C(2) * sum[s].a), b = round_to<T>(C(2) * sum[s].b);
        if (both && reinterpret_cast<std::uintptr_t>(to) % (2 * sizeof(T)) == 0) {
            *reinterpret_cast<driver::Pack<T, 2>*>(to) = {{a, b}};
        } else {
            to[0] = a;
            if (both) to[1] = b;
        }
    }
}

/// The launches of one run, slice group by slice group.
template <class T, class C> class Launcher {
public:
    Launcher(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out)
        : passes_(passes), planes_(planes), in_(in.as<T>()), out_(out.as<T>()), box_(out.box) {
        rule_ = {passes.dims, passes.boundary, C(gaussian_scale) * static_cast<C>(passes.border_value), in.box.lower.y,
                 in.box.upper.y};
        constexpr auto line = static_cast<std::int64_t>(128 / sizeof(C));
        middle_.pitch = (box_.dims().x + line - 1) / line * line;
        middle_.plane = middle_.pitch * box_.dims().y;
        std::int64_t const r = passes.taps[2].radius,
                           plane_bytes = middle_.plane * static_cast<std::int64_t>(sizeof(C));
        Index3 const radius{passes.taps[0].radius, passes.taps[1].radius, r};
        marches_ = std::is_same_v<C, float> && std::max({radius.x, radius.y, radius.z}) <= most_marched;
        std::int64_t const bytes = marches_ ? marched_bytes : middle_bytes;
        group_ = std::clamp<std::int64_t>(bytes / plane_bytes / march_slices * march_slices, march_slices, 16384);
        if (!marches_) group_ = std::clamp<std::int64_t>(bytes / plane_bytes / outputs * outputs, outputs, 16384);
        middle_.slots = group_ + 2 * r;
        if (passes.boundary != Boundary::wrap) middle_.slots = std::min(middle_.slots, passes.dims.z);
        shared_xy_ = static_cast<std::int64_t>(sizeof(C)) * (tile_y + 2 * radius.y) *
                     (((tile_x + 2 * radius.x) | 1) + (radius.x > 0 ? tile_x + 1 : 0));
        shared_z_ = (outputs + 2 * r) * 8;
        if (shared_z_ > shared_limit)
            throw Error(ErrorKind::resources, "sigma along z is too large for the GPU",
                        "use --device cpu, or a smaller --sigma");
        fused_ = shared_xy_ <= shared_limit;
        rows_ = middle_;
        if (!fused_) rows_.plane = rows_.pitch * (box_.dims().y + 2 * radius.y);
    }

    void run() {
        prepare();
        for (std::int64_t z = box_.lower.z; z < box_.upper.z; z += group_) {
            std::int64_t const last = std::min(z + group_, box_.upper.z);
            std::int64_t const have = std::max(planes_.end, first_slice(z)), need = last_slice(last);
            if (have < need) filter_slices(have, need - have);
            planes_.end = std::max(planes_.end, need);
            if constexpr (std::is_same_v<C, float>)
                if (marches_) {
                    march_along_z(z, last);
                    continue;
                }
            launch_z(z, last);
        }
        planes_.begin = box_.upper.z;
    }

private:
    void filter_slices(std::int64_t first, std::int64_t count) {
        if constexpr (std::is_same_v<C, float>)
            if (marches_) return march_along_y(first, count);
        fused_ ? launch_xy(first, count) : launch_lines(first, count);
    }

    /// Slices still in the ring are kept if this run goes on where the last one ended.
    void prepare() {
        std::int64_t const layout = -1 - group_;
        Box const& a = planes_.area;
        bool const same = a.lower.x == box_.lower.x && a.upper.x == box_.upper.x && a.lower.y == box_.lower.y &&
                          a.upper.y == box_.upper.y && planes_.layout == layout && planes_.begin == box_.lower.z;
        if (!same) planes_.end = first_slice(box_.lower.z);
        planes_.area = box_;
        planes_.layout = layout;
        std::int64_t const ring = middle_.plane * middle_.slots, extra = fused_ ? 0 : rows_.plane * rows_.slots;
        std::int64_t tap_count = 0;
        for (auto const& t : passes_.taps) tap_count += t.radius + 1;
        planes_.storage.reserve(static_cast<std::size_t>(ring + extra + tap_count) * sizeof(C));
        C* const memory = reinterpret_cast<C*>(planes_.storage.write(Space::device));
        middle_.data = memory;
        rows_.data = memory + ring;
        C* shares = memory + ring + extra;
        for (int axis = 0; axis < 3; ++axis) {
            GaussianTaps const& t = passes_.taps[static_cast<std::size_t>(axis)];
            taps_[axis] = {static_cast<int>(t.radius), shares};
            C const* from = nullptr;
            if constexpr (std::is_same_v<C, float>)
                from = t.single_shares.data();
            else
                from = t.shares.data();
            if (!same) copy_to_device(shares, from, static_cast<std::size_t>(t.radius + 1) * sizeof(C));
            shares += t.radius + 1;
        }
    }
    std::int64_t first_slice(std::int64_t z) const {
        return passes_.boundary == Boundary::wrap ? z - passes_.taps[2].radius
                                                  : std::max<std::int64_t>(0, z - passes_.taps[2].radius);
    }
    std::int64_t last_slice(std::int64_t end) const {
        return passes_.boundary == Boundary::wrap ? end + passes_.taps[2].radius
                                                  : std::min(passes_.dims.z, end + passes_.taps[2].radius);
    }
    static dim3 grid(std::int64_t blocks, std::int64_t slices) {
        return dim3(launch_blocks(blocks), static_cast<unsigned>(slices));
    }
    template <class Kernel> static void allow_shared(Kernel* kernel, std::int64_t bytes) {
        if (bytes > 48 << 10)
            (void)cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
    }

    /// Launches hold at most 32768 slices each.
    template <class Launch> static void in_groups(std::int64_t first, std::int64_t count, Launch const& launch) {
        for (std::int64_t i = 0; i < count; i += 32768) launch(first + i, std::min<std::int64_t>(32768, count - i));
    }
    MarchTaps march_taps(std::size_t axis) const {
        GaussianTaps const& taps = passes_.taps[axis];
        MarchTaps result{static_cast<int>(taps.radius), {}};
        std::copy(taps.single_shares.begin(), taps.single_shares.end(), result.shares);
        return result;
    }
    /// Calls f with the number of voxels on either side for which there is a kernel.
    template <class F> void with_reach(F const& f) const {
        std::int64_t most = 0;
        for (auto const& taps : passes_.taps) most = std::max(most, taps.radius);
        if (most <= most_marched / 2)
            f(std::integral_constant<int, most_marched / 2>{});
        else
            f(std::integral_constant<int, most_marched>{});
    }
    void march_along_y(std::int64_t first, std::int64_t count) {
        std::int64_t const across = (box_.dims().x + march_width - 1) / march_width,
                           chunks = (box_.dims().y + march_chunk - 1) / march_chunk;
        in_groups(first, count, [&](std::int64_t z, std::int64_t n) {
            with_reach([&]<int R>(std::integral_constant<int, R>) {
                auto* const kernel =
                    passes_.boundary == Boundary::border ? &march_xy<T, R, true> : &march_xy<T, R, false>;
                kernel<<<grid(across * chunks, n), march_width>>>(in_, box_, z, static_cast<unsigned>(across),
                                                                  march_taps(0), march_taps(1), rule_, middle_);
            });
            check_launch("gaussian along x and y");
        });
    }
    void march_along_z(std::int64_t z, std::int64_t last) {
        Box part = box_;
        part.lower.z = z;
        part.upper.z = last;
        std::int64_t const across = (box_.dims().x + march_width - 1) / march_width;
        dim3 const blocks = grid(across * box_.dims().y, (last - z + march_slices - 1) / march_slices);
        with_reach([&]<int R>(std::integral_constant<int, R>) {
            march_z<T, R>
                <<<blocks, march_width>>>(middle_, part, out_, static_cast<unsigned>(across), march_taps(2), rule_);
        });
        check_launch("gaussian along z");
    }
    void launch_xy(std::int64_t first, std::int64_t count) {
        auto* const kernel = &filter_xy<T, C>;
        allow_shared(kernel, shared_xy_);
        std::int64_t const tiles = ((box_.dims().x + tile_x - 1) / tile_x) * ((box_.dims().y + tile_y - 1) / tile_y);
        in_groups(first, count, [&](std::int64_t z, std::int64_t n) {
            kernel<<<grid(tiles, n), threads, static_cast<std::size_t>(shared_xy_)>>>(in_, box_, z, taps_[0], taps_[1],
                                                                                      rule_, middle_);
            check_launch("gaussian along x and y");
        });
    }
    void launch_lines(std::int64_t first, std::int64_t count) {
        std::int64_t const ry = passes_.taps[1].radius, ny = box_.dims().y;
        Index3 lower = box_.lower;
        lower.y -= ry;
        auto blocks = [&](std::int64_t rows) { return (box_.dims().x * rows + threads - 1) / threads; };
        in_groups(first, count, [&](std::int64_t z, std::int64_t n) {
            filter_line<0><<<grid(blocks(ny + 2 * ry), n), threads>>>(AlongX<T, C>{in_, lower, rule_}, box_, z,
                                                                      ny + 2 * ry, taps_[0], rule_, rows_);
            check_launch("gaussian along x");
            filter_line<1><<<grid(blocks(ny), n), threads>>>(AlongY<C>{rows_, taps_[1].radius}, box_, z, ny, taps_[1],
                                                             rule_, middle_);
            check_launch("gaussian along y");
        });
    }
    void launch_z(std::int64_t z, std::int64_t last) {
        auto* const kernel = &filter_z<T, C>;
        allow_shared(kernel, shared_z_);
        Box part = box_;
        part.lower.z = z;
        part.upper.z = last;
        std::int64_t const blocks = (middle_.plane / 2 + threads - 1) / threads;
        kernel<<<grid(blocks, (last - z + outputs - 1) / outputs), threads, static_cast<std::size_t>(shared_z_)>>>(
            middle_, part, out_, taps_[2], rule_);
        check_launch("gaussian along z");
    }

    GaussianPasses const& passes_;
    GaussianPlanes& planes_;
    View<T const> in_;
    View<T> out_;
    Box box_;
    Surroundings<C> rule_;
    Middle<C> middle_, rows_; ///< filtered planes; rows filtered along x only, where the passes are not fused
    DeviceTaps<C> taps_[3];
    std::int64_t group_, shared_xy_, shared_z_;
    bool fused_, marches_;
};

} // namespace gaussian

} // namespace vkt::VKT_BACKEND
