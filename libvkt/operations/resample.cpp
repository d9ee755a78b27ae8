// Resample: weight tables per axis on the host, one pass over rows in every back end.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample.h"

#include "libvkt/formats/format.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/rows.h"
#include "libvkt/operations/wide.h"

#include <cmath>
#include <vector>

namespace vkt {

/// Everything that the weighted kernel needs besides the voxels.
struct WeightedSum {
    Taps x, y, z;
    double divisor = 1;
    double scale = 1, offset = 0; ///< applied before the value is stored
    bool x_identity = false;
};

VKT_KERNEL(resample_nearest, (ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution), (in, out, sum, execution))
VKT_KERNEL(resample_halved, (ConstView in, AnyView out, Index3 factors, Execution const& execution), (in, out, factors, execution))
VKT_KERNEL(resample_weighted,
           (ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Tally& tally, Execution const& execution),
           (in, out, sum, scratch, tally, execution))

namespace VKT_BACKEND {
namespace {

/// The type in which up to eight voxels are added: exactly for integers, in their own precision for floats.
template <class T>
using Sum = std::conditional_t<!std::is_integral_v<T>, std::conditional_t<std::is_same_v<T, double>, double, float>,
                               std::conditional_t<sizeof(T) <= 2, std::int32_t, std::conditional_t<sizeof(T) == 4, std::int64_t, Int128>>>;

/// A term of the mean of 2^shift voxels: floats are divided first, so that no sum overflows.
template <class T>
VKT_HD Sum<T> term_of(T v, Sum<T> share) {
    if constexpr (std::is_integral_v<T>)
        return static_cast<Sum<T>>(v);
    else
        return static_cast<Sum<T>>(v) * share;
}

/// The mean of 2^shift voxels from their terms, halves to even.
template <class T>
VKT_HD T mean_of(Sum<T> sum, int shift) {
    if constexpr (std::is_integral_v<T>) {
        Sum<T> const half = (Sum<T>(1) << shift) / 2;
        return static_cast<T>(shift == 0 ? sum : (sum + half - 1 + ((sum >> shift) & 1)) >> shift);
    } else {
        return round_to<T>(sum);
    }
}

template <class T>
Sum<T> share_of(int shift) {
    return std::is_integral_v<T> ? Sum<T>(1) : Sum<T>(1) / static_cast<Sum<T>>(1 << shift);
}

int log2_of(Index3 factors) { return static_cast<int>(factors.x + factors.y + factors.z - 3); }

#ifdef __CUDACC__

template <class U>
void nearest(View<U const> in, View<U> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    std::int64_t const *const x_of = sum.x.first, *const y_of = sum.y.first, *const z_of = sum.z.first;
    gather(execution, box, out,
           [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) { return in(x_of[x], y_of[y], z_of[z]); });
}

template <class T>
void halved(View<T const> in, View<T> out, Box const& box, Index3 factors, Execution const& execution) {
    int const fx = static_cast<int>(factors.x), fy = static_cast<int>(factors.y), fz = static_cast<int>(factors.z);
    int const shift = log2_of(factors);
    Sum<T> const share = share_of<T>(shift);
    gather(execution, box, out, [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) {
        Sum<T> pair[2] = {};
        for (int i = 0; i < fx; ++i)
            for (int k = 0; k < fz; ++k)
                for (int j = 0; j < fy; ++j) pair[i] += term_of<T>(in(x * fx + i, y * fy + j, z * fz + k), share);
        return mean_of<T>(pair[0] + pair[1], shift);
    });
}

template <class T>
struct WeightedAt {
    View<T const> in;
    WeightedSum sum;
    VKT_HD double operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        double total = 0;
        std::int64_t const fx = sum.x.first[x], fy = sum.y.first[y], fz = sum.z.first[z];
        std::int64_t const x0 = sum.x.start[x], y0 = sum.y.start[y], z0 = sum.z.start[z];
        std::int64_t const nx = sum.x.start[x + 1] - x0, ny = sum.y.start[y + 1] - y0, nz = sum.z.start[z + 1] - z0;
        for (std::int64_t i = 0; i < nx; ++i) {
            double column = 0;
            for (std::int64_t k = 0; k < nz; ++k)
                for (std::int64_t j = 0; j < ny; ++j)
                    column += sum.z.weight[z0 + k] * sum.y.weight[y0 + j] * static_cast<double>(in(fx + i, fy + j, fz + k));
            total += sum.x_identity ? column : sum.x.weight[x0 + i] * column;
        }
        return total / sum.divisor * sum.scale + sum.offset;
    }
};

template <class T>
void weighted_to_double(View<T const> in, View<double> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    gather(execution, box, out, WeightedAt<T>{in, sum});
}
template <class T>
void weighted_same_type(View<T const> in, View<T> out, Box const& box, WeightedSum const& sum, Tally& tally, Execution const& execution) {
    gather_rounded(execution, box, out, tally, WeightedAt<T>{in, sum});
}
template <class U>
void store_doubles(View<double const> in, View<U> out, Box const& box, Tally& tally, Execution const& execution) {
    map_rounded(execution, box, out, tally, [=] VKT_DEVICE(double v) { return v; }, in);
}

template <class T>
void weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Tally& tally, Execution const& execution) {
    if (in.type == out.type) return weighted_same_type(in.as<T>(), out.as<T>(), out.box, sum, tally, execution);
    scratch.reserve(static_cast<std::size_t>(out.box.voxels()) * sizeof(double));
    AnyView const wide = dense_view(scratch.write(Space::device), DataType::float64, out.box, Space::device);
    weighted_to_double<T>(in.as<T>(), wide.as<double>(), out.box, sum, execution);
    for_each_type(out.type, [&]<class U>(U) {
        store_doubles<U>(ConstView(wide).as<double>(), out.as<U>(), out.box, tally, execution);
    });
}

#else

/// Calls f(x0, x1, y, z) for pieces of output rows, in parallel; maker() gives each thread its own f.
template <class Maker>
void for_each_piece(Execution const& execution, Box const& box, std::int64_t length, std::int64_t work, Maker const& maker) {
    if (box.empty()) return;
    Index3 const n = box.dims();
    std::int64_t const pieces = (n.x + length - 1) / length;
    for_each_item(threads_for(execution, work), pieces * n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
        auto f = maker();
        for (std::int64_t item = begin; item < end; ++item) {
            std::int64_t const x0 = box.lower.x + item % pieces * length;
            f(x0, std::min(x0 + length, box.upper.x), box.lower.y + item / pieces % n.y, box.lower.z + item / pieces / n.y);
        }
    });
}

