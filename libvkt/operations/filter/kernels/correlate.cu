// Correlation on GPUs: separable kernels axis by axis, dense ones from neighbours in shared memory; the sums of the CPU
// in their order.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/correlate.h"

#include "libvkt/kernel/cuda_stencil.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/device_large_values.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <type_traits>
#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// Voxels in device memory as C, of a type that is looked up, times a power of two.
template <class C> struct Values {
    driver::DeviceRows rows;
    C scale = 1;
    __device__ __forceinline__ C operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return driver::load_value<C>(rows.type, rows.at(x, y, z)) * scale;
    }
};

/// A dense volume of C for the time of one call.
template <class C> class Stage {
public:
    explicit Stage(Index3 dims)
        : dims_(dims), memory_(static_cast<std::size_t>(dims.x * dims.y * dims.z) * sizeof(C)) {}
    View<C> as() const { return view().template as<C>(); }

private:
    AnyView view() const {
        return dense_view(memory_.get(), sizeof(C) == 4 ? DataType::float32 : DataType::float64, box_of(dims_),
                          Space::device);
    }
    Index3 dims_;
    driver::DeviceScratch memory_;
};

/// The taps of all axes on the device.
template <class C> class Weights {
public:
    explicit Weights(std::vector<AxisTaps> const& all) : list_(values_of(all)) {
        std::size_t next = 0;
        for (AxisTaps const& taps : all) {
            first_.push_back(next);
            next += taps.taps.size();
        }
    }
    C const* of(std::size_t taps) const { return list_.get() + first_[taps]; }

private:
    static std::vector<C> values_of(std::vector<AxisTaps> const& all) {
        std::vector<C> values;
        for (AxisTaps const& taps : all)
            for (double const tap : taps.taps) values.push_back(static_cast<C>(tap));
        return values;
    }

    std::vector<std::size_t> first_;
    driver::DeviceList<C> list_;
};

/// What AxisTaps makes of the values around one, added to `sum`.
template <class C, class V>
__device__ __forceinline__ C axis_sum(AxisTaps::Kind kind, int radius, C const* weight, V const& value, C sum) {
    switch (kind) {
    case AxisTaps::Kind::plain:
        for (int k = 0; k <= 2 * radius; ++k) sum = madd(weight[k], value(k - radius), sum);
        return sum;
    case AxisTaps::Kind::even:
        sum = madd(weight[0], value(0), sum);
        for (int k = 1; k <= radius; ++k) sum = madd(weight[k], value(k) + value(-k), sum);
        return sum;
    case AxisTaps::Kind::odd:
        for (int k = 1; k <= radius; ++k) sum = madd(weight[k], value(k) - value(-k), sum);
        return sum;
    default: {
        C const v = value(0);
        for (int k = 1; k <= radius; ++k) sum = madd(weight[k], (value(k) - v) + (value(-k) - v), sum);
        return kind == AxisTaps::Kind::average ? sum + v : sum;
    }
    }
}

/// One axis of a filter over a box of results: `at` is where the middle of the first result's voxels lies in `in`.
template <class C, class In> struct AxisPass {
    In in;
    View<C> out;
    Index3 at;
    int axis;
    AxisTaps::Kind kind;
    int radius;
    C const* weight;
    bool add;    ///< to what there is
    bool scaled; ///< the sum times `scale` is added
    C scale;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        std::int64_t const px = at.x + x, py = at.y + y, pz = at.z + z;
        auto const value = [&](int k) {
            return axis == 0 ? in(px + k, py, pz) : axis == 1 ? in(px, py + k, pz) : in(px, py, pz + k);
        };
        C& to = out(x, y, z);
        C const before = add ? to : C(0);
        C const sum = axis_sum<C>(kind, radius, weight, value, scaled ? C(0) : before);
        to = scaled ? madd(scale, sum, before) : sum;
    }
};

constexpr int most_parts = 6;

/// The root of the sum of squares.
template <class C, int N> __device__ __forceinline__ C length_of(C const (&part)[N]) {
    C most = abs(part[0]);
#pragma unroll
    for (int i = 1; i < N; ++i) most = abs(part[i]) > most ? abs(part[i]) : most;
    C const scale = scale_for_squares(most);
    C sum = part[0] * scale * (part[0] * scale);
#pragma unroll
    for (int i = 1; i < N; ++i) sum = madd(part[i] * scale, part[i] * scale, sum);
    return sqrt(sum) / scale;
}

