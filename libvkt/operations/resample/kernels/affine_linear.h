// Linear sampling on GPUs in float32: what nearly all voxels of a rotated volume need, the others apart.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/kernels/affine_sample.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

namespace vkt::VKT_BACKEND::affine {

/// Linear in float32, of voxels of type T, where all that is counted has room in 32 bits: the same bits as Sample, to
/// which all is left that lies elsewhere than among voxels.
template <class T> struct LinearSample {
    Sample<Linear, float, T> any;
    std::byte const* origin;            ///< of the input volume's voxel 0, which need not be there
    int row, slice;                     ///< bytes
    unsigned inner_x, inner_y, inner_z; ///< voxels below which there is another one
    bool typed_out;                     ///< results are of type T, too

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        PositionRow const centre = row_of(any.s.map, {}, any.s.first.y + y, any.s.first.z + z);
        if (!among_voxels(centre, x, y, z, counts)) at_last(centre, x, y, z, counts);
    }
    /// Most voxels; false if nothing was done, because something is to be looked at more closely.
    __device__ __forceinline__ bool among_voxels(PositionRow const& centre, std::int64_t x, std::int64_t y,
                                                 std::int64_t z, driver::LossCounts& counts) const {
        auto const column = static_cast<double>(any.s.first.x + x);
        Part const px = part(centre.x, column), py = part(centre.y, column), pz = part(centre.z, column);
        if (!(static_cast<unsigned>(px.index) < inner_x && static_cast<unsigned>(py.index) < inner_y &&
              static_cast<unsigned>(pz.index) < inner_z)) {
            bool const far = is_far(px.index, inner_x) || is_far(py.index, inner_y) || is_far(pz.index, inner_z);
            if (far) store_background(any.out.at(x, y, z), counts);
            return far;
        }
        auto const* const near = reinterpret_cast<T const*>(
            origin + static_cast<std::int64_t>(pz.index) * slice + static_cast<std::int64_t>(py.index) * row +
            static_cast<std::int64_t>(px.index) * static_cast<int>(sizeof(T)));
        auto const beyond = [](T const* from, int bytes) {
            return reinterpret_cast<T const*>(reinterpret_cast<std::byte const*>(from) + bytes);
        };
        T const *const second = beyond(near, row), *const third = beyond(near, slice),
                       *const fourth = beyond(second, slice);
        float const v[8] = {static_cast<float>(near[0]),   static_cast<float>(near[1]),  static_cast<float>(second[0]),
                            static_cast<float>(second[1]), static_cast<float>(third[0]), static_cast<float>(third[1]),
                            static_cast<float>(fourth[0]), static_cast<float>(fourth[1])};
        if constexpr (!std::is_integral_v<T>) {
            float odd = 0; // NaN, if one of them is not finite
#pragma unroll
            for (float const value : v) odd = __fmaf_rn(value, 0.0F, odd);
            if (odd != 0) return false;
        }
        Fraction const fx(px.rest), fy(py.rest), fz(pz.rest);
        float const value = fz.between(fy.between(fx.between(v[0], v[1]), fx.between(v[2], v[3])),
                                       fy.between(fx.between(v[4], v[5]), fx.between(v[6], v[7])));
        store(any.out.at(x, y, z), value, counts);
        return true;
    }
    /// The others: near a face, or beside a voxel that is not finite.
    __device__ __forceinline__ void at_last(PositionRow const& centre, std::int64_t x, std::int64_t y, std::int64_t z,
                                            driver::LossCounts& counts) const {
        if (any.s.bounded) return elsewhere(x, y, z, counts);
        store_found(closely(centre, static_cast<double>(any.s.first.x + x)), any.out.at(x, y, z), counts);
    }
    /// What Sample does, apart, lest it takes registers from what nearly all threads do.
    __device__ __forceinline__ void elsewhere(std::int64_t x, std::int64_t y, std::int64_t z,
                                              driver::LossCounts& counts) const {
        counts += counts_elsewhere(x, y, z);
    }
    __device__ __noinline__ driver::LossCounts counts_elsewhere(std::int64_t x, std::int64_t y, std::int64_t z) const {
        driver::LossCounts own;
        any(x, y, z, own);
        return own;
    }
    /// The two voxels along an axis around a position, those at the faces being continued: there is no boundary rule.
    struct Pair {
        std::int64_t first, second; ///< bytes from voxel 0
        double rest;
        bool inside, whole; ///< the position is; both voxels are
    };
    static __device__ __forceinline__ Pair pair(PositionLine const& line, double x, double end, int n, int stride) {
        Split const at = split(along(line, x));
        int const last = n - 1;
        return {static_cast<std::int64_t>(min(max(at.index, 0), last)) * stride,
                static_cast<std::int64_t>(min(max(at.index + 1, 0), last)) * stride, at.rest,
                lies_in(at.snapped(), end), at.index >= 0 && at.index < last};
    }
    __device__ __forceinline__ T voxel(std::int64_t at) const { return *reinterpret_cast<T const*>(origin + at); }
    struct Found {
        float value;
        bool inside;
    };
    /// What Sample does without a boundary rule, in a tenth of its steps: in double within a voxel of a face.
    __device__ __noinline__ Found closely(PositionRow const& centre, double column) const {
        DeviceSampling const& s = any.s;
        Pair const px = pair(centre.x, column, s.end_x, s.inner_x, static_cast<int>(sizeof(T))),
                   py = pair(centre.y, column, s.end_y, s.inner_y, row),
                   pz = pair(centre.z, column, s.end_z, s.inner_z, slice);
        if (!px.inside || !py.inside || !pz.inside) return {0, false};
        T v[2][2][2];
#pragma unroll
        for (int i = 0; i < 8; ++i)
            v[i / 4][i / 2 % 2][i % 2] =
                voxel((i % 2 == 0 ? px.first : px.second) + (i / 2 % 2 == 0 ? py.first : py.second) +
                      (i / 4 == 0 ? pz.first : pz.second));
        return {px.whole && py.whole && pz.whole ? linear<float>(v, px.rest, py.rest, pz.rest)
                                                 : static_cast<float>(linear<double>(v, px.rest, py.rest, pz.rest)),
                true};
    }
    template <class C> static __device__ __forceinline__ C linear(T const (&v)[2][2][2], double x, double y, double z) {
        auto const fx = static_cast<C>(x), fy = static_cast<C>(y), fz = static_cast<C>(z);
        C plane[2];
#pragma unroll
        for (int k = 0; k < 2; ++k)
            plane[k] = between(between(static_cast<C>(v[k][0][0]), static_cast<C>(v[k][0][1]), fx),
                               between(static_cast<C>(v[k][1][0]), static_cast<C>(v[k][1][1]), fx), fy);
        return between(plane[0], plane[1], fz);
    }
    __device__ __forceinline__ void store_found(Found const& found, std::byte* to, driver::LossCounts& counts) const {
        if (found.inside)
            store(to, found.value, counts);
        else
            store_background(to, counts);
    }
    /// A voxel further than half of one beyond a face, by the whole below its position; no rule continues the volume.
    __device__ __forceinline__ bool is_far(int index, unsigned inner) const {
        return !any.s.bounded && (index < -1 || index > static_cast<int>(inner));
    }
    __device__ __forceinline__ void store_background(std::byte* to, driver::LossCounts& counts) const {
        ++counts.undefined;
        driver::store_value(any.out.type, to, static_cast<float>(any.s.background), counts);
    }
    __device__ __forceinline__ void store(std::byte* to, float value, driver::LossCounts& counts) const {
        if (typed_out)
            *reinterpret_cast<T*>(to) = round_to<T>(value); // no less and no more than voxels are
        else
            driver::store_value(any.out.type, to, value, counts);
    }
    struct Part {
        int index;
        float rest;
    };
    /// PositionLine::floor, of positions that have room.
    static __device__ __forceinline__ Part part(PositionLine const& line, double x) {
        double const p = line.base + x * line.step, shifted = p + magic, r = shifted - magic, d = p - r;
        bool const below = d <= -1e-9;
        double const rest = below ? d + 1 : d;
        return {__double2loint(shifted) - (below ? 1 : 0),
                rest < 1e-9 ? 0.0F : static_cast<float>(rest)}; // what is below is more than a half
    }
    /// between() of finite numbers in fewer steps.
    struct Fraction {
        float f, rest;
        bool none;
        __device__ __forceinline__ explicit Fraction(float fraction)
            : f(fraction), rest(1 - fraction), none(fraction == 0) {}
        __device__ __forceinline__ float between(float a, float b) const {
            float r = rest * a + f * b;
            r = fminf(fmaxf(r, fminf(a, b)), fmaxf(a, b));
            return none ? a : r;
        }
    };
};

