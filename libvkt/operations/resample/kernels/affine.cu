// Affine sampling on GPUs: a thread a column of voxels, with the arithmetic of the CPU's rows.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/affine.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/resample/kernels/interpolants.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr std::int64_t most_counted = 1 << 30; ///< voxels along an axis that are counted in 32 bits

/// AffineSampling as kernels get it.
struct DeviceSampling {
    Affine map;
    Index3 dims;  ///< of the input volume
    Index3 lower; ///< of the input's view
    Index3 first; ///< of the output's
    int samples_x = 1, samples_y = 1, samples_z = 1;
    bool bounded = false;   ///< there is a boundary rule: nothing becomes background
    bool continued = false; ///< coefficients go on beyond the faces
    Boundary boundary = Boundary::clamp;
    std::int64_t beyond = 0;
    double border = 0, background = 0, scale = 1, offset = 0;
    double end_x = 0, end_y = 0, end_z = 0;    ///< positions that lie in the volume are below
    int inner_x = 0, inner_y = 0, inner_z = 0; ///< dims, or 0 where they are too large to count in 32 bits
};

DeviceSampling device_sampling(AffineSampling const& rule, ConstView const& in, Box const& out) {
    DeviceSampling s;
    s.map = rule.map;
    s.dims = rule.dims;
    s.lower = in.box.lower;
    s.first = out.lower;
    s.end_x = end_position(s.dims.x), s.end_y = end_position(s.dims.y), s.end_z = end_position(s.dims.z);
    bool const small = std::max({s.dims.x, s.dims.y, s.dims.z}) < most_counted;
    s.inner_x = small ? static_cast<int>(s.dims.x) : 0;
    s.inner_y = small ? static_cast<int>(s.dims.y) : 0;
    s.inner_z = small ? static_cast<int>(s.dims.z) : 0;
    s.samples_x = static_cast<int>(rule.samples.x);
    s.samples_y = static_cast<int>(rule.samples.y);
    s.samples_z = static_cast<int>(rule.samples.z);
    s.bounded = rule.boundary.has_value();
    s.boundary = rule.boundary.value_or(Boundary::clamp);
    s.continued = spline_degree(rule.interpolant) > 0 && s.boundary != Boundary::mirror && s.boundary != Boundary::wrap;
    s.beyond = rule.beyond;
    s.border = rule.border;
    s.background = rule.background;
    s.scale = rule.scale;
    s.offset = rule.offset;
    return s;
}

/// Voxels of a known type, or of one that is looked up for each.
template <class T> struct Voxels {
    driver::DeviceRows rows;
    template <class C> __device__ __forceinline__ C at(std::byte const* from) const {
        if constexpr (std::is_same_v<T, void>)
            return driver::load_value<C>(rows.type, from);
        else
            return static_cast<C>(*reinterpret_cast<T const*>(from));
    }
};

__device__ __forceinline__ bool lies_in(double p, double end) { return p >= first_position() && p < end; }

/// A position as the whole below it and what is beyond, and the same whole in 32 bits, if it fits there: snapped() and
/// floor_of() at once.
struct Split {
    double whole, rest;
    int index; ///< less than any that is asked for where it does not fit

    __device__ __forceinline__ double snapped() const { return whole + rest; }
};
__device__ __forceinline__ Split split(double p) {
    double const shifted = p + magic, r = shifted - magic, d = p - r;
    bool const near = d < 1e-9 && d > -1e-9, above = !near && r > p;
    double const whole = above ? r - 1 : r;
    // Positions may be anything that a header can say: of those beyond 2^30, and NaN, the exponent tells.
    bool const counted = (__double2hiint(p) & 0x7fffffff) < 0x41d00000;
    return {whole, near ? 0.0 : p - whole, counted ? __double2loint(shifted) - (above ? 1 : 0) : -(1 << 30)};
}
/// A position in three parts.
struct Place {
    Split x, y, z;
};
/// The position itself, not snapped.
__device__ __forceinline__ double along(PositionLine const& line, double x) { return line.base + x * line.step; }

/// Index of the voxel i beyond a whole position, -1 if that is the border.
__device__ __forceinline__ std::int64_t index_at(DeviceSampling const& s, double whole, int i, std::int64_t n,
                                                 std::int64_t lower) {
    double const limit = 0x1p60; // positions may be anything that a header can say
    double const within = whole < -limit ? -limit : whole > limit ? limit : whole;
    std::int64_t const at = static_cast<std::int64_t>(within) + i;
    if (s.continued) {
        std::int64_t const beyond = beyond_along(n, s.beyond, s.boundary);
        return at < -beyond ? -beyond : at > n - 1 + beyond ? n - 1 + beyond : at;
    }
    return s.boundary == Boundary::wrap ? lower + fold(at - lower, n, s.boundary) : fold(at, n, s.boundary);
}