/// What is made of the parts of a sum; where that is not finite, of the sum of voxels times `scale`, if there is one.
/// Counts what is not finite without it.
template <class C> struct Finish {
    C const *part[most_parts], *reduced[most_parts];
    int parts;
    bool has_reduced;
    std::int64_t row, slice;
    C offset, scale;
    driver::DeviceRows out;

    __device__ __forceinline__ C result_of(C const* const (&of)[most_parts], std::int64_t i) const {
        if (parts == 1) return of[0][i];
        C value[most_parts];
#pragma unroll
        for (int p = 0; p < most_parts; ++p) value[p] = p < parts ? of[p][i] : C(0);
        return length_of(value);
    }
    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        std::int64_t const i = x + y * row + z * slice;
        C result = result_of(part, i);
        if (offset != 0) result += offset;
        if (!is_finite(result)) {
            ++counts.undefined;
            if (has_reduced) {
                result = result_of(reduced, i) / scale;
                if (offset != 0) result += offset;
            }
        }
        driver::store_value(out.type, out.at(x, y, z), result, counts);
    }
};

template <class C, class In>
void pass(In const& from, View<C> to, Index3 dims, Index3 at, int axis, AxisTaps const& taps, C const* weight, bool add,
          double scale) {
    driver::for_each_voxel(dims,
                           AxisPass<C, In>{from, to, at, axis, taps.kind, static_cast<int>(taps.radius()), weight, add,
                                           scale != 1, static_cast<C>(scale)},
                           nullptr, "correlate");
}

constexpr int most_taps = 3, most_planes = 4, most_terms = 6; ///< of the filters below

/// A sum of separable kernels of 3^3 voxels at most.
template <class C> struct NearSum {
    struct Taps {
        AxisTaps::Kind kind = AxisTaps::Kind::even;
        int radius = 0;
        C weight[3] = {};
    };
    struct Term {
        int plane = 0, z = 0, part = 0;
        bool first = false, scaled = false; ///< of its part; its weight is not 1
        C scale = 1;
    };
    Taps x[most_taps], y[most_taps], z[most_taps];
    int plane_x[most_planes] = {}, plane_y[most_planes] = {};
    Term term[most_terms];
    int lines = 0, planes = 0, terms = 0, parts = 0;
    bool wide_x = false, wide_y = false, wide_z = false; ///< looks at neighbours along these axes
    C offset = 0;

    static bool fits(SeparableSum const& sum) {
        Index3 const r = sum.radius();
        std::size_t const most = most_taps;
        return std::max({r.x, r.y, r.z}) <= 1 && sum.x.size() <= most && sum.y.size() <= most && sum.z.size() <= most &&
               sum.planes.size() <= most_planes && sum.terms.size() <= most_terms && sum.parts <= most_taps;
    }
    explicit NearSum(SeparableSum const& sum)
        : lines(static_cast<int>(sum.x.size())), planes(static_cast<int>(sum.planes.size())),
          terms(static_cast<int>(sum.terms.size())), parts(sum.parts), offset(static_cast<C>(sum.offset)) {
        auto const copy = [](std::vector<AxisTaps> const& from, Taps* to) {
            for (AxisTaps const& taps : from) {
                to->kind = taps.kind;
                to->radius = static_cast<int>(taps.radius());
                for (std::size_t k = 0; k < taps.taps.size(); ++k) to->weight[k] = static_cast<C>(taps.taps[k]);
                ++to;
            }
        };
        copy(sum.x, x);
        copy(sum.y, y);
        copy(sum.z, z);
        Index3 const r = sum.radius();
        wide_x = r.x > 0;
        wide_y = r.y > 0;
        wide_z = r.z > 0;
        for (int p = 0; p < planes; ++p) {
            plane_x[p] = sum.planes[static_cast<std::size_t>(p)].x;
            plane_y[p] = sum.planes[static_cast<std::size_t>(p)].y;
        }
        int before = -1;
        for (int t = 0; t < terms; ++t) {
            auto const& from = sum.terms[static_cast<std::size_t>(t)];
            term[t] = {from.plane,          from.z,           from.part,
                       from.part != before, from.weight != 1, static_cast<C>(from.weight)};
            before = from.part;
        }
    }
};

