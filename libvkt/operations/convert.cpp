// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/convert.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/rows.h"

#include <cmath>
#include <limits>

namespace vkt {

/// stored = (v - low) * factor + to_low for v limited to [least, most].
struct LinearMap {
    double low = 0, factor = 1, to_low = 0, least = 0, most = 0;
};

/// The finite extremes of stored values, low > high if there are none.
struct FiniteExtremes {
    double low = std::numeric_limits<double>::infinity(), high = -low;
};

VKT_CPU_KERNEL(find_extremes, (ConstView in, FiniteExtremes& found, Execution const& execution), (in, found, execution))
VKT_CPU_KERNEL(convert_values, (ConstView in, AnyView out, Tally& tally, Execution const& execution),
               (in, out, tally, execution))
VKT_CPU_KERNEL(convert_range,
               (ConstView in, AnyView out, LinearMap const& map, Tally& tally, Execution const& execution),
               (in, out, map, tally, execution))

#ifndef __CUDACC__
namespace VKT_BACKEND {
namespace {

/// Calls f(x, y, z, n, scratch) for pieces of rows; scratch holds row_piece values of C.
template <class C, class F> void for_each_row_piece(Execution const& execution, Box const& box, F const& f) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) C scratch[row_piece];
        for (std::int64_t i = 0; i < n; i += row_piece) f(x + i, y, z, std::min(row_piece, n - i), scratch);
    });
}

template <class C> void convert_through(ConstView in, AnyView out, Tally& tally, Execution const& execution) {
    for_each_row_piece<C>(
        execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, C* scratch) {
            load_row(in.type, in.at(x, y, z), scratch, n);
            driver::add(tally, store_row(out.type, static_cast<C const*>(scratch), out.at(x, y, z), n));
        });
}

template <class T, class U> U direct(T v) {
    if constexpr (std::is_same_v<U, Half>)
        return Half(
            static_cast<float>(v)); // floats hold more than twice the bits of a half: no double rounding below 2^16
    else if constexpr (std::is_floating_point_v<U>)
        return static_cast<U>(v);
    else
        return round_to<U>(v);
}

/// 64-bit integers, which double does not hold.
template <class T, class U>
void convert_wide(View<T const> in, View<U> out, Box const& box, Tally& tally, Execution const& execution) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        T const* const from = &in(x, y, z);
        U* const to = &out(x, y, z);
        Tally mine;
        for (std::int64_t i = 0; i < n; ++i) {
            if constexpr (std::is_integral_v<U>)
                mine.clipped += is_clipped<U>(from[i]) ? 1 : 0;
            else if constexpr (std::is_same_v<U, Half>)
                mine.clipped += is_clipped<U>(static_cast<double>(from[i])) ? 1 : 0;
            to[i] = direct<T, U>(from[i]);
        }
        driver::add(tally, mine);
    });
}

template <class T> void convert_wide_from(ConstView in, AnyView out, Tally& tally, Execution const& execution) {
    for_each_type(out.type,
                  [&]<class U>(U) { convert_wide<T, U>(in.as<T>(), out.as<U>(), out.box, tally, execution); });
}

Tally limit_and_map(double* v, std::int64_t n, LinearMap const& map) {
    std::int64_t clipped = 0;
    double const low = map.low, factor = map.factor, to_low = map.to_low, least = map.least, most = map.most;
#pragma omp simd reduction(+ : clipped)
    for (std::int64_t i = 0; i < n; ++i) {
        double u = v[i];
        clipped += (u < least ? 1 : 0) + (u > most ? 1 : 0);
        u = u < least ? least : u; // NaN passes
        u = u > most ? most : u;
        v[i] = (u - low) * factor + to_low;
    }
    return {clipped, 0};
}

} // namespace

void convert_values(ConstView in, AnyView out, Tally& tally, Execution const& execution) {
    if (in.type == DataType::int64) return convert_wide_from<std::int64_t>(in, out, tally, execution);
    if (in.type == DataType::uint64) return convert_wide_from<std::uint64_t>(in, out, tally, execution);
    if (float_suffices(in.type) && float_suffices(out.type)) return convert_through<float>(in, out, tally, execution);
    convert_through<double>(in, out, tally, execution);
}