template <class U>
void nearest(View<U const> in, View<U> out, Box const& box, WeightedSum const& sum, Execution const& execution) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        U const* const from = &in(0, sum.y.first[y], sum.z.first[z]);
        std::int64_t const* const index = sum.x.first + x;
        U* const to = &out(x, y, z);
        for (std::int64_t i = 0; i < n; ++i) to[i] = from[index[i]];
    });
}

/// to[i] = sum of the rows' voxels i.
template <class T, int N>
void add_rows(T const* const (&rows)[4], Sum<T>* to, std::int64_t n, Sum<T> share) {
    T const *const a = rows[0], *const b = rows[1], *const c = rows[2], *const d = rows[3];
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        Sum<T> s = term_of<T>(a[i], share);
        if constexpr (N > 1) s += term_of<T>(b[i], share);
        if constexpr (N > 2) s = (s + term_of<T>(c[i], share)) + term_of<T>(d[i], share);
        to[i] = s;
    }
}

template <class T>
void halve_columns(Sum<T> const* sums, T* to, std::int64_t n, bool pairs, int shift) {
    if (pairs) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = mean_of<T>(sums[2 * i] + sums[2 * i + 1], shift);
    } else {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = mean_of<T>(sums[i], shift);
    }
}

template <class T>
void halved(View<T const> in, View<T> out, Box const& box, Index3 factors, Execution const& execution) {
    int const shift = log2_of(factors);
    Sum<T> const share = share_of<T>(shift);
    for_each_piece(execution, box, row_piece / 2, box.voxels() << shift, [&] {
        return [&, sums = std::vector<Sum<T>>(row_piece)](std::int64_t x0, std::int64_t x1, std::int64_t y, std::int64_t z) mutable {
            std::int64_t const n = (x1 - x0) * factors.x;
            T const* rows[4] = {};
            int count = 0;
            for (std::int64_t k = 0; k < factors.z; ++k)
                for (std::int64_t j = 0; j < factors.y; ++j)
                    rows[count++] = &in(x0 * factors.x, y * factors.y + j, z * factors.z + k);
            if (count == 1) add_rows<T, 1>(rows, sums.data(), n, share);
            if (count == 2) add_rows<T, 2>(rows, sums.data(), n, share);
            if (count == 4) add_rows<T, 4>(rows, sums.data(), n, share);
            halve_columns<T>(sums.data(), &out(x0, y, z), x1 - x0, factors.x == 2, shift);
        };
    });
}