/// Of a thread's strips those whose bits are set. A function of its own: what it needs takes no registers from what
/// most voxels need.
template <class T>
__device__ __noinline__ driver::LossCounts strips_left(LinearSample<T> const& sample, std::uint32_t left,
                                                       std::int64_t x0, std::int64_t y, std::int64_t z) {
    DeviceSampling const& s = sample.any.s;
    PositionRow const centre = row_of(s.map, {}, s.first.y + y, s.first.z + z);
    driver::LossCounts counts;
    for (; left != 0; left &= left - 1)
        sample.at_last(centre, x0 + (__ffs(static_cast<int>(left)) - 1) * driver::SlantedBlock::x, y, z, counts);
    return counts;
}

/// A thread's voxels of a row, most of them one after the other and then those that want a closer look.
template <class T>
__global__ void __launch_bounds__(256, 4)
    linear_kernel(driver::Blocks blocks, Index3 n, __grid_constant__ LinearSample<T> const sample,
                  unsigned long long* totals) {
    using Shape = driver::SlantedBlock;
    std::int64_t const x0 = static_cast<std::int64_t>(blockIdx.x % blocks.across) * Shape::width + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * Shape::y +
                           threadIdx.y,
                       z = static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * Shape::z +
                           threadIdx.z;
    driver::LossCounts counts;
    if (y < n.y && z < n.z) {
        DeviceSampling const& s = sample.any.s;
        PositionRow const centre = row_of(s.map, {}, s.first.y + y, s.first.z + z);
        std::uint32_t left = 0;
        for (int i = 0; i < Shape::strips; ++i) {
            std::int64_t const x = x0 + i * Shape::x;
            if (x < n.x && !sample.among_voxels(centre, x, y, z, counts)) left |= 1U << i;
        }
        if (left != 0) counts += strips_left(sample, left, x0, y, z);
    }
    driver::add_counts(counts, totals);
}