/// One of a few values in registers, which have no addresses.
template <int n, class C> __device__ __forceinline__ C picked(C const (&values)[n], int which) {
    C result = values[0];
#pragma unroll
    for (int i = 1; i < n; ++i) result = which == i ? values[i] : result;
    return result;
}
template <class C, class Taps>
__device__ __forceinline__ C near_sum(Taps const& taps, C below, C middle, C above, C start) {
    auto const value = [&](int k) { return k < 0 ? below : k > 0 ? above : middle; };
    if (taps.radius == 0) return axis_sum<C>(taps.kind, 0, taps.weight, value, start);
    return axis_sum<C>(taps.kind, 1, taps.weight, value, start);
}

constexpr int near_x = 32, near_y = 8, near_slices = 32;

/// All axes at once: a thread goes through slices, of each of which it filters nine voxels along x and y, and keeps
/// what came of the last two. The sums are those of correlate_terms().
template <class C, class T>
__global__ void __launch_bounds__(near_x* near_y)
    near_kernel(driver::DeviceRows in, driver::DeviceRows out, Index3 n, unsigned across, unsigned along,
                __grid_constant__ NearSum<C> const sum, unsigned long long* totals) {
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % across) * near_x + threadIdx.x,
                       y = static_cast<std::int64_t>(blockIdx.x / across % along) * near_y + threadIdx.y,
                       z0 = static_cast<std::int64_t>(blockIdx.x / across / along) * near_slices;
    driver::LossCounts counts;
    bool const wide_x = sum.wide_x, wide_y = sum.wide_y;
    if (x < n.x && y < n.y) {
        std::int64_t const end = z0 + near_slices < n.z ? z0 + near_slices : n.z;
        std::int64_t const before = sum.wide_z ? 1 : 0;
        std::byte const* from = in.at(x, y, z0 - before);
        C first[most_planes] = {}, second[most_planes] = {}, third[most_planes] = {};
        for (std::int64_t z = z0 - before; z < end + before; ++z, from += in.slice) {
            C v[3][3] = {};
#pragma unroll
            for (int j = 0; j < 3; ++j)
#pragma unroll
                for (int i = 0; i < 3; ++i) {
                    bool const there = (i == 1 || wide_x) && (j == 1 || wide_y); // else nobody has a right to look
                    if (there) v[j][i] = static_cast<C>(reinterpret_cast<T const*>(from + (j - 1) * in.row)[i - 1]);
                }
            C line[3][most_taps] = {};
#pragma unroll
            for (int j = 0; j < 3; ++j)
#pragma unroll
                for (int t = 0; t < most_taps; ++t)
                    if (t < sum.lines) line[j][t] = near_sum<C>(sum.x[t], v[j][0], v[j][1], v[j][2], C(0));
#pragma unroll
            for (int p = 0; p < most_planes; ++p) {
                first[p] = second[p];
                second[p] = third[p];
                if (p < sum.planes) {
                    int const t = sum.plane_x[p];
                    third[p] = near_sum<C>(sum.y[sum.plane_y[p]], picked(line[0], t), picked(line[1], t),
                                           picked(line[2], t), C(0));
                }
            }
            std::int64_t const made = z - before; // the slice whose neighbours are known now
            if (made < z0) continue;
            C part[most_taps] = {};
#pragma unroll
            for (int t = 0; t < most_terms; ++t) {
                if (t >= sum.terms) continue;
                auto const& term = sum.term[t];
                C const old = term.first ? C(0) : picked(part, term.part), start = term.scaled ? C(0) : old;
                C const below = before != 0 ? picked(first, term.plane) : C(0),
                        middle = before != 0 ? picked(second, term.plane) : picked(third, term.plane),
                        above = before != 0 ? picked(third, term.plane) : C(0);
                C const all = near_sum<C>(sum.z[term.z], below, middle, above, start);
                C const result = term.scaled ? madd(term.scale, all, old) : all;
#pragma unroll
                for (int i = 0; i < most_taps; ++i) part[i] = term.part == i ? result : part[i];
            }
            C result = part[0];
            if (sum.parts > 1) {
                // Those that do not belong to the sum are 0.
                result = length_of(part);
            }
            if (sum.offset != 0) result += sum.offset;
            if (!is_finite(result)) ++counts.undefined;
            driver::store_value(out.type, out.at(x, y, made), result, counts);
        }
    }
    driver::add_counts(counts, totals);
}

template <class C, class T> void launch_near(ConstView in, AnyView out, NearSum<C> const& sum, Losses& losses) {
    Index3 const n = out.dims();
    driver::Blocks const blocks = driver::blocks_of<driver::BlockShape<near_x, near_y, near_slices, 1>>(n);
    driver::DeviceLosses const counts;
    near_kernel<C, T><<<blocks.all, dim3(near_x, near_y)>>>(driver::device_rows(in, out.box),
                                                            driver::device_rows(ConstView(out), out.box), n,
                                                            blocks.across, blocks.along, sum, counts.get());
    check_launch("correlate_near");
    counts.add_to(losses);
}

