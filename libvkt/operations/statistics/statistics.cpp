// Statistics: bands of rows merged in order, and what follows from the sums.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/statistics.h"

#include "libvkt/amr/tree.h"
#include "libvkt/engine/cut.h"
#include "libvkt/kernel/host_copy.h"
#include "libvkt/operations/common/foreground.h"
#include "libvkt/operations/statistics/kernels/statistics.h"

#include <cmath>
#include <limits>
#include <tuple>

namespace vkt {

namespace {

/// The first voxel from the beginning of a row on that has a value.
template <class T, class V> Index3 find_from_row(ConstView slab, Index3 at, V value) {
    View<T const> const in = slab.as<T>();
    for (; at.y < slab.box.upper.y; ++at.y)
        for (at.x = slab.box.lower.x; at.x < slab.box.upper.x; ++at.x)
            if (static_cast<V>(in(at.x, at.y, at.z)) == value) return at;
    return at;
}

Index3 find(ConstView slab, Index3 row, Extreme const& extreme) {
    HostCopy copy;
    if (slab.space == Space::device) { // the band that the row begins
        std::int64_t const end = std::min(row.y + rows_in_band(slab.dims(), slab.type), slab.box.upper.y);
        slab = copy.of(slab.part({{slab.box.lower.x, row.y, row.z}, {slab.box.upper.x, end, row.z + 1}}));
    }
    Index3 at;
    with_type(slab.type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>)
            at = find_from_row<T>(slab, row, extreme.integer);
        else
            at = find_from_row<T>(slab, row, extreme.value);
    });
    return at;
}

/// The first finite voxel of a slab in x-fastest order.
MeanOrigin first_finite(ConstView slab) {
    MeanOrigin origin;
    if (slab.space == Space::device) {
        HostCopy copy;
        std::int64_t const rows = rows_in_band(slab.dims(), slab.type);
        Box band = slab.box; // mostly the first one has it
        for (std::int64_t z = slab.box.lower.z; z < slab.box.upper.z && !origin.known; ++z)
            for (std::int64_t y = slab.box.lower.y; y < slab.box.upper.y && !origin.known; y += rows) {
                band.lower.z = z, band.upper.z = z + 1;
                band.lower.y = y, band.upper.y = std::min(y + rows, slab.box.upper.y);
                origin = first_finite(copy.of(slab.part(band)));
            }
        return origin;
    }
    with_type(slab.type, [&]<class T>(T) {
        View<T const> const in = slab.as<T>();
        Box const b = slab.box;
        for (std::int64_t z = b.lower.z; z < b.upper.z && !origin.known; ++z)
            for (std::int64_t y = b.lower.y; y < b.upper.y && !origin.known; ++y)
                for (std::int64_t x = b.lower.x; x < b.upper.x && !origin.known; ++x) {
                    auto const v = static_cast<double>(in(x, y, z));
                    if (!std::isfinite(v)) continue;
                    origin = {true, v, 0};
                    if constexpr (std::is_integral_v<T>) origin.integer = static_cast<Int128>(in(x, y, z));
                }
    });
    return origin;
}

/// Variance from exact sums: the sum of squares about the integer nearest to the mean is exact too.
double exact_variance(Moments const& m) {
    auto const n = static_cast<Int128>(m.finite);
    Int128 const center = static_cast<Int128>(std::nearbyint(quotient(m.integer_sum, m.finite)));
    Int128 const squares = static_cast<Int128>(m.squares) - 2 * center * m.integer_sum + n * center * center;
    double const offset = quotient(m.integer_sum - n * center, m.finite);
    return std::max(0.0, quotient(squares, m.finite) - offset * offset);
}

} // namespace

PercentList ValueText<PercentList>::read(std::vector<std::string> const& w, std::string_view name) {
    PercentList list;
    for (std::string const& word : parts_of(w, name)) {
        double const percent = ValueText<double>::read({word}, name);
        if (!(percent >= 0 && percent <= 100))
            throw Error(ErrorKind::usage, text(name, ": ", word, " is not between 0 and 100"));
        list.values.push_back(percent);
    }
    return list;
}