void find_extremes(ConstView in, FiniteExtremes& found, Execution const& execution) {
    for_each_row_piece<double>(execution, in.box,
                               [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, double* scratch) {
                                   load_row(in.type, in.at(x, y, z), scratch, n);
                                   double low = std::numeric_limits<double>::infinity(), high = -low;
#pragma omp simd reduction(min : low) reduction(max : high)
                                   for (std::int64_t i = 0; i < n; ++i) {
                                       double const v = scratch[i];
                                       bool const finite = v - v == 0;
                                       low = finite && v < low ? v : low;
                                       high = finite && v > high ? v : high;
                                   }
#pragma omp critical(vkt_convert)
                                   {
                                       found.low = std::min(found.low, low);
                                       found.high = std::max(found.high, high);
                                   }
                               });
}

void convert_range(ConstView in, AnyView out, LinearMap const& map, Tally& tally, Execution const& execution) {
    for_each_row_piece<double>(
        execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, double* scratch) {
            load_row(in.type, in.at(x, y, z), scratch, n);
            Tally counts = limit_and_map(scratch, n, map);
            // What lies in the range fits; the ends of 64-bit types, which double rounds up, only seem not to.
            counts.nan = store_row(out.type, static_cast<double const*>(scratch), out.at(x, y, z), n).nan;
            driver::add(tally, counts);
        });
}

} // namespace VKT_BACKEND
#endif

#if VKT_HOST

namespace {

RangeEnd parse_end(std::string_view word, std::string_view name) {
    RangeEnd end;
    end.percentile = !word.empty() && word.front() == 'p';
    end.value = ValueText<double>::read({std::string(end.percentile ? word.substr(1) : word)}, name);
    if (end.percentile && !(end.value >= 0 && end.value <= 100))
        throw Error(ErrorKind::usage, text("--", name, ": ", end.value, " is not a percentile between 0 and 100"));
    if (!std::isfinite(end.value)) throw Error(ErrorKind::usage, text("--", name, ": '", word, "' is not finite"));
    return end;
}

bool is_extreme(RangeEnd const& end) { return end.percentile && (end.value == 0 || end.value == 100); }

} // namespace

ValueRange ValueText<ValueRange>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string_view const word = w.front();
    if (word == "minmax") return {{true, 0}, {true, 100}};
    std::size_t const colon = word.find(':');
    if (colon == std::string_view::npos || word.find(':', colon + 1) != std::string_view::npos)
        throw Error(ErrorKind::usage, text("--", name, ": '", word, "' is not a range LO:HI"),
                    "for example 0:255, minmax or p1:p99");
    ValueRange const range{parse_end(word.substr(0, colon), name), parse_end(word.substr(colon + 1), name)};
    if (range.low.percentile == range.high.percentile && !(range.low.value < range.high.value))
        throw Error(ErrorKind::usage,
                    text("--", name, ": '", word, "' is empty: the first end must be below the second"));
    return range;
}

std::vector<std::string> ValueText<ValueRange>::write(ValueRange const& v) {
    if (v == ValueRange{{true, 0}, {true, 100}}) return {"minmax"};
    return {text(v.low.percentile ? "p" : "", v.low.value, ":", v.high.percentile ? "p" : "", v.high.value)};
}

VKT_OPERATION(Convert, "convert")

void Convert::parameters(Parameters& p) {
    p.option("dtype", dtype, "TYPE", "data type of the result").alias("data-format");
    p.option("range", range, "LO:HI|minmax|pA:pB",
             "map these values to the full range of the result; what lies outside is clipped");
    p.option("to", to, "LO:HI", "with --range: map to these stored values instead");
}

void Convert::check() const {
    if (!dtype && !range)
        throw Error(ErrorKind::usage, "neither --dtype nor --range is given",
                    "say for example --dtype uint8 --range minmax");
    if (to && !range) throw Error(ErrorKind::usage, "--to needs --range");
    if (to && (to->low.percentile || to->high.percentile))
        throw Error(ErrorKind::usage, "--to takes two numbers, as in 0:255");
}

