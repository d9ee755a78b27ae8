// Convert: rows go through float where that is exact, through double otherwise, 64-bit integers directly.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/convert.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/rows.h"

#include <cmath>
#include <limits>

namespace vkt {

/// stored = (v * scale - low * scale) * factor + to_low for v limited to [least, most]. All but to_low count from
/// `base`. The scale is a power of two that keeps differences of the largest doubles finite, and 1 for all others.
struct LinearMap {
    Int128 base = 0;
    double low = 0, scale = 1, factor = 1, to_low = 0, least = 0, most = 0;
};

/// The finite extremes of stored values, low > high if there are none. Integers also have them exactly.
struct FiniteExtremes {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    Int128 whole_low = 0, whole_high = 0;
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
    double const scale = map.scale, low = map.low * scale, factor = map.factor, to_low = map.to_low;
    double const least = map.least, most = map.most;
#pragma omp simd reduction(+ : clipped)
    for (std::int64_t i = 0; i < n; ++i) {
        double u = v[i];
        clipped += (u < least ? 1 : 0) + (u > most ? 1 : 0);
        u = u < least ? least : u; // NaN passes
        u = u > most ? most : u;
        v[i] = (u * scale - low) * factor + to_low;
    }
    return {clipped, 0};
}

template <class T> void load_from_base(T const* from, double* to, std::int64_t n, Int128 base) {
    for (std::int64_t i = 0; i < n; ++i) {
        std::int64_t distance = 0;
        bool const far = __builtin_sub_overflow(from[i], base, &distance);
        to[i] = far ? static_cast<double>(static_cast<Int128>(from[i]) - base) : static_cast<double>(distance);
    }
}

/// Voxels less the base, which is 0 for all but 64-bit integers.
void load_differences(DataType type, std::byte const* from, double* to, std::int64_t n, Int128 base) {
    if (type == DataType::int64) return load_from_base(reinterpret_cast<std::int64_t const*>(from), to, n, base);
    if (type == DataType::uint64) return load_from_base(reinterpret_cast<std::uint64_t const*>(from), to, n, base);
    load_row(type, from, to, n);
}

template <class T>
void whole_extremes(View<T const> in, Box const& box, FiniteExtremes& found, Execution const& execution) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        T const* const from = &in(x, y, z);
        T low = from[0], high = from[0];
        for (std::int64_t i = 1; i < n; ++i) {
            low = std::min(low, from[i]);
            high = std::max(high, from[i]);
        }
#pragma omp critical(vkt_convert)
        {
            bool const first = !(found.low <= found.high);
            found.whole_low = first ? Int128{low} : std::min<Int128>(found.whole_low, low);
            found.whole_high = first ? Int128{high} : std::max<Int128>(found.whole_high, high);
            found.low = static_cast<double>(found.whole_low);
            found.high = static_cast<double>(found.whole_high);
        }
    });
}

} // namespace

void convert_values(ConstView in, AnyView out, Tally& tally, Execution const& execution) {
    if (in.type == DataType::int64) return convert_wide_from<std::int64_t>(in, out, tally, execution);
    if (in.type == DataType::uint64) return convert_wide_from<std::uint64_t>(in, out, tally, execution);
    if (float_suffices(in.type) && float_suffices(out.type)) return convert_through<float>(in, out, tally, execution);
    convert_through<double>(in, out, tally, execution);
}

void find_extremes(ConstView in, FiniteExtremes& found, Execution const& execution) {
    if (in.type == DataType::int64) return whole_extremes(in.as<std::int64_t>(), in.box, found, execution);
    if (in.type == DataType::uint64) return whole_extremes(in.as<std::uint64_t>(), in.box, found, execution);
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
            load_differences(in.type, in.at(x, y, z), scratch, n, map.base);
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
    end.value = ValueText<Number>::read({std::string(end.percentile ? word.substr(1) : word)}, name);
    double const value = end.value.value;
    if (end.percentile && !(value >= 0 && value <= 100))
        throw Error(ErrorKind::usage, text("--", name, ": ", value, " is not a percentile between 0 and 100"));
    if (!std::isfinite(value)) throw Error(ErrorKind::usage, text("--", name, ": '", word, "' is not finite"));
    return end;
}