/// The parts of a sum of voxels times `scale`, axis by axis.
template <class C>
std::vector<std::unique_ptr<Stage<C>>> parts_of(ConstView in, Box const& box, SeparableSum const& sum, C scale) {
    Index3 const r = sum.radius(), n = box.dims();
    Index3 const rows{n.x, n.y + 2 * r.y, n.z + 2 * r.z}, columns{n.x, n.y, rows.z};
    Weights<C> const wx(sum.x), wy(sum.y), wz(sum.z);
    Values<C> const voxels{driver::device_rows(in, {box.lower - r, box.upper + r}), scale};
    std::vector<std::unique_ptr<Stage<C>>> lines, planes, parts;
    for (std::size_t t = 0; t < sum.x.size(); ++t) {
        lines.push_back(std::make_unique<Stage<C>>(rows));
        pass(voxels, lines.back()->as(), rows, {r.x, 0, 0}, 0, sum.x[t], wx.of(t), false, 1);
    }
    for (auto const& plane : sum.planes) {
        auto const t = static_cast<std::size_t>(plane.y);
        planes.push_back(std::make_unique<Stage<C>>(columns));
        pass(lines[static_cast<std::size_t>(plane.x)]->as(), planes.back()->as(), columns, {0, r.y, 0}, 1, sum.y[t],
             wy.of(t), false, 1);
    }
    lines.clear();
    for (int p = 0; p < sum.parts; ++p) parts.push_back(std::make_unique<Stage<C>>(n));
    int before = -1;
    for (auto const& term : sum.terms) {
        auto const t = static_cast<std::size_t>(term.z);
        pass(planes[static_cast<std::size_t>(term.plane)]->as(), parts[static_cast<std::size_t>(term.part)]->as(), n,
             {0, 0, r.z}, 2, sum.z[t], wz.of(t), term.part == before, term.weight);
        before = term.part;
    }
    return parts;
}

/// Any sum; `reduced`: with that of smaller voxels for what is not finite.
template <class C> void by_axes(ConstView in, AnyView out, SeparableSum const& sum, bool reduced, Losses& losses) {
    Index3 const n = out.dims();
    auto const headroom = static_cast<C>(sum.headroom());
    auto const parts = parts_of<C>(in, out.box, sum, C(1));
    std::vector<std::unique_ptr<Stage<C>>> others;
    if (reduced) others = parts_of<C>(in, out.box, sum, headroom);
    Finish<C> finish{};
    for (std::size_t p = 0; p < parts.size(); ++p) finish.part[p] = parts[p]->as().data;
    for (std::size_t p = 0; p < others.size(); ++p) finish.reduced[p] = others[p]->as().data;
    finish.parts = sum.parts;
    finish.has_reduced = reduced;
    finish.row = n.x;
    finish.slice = n.x * n.y;
    finish.offset = static_cast<C>(sum.offset);
    finish.scale = headroom;
    finish.out = driver::device_rows(ConstView(out), out.box);
    driver::DeviceLosses const counts;
    driver::for_each_voxel(n, finish, counts.get(), "correlate");
    counts.add_to(losses);
}

template <class C> void correlate_terms(ConstView in, AnyView out, SeparableSum const& sum, Losses& losses) {
    if (out.box.empty()) return;
    if (sum.parts > most_parts) throw Error(ErrorKind::failure, "a filter of more parts than are known");
    Losses mine;
    if (NearSum<C>::fits(sum)) {
        NearSum<C> const near(sum);
        with_type(in.type, [&]<class T>(T) { launch_near<C, T>(in, out, near, mine); });
    } else {
        by_axes<C>(in, out, sum, false, mine);
    }
    if (mine.undefined > 0) { // infinities and NaN, if nothing overflowed
        Index3 const r = sum.radius();
        if (any_large_on_device(in, {out.box.lower - r, out.box.upper + r}, static_cast<C>(sum.headroom()))) {
            mine = {};
            by_axes<C>(in, out, sum, true, mine);
        }
    }
    mine.undefined = 0;
    losses += mine;
}

/// 27 weights, in the registers of a launch's parameters.
template <class C> struct Cube {
    C weight[27];
    C offset, headroom;
};

