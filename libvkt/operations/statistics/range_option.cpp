// Parsing ranges, and passes that find their ends.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/range_option.h"

#include "libvkt/operations/common/kernels/convert.h"

#include <algorithm>
#include <cmath>

namespace vkt {
namespace {

RangeEnd parse_end(std::string_view word, std::string_view name) {
    RangeEnd end;
    end.percentile = !word.empty() && word.front() == 'p';
    end.value = ValueText<Number>::read({std::string(end.percentile ? word.substr(1) : word)}, name);
    double const value = end.value.value;
    if (end.percentile && !(value >= 0 && value <= 100))
        throw Error(ErrorKind::usage, text(name, ": ", value, " is not a percentile between 0 and 100"));
    if (!std::isfinite(value)) throw Error(ErrorKind::usage, text(name, ": '", word, "' is not finite"));
    return end;
}

bool is_extreme(RangeEnd const& end) { return end.percentile && (end.value == Number(0) || end.value == Number(100)); }

bool is_below(Number const& a, Number const& b) { return a.whole && b.whole ? *a.whole < *b.whole : a.value < b.value; }

bool is_wide(DataType type) { return type == DataType::int64 || type == DataType::uint64; }

} // namespace

bool RangeOption::percentiles() const {
    return (low.percentile && !is_extreme(low)) || (high.percentile && !is_extreme(high));
}

RangeOption ValueText<RangeOption>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string_view const word = w.front();
    if (word == "minmax") return {{true, Number(0)}, {true, Number(100)}};
    std::size_t const colon = word.find(':');
    if (colon == std::string_view::npos || word.find(':', colon + 1) != std::string_view::npos)
        throw Error(ErrorKind::usage, text(name, ": '", word, "' is not a range LO:HI"),
                    "for example 0:255, minmax or p1:p99");
    RangeOption const range{parse_end(word.substr(0, colon), name), parse_end(word.substr(colon + 1), name)};
    if (range.low.percentile == range.high.percentile && !is_below(range.low.value, range.high.value))
        throw Error(ErrorKind::usage, text(name, ": '", word, "' is empty: the first end must be below the second"));
    return range;
}

std::vector<std::string> ValueText<RangeOption>::write(RangeOption const& v) {
    if (v == RangeOption{{true, Number(0)}, {true, Number(100)}}) return {"minmax"};
    return {text(v.low.percentile ? "p" : "", to_text(v.low.value), ":", v.high.percentile ? "p" : "",
                 to_text(v.high.value))};
}

RangeScan::RangeScan(RangeOption const& range, Header const& header) : range_(range), header_(header) {
    std::vector<double> percents;
    bool const falling = header.values.slope < 0; // percentiles are of physical values
    for (RangeEnd const& end : {range.low, range.high})
        if (end.percentile && !is_extreme(end)) percents.push_back(falling ? 100 - end.value.value : end.value.value);
    if (!percents.empty()) quantiles_ = std::make_unique<Quantiles>(header.dtype, std::move(percents), header.voxels());
    if (!range.depends()) set_ends();
}

void RangeScan::scan(ConstView slab, Execution const& execution) {
    if (first_pass_ && (is_extreme(range_.low) || is_extreme(range_.high))) {
        FiniteExtremes found;
        find_extremes(slab, found, execution);
        auto const value = [&](double v, Int128 whole) {
            return is_wide(header_.dtype) ? StoredValue{whole, 0} : StoredValue{0, v};
        };
        if (found.low <= found.high) {
            StoredValue const low = value(found.low, found.whole_low), high = value(found.high, found.whole_high);
            if (!any_finite_ || low - least_ < 0) least_ = low;
            if (!any_finite_ || high - most_ > 0) most_ = high;
            any_finite_ = true;
        }
    }
    if (quantiles_) quantiles_->add(slab, execution);
}

bool RangeScan::end_pass() {
    first_pass_ = false;
    if (quantiles_ && quantiles_->end_pass()) return true;
    if (known()) set_ends();
    return false;
}

void RangeScan::set_ends() {
    std::size_t percentiles = 0;
    low_ = end_of(range_.low, percentiles);
    high_ = end_of(range_.high, percentiles);
}

/// Of integers without a value map whole numbers are kept as they are.
StoredValue RangeScan::stored(Number const& physical) const {
    if (is_wide(header_.dtype) && header_.values == ValueMap{} && physical.whole) return {*physical.whole, 0};
    return {0, header_.values.stored(physical.value)};
}

StoredValue RangeScan::end_of(RangeEnd const& end, std::size_t& percentiles) const {
    if (!end.percentile) return stored(end.value);
    if (is_extreme(end)) return (end.value == Number(0)) == (header_.values.slope > 0) ? least_ : most_;
    return quantiles_->percentile(percentiles++);
}

} // namespace vkt