/// to[i] (+)= sum over four rows of weight * voxel, added one after the other.
template <bool First, class T>
void add_weighted4(T const* const* rows, double const* weights, double* to, std::int64_t n) {
    T const *const a = rows[0], *const b = rows[1], *const c = rows[2], *const d = rows[3];
    double const wa = weights[0], wb = weights[1], wc = weights[2], wd = weights[3];
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double s = wa * static_cast<double>(a[i]);
        if constexpr (!First) s = to[i] + s;
        s += wb * static_cast<double>(b[i]);
        s += wc * static_cast<double>(c[i]);
        to[i] = s + wd * static_cast<double>(d[i]);
    }
}
template <bool First, class T>
void add_weighted(T const* row, double weight, double* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        double const s = weight * static_cast<double>(row[i]);
        to[i] = First ? s : to[i] + s;
    }
}

/// The weighted sum of all rows in the footprint of output row (y, z), for input columns [lower, lower + n).
template <class T>
void sum_rows(View<T const> in, WeightedSum const& sum, std::int64_t y, std::int64_t z, std::int64_t lower, std::int64_t n, double* to) {
    std::int64_t const ny = sum.y.start[y + 1] - sum.y.start[y], nz = sum.z.start[z + 1] - sum.z.start[z];
    double const *const wy = sum.y.weight + sum.y.start[y], *const wz = sum.z.weight + sum.z.start[z];
    T const* rows[4];
    double weights[4];
    int pending = 0;
    bool first = true;
    for (std::int64_t k = 0; k < nz; ++k)
        for (std::int64_t j = 0; j < ny; ++j) {
            rows[pending] = &in(lower, sum.y.first[y] + j, sum.z.first[z] + k);
            weights[pending++] = wz[k] * wy[j];
            if (pending < 4) continue;
            first ? add_weighted4<true>(rows, weights, to, n) : add_weighted4<false>(rows, weights, to, n);
            first = false;
            pending = 0;
        }
    for (int i = 0; i < pending; ++i) {
        first ? add_weighted<true>(rows[i], weights[i], to, n) : add_weighted<false>(rows[i], weights[i], to, n);
        first = false;
    }
}

/// Weighted sums along x. columns[i] belongs to input column lower + i.
void sum_columns(Taps const& x, std::int64_t x0, std::int64_t x1, double const* columns, std::int64_t lower, double* to) {
    if (x.pair != nullptr) { // a zero weight must not touch its neighbour: 0 * infinity is NaN
        double const* const pairs = x.pair + 2 * x0;
        std::int64_t const* const first = x.first + x0;
        std::int64_t const n = x1 - x0;
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) {
            double const* const c = columns + (first[i] - lower);
            double const a = pairs[2 * i] * c[0], b = pairs[2 * i + 1];
            to[i] = b == 0 ? a : a + b * c[1];
        }
        return;
    }
    for (std::int64_t o = x0; o < x1; ++o) {
        double const* const c = columns + (x.first[o] - lower);
        double const* const w = x.weight + x.start[o];
        std::int64_t const n = x.start[o + 1] - x.start[o];
        double total = w[0] * c[0];
        for (std::int64_t i = 1; i < n; ++i) total += w[i] * c[i];
        to[o - x0] = total;
    }
}

void scale_row(double* values, std::int64_t n, double divisor, double scale, double offset) {
    if (divisor != 1) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) values[i] /= divisor;
    }
    if (scale != 1 || offset != 0) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) values[i] = values[i] * scale + offset;
    }
}