/// A thread goes through slices of a column of voxels; of each slice it loads what lies around them once, for all the
/// voxels whose neighbour it is.
constexpr int cube_x = 64, cube_y = 4, cube_rows = 4, cube_slices = 32;

/// The same for one voxel, in the same order, of voxels times a power of two if Scaled; weights of 0 take no part,
/// whatever the voxel is.
template <bool Scaled, class C, class T>
__device__ C cube_at(std::byte const* at, driver::DeviceRows const& in, Cube<C> const& cube) {
    C sum = 0;
    for (int k = 0; k < 27; ++k)
        if (cube.weight[k] != 0) {
            C const value = static_cast<C>(
                reinterpret_cast<T const*>(at + (k / 9 - 1) * in.slice + (k / 3 % 3 - 1) * in.row)[k % 3 - 1]);
            sum = madd(cube.weight[k], Scaled ? value * cube.headroom : value, sum);
        }
    return Scaled ? sum / cube.headroom : sum;
}

/// A thread's results that are not finite, once more, of smaller voxels. Apart, when all others are done: it takes no
/// registers from them.
template <class C, class T>
__device__ __noinline__ driver::LossCounts column_again(std::byte const* from, std::byte* to, driver::DeviceRows in,
                                                        driver::DeviceRows out, Cube<C> const& cube, int rows,
                                                        int slices) {
    driver::LossCounts counts;
    for (int z = 0; z < slices; ++z)
        for (int r = 0; r < rows; ++r) {
            std::byte const* const at = from + z * in.slice + r * in.row;
            if (is_finite(cube_at<false, C, T>(at, in, cube))) continue;
            C const sum = cube_at<true, C, T>(at, in, cube);
            driver::store_value(out.type, to + z * out.slice + r * out.row, cube.offset != 0 ? sum + cube.offset : sum,
                                counts);
        }
    return counts;
}

/// `Floats`: voxels of which sums may not be finite.
template <class C, class T, bool Floats>
__global__ void __launch_bounds__(cube_x* cube_y)
    cube_kernel(driver::DeviceRows in, driver::DeviceRows out, Index3 n, unsigned across, unsigned along,
                __grid_constant__ Cube<C> const cube, unsigned long long* totals) {
    std::int64_t const x = static_cast<std::int64_t>(blockIdx.x % across) * cube_x + threadIdx.x,
                       y = (static_cast<std::int64_t>(blockIdx.x / across % along) * cube_y + threadIdx.y) * cube_rows,
                       z0 = static_cast<std::int64_t>(blockIdx.x / across / along) * cube_slices;
    driver::LossCounts counts;
    if (x < n.x && y < n.y) {
        std::int64_t const end = z0 + cube_slices < n.z ? z0 + cube_slices : n.z;
        int const rows = n.y - y < cube_rows ? static_cast<int>(n.y - y) : cube_rows;
        std::byte const* from = in.at(x, y, z0 - 1);
        T voxels[cube_rows + 2][3]; // of the next slice: they are on their way while sums are made
        auto const load_row = [&](int j, std::byte const* row) {
#pragma unroll
            for (int i = 0; i < 3; ++i) voxels[j][i] = reinterpret_cast<T const*>(row)[i - 1];
        };
        auto const load = [&](std::byte const* at) {
            if (rows == cube_rows) {
#pragma unroll
                for (int j = 0; j < cube_rows + 2; ++j) load_row(j, at + (j - 1) * in.row);
            } else { // there are no more
#pragma unroll
                for (int j = 0; j < cube_rows + 2; ++j) load_row(j, at + (j <= rows ? j - 1 : rows) * in.row);
            }
        };
        load(from);
        C above[cube_rows] = {}, middle[cube_rows] = {}; // sums for this slice and for the one before, so far
        bool again = false;
        std::byte* to = out.at(x, y, z0 - 2);
        for (std::int64_t z = z0 - 1; z <= end; ++z, from += in.slice, to += out.slice) {
            C v[cube_rows + 2][3];
#pragma unroll
            for (int j = 0; j < cube_rows + 2; ++j)
#pragma unroll
                for (int i = 0; i < 3; ++i) v[j][i] = static_cast<C>(voxels[j][i]);
            if (z < end) load(from + in.slice);
#pragma unroll
            for (int r = 0; r < cube_rows; ++r) {
                C below = middle[r], here = above[r], next = 0; // results at z - 1, z and z + 1
#pragma unroll
                for (int k = 0; k < 9; ++k) {
                    C const value = v[r + k / 3][k % 3];
                    below = madd(cube.weight[18 + k], value, below);
                    here = madd(cube.weight[9 + k], value, here);
                    next = madd(cube.weight[k], value, next);
                }
                middle[r] = here;
                above[r] = next;
                if (z == z0 - 1 || z == z0 || r >= rows) continue;
                if (Floats && !is_finite(below)) { // weights of 0 add nothing to a sum but of what is not finite
                    below = cube_at<false, C, T>(from - in.slice + r * in.row, in, cube);
                    if (!is_finite(below)) {
                        again = true;
                        continue;
                    }
                }
                C const sum = cube.offset != 0 ? below + cube.offset : below;
                if (std::is_same_v<T, C> && out.type == in.type)
                    *reinterpret_cast<C*>(to + r * out.row) = sum;
                else
                    driver::store_value(out.type, to + r * out.row, sum, counts);
            }
        }
        if (again)
            counts +=
                column_again<C, T>(in.at(x, y, z0), out.at(x, y, z0), in, out, cube, rows, static_cast<int>(end - z0));
    }
    driver::add_counts(counts, totals);
}