std::vector<std::string> ValueText<PercentList>::write(PercentList const& v) {
    std::string words;
    for (double const percent : v.values) words += text(words.empty() ? "" : ",", percent);
    return words.empty() ? std::vector<std::string>{} : std::vector<std::string>{words};
}

void Statistics::parameters(Parameters& p) {
    p.option("roi", roi, "X0:X1,Y0:Y1,Z0:Z1", "look only at these voxels (half-open); X0:X1:S is every S-th");
    p.option("percentiles", percents_, "P,P...", "also the values below which these per cents of the finite ones lie");
}

std::vector<double> PercentList::of_stored(ValueMap const& map) const {
    std::vector<double> stored = values;
    for (double& percent : stored) percent = map.slope < 0 ? 100 - percent : percent;
    return stored;
}

Percentile percentile_of(double percent, StoredValue const& stored, ValueMap const& map) {
    bool const whole = map == ValueMap{} && stored.rest == 0 && stored.whole != 0;
    return {percent, whole ? to_text(stored.whole) : to_text(map.physical(stored.value()))};
}

std::optional<Quantiles> Statistics::quantiles_for(Header const& in) const {
    if (!percentiles()) return std::nullopt;
    std::int64_t const cells = in.kind == Kind::hierarchical ? in.cell_count : roi.resolve(in.dims).voxels();
    return Quantiles(in.dtype, percents_.of_stored(in.values), cells);
}

Plan Statistics::plan(std::span<Header const> inputs) const {
    Header const& in = inputs.front();
    static_cast<void>(LevelRegion(roi, in)); // or it is refused
    Plan plan;
    plan.output = in;
    if (percentiles()) {
        plan.scans = size_of(in.dtype) > 2;
        plan.state_bytes = Quantiles::state_bytes(in.dtype, 1);
    }
    plan.method = is_integer(in.dtype) && size_of(in.dtype) <= 4 ? "exact integer sums" : "shifted sums, Chan merge";
    if (!is_integer(in.dtype) || size_of(in.dtype) > 4) {
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 1e-15;
    }
    plan.cost = !percentiles() ? 4 : size_of(in.dtype) <= 2 ? 16 : 120;
    return plan;
}

void Statistics::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    region_ = {roi, input_};
    width_ = {1, 1, 1};
    first_cell_ = {};
    background_ = input_.kind == Kind::hierarchical ? stored_background(input_) : std::nullopt;
    levels_.clear();
    level_ = nullptr;
    total_ = {};
    min_ = max_ = {};
    product_ = {};
    origin_ = {};
    result_ = {};
    first_pass_ = true;
    scans_again_ = false;
    quantiles_ = quantiles_for(input_);
}

void Statistics::enter_level(Index3 cell_width, Index3 first) {
    width_ = cell_width;
    first_cell_ = first;
    region_.enter_level(cell_width, first);
    double const cell = volume_of(cell_width);
    level_ = &levels_[cell];
    level_->cell = cell;
}

void Statistics::append(Moments const& slice, bool exact) {
    total_.append(slice, exact);
    if (level_ != nullptr) level_->moments.append(slice, exact);
}

void Statistics::append(SliceStatistics const& slice) {
    bool const exact = is_integer(input_.dtype) && size_of(input_.dtype) <= 4;
    append(has_float_moments(input_.dtype) ? moments_of(slice.narrow) : slice.moments, exact);
    if (product_map() != nullptr) product_.multiply(slice.product);
}