template <class T> void launch_linear(Index3 n, LinearSample<T> const& sample, unsigned long long* totals) {
    using Shape = driver::SlantedBlock;
    driver::Blocks const blocks = driver::blocks_of<Shape>(n);
    linear_kernel<T><<<blocks.all, dim3(Shape::x, Shape::y, Shape::z)>>>(blocks, n, sample, totals);
    check_launch("affine_sample");
}

constexpr int plane_x = 8, plane_rows = 4, plane_slices = 16, slices_at_once = 4;

/// Of a thread's slices those whose bits are set.
template <class T>
__device__ __noinline__ driver::LossCounts slices_left(LinearSample<T> const& sample, StillAxis const& still,
                                                       std::uint32_t left, std::int64_t x, std::int64_t row,
                                                       std::int64_t first, std::int64_t end) {
    using Sampler = LinearSample<T>;
    DeviceSampling const& s = sample.any.s;
    bool const by_z = still.axis == 2;
    PositionRow const centre = by_z ? row_of(s.map, {}, s.first.y + row, s.first.z + first)
                                    : row_of(s.map, {}, s.first.y + first, s.first.z + row);
    auto const column = static_cast<double>(s.first.x + x);
    typename Sampler::Pair const px = Sampler::pair(centre.x, column, s.end_x, s.inner_x, sizeof(T)),
                                 pw = by_z ? Sampler::pair(centre.y, column, s.end_y, s.inner_y, sample.row)
                                           : Sampler::pair(centre.z, column, s.end_z, s.inner_z, sample.slice);
    std::int64_t const along = by_z ? sample.slice : sample.row,
                       begin = (by_z ? s.first.z : s.first.y) + still.shift, // of the input, at slice 0
        there = by_z ? s.dims.z : s.dims.y;
    driver::LossCounts counts;
    for (; left != 0; left &= left - 1) {
        std::int64_t const slice = first + __ffs(static_cast<int>(left)) - 1, at = begin + slice;
        if (slice >= end) break;
        std::int64_t const y = by_z ? row : slice, z = by_z ? slice : row;
        if (s.bounded || (px.whole && pw.whole && at >= 0 && at + 1 < there)) {
            sample(x, y, z, counts);
            continue;
        }
        // Within a voxel of a face, in double; the axis that stays has no fraction.
        typename Sampler::Found found{0, px.inside && pw.inside && at >= 0 && at < there};
        if (found.inside) {
            auto const v = [&](std::int64_t dx, std::int64_t dw) {
                return static_cast<double>(sample.voxel(at * along + dx + dw));
            };
            double const near = between(v(px.first, pw.first), v(px.second, pw.first), px.rest),
                         next = between(v(px.first, pw.second), v(px.second, pw.second), px.rest);
            found.value = static_cast<float>(between(near, next, pw.rest));
        }
        sample.store_found(found, sample.any.out.at(x, y, z), counts);
    }
    return counts;
}