/// True if all voxels that a sample looks at lie in the volume.
template <class Kernel> __device__ __forceinline__ bool is_inner(DeviceSampling const& s, Place const& at) {
    constexpr int before = Kernel::kind == Interpolant::cubic || Kernel::kind == Interpolant::bspline3      ? 1
                           : Kernel::kind == Interpolant::bspline5 || Kernel::kind == Interpolant::lanczos3 ? 2
                                                                                                            : 0;
    constexpr int after = before + 1;
    return at.x.index >= before && at.y.index >= before && at.z.index >= before && at.x.index + after < s.inner_x &&
           at.y.index + after < s.inner_y && at.z.index + after < s.inner_z;
}

/// A sample at a position; C is what linear is computed in where nothing but voxels is looked at.
template <class Kernel, class C, class T>
__device__ __forceinline__ C sample_at(DeviceSampling const& s, Voxels<T> const& voxels, Place const& place) {
    auto const& [x, y, z] = place;
    bool const inner = is_inner<Kernel>(s, place);
    driver::DeviceRows const& rows = voxels.rows;
    if (inner) {
        std::byte const* const first = rows.at(x.index - s.lower.x, y.index - s.lower.y, z.index - s.lower.z);
        auto const v = [&](int i, int j, int k) {
            return voxels.template at<C>(first + i * rows.size + j * rows.row + k * rows.slice);
        };
        if constexpr (std::is_same_v<C, float>) {
            auto const fx = static_cast<float>(x.rest), fy = static_cast<float>(y.rest),
                       fz = static_cast<float>(z.rest);
            return between(between(between(v(0, 0, 0), v(1, 0, 0), fx), between(v(0, 1, 0), v(1, 1, 0), fx), fy),
                           between(between(v(0, 0, 1), v(1, 0, 1), fx), between(v(0, 1, 1), v(1, 1, 1), fx), fy), fz);
        } else {
            return Kernel::value(v, x.rest, y.rest, z.rest);
        }
    }
    auto const v = [&](int i, int j, int k) {
        std::int64_t const vx = index_at(s, x.whole, i, s.dims.x, s.lower.x),
                           vy = index_at(s, y.whole, j, s.dims.y, s.lower.y),
                           vz = index_at(s, z.whole, k, s.dims.z, s.lower.z);
        bool const border = !s.continued && s.boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0);
        if (border) return s.border;
        return voxels.template at<double>(rows.at(vx - s.lower.x, vy - s.lower.y, vz - s.lower.z));
    };
    return static_cast<C>(Kernel::value(v, x.rest, y.rest, z.rest));
}

__device__ __forceinline__ double mapped(DeviceSampling const& s, double v) {
    return s.scale == 1 && s.offset == 0 ? v : v * s.scale + s.offset; // of -0 nothing is left else
}

__device__ __forceinline__ double aside(int i, int n) {
    return (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 0.5;
}

template <class Kernel, class C, class T> struct Sample {
    DeviceSampling s;
    Voxels<T> voxels;
    driver::DeviceRows out;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        driver::store_value(out.type, out.at(x, y, z), value(x, y, z, counts), counts);
    }

private:
    static __device__ __forceinline__ Place place(PositionRow const& row, double column) {
        return {split(along(row.x, column)), split(along(row.y, column)), split(along(row.z, column))};
    }
    __device__ __forceinline__ C value(std::int64_t x, std::int64_t y, std::int64_t z,
                                       driver::LossCounts& counts) const {
        auto const column = static_cast<double>(s.first.x + x);
        PositionRow const centre = row_of(s.map, {}, s.first.y + y, s.first.z + z);
        Place const at = place(centre, column);
        if (!s.bounded && !is_inner<Kernel>(s, at) &&
            !(lies_in(at.x.snapped(), s.end_x) && lies_in(at.y.snapped(), s.end_y) &&
              lies_in(at.z.snapped(), s.end_z))) {
            ++counts.undefined;
            return static_cast<C>(s.background);
        }
        if constexpr (std::is_same_v<C, float>) { // a single sample, and values as they are
            return sample_at<Kernel, C>(s, voxels, at);
        } else {
            if (s.samples_x * s.samples_y * s.samples_z == 1) return mapped(s, sample_at<Kernel, C>(s, voxels, at));
            return mapped(s, mean(column, y, z));
        }
    }

    /// Of the samples in the voxel's cell.
    __device__ __forceinline__ double mean(double column, std::int64_t y, std::int64_t z) const {
        double result = 0;
        int count = 0;
        for (int k = 0; k < s.samples_z; ++k)
            for (int j = 0; j < s.samples_y; ++j)
                for (int i = 0; i < s.samples_x; ++i) {
                    double const a = aside(i, s.samples_x), b = aside(j, s.samples_y), c = aside(k, s.samples_z);
                    auto const &p = s.map.column[0], &q = s.map.column[1], &r = s.map.column[2];
                    PositionRow const at = row_of(
                        s.map, {p.x * a + q.x * b + r.x * c, p.y * a + q.y * b + r.y * c, p.z * a + q.z * b + r.z * c},
                        s.first.y + y, s.first.z + z);
                    double const sample = sample_at<Kernel, C>(s, voxels, place(at, column));
                    ++count;
                    result = count == 1 ? sample : between(result, sample, 1 / static_cast<double>(count));
                }
        return result;
    }
};

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