template <class T>
void weighted(ConstView from, AnyView out, WeightedSum const& sum, Buffer&, Tally& tally, Execution const& execution) {
    View<T const> const in = from.as<T>();
    Box const box = out.box;
    std::int64_t const n_in = std::max<std::int64_t>(from.dims().x, 1), n_out = std::max<std::int64_t>(box.dims().x, 1);
    std::int64_t const length = std::clamp<std::int64_t>(2 * row_piece * n_out / n_in, 32, 2 * row_piece);
    for_each_piece(execution, box, length, std::max(from.box.voxels(), box.voxels()), [&] {
        return [&, columns = std::vector<double>(), row = std::vector<double>(static_cast<std::size_t>(length))](
                   std::int64_t x0, std::int64_t x1, std::int64_t y, std::int64_t z) mutable {
            std::int64_t lower = sum.x.first[x0], upper = lower + 1;
            for (std::int64_t o = x0; o < x1; ++o) {
                lower = std::min(lower, sum.x.first[o]);
                upper = std::max(upper, sum.x.first[o] + sum.x.start[o + 1] - sum.x.start[o]);
            }
            columns.resize(static_cast<std::size_t>(upper - lower + 1)); // pairs read one beyond, with weight 0
            sum_rows(in, sum, y, z, lower, upper - lower, columns.data());
            double* values = columns.data();
            if (!sum.x_identity) {
                sum_columns(sum.x, x0, x1, columns.data(), lower, row.data());
                values = row.data();
            }
            std::int64_t const n = x1 - x0;
            scale_row(values, n, sum.divisor, sum.scale, sum.offset);
            driver::add(tally, store_row(out.type, static_cast<double const*>(values), out.at(x0, y, z), n));
        };
    });
}

#endif

} // namespace

void resample_nearest(ConstView in, AnyView out, WeightedSum const& sum, Execution const& execution) {
    for_each_size(size_of(in.type), [&]<class U>(U) { nearest<U>(in.as<U>(), out.as<U>(), out.box, sum, execution); });
}

void resample_halved(ConstView in, AnyView out, Index3 factors, Execution const& execution) {
    for_each_type(in.type, [&]<class T>(T) { halved<T>(in.as<T>(), out.as<T>(), out.box, factors, execution); });
}

void resample_weighted(ConstView in, AnyView out, WeightedSum const& sum, Buffer& scratch, Tally& tally, Execution const& execution) {
    for_each_type(in.type, [&]<class T>(T) { weighted<T>(in, out, sum, scratch, tally, execution); });
}

} // namespace VKT_BACKEND

#if VKT_HOST

void Resample::parameters(Parameters& p) {
    p.option("scale", scale, "S|SX,SY,SZ", "factor for the numbers of voxels, rounded to the nearest");
    p.option("dims", dims, "X Y Z", "numbers of voxels of the result");
    p.option("size", size, "N,auto,auto", "number of voxels along one axis, the others in proportion");
    p.option("spacing", spacing, "S|SX,SY,SZ", "size of the result's voxels in world units, met as nearly as whole voxels allow");
    p.option("like", like, "FILE", "as many voxels as this volume file has");
    p.option("method", method, "METHOD", "auto: area average where an axis shrinks, linear where it grows");
    p.option("boundary", boundary, "RULE", "how the volume continues outside, for linear and cubic: mirror, clamp (default), wrap or border[:VALUE]");
    p.option("dtype", dtype, "TYPE", "data type of the result, values kept").alias("data-format");
    p.option("bytes-per-voxel", bytes_per_voxel, "N", "unsigned integers of this many bytes (volkit)").alias("bpv");
    p.option("dist", dist, "X Y Z", "spacing to write into the header, instead of the one that keeps the extent (volkit)").values(3, 3);
    p.option("voxel-mapping", voxel_mapping, "LO HI", "values that the range of the result's integers stands for (volkit)").alias("vm");
}