/// Slices along the axis that stays: a thread looks up its place in the plane once for all of its slices, of which it
/// needs four voxels each. The same bits as LinearSample, to which is left what lies elsewhere.
template <class T>
__global__ void __launch_bounds__(256, 3)
    slices_kernel(driver::Blocks blocks, Index3 n, StillAxis still, __grid_constant__ LinearSample<T> const sample,
                  unsigned long long* totals) {
    // Warps of 8 by 4 voxels, four of them side by side and two rows of them.
    unsigned const warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    std::int64_t const x = (static_cast<std::int64_t>(blockIdx.x % blocks.across) * 4 + warp % 4) * plane_x + lane % 8,
                       row = (static_cast<std::int64_t>(blockIdx.x / blocks.across % blocks.along) * 2 + warp / 4) *
                                 plane_rows +
                             lane / 8,
                       first = static_cast<std::int64_t>(blockIdx.x / blocks.across / blocks.along) * plane_slices;
    bool const by_z = still.axis == 2;
    std::int64_t const end = min(first + plane_slices, by_z ? n.z : n.y);
    driver::LossCounts counts;
    if (x < n.x && row < (by_z ? n.y : n.z)) {
        DeviceSampling const& s = sample.any.s;
        PositionRow const centre = by_z ? row_of(s.map, {}, s.first.y + row, s.first.z + first)
                                        : row_of(s.map, {}, s.first.y + first, s.first.z + row);
        auto const column = static_cast<double>(s.first.x + x);
        using Sampler = LinearSample<T>;
        auto const px = Sampler::part(centre.x, column), pw = Sampler::part(by_z ? centre.y : centre.z, column);
        unsigned const inner_w = by_z ? sample.inner_y : sample.inner_z;
        bool const inner =
                       static_cast<unsigned>(px.index) < sample.inner_x && static_cast<unsigned>(pw.index) < inner_w,
                   far = sample.is_far(px.index, sample.inner_x) || sample.is_far(pw.index, inner_w);
        std::int64_t const across = by_z ? sample.row : sample.slice, along = by_z ? sample.slice : sample.row,
                           begin = (by_z ? s.first.z : s.first.y) + still.shift; // of the input, at slice 0
        std::int64_t const there = by_z ? s.dims.z : s.dims.y;
        typename Sampler::Fraction const fx(px.rest), fw(pw.rest);
        auto const* const near =
            sample.origin + static_cast<std::int64_t>(pw.index) * across + px.index * static_cast<int>(sizeof(T));
        driver::DeviceRows const& out = sample.any.out;
        auto const place = [&](std::int64_t slice) { return by_z ? out.at(x, row, slice) : out.at(x, slice, row); };
        if (far)
            for (std::int64_t slice = first; slice < end; ++slice) sample.store_background(place(slice), counts);
        std::uint32_t left = 0; // slices near a face, and with voxels that are not finite
        for (int i = 0; !far && i < plane_slices; i += slices_at_once) {
            std::int64_t const slice = first + i;
            // The last slice is what LinearSample leaves to Sample, however slices are cut.
            if (!inner || slice + slices_at_once > end || begin + slice < 0 ||
                begin + slice + slices_at_once >= there) {
                left |= ((1U << slices_at_once) - 1) << i;
                continue;
            }
            float v[slices_at_once][4];
#pragma unroll
            for (int k = 0; k < slices_at_once; ++k) {
                std::byte const* const from = near + (begin + slice + k) * along;
                auto const *const a = reinterpret_cast<T const*>(from), *const b =
                                                                            reinterpret_cast<T const*>(from + across);
                v[k][0] = static_cast<float>(a[0]);
                v[k][1] = static_cast<float>(a[1]);
                v[k][2] = static_cast<float>(b[0]);
                v[k][3] = static_cast<float>(b[1]);
            }
#pragma unroll
            for (int k = 0; k < slices_at_once; ++k) {
                if constexpr (!std::is_integral_v<T>) {
                    float odd = 0; // NaN, if one of them is not finite
#pragma unroll
                    for (float const value : v[k]) odd = __fmaf_rn(value, 0.0F, odd);
                    if (odd != 0) {
                        left |= 1U << (i + k);
                        continue;
                    }
                }
                float const value = fw.between(fx.between(v[k][0], v[k][1]), fx.between(v[k][2], v[k][3]));
                sample.store(place(slice + k), value, counts);
            }
        }
        if (left != 0) counts += slices_left(sample, still, left, x, row, first, end);
    }
    driver::add_counts(counts, totals);
}

template <class T>
void launch_slices(Index3 n, StillAxis still, LinearSample<T> const& sample, unsigned long long* totals) {
    using Shape = driver::BlockShape<4 * plane_x, 2 * plane_rows, plane_slices, 1>;
    driver::Blocks const blocks = driver::blocks_of<Shape>(still.axis == 2 ? n : Index3{n.x, n.z, n.y});
    slices_kernel<T><<<blocks.all, 256>>>(blocks, n, still, sample, totals);
    check_launch("affine_sample");
}

} // namespace vkt::VKT_BACKEND::affine