/// True if a thread may count in 32 bits wherever the output's positions are and the input's voxels lie.
bool counts_in_32_bits(AffineSampling const& rule, ConstView const& in, Box const& out) {
    auto const size = static_cast<std::int64_t>(size_of(in.type));
    bool small = std::max({rule.dims.x, rule.dims.y, rule.dims.z}) < most_counted && in.row * size < most_counted &&
                 in.slice * size < most_counted;
    for (int corner = 0; corner < 8; ++corner) {
        PositionRow const row = row_of(rule.map, {}, corner % 2 != 0 ? out.upper.y - 1 : out.lower.y,
                                       corner / 2 % 2 != 0 ? out.upper.z - 1 : out.lower.z);
        auto const x = static_cast<double>(corner / 4 != 0 ? out.upper.x - 1 : out.lower.x);
        for (int axis = 0; axis < 3; ++axis)
            small = small && std::abs(row.line(axis).base + x * row.line(axis).step) < most_counted;
    }
    return small;
}

template <class Kernel, class C, class T>
void launch_sample(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    Sample<Kernel, C, T> const sample{device_sampling(rule, in, out.box),
                                      {driver::device_rows(in, in.box)},
                                      driver::device_rows(ConstView(out), out.box)};
    driver::for_each_voxel<driver::SlantedBlock>(out.dims(), sample, totals, "affine_sample");
}

/// Losses, and the voxels outside.
void count(driver::DeviceLosses const& counts, Losses& losses, std::int64_t& outside) {
    Losses found;
    counts.add_to(found);
    outside += found.undefined;
    found.undefined = 0;
    losses += found;
}

template <class U> struct NearestVoxel {
    DeviceSampling s;
    driver::DeviceRows in, out;
    U background;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        auto const column = static_cast<double>(s.first.x + x);
        PositionRow const at = row_of(s.map, {}, s.first.y + y, s.first.z + z);
        double const px = at.x(column), py = at.y(column), pz = at.z(column);
        U value = background;
        if (!s.bounded && !(lies_in(px, s.end_x) && lies_in(py, s.end_y) && lies_in(pz, s.end_z))) {
            ++counts.undefined;
        } else {
            double const half = 0.5 + face_slack;
            std::int64_t const vx = index_at(s, std::floor(px + half), 0, s.dims.x, s.lower.x),
                               vy = index_at(s, std::floor(py + half), 0, s.dims.y, s.lower.y),
                               vz = index_at(s, std::floor(pz + half), 0, s.dims.z, s.lower.z);
            bool const border = s.boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0);
            if (!border) value = *reinterpret_cast<U const*>(in.at(vx - s.lower.x, vy - s.lower.y, vz - s.lower.z));
        }
        *reinterpret_cast<U*>(out.at(x, y, z)) = value;
    }
};

template <class U>
void launch_nearest(ConstView in, AnyView out, AffineSampling const& rule, VoxelBytes const& voxel,
                    unsigned long long* totals) {
    NearestVoxel<U> nearest{device_sampling(rule, in, out.box), driver::device_rows(in, in.box),
                            driver::device_rows(ConstView(out), out.box), U{}};
    std::memcpy(&nearest.background, voxel.data(), sizeof nearest.background);
    driver::for_each_voxel<driver::SlantedBlock>(out.dims(), nearest, totals, "affine_nearest");
}