Plan Convert::plan(std::span<Header const> inputs) {
    input_ = inputs.front();
    type_ = dtype.value_or(input_.dtype);
    values_ = input_.values;
    counts_ = {};
    quantiles_.reset();
    Plan plan;
    plan.output = input_;
    plan.output.dtype = type_;
    copies_ = !range && type_ == input_.dtype;
    if (copies_) {
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return plan;
    }
    plan.method = range ? "linear map, rounded half to even, saturated" : "rounded half to even, saturated";
    if (!range) return plan;
    to_low_ = to ? to->low.value : is_integer(type_) ? lowest_of(type_) : 0;
    to_high_ = to ? to->high.value : is_integer(type_) ? highest_of(type_) : 1;
    if (to_low_ < lowest_of(type_) || to_high_ > highest_of(type_))
        throw Error(ErrorKind::usage, text("--to ", to_low_, ":", to_high_, " does not fit into ", type_));
    if (!range->low.percentile && !range->high.percentile) {
        set_map(range->low.value, range->high.value);
        plan.output.values = values_;
        return plan;
    }
    plan.scans = true;
    percentiles_ =
        (range->low.percentile && !is_extreme(range->low)) || (range->high.percentile && !is_extreme(range->high));
    plan.method = percentiles_ ? "percentiles first, then linear map" : "extremes first, then linear map";
    bool const few = is_integer(input_.dtype) && size_of(input_.dtype) <= 2; // values, each with a counter
    if (percentiles_) plan.state_bytes = few ? std::size_t{8} << (8 * size_of(input_.dtype)) : std::size_t{16} << 20;
    low_ = FiniteExtremes{}.low;
    high_ = FiniteExtremes{}.high;
    if (percentiles_) quantiles_ = std::make_unique<Quantiles>(input_.dtype);
    return plan;
}

void Convert::scan(ConstView slab, Execution const& execution) {
    FiniteExtremes found{low_, high_};
    find_extremes(slab, found, execution);
    low_ = found.low;
    high_ = found.high;
    if (quantiles_) quantiles_->add(slab, execution.threads);
}

void Convert::scan_end() {
    if (!(low_ <= high_))
        throw Error(ErrorKind::data, "no voxel is a finite number: there is no range to map",
                    "give numbers: --range LO:HI");
    bool const falling = input_.values.slope < 0; // percentiles are of physical values
    double const first = input_.values.physical(low_) + 0.0, last = input_.values.physical(high_) + 0.0; // 0 for -0
    double const least = std::min(first, last), most = std::max(first, last);
    auto const resolve = [&](RangeEnd const& end) {
        if (!end.percentile) return end.value;
        if (end.value == 0) return least;
        if (end.value == 100) return most;
        return input_.values.physical(quantiles_->percentile(falling ? 100 - end.value : end.value));
    };
    double const low = resolve(range->low), high = resolve(range->high);
    if (!std::isfinite(low) || !std::isfinite(high))
        throw Error(ErrorKind::data, text("the volume's range reaches from ", low, " to ", high),
                    "use percentiles, as in --range p1:p99");
    if (!(low < high))
        throw Error(ErrorKind::data, text("the range to map is empty: it reaches from ", low, " to ", high),
                    "give numbers: --range LO:HI");
    set_map(low, high);
}

/// Fixes the map from the stored input values of a physical range to stored output values, and the value map after it.
void Convert::set_map(double low, double high) {
    low_ = input_.values.stored(low);
    high_ = input_.values.stored(high);
    factor_ = (to_high_ - to_low_) / (high_ - low_);
    values_.slope = input_.values.slope / factor_;
    values_.intercept = input_.values.physical(low_) - to_low_ * values_.slope;
    if (!std::isfinite(values_.slope) || values_.slope == 0 || !std::isfinite(values_.intercept))
        throw Error(ErrorKind::usage, text("--range: ", low, ":", high, " is too narrow or too wide to be mapped"));
}

void Convert::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs.front().part(out.box);
    if (copies_) return copy_region(in, out, execution);
    Tally tally;
    if (range)
        convert_range(in, out, {low_, factor_, to_low_, std::min(low_, high_), std::max(low_, high_)}, tally,
                      execution);
    else
        convert_values(in, out, tally, execution);
    counts_.clipped += tally.clipped;
    counts_.nan += tally.nan;
}

std::vector<Remark> Convert::remarks() const {
    std::int64_t const voxels = input_.voxels();
    std::vector<Remark> result = store_remarks(counts_, voxels, type_);
    if (range && counts_.clipped > 0)
        result.front().message =
            text(share_text(counts_.clipped, voxels), " clipped to [", to_low_, ",", to_high_, "]");
    return result;
}

#endif

} // namespace vkt