bool is_extreme(RangeEnd const& end) { return end.percentile && (end.value == Number(0) || end.value == Number(100)); }

bool is_below(Number const& a, Number const& b) { return a.whole && b.whole ? *a.whole < *b.whole : a.value < b.value; }

bool is_wide(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

} // namespace

RangeOption ValueText<RangeOption>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string_view const word = w.front();
    if (word == "minmax") return {{true, Number(0)}, {true, Number(100)}};
    std::size_t const colon = word.find(':');
    if (colon == std::string_view::npos || word.find(':', colon + 1) != std::string_view::npos)
        throw Error(ErrorKind::usage, text("--", name, ": '", word, "' is not a range LO:HI"),
                    "for example 0:255, minmax or p1:p99");
    RangeOption const range{parse_end(word.substr(0, colon), name), parse_end(word.substr(colon + 1), name)};
    if (range.low.percentile == range.high.percentile && !is_below(range.low.value, range.high.value))
        throw Error(ErrorKind::usage,
                    text("--", name, ": '", word, "' is empty: the first end must be below the second"));
    return range;
}

std::vector<std::string> ValueText<RangeOption>::write(RangeOption const& v) {
    if (v == RangeOption{{true, Number(0)}, {true, Number(100)}}) return {"minmax"};
    return {text(v.low.percentile ? "p" : "", to_text(v.low.value), ":", v.high.percentile ? "p" : "",
                 to_text(v.high.value))};
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
    to_low_ = to ? to->low.value.value : is_integer(type_) ? lowest_of(type_) : 0;
    to_high_ = to ? to->high.value.value : is_integer(type_) ? highest_of(type_) : 1;
    if (to_low_ < lowest_of(type_) || to_high_ > highest_of(type_))
        throw Error(ErrorKind::usage, text("--to ", to_low_, ":", to_high_, " does not fit into ", type_));
    plan.error.kind = ErrorBound::Kind::bound;
    // Of the range that is mapped, which percentiles do not make wider than the data's.
    double const share =
        0x1p-53 * (5 + std::max(std::abs(to_low_), std::abs(to_high_)) / (to_high_ / 2 - to_low_ / 2) / 2);
    bool const known = !range->low.percentile && !range->high.percentile;
    double const stores = storing_error(type_), largest = std::max(std::abs(to_low_), std::abs(to_high_));
    double const width = to_high_ - to_low_; // of stored values that the range becomes
    double const stored_share = std::isfinite(largest / width) ? stores * largest / width : 1;
    // The maps of both sides round as well: a few units in the last place of what their terms reach.
    plan.error.magnitude = 4 * 0x1p-53;
    plan.error.absolute = 8 * 0x1p-53 * std::abs(input_.values.intercept);
    if (known) {
        double const low = range->low.value.value, high = range->high.value.value;
        plan.error.absolute +=
            (share + stored_share) * (high - low) + 8 * 0x1p-53 * std::max(std::abs(low), std::abs(high));
    } else {
        plan.error.range = share + stored_share;
    }
    if (known) {
        set_map(stored(range->low.value), stored(range->high.value));
        plan.output.values = values_;
        return plan;
    }
    plan.scans = true;
    std::vector<double> percents;
    bool const falling = input_.values.slope < 0; // percentiles are of physical values
    for (RangeEnd const& end : {range->low, range->high})
        if (end.percentile && !is_extreme(end)) percents.push_back(falling ? 100 - end.value.value : end.value.value);
    plan.method = percents.empty() ? "extremes first, then linear map" : "percentiles first, then linear map";
    any_finite_ = scans_again_ = false;
    if (percents.empty()) return plan;
    plan.state_bytes = Quantiles::state_bytes(input_.dtype, 1);
    quantiles_ = std::make_unique<Quantiles>(input_.dtype, std::move(percents), input_.voxels());
    return plan;
}