template <class C, class T> void launch_cube(ConstView in, AnyView out, Cube<C> const& cube, Losses& losses) {
    Index3 const n = out.dims();
    driver::Blocks const blocks = driver::blocks_of<driver::BlockShape<cube_x, cube_y * cube_rows, cube_slices, 1>>(n);
    driver::DeviceLosses const counts;
    cube_kernel<C, T, !std::is_integral_v<T>><<<blocks.all, dim3(cube_x, cube_y)>>>(
        driver::device_rows(in, out.box), driver::device_rows(ConstView(out), out.box), n, blocks.across, blocks.along,
        cube, counts.get());
    check_launch("correlate_cube");
    counts.add_to(losses);
}

template <class C> struct DeviceTap {
    int x, y, z;
    C weight;
};

/// Any taps, in their order. Sums that are not finite are made again of smaller
/// voxels.
template <class C> struct AnyTaps {
    DeviceTap<C> const* tap;
    int count;
    C offset, headroom;

    template <class W> VKT_DEVICE C operator()(W const& voxel) const {
        C total = 0;
        for (int k = 0; k < count; ++k) {
            DeviceTap<C> const t = tap[k];
            total = madd(t.weight, voxel(t.x, t.y, t.z), total);
        }
        if (!is_finite(total)) {
            total = 0;
            for (int k = 0; k < count; ++k) {
                DeviceTap<C> const t = tap[k];
                total = madd(t.weight, voxel(t.x, t.y, t.z) * headroom, total);
            }
            total = total / headroom;
        }
        return offset != 0 ? total + offset : total;
    }
};

template <class C>
void correlate_any(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    if (out.box.empty()) return;
    Index3 const r = kernel.radius;
    auto const offset = static_cast<C>(kernel.offset), headroom = static_cast<C>(kernel.headroom());
    if (r == Index3{1, 1, 1} && kernel.taps.size() > 9) {
        Cube<C> cube{};
        for (Tap const& tap : kernel.taps)
            cube.weight[tap.at.x + 1 + 3 * (tap.at.y + 1) + 9 * (tap.at.z + 1)] = static_cast<C>(tap.weight);
        cube.offset = offset;
        cube.headroom = headroom;
        return with_type(in.type, [&]<class T>(T) { launch_cube<C, T>(in, out, cube, losses); });
    }
    std::vector<DeviceTap<C>> taps;
    for (Tap const& tap : kernel.taps)
        taps.push_back({static_cast<int>(tap.at.x), static_cast<int>(tap.at.y), static_cast<int>(tap.at.z),
                        static_cast<C>(tap.weight)});
    driver::DeviceList const list(taps);
    AnyTaps<C> const any{list.get(), static_cast<int>(taps.size()), offset, headroom};
    stencil<C>(execution, out, losses, r, any, in);
}

} // namespace

void correlate(ConstView in, AnyView out, SeparableSum const& sum, Losses& losses, Execution const&) {
    if (sum.wide)
        correlate_terms<double>(in, out, sum, losses);
    else
        correlate_terms<float>(in, out, sum, losses);
}

void correlate_dense(ConstView in, AnyView out, DenseKernel const& kernel, Losses& losses, Execution const& execution) {
    if (kernel.wide)
        correlate_any<double>(in, out, kernel, losses, execution);
    else
        correlate_any<float>(in, out, kernel, losses, execution);
}

} // namespace vkt::VKT_BACKEND