/// Linear in float32, of the types that it holds.
template <class T>
void launch_single(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (!counts_in_32_bits(rule, in, out.box)) return launch_sample<Linear, float, T>(in, out, rule, totals);
    DeviceSampling const s = device_sampling(rule, in, out.box);
    driver::DeviceRows const rows = driver::device_rows(in, in.box);
    auto const before = s.lower.z * rows.slice + s.lower.y * rows.row + s.lower.x * rows.size;
    auto const inner = [](int n) { return static_cast<unsigned>(n - 1); };
    LinearSample<T> const sample{{s, {rows}, driver::device_rows(ConstView(out), out.box)},
                                 rows.data - before,
                                 static_cast<int>(rows.row),
                                 static_cast<int>(rows.slice),
                                 inner(s.inner_x),
                                 inner(s.inner_y),
                                 inner(s.inner_z),
                                 in.type == out.type};
    if (StillAxis const still = still_axis(rule.map); still.axis >= 0)
        return launch_slices(out.dims(), still, sample, totals);
    launch_linear(out.dims(), sample, totals);
}

void sample_single(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::float32) return launch_single<float>(in, out, rule, totals);
    if (in.type == DataType::uint8) return launch_single<std::uint8_t>(in, out, rule, totals);
    if (in.type == DataType::uint16) return launch_single<std::uint16_t>(in, out, rule, totals);
    if (in.type == DataType::int16) return launch_single<std::int16_t>(in, out, rule, totals);
    launch_sample<Linear, float, void>(in, out, rule, totals);
}

/// The coefficients of splines are floats; of other types the voxels' is looked up.
template <class Kernel>
void sample_floats(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::float32) return launch_sample<Kernel, double, float>(in, out, rule, totals);
    launch_sample<Kernel, double, void>(in, out, rule, totals);
}

/// Of voxels of the usual types that is a third of the time of looking it up.
template <class Kernel>
void sample_voxels(ConstView in, AnyView out, AffineSampling const& rule, unsigned long long* totals) {
    if (in.type == DataType::uint8) return launch_sample<Kernel, double, std::uint8_t>(in, out, rule, totals);
    if (in.type == DataType::uint16) return launch_sample<Kernel, double, std::uint16_t>(in, out, rule, totals);
    if (in.type == DataType::int16) return launch_sample<Kernel, double, std::int16_t>(in, out, rule, totals);
    sample_floats<Kernel>(in, out, rule, totals);
}

} // namespace

void affine_sample(ConstView in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const&) {
    if (out.box.empty()) return;
    driver::DeviceLosses const counts;
    if (rule.single) {
        sample_single(in, out, rule, counts.get());
    } else {
        switch (rule.interpolant) {
        case Interpolant::nearest:
            launch_sample<Nearest, double, void>(in, out, rule, counts.get());
            break;
        case Interpolant::linear:
            launch_sample<Linear, double, void>(in, out, rule, counts.get());
            break;
        case Interpolant::cubic:
            sample_voxels<Cubic>(in, out, rule, counts.get());
            break;
        case Interpolant::lanczos3:
            sample_voxels<Lanczos3>(in, out, rule, counts.get());
            break;
        case Interpolant::bspline3:
            sample_floats<BSpline3>(in, out, rule, counts.get());
            break;
        case Interpolant::bspline5:
            sample_floats<BSpline5>(in, out, rule, counts.get());
        }
    }
    count(counts, losses, outside);
}

void affine_nearest(ConstView in, AnyView out, AffineSampling const& rule, std::int64_t& outside, Execution const&) {
    if (out.box.empty()) return;
    VoxelBytes const voxel = voxel_bytes(out.type, rule.boundary ? rule.border : rule.background);
    driver::DeviceLosses const counts;
    switch (size_of(in.type)) {
    case 1:
        launch_nearest<std::uint8_t>(in, out, rule, voxel, counts.get());
        break;
    case 2:
        launch_nearest<std::uint16_t>(in, out, rule, voxel, counts.get());
        break;
    case 4:
        launch_nearest<std::uint32_t>(in, out, rule, voxel, counts.get());
        break;
    default:
        launch_nearest<std::uint64_t>(in, out, rule, voxel, counts.get());
    }
    Losses none;
    count(counts, none, outside);
}

} // namespace VKT_BACKEND
} // namespace vkt