void Statistics::scan(ConstView slab, Execution const& execution) {
    Box const box = intersect(slab.box, region_.box());
    if (box.empty()) return;
    ConstView const part = slab.part(box);
    if (background_) return scan_foreground(part, execution);
    if (quantiles_) quantiles_->add(part, execution);
    if (!first_pass_) return;
    Index3 const n = box.dims();
    std::int64_t const bands = bands_in_slice(n, part.type);
    if (!origin_.known) origin_ = first_finite(part);
    // Bands to slices, slices to the volume, each in order: the same tree however the volume is cut into slabs.
    slices_.assign(static_cast<std::size_t>(n.z), {});
    // Of a slice that comes in pieces, its first bands were seen before.
    bool const grid = input_.kind == Kind::structured;
    if (grid && box.lower.y > region_.box().lower.y) {
        slices_.front() = slice_;
        slices_.front().range = {};
    }
    if (execution.device == Device::gpu && has_slice_sums(part.type)) {
        slice_statistics(part, origin_, product_map(), slices_.data(), execution);
    } else {
        bands_.resize(static_cast<std::size_t>(bands * n.z));
        band_statistics(part, origin_, product_map(), bands_.data(), execution);
#pragma omp parallel for num_threads(execution.threads) if (bands * n.z > 4096 && execution.threads > 1)
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t b = 0; b < bands; ++b)
                slices_[static_cast<std::size_t>(z)].append(bands_[static_cast<std::size_t>(z * bands + b)], b,
                                                            part.type);
    }
    if (grid)
        merge_extremes(part);
    else
        for (std::size_t z = 0; z < slices_.size(); ++z) {
            Box slice = box;
            slice.lower.z += static_cast<std::int64_t>(z);
            slice.upper.z = slice.lower.z + 1;
            merge_extremes(part.part(slice), slices_[z].range);
        }
    if (grid && box.upper.y < region_.box().upper.y)
        slice_ = slices_.front();
    else
        for (SliceStatistics const& slice : slices_) append(slice);
}

/// The same of what is not background.
void Statistics::scan_foreground(ConstView part, Execution const& execution) {
    ConstView const cells = without_background(part, *background_, foreground_);
    if (cells.box.empty()) return;
    if (quantiles_) quantiles_->add(cells, execution);
    if (!first_pass_) return;
    bands_.resize(1); // one row
    if (!origin_.known) origin_ = first_finite(cells);
    band_statistics(cells, origin_, product_map(), bands_.data(), execution);
    SliceStatistics all;
    all.append(bands_.front(), 0, input_.dtype);
    append(all);
    merge_extremes(part, bands_.front().range);
}

/// Where a cell begins, in finest cells.
Index3 Statistics::finest_cell(Index3 cell) const {
    for (int axis = 0; axis < 3; ++axis) cell[axis] = cell[axis] * width_[axis] + first_cell_[axis];
    return cell;
}

/// The extremes of a slab's cells, which may be anywhere in it.
void Statistics::merge_extremes(ConstView slab, Range const& range) {
    if (!range.valid) return;
    bool const integer = is_integer(input_.dtype);
    HostCopy copy;
    auto const locate = [&](Extreme& extreme) {
        Index3 at = slab.box.lower;
        ConstView const cells = copy.of(slab);
        for (; at.z < slab.box.upper.z; ++at.z) {
            Index3 const found = find(cells, at, extreme);
            if (found.y == slab.box.upper.y) continue; // not in this slice
            extreme.where = finest_cell(found);
            return;
        }
    };
    // Bricks come in an order of their own: of equal values the first in x-fastest order counts, wherever it comes.
    auto const keep = [&](Extreme& extreme, Extreme next, int sign) {
        auto const beyond = [&](Extreme const& a, Extreme const& b) {
            return integer ? sign * a.integer > sign * b.integer : sign * a.value > sign * b.value;
        };
        if (extreme.valid && beyond(extreme, next)) return;
        locate(next);
        Index3 const &a = next.where, &b = extreme.where;
        bool const before = std::tie(a.z, a.y, a.x) < std::tie(b.z, b.y, b.x);
        if (!extreme.valid || beyond(next, extreme) || before) extreme = next;
    };
    keep(min_, {true, range.low, range.integer_low, {}}, -1);
    keep(max_, {true, range.high, range.integer_high, {}}, 1);
}