void Convert::scan(ConstView slab, Execution const& execution) {
    bool const first_pass = !scans_again_;
    if (first_pass && (is_extreme(range->low) || is_extreme(range->high))) {
        FiniteExtremes found;
        find_extremes(slab, found, execution);
        auto const value = [&](double v, Int128 whole) {
            return is_wide(input_.dtype) ? StoredValue{whole, 0} : StoredValue{0, v};
        };
        if (found.low <= found.high) {
            StoredValue const low = value(found.low, found.whole_low), high = value(found.high, found.whole_high);
            if (!any_finite_ || low - least_voxel_ < 0) least_voxel_ = low;
            if (!any_finite_ || high - most_voxel_ > 0) most_voxel_ = high;
            any_finite_ = true;
        }
    }
    if (!quantiles_) return;
    // Every thread has counters of its own; all together they take no more than an eighth of the budget.
    auto const fitting = static_cast<std::int64_t>(execution.memory / (8 * Quantiles::state_bytes(input_.dtype, 1)));
    quantiles_->add(slab, static_cast<int>(std::clamp<std::int64_t>(fitting, 1, execution.threads)));
}

/// Of integers without a value map whole numbers are kept as they are.
StoredValue Convert::stored(Number const& physical) const {
    if (is_wide(input_.dtype) && input_.values == ValueMap{} && physical.whole) return {*physical.whole, 0};
    return {0, input_.values.stored(physical.value)};
}

StoredValue Convert::end_of(RangeEnd const& end, std::size_t& percentiles) const {
    if (!end.percentile) return stored(end.value);
    if (is_extreme(end)) return (end.value == Number(0)) == (input_.values.slope > 0) ? least_voxel_ : most_voxel_;
    return quantiles_->percentile(percentiles++);
}

void Convert::scan_end() {
    scans_again_ = quantiles_ && quantiles_->end_pass();
    if (scans_again_) return;
    if (!any_finite_ && !(quantiles_ && quantiles_->count() > 0))
        throw Error(ErrorKind::data, "no voxel is a finite number: there is no range to map",
                    "give numbers: --range LO:HI");
    std::size_t percentiles = 0;
    StoredValue const low = end_of(range->low, percentiles), high = end_of(range->high, percentiles);
    double const first = input_.values.physical(low.value()) + 0.0, last = input_.values.physical(high.value()) + 0.0;
    if (!std::isfinite(first) || !std::isfinite(last))
        throw Error(ErrorKind::data, text("the volume's range reaches from ", first, " to ", last),
                    "use percentiles, as in --range p1:p99");
    if (!(input_.values.slope > 0 ? high - low > 0 : high - low < 0))
        throw Error(ErrorKind::data, text("the range to map is empty: it reaches from ", first, " to ", last),
                    "give numbers: --range LO:HI");
    set_map(low, high);
}

/// Fixes the map from a range of stored input values to stored output values, and the value map after it.
void Convert::set_map(StoredValue low, StoredValue high) {
    low_ = low;
    high_ = high;
    scale_ = std::isfinite(high - low) ? 1 : 0.25;
    double const extent =
        scale_ == 1 ? high - low : high.value() * scale_ - low.value() * scale_; // only floats are so far apart
    factor_ = (to_high_ - to_low_) / extent;
    values_.slope = input_.values.slope / (factor_ * scale_);
    values_.intercept = input_.values.physical(low_.value()) - to_low_ * values_.slope;
    if (!std::isfinite(values_.slope) || values_.slope == 0 || !std::isfinite(values_.intercept))
        throw Error(ErrorKind::usage,
                    text("--range: ", input_.values.physical(low_.value()), ":", input_.values.physical(high_.value()),
                         " is too narrow or too wide to be mapped"));
}

void Convert::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs.front().part(out.box);
    if (copies_) return copy_region(in, out, execution);
    Tally tally;
    if (range) {
        double const low = low_.rest, high = high_.rest + static_cast<double>(high_.whole - low_.whole);
        LinearMap const map{low_.whole, low, scale_, factor_, to_low_, std::min(low, high), std::max(low, high)};
        convert_range(in, out, map, tally, execution);
    } else
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