void Resample::check() const {
    int const given = (scale ? 1 : 0) + (dims ? 1 : 0) + (size.empty() ? 0 : 1) + (spacing ? 1 : 0) + (like.empty() ? 0 : 1);
    if (given > 1) throw Error(ErrorKind::usage, "only one of --scale, --dims, --size, --spacing and --like can be followed");
    if (given == 0 && !dtype && !bytes_per_voxel && !dist && !voxel_mapping)
        throw Error(ErrorKind::usage, "no new size is given", "say for example --scale 0.5 or --dims 128 128 64");
    if (scale)
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite((*scale)[axis]) || !((*scale)[axis] > 0))
                throw Error(ErrorKind::usage, text("--scale: ", (*scale)[axis], " is not a positive factor"));
    if (dims) check_dims(*dims, DataType::uint8, "dims");
    if (spacing) check_spacing(*spacing, "spacing");
    if (dist) check_spacing(*dist, "dist");
    if (bytes_per_voxel) {
        DataType const type = type_of_bytes(*bytes_per_voxel);
        if (dtype && size_of(*dtype) != size_of(type))
            throw Error(ErrorKind::usage, text("--bytes-per-voxel ", *bytes_per_voxel, " contradicts --dtype ", *dtype));
    }
    if (boundary && (method == ResampleMethod::nearest || method == ResampleMethod::area))
        throw Error(ErrorKind::usage, text("--boundary does not apply to --method ", enum_name(method), ", which never looks outside"));
}

namespace {

std::int64_t rounded_extent(double voxels) {
    double const n = std::floor(voxels + 0.5);
    if (!(n < static_cast<double>(max_extent)))
        throw Error(ErrorKind::usage, text("the result would have ", voxels, " voxels along an axis"));
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(n));
}

/// "512,auto,auto": the numbers given, and for the axes without one the scale of those that have one.
Index3 dims_of_size(std::string const& size, Index3 dims) {
    std::vector<std::string> const parts = split(size, ',');
    if (parts.size() != 3) throw Error(ErrorKind::usage, text("--size: '", size, "' is not X,Y,Z"), "for example --size 512,auto,auto");
    Index3 result{};
    double factor = 0;
    for (int axis = 0; axis < 3; ++axis) {
        std::string const& part = parts[static_cast<std::size_t>(axis)];
        if (part == "auto") continue;
        result[axis] = parse_integer(part);
        if (result[axis] < 1) throw Error(ErrorKind::usage, text("--size: ", part, " is not a positive number of voxels"));
        double const here = static_cast<double>(result[axis]) / static_cast<double>(dims[axis]);
        factor = factor == 0 ? here : std::min(factor, here);
    }
    if (factor == 0) throw Error(ErrorKind::usage, "--size gives no axis a number of voxels", "for example --size 512,auto,auto");
    for (int axis = 0; axis < 3; ++axis)
        if (result[axis] == 0) result[axis] = rounded_extent(static_cast<double>(dims[axis]) * factor);
    return result;
}

} // namespace

Index3 Resample::target_dims(Header const& input) const {
    if (dims) return *dims;
    if (!size.empty()) return dims_of_size(size, input.dims);
    if (!like.empty()) {
        auto const source = open_volume(open_bytes(like), {});
        if (!source->next_volume()) throw Error(ErrorKind::data, text("--like: ", like, " holds no volume"));
        return source->header().dims;
    }
    Index3 result = input.dims;
    for (int axis = 0; axis < 3; ++axis) {
        auto const n = static_cast<double>(input.dims[axis]);
        if (scale) result[axis] = rounded_extent(n * (*scale)[axis]);
        if (spacing) result[axis] = rounded_extent(n * input.geometry.spacing[axis] / (*spacing)[axis]);
    }
    return result;
}

Kernel Resample::kernel_for(std::int64_t n_in, std::int64_t n_out) const {
    switch (method) {
    case ResampleMethod::nearest: return Kernel::nearest;
    case ResampleMethod::linear: return Kernel::linear;
    case ResampleMethod::area: return Kernel::area;
    case ResampleMethod::cubic: return Kernel::cubic;
    case ResampleMethod::automatic: break;
    }
    return n_out < n_in ? Kernel::area : Kernel::linear;
}

void Resample::choose_header(Header const& input, Header& output) {
    output = input;
    output.dims = to_;
    output.geometry = rescaled(input.geometry, from_, to_);
    if (dist) output.geometry.spacing = *dist;
    if (!(from_ == to_)) output.part.reset();
    bool const lobes = method == ResampleMethod::cubic && !(from_ == to_);
    if (lobes && is_integer(input.dtype) && !is_signed(input.dtype))
        output.dtype = size_of(input.dtype) <= 2 ? DataType::float32 : DataType::float64;
    if (bytes_per_voxel && size_of(output.dtype) != size_of(type_of_bytes(*bytes_per_voxel))) output.dtype = type_of_bytes(*bytes_per_voxel);
    if (dtype) output.dtype = *dtype;
    scale_value_ = 1;
    offset_value_ = 0;
    if (!voxel_mapping) return;
    output.values = value_map_of(*voxel_mapping, output.dtype);
    if (output.values == input.values) return;
    scale_value_ = input.values.slope / output.values.slope;
    offset_value_ = (input.values.intercept - output.values.intercept) / output.values.slope;
}