void Statistics::merge_extremes(ConstView slab) {
    bool const integer = is_integer(input_.dtype);
    Index3 const lower = slab.box.lower;
    std::int64_t const rows = rows_in_band(slab.dims(), slab.type);
    bool new_min = false, new_max = false;
    for (std::size_t z = 0; z < slices_.size(); ++z) {
        SliceStatistics const& slice = slices_[z];
        Range const& range = slice.range;
        if (!range.valid) continue;
        auto const row = [&](std::int64_t band) {
            return Index3{lower.x, lower.y + band * rows, lower.z + static_cast<std::int64_t>(z)};
        };
        if (!min_.valid || (integer ? range.integer_low < min_.integer : range.low < min_.value)) {
            min_ = {true, range.low, range.integer_low, row(slice.low_band)};
            new_min = true;
        }
        if (!max_.valid || (integer ? range.integer_high > max_.integer : range.high > max_.value)) {
            max_ = {true, range.high, range.integer_high, row(slice.high_band)};
            new_max = true;
        }
    }
    // Only the band that won is searched: the first voxel in x-fastest order that has the value.
    auto const locate = [&](Extreme& extreme) { extreme.where = finest_cell(find(slab, extreme.where, extreme)); };
    if (new_min) locate(min_);
    if (new_max) locate(max_);
}

void Statistics::scan_end() {
    if (first_pass_) summarise();
    first_pass_ = false;
    scans_again_ = quantiles_ && quantiles_->end_pass();
    if (quantiles_ && !scans_again_) set_percentiles();
}

void Statistics::set_percentiles() {
    for (std::size_t i = 0; i < percents_.values.size(); ++i)
        result_.percentiles.push_back(quantiles_->count() > 0
                                          ? percentile_of(percents_.values[i], quantiles_->percentile(i), input_.values)
                                          : Percentile{percents_.values[i], "nan"});
}

StatisticsResult result_of(PartialStatistics const& all, DataType type, ValueMap const& map) {
    StatisticsResult r;
    Moments const& m = all.moments;
    double const undefined = std::numeric_limits<double>::quiet_NaN();
    bool const integer = is_integer(type);
    std::int64_t const infinite = m.positive_infinity + m.negative_infinity;
    r.nan = m.nan;
    r.inf = infinite;
    r.count = m.finite + m.nan + infinite;
    r.valid = m.finite + infinite > 0;
    if (!r.valid) {
        r.min = r.max = r.sum = r.mean = r.variance = r.stddev = undefined;
        r.product = r.product_log = r.product_sign = undefined;
        r.min_text = r.max_text = r.sum_text = "nan";
        return r;
    }
    long double sum = 0, mean = 0, variance = 0;
    if (integer) {
        sum = static_cast<long double>(m.integer_sum);
        mean = quotient(m.integer_sum, m.finite);
        variance = size_of(type) <= 4 ? exact_variance(m) : m.squared_deviations() / static_cast<long double>(m.finite);
    } else if (infinite > 0) {
        double const infinity = std::numeric_limits<double>::infinity();
        sum = mean = m.negative_infinity == 0 ? infinity : m.positive_infinity == 0 ? -infinity : undefined;
        variance = undefined;
    } else {
        sum = m.sum + m.sum_error;
        mean = sum / static_cast<long double>(m.finite);
        variance = m.squared_deviations() / static_cast<long double>(m.finite);
    }
    Extreme const low = map.slope < 0 ? all.max : all.min, high = map.slope < 0 ? all.min : all.max;
    r.argmin = low.where;
    r.argmax = high.where;
    long double const slope = map.slope, intercept = map.intercept;
    auto const physical = [&](double stored) {
        double const value = map.physical(stored);
        // The product may have no room in double where the sum has.
        return std::isfinite(value) ? value : static_cast<double>(slope * stored + intercept);
    };
    r.min = physical(low.value);
    r.max = physical(high.value);
    r.sum = static_cast<double>(slope * sum + intercept * static_cast<long double>(r.count - r.nan));
    r.mean = static_cast<double>(slope * mean + intercept);
    r.variance = static_cast<double>(slope * slope * variance);
    r.stddev = static_cast<double>(std::abs(slope) * std::sqrt(variance));
    r.product = all.product.sign() == 0 ? 0 : all.product.value(); // not -0
    r.product_log = all.product.logarithm();
    r.product_sign = all.product.sign();
    if (infinite > 0) {
        bool const negative = (map.slope < 0 ? m.positive_infinity : m.negative_infinity) % 2 != 0;
        double const sign = r.product_sign * (negative ? -1 : 1), infinity = std::numeric_limits<double>::infinity();
        r.product_sign = sign == 0 ? undefined : sign;
        r.product = sign == 0 ? undefined : sign * infinity;
        r.product_log = sign == 0 ? undefined : infinity;
    }
    bool const exact = integer && map == ValueMap{};
    r.min_text = exact ? to_text(low.integer) : to_text(r.min);
    r.max_text = exact ? to_text(high.integer) : to_text(r.max);
    r.sum_text = exact ? to_text(m.integer_sum) : to_text(r.sum);
    return r;
}

