// Affine sampling on GPUs, voxel by voxel: any interpolant, with the arithmetic of the CPU's rows.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/operations/resample/kernels/affine.h"
#include "libvkt/operations/resample/kernels/interpolants.h"

#include <algorithm>
#include <type_traits>

namespace vkt::VKT_BACKEND::affine {

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

inline DeviceSampling device_sampling(AffineSampling const& rule, ConstView const& in, Box const& out) {
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
    return s.scale == 1 && s.offset == 0 ? v : saturated(v * s.scale + s.offset, v); // of -0 nothing is left else
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

} // namespace vkt::VKT_BACKEND::affine
