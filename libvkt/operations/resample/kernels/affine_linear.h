// Linear sampling on GPUs in float32: what nearly all voxels of a rotated volume need, the others apart.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/kernels/affine_sample.h"

namespace vkt::VKT_BACKEND::affine {

/// Linear in float32, of voxels of type T, where all that is counted has room in 32 bits: the same bits as Sample, to
/// which all is left that lies elsewhere than among voxels.
template <class T> struct LinearSample {
    Sample<Linear, float, T> any;
    std::byte const* origin;            ///< of the input volume's voxel 0, which need not be there
    int row, slice;                     ///< bytes
    unsigned inner_x, inner_y, inner_z; ///< voxels below which there is another one
    bool typed_out;                     ///< results are of type T, too

    struct Part {
        int index;
        float rest;
    };

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
        float const value = among(px, py, pz);
        if (!std::is_integral_v<T> && !(value - value == 0)) return false; // NOLINT(misc-redundant-expression)
        store(any.out.at(x, y, z), value, counts);
        return true;
    }
    /// Between the eight voxels around; not finite where not all of them are, or their differences.
    __device__ __forceinline__ float among(Part const& px, Part const& py, Part const& pz) const {
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
        Fraction const fx(px.rest), fy(py.rest), fz(pz.rest);
        return fz.between(fy.between(fx.between(v[0], v[1]), fx.between(v[2], v[3])),
                          fy.between(fx.between(v[4], v[5]), fx.between(v[6], v[7])));
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
    /// PositionLine::floor, of positions that have room.
    static __device__ __forceinline__ Part part(PositionLine const& line, double x) {
        return part_of(line.base + x * line.step);
    }
    static __device__ __forceinline__ Part part_of(double p) {
        double const shifted = p + magic, r = shifted - magic, d = p - r;
        bool const below = d <= -1e-9;
        double const rest = below ? d + 1 : d;
        return {__double2loint(shifted) - (below ? 1 : 0),
                rest < 1e-9 ? 0 : static_cast<float>(rest)}; // what is below is more than a half
    }
    /// The same in fewer steps, where is_apart() says so.
    static __device__ __forceinline__ Part floor_of(double p) {
        double const shifted = __dadd_rd(p, magic);
        return {__double2loint(shifted), static_cast<float>(p - (shifted - magic))};
    }
    /// The position is not so near to a whole number that it may be taken for one.
    static __device__ __forceinline__ bool is_apart(Part const& part) {
        return part.rest > 2e-9F && part.rest < 0.9999999F;
    }
    /// quickly_between(), of a fraction that several have.
    struct Fraction {
        bool second;
        float rest;
        __device__ __forceinline__ explicit Fraction(float f) : second(f > 0.5F), rest(second ? f - 1 : f) {}
        __device__ __forceinline__ float between(float a, float b) const { return (second ? b : a) + rest * (b - a); }
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

} // namespace vkt::VKT_BACKEND::affine