void Statistics::summarise() {
    result_ = result_of(partial(), input_.dtype, input_.values);
    result_.hierarchical = input_.kind == Kind::hierarchical;
    if (!result_.valid && result_.hierarchical)
        result_.weighted_sum = result_.weighted_mean = result_.weighted_variance = result_.sum;
    else
        weigh(result_);
}

/// Mean and variance over volume: every level adds its sum and its squared deviations, cell volume times.
void Statistics::weigh(StatisticsResult& r) const {
    if (!r.hierarchical) return;
    bool const integer = is_integer(input_.dtype), exact = integer && size_of(input_.dtype) <= 4;
    ValueMap const map = input_.values;
    double const finest =
        input_.geometry.spacing.x * input_.geometry.spacing.y * input_.geometry.spacing.z; // in world units
    long double weight = 0, sum = 0;
    auto const count = [](Moments const& m) {
        return static_cast<long double>(m.finite + m.positive_infinity + m.negative_infinity);
    };
    auto const mean_of = [&](Moments const& m) -> long double {
        return integer ? quotient(m.integer_sum, m.finite) : (m.sum + m.sum_error) / static_cast<long double>(m.finite);
    };
    for (auto const& [cell, level] : levels_) {
        weight += cell * count(level.moments);
        if (level.moments.finite > 0)
            sum += cell * static_cast<long double>(level.moments.finite) * mean_of(level.moments);
    }
    r.volume = static_cast<double>(weight * finest);
    if (r.inf > 0) { // as unweighted
        r.weighted_mean = r.mean;
        r.weighted_sum = r.sum;
        r.weighted_variance = r.variance;
        return;
    }
    long double const mean = sum / weight;
    long double deviations = 0;
    for (auto const& [cell, level] : levels_) {
        Moments const& m = level.moments;
        if (m.finite == 0) continue;
        auto const n = static_cast<long double>(m.finite);
        long double const offset = mean_of(m) - mean;
        deviations += cell * ((exact ? exact_variance(m) * n : m.squared_deviations()) + n * offset * offset);
    }
    long double const slope = map.slope, physical = slope * mean + map.intercept;
    r.weighted_mean = static_cast<double>(physical);
    r.weighted_variance = static_cast<double>(slope * slope * (deviations / weight));
    r.weighted_sum = static_cast<double>(physical * weight * finest);
}

Report report(StatisticsResult const& r) {
    Report report;
    report_into(report, r);
    return report;
}

void report_into(Report& report, StatisticsResult const& r) {
    report.add("count", r.count).add("nan", r.nan).add("inf", r.inf);
    report.add_number("min", r.min_text).add_number("max", r.max_text);
    auto const index = [&](Index3 at) { return r.valid ? std::optional(at) : std::nullopt; };
    report.add("argmin", index(r.argmin)).add("argmax", index(r.argmax));
    report.add_number("sum", r.sum_text);
    report.add("mean", r.mean).add("variance", r.variance).add("stddev", r.stddev);
    report.add("product", r.product).add("product_log", r.product_log).add("product_sign", r.product_sign);
    for (Percentile const& p : r.percentiles) report.add_number(text("p", p.percent), p.digits);
    if (r.hierarchical)
        report.add("weighted_sum", r.weighted_sum)
            .add("weighted_mean", r.weighted_mean)
            .add("weighted_variance", r.weighted_variance)
            .add("volume", r.volume);
}

} // namespace vkt