Plan Resample::plan(std::span<Header const> inputs) {
    Header const& input = inputs.front();
    if (input.kind != Kind::structured)
        throw Error(ErrorKind::usage, "the volume is hierarchical", "make it a grid first: vkt amr-resample");
    Plan plan;
    from_ = input.dims;
    to_ = target_dims(input);
    counts_ = {};
    choose_header(input, plan.output);
    vkt::check(plan.output);
    out_type_ = plan.output.dtype;

    BoundaryRule const rule = boundary.value_or(BoundaryRule{});
    plan.boundary = rule.boundary;
    plan.border_value = input.values.stored(rule.value);
    Index3 halving{};
    double taps = 1;
    bool all_nearest = true;
    for (int axis = 0; axis < 3; ++axis) {
        WeightTable& table = tables_[static_cast<std::size_t>(axis)];
        table = WeightTable(from_[axis], to_[axis], kernel_for(from_[axis], to_[axis]), rule.boundary);
        halving[axis] = table.halving();
        taps *= static_cast<double>(table.most_taps());
        all_nearest = all_nearest && (table.kernel() == Kernel::nearest || table.kernel() == Kernel::identity);
        plan.state_bytes += table.bytes();
    }
    bool const same_values = out_type_ == input.dtype && scale_value_ == 1 && offset_value_ == 0;
    way_ = Way::weighted;
    if (same_values && from_ == to_)
        way_ = Way::copy;
    else if (same_values && all_nearest)
        way_ = Way::nearest;
    else if (same_values && halving.x * halving.y * halving.z > 1)
        way_ = Way::halving;
    if (way_ == Way::copy) plan.shift = Index3{};
    plan.method = describe();
    plan.exact = method != ResampleMethod::cubic || from_ == to_;
    plan.error_bound = plan.exact ? 0 : 1e-15; // rounding only: interpolation error depends on the data
    plan.cost = way_ == Way::copy || way_ == Way::nearest ? 0 : taps;
    return plan;
}

std::string Resample::describe() const {
    static char const* const names[] = {"copy", "nearest", "linear", "area", "cubic"};
    std::string result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::string const name = names[static_cast<std::size_t>(tables_[axis].kernel())];
        result += axis == 0 ? name : ", " + name;
    }
    if (way_ == Way::copy) return "copy";
    return way_ == Way::halving ? result + " (halving)" : result;
}

Box Resample::footprint(Box const& output, int) const {
    Box result;
    for (int axis = 0; axis < 3; ++axis) {
        auto const range = tables_[static_cast<std::size_t>(axis)].footprint(output.lower[axis], output.upper[axis]);
        result.lower[axis] = range.first;
        result.upper[axis] = range.second;
    }
    return result;
}

void Resample::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs.front();
    if (out.box.empty()) return;
    if (way_ == Way::copy) return copy_region(in.part(out.box), out, execution);
    if (way_ == Way::halving) {
        Index3 const factors{tables_[0].halving(), tables_[1].halving(), tables_[2].halving()};
        return resample_halved(in, out, factors, execution);
    }
    WeightedSum sum;
    sum.x = tables_[0].taps(execution.space());
    sum.y = tables_[1].taps(execution.space());
    sum.z = tables_[2].taps(execution.space());
    if (way_ == Way::nearest) return resample_nearest(in, out, sum, execution);
    sum.divisor = tables_[0].divisor() * tables_[1].divisor() * tables_[2].divisor();
    sum.scale = scale_value_;
    sum.offset = offset_value_;
    sum.x_identity = tables_[0].kernel() == Kernel::identity;
    Tally tally;
    resample_weighted(in, out, sum, scratch_, tally, execution);
    counts_.clipped += tally.clipped;
    counts_.nan += tally.nan;
}

std::vector<Remark> Resample::remarks() const { return store_remarks(counts_, to_.x * to_.y * to_.z, out_type_); }

#endif

} // namespace vkt
