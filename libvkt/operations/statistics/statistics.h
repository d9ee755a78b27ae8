// All aggregates of a volume in one pass: counts, extremes and where they are, exact sums, mean, variance.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/report.h"
#include "libvkt/core/wide.h"
#include "libvkt/engine/operation.h"
#include "libvkt/kernel/host_device.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/statistics/quantiles.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// What is known about (a part of) one line, slice or volume; append() adds what follows in x-fastest order. Integers
/// up to 32 bits keep exact sums of values and squares; the others keep mean and sum of squared deviations, which are
/// merged by Chan, Golub and LeVeque's update ("Updating formulae and a pairwise algorithm", 1979) in a fixed order.
///
/// Sums are long double: its exponent has room for sums and squares of all doubles, the largest and the least.
struct Moments {
    std::int64_t finite = 0, nan = 0, positive_infinity = 0, negative_infinity = 0;
    Int128 integer_sum = 0;             ///< integers: exact sum
    Unsigned128 squares = 0;            ///< integers up to 32 bits: exact sum of squares
    long double sum = 0, sum_error = 0; ///< floats: sum of the finite values, and the part that rounding lost
    long double mean = 0;               ///< floats and 64-bit integers: mean less the origin
    long double deviations = 0, deviations_error = 0; ///< sum of (value - mean)^2, and the part that rounding lost

    long double squared_deviations() const { return deviations + deviations_error; }

    /// `exact`: only counts and integer sums matter.
    void append(Moments const& next, bool exact);

private:
    void append_sum(Moments const& next);
};

/// The same of floats of up to 32 bits, whose sums have room in double: sums in two doubles, merged by the same update,
/// to the same bits on every back end.
struct FloatMoments {
    std::int64_t finite = 0, nan = 0, above = 0, below = 0;
    double sum = 0, sum_error = 0;
    double mean = 0, mean_error = 0; ///< less the origin
    double deviations = 0, deviations_error = 0;

    VKT_HD void append(FloatMoments const& next) { append(next, share(finite, next.finite)); }
    /// What part of both's finite values the next ones are.
    VKT_HD static double share(std::int64_t before, std::int64_t next) {
        auto const a = static_cast<double>(before), b = static_cast<double>(next);
        return next == 0 ? 0 : b / (a + b);
    }
    /// The same where that share is known: a division waits for nothing but counts.
    VKT_HD void append(FloatMoments const& next, double share) {
        nan += next.nan;
        above += next.above;
        below += next.below;
        add(sum, sum_error, next.sum);
        sum_error += next.sum_error;
        if (next.finite == 0) return;
        if (finite == 0) {
            finite = next.finite;
            mean = next.mean;
            mean_error = next.mean_error;
            deviations = next.deviations;
            deviations_error = next.deviations_error;
            return;
        }
        auto const a = static_cast<double>(finite);
        double const difference = next.mean - mean, back = difference - next.mean;
        double const lost = (next.mean - (difference - back)) - (mean + back) + (next.mean_error - mean_error);
        double const delta = difference + lost;
        add(deviations, deviations_error, next.deviations);
        add(deviations, deviations_error, delta * delta * a * share);
        deviations_error += next.deviations_error;
        add(mean, mean_error, difference * share);
        mean_error += lost * share;
        finite += next.finite;
    }

private:
    /// With the rounding error kept (Knuth, TAOCP 2, 4.2.2).
    VKT_HD static void add(double& sum, double& error, double value) {
        double const next = sum + value, back = next - sum;
        error += (sum - (next - back)) + (value - back);
        sum = next;
    }
};
Moments moments_of(FloatMoments const& m);

/// A product that neither overflows nor vanishes: mantissa * 2^exponent, the mantissa in [1,2), or 0. Each factor costs
/// a relative error of 2^-53 at most.
struct Product {
    long double mantissa = 1;
    std::int64_t exponent = 0;

    void multiply(Product const& next);
    double value() const;     ///< infinite, or 0, where double has no room
    double logarithm() const; ///< natural, of the magnitude; -inf of 0
    int sign() const { return mantissa > 0 ? 1 : mantissa < 0 ? -1 : 0; }
};

/// Smallest and largest value of some rows: as a float, or as an integer (128 bits hold every integer type).
struct Range {
    bool valid = false;
    double low = 0, high = 0;
    Int128 integer_low = 0, integer_high = 0;
};

/// The volume's first finite voxel. Means are kept as differences from it, so that a large common offset costs no
/// digits.
struct MeanOrigin {
    bool known = false;
    double value = 0;
    Int128 integer = 0;
};

/// What neighbouring rows of one slice contribute.
struct BandStatistics {
    FloatMoments narrow; ///< of floats of up to 32 bits, `moments` of all others
    Moments moments;
    Range range;
    Product product; ///< of the finite physical values, if asked for
};

/// What the bands of a slice, or of some of its rows, are together.
struct SliceStatistics {
    FloatMoments narrow; ///< of floats of up to 32 bits, `moments` of all others
    Moments moments;
    Product product;
    Range range;
    std::int64_t low_band = 0, high_band = 0; ///< the first that has the extreme

    void append(BandStatistics const& band, std::int64_t number, DataType type);
};
/// Floats of up to 32 bits have FloatMoments.
inline bool has_float_moments(DataType type) { return !is_integer(type) && size_of(type) <= 4; }

/// Short rows are summed several at a time, so that they cost no more than long ones; of small voxels, which cost
/// little, more. How many depends on their length and type alone, so that slabs do not matter.
inline std::int64_t rows_in_band(Index3 dims, DataType type) {
    std::int64_t const voxels = is_integer(type) && size_of(type) <= 2 ? 16384 : 4096;
    return std::clamp<std::int64_t>(voxels / dims.x, 1, dims.y);
}
inline std::int64_t bands_in_slice(Index3 dims, DataType type) {
    std::int64_t const rows = rows_in_band(dims, type);
    return (dims.y + rows - 1) / rows;
}

/// An extreme value and the first voxel in x-fastest order that has it.
struct Extreme {
    bool valid = false;
    double value = 0;
    Int128 integer = 0;
    Index3 where;
};

/// All that is known of some voxels: the same of more of them follows by append().
struct PartialStatistics {
    Moments moments;
    MeanOrigin origin;
    Extreme min, max;
    Product product; ///< of the finite physical values

    /// `type`: of the voxels. What comes first keeps the position of an extreme that both have.
    void append(PartialStatistics const& next, DataType type);
};

/// Percents in [0,100], as "1,50,99".
struct PercentList {
    std::vector<double> values;
    /// The same of stored values, where these are percents of physical ones.
    std::vector<double> of_stored(ValueMap const& map) const;
    friend bool operator==(PercentList const&, PercentList const&) = default;
};
template <> struct ValueText<PercentList> : OneWord {
    static PercentList read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(PercentList const& v);
};

/// A value below which a share of the finite ones lies.
struct Percentile {
    double percent = 0;
    std::string digits; ///< of the physical value; exact for integers, "nan" if there is no finite value
};

Percentile percentile_of(double percent, StoredValue const& stored, ValueMap const& map);

/// Results in physical values (slope * stored + intercept). Exact texts where the stored values are integers and the
/// value map is the identity.
struct StatisticsResult {
    std::int64_t count = 0, nan = 0, inf = 0; ///< count includes NaN and infinities
    bool valid = false;                       ///< false if there is no number at all: min … stddev are NaN
    /// Variance with ddof 0. What double has no room for (the variance of values near 1e200) is infinite.
    double min = 0, max = 0, sum = 0, mean = 0, variance = 0, stddev = 0;
    Index3 argmin, argmax; ///< voxel indices in the whole volume, first in x-fastest order
    /// Of the values: infinite where double has no room; its sign and the logarithm of its magnitude are known all the
    /// same. NaN: there is no number, or 0 times infinity.
    double product = 1, product_log = 0, product_sign = 1;
    /// Hierarchical volumes: the same weighted by the world volume of the cells; weighted_sum is the integral, `volume`
    /// that of the cells that count. Extremes are named by their cell's first finest cell. Structured volumes: 0.
    bool hierarchical = false;
    double weighted_sum = 0, weighted_mean = 0, weighted_variance = 0, volume = 0;
    std::vector<Percentile> percentiles;      ///< as asked for
    std::string min_text, max_text, sum_text; ///< exact decimals for integers, shortest round trip otherwise; "nan"
};

Report report(StatisticsResult const& result);
/// The same after what the report says already.
void report_into(Report& report, StatisticsResult const& result);
/// What follows from the sums over a structured volume of this type.
StatisticsResult result_of(PartialStatistics const& all, DataType type, ValueMap const& map);

/// Reduction. NaN is skipped and counted. Infinities count as values: mean and sum become infinite, variance NaN.
/// The result is the same bit for bit for every thread count, slab height and instruction set: rows are summed
/// in 16 lanes, bands of rows are merged in order, then slices. Cells of hierarchical volumes are counted one by one,
/// and once more weighted by their volume; those whose centres lie in the region, which is the volume's own (attribute
/// "roi") if none is given. Cells that hold the volume's background (attribute "background") are not counted, whether
/// they are stored or not: blocks are filled up with them. Cost: one read of the volume, O(rows of a slab) memory.
/// Percentiles are those of Quantiles, of cells one by one; types of more than 16 bits take up to three more passes.
class Statistics : public Operation {
public:
    Roi roi; ///< part to look at; empty: all

    std::string_view name() const override { return "stats"; }
    Shape shape() const override { return Shape::reduction; }
    void parameters(Parameters& p) override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void enter_level(Index3 cell_width, Index3 first) override;
    Box scanned(Box const& whole) const override { return intersect(whole, region_.box()); }
    std::int64_t scan_step(Index3 part) const override { return rows_in_band(part, input_.dtype); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    bool runs_on_gpu() const override { return true; }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}

    StatisticsResult const& result() const { return result_; }
    PartialStatistics partial() const { return {total_, origin_, min_, max_, product_}; }
    bool percentiles() const { return !percents_.values.empty(); }
    PercentList const& percents() const { return percents_; }

private:
    /// Sums of the cells of one volume, in finest cells.
    struct Weighted {
        double cell = 1;
        Moments moments;
    };
    std::optional<Quantiles> quantiles_for(Header const& in) const;
    void append(SliceStatistics const& slice);
    void append(Moments const& slice, bool exact);
    void scan_foreground(ConstView part, Execution const& execution);
    void merge_extremes(ConstView slab);
    void merge_extremes(ConstView slab, Range const& range);
    Index3 finest_cell(Index3 cell) const;
    void weigh(StatisticsResult& result) const;
    /// For band_statistics: of no interest once a factor was 0.
    ValueMap const* product_map() const { return product_.mantissa == 0 ? nullptr : &input_.values; }
    void summarise();
    void set_percentiles();

    PercentList percents_;
    std::optional<Quantiles> quantiles_;
    bool first_pass_ = true, scans_again_ = false;
    Header input_;
    LevelRegion region_;
    Index3 width_{1, 1, 1};             ///< of a cell, in finest cells
    Index3 first_cell_;                 ///< where the level's first cell begins, in finest cells
    std::optional<double> background_;  ///< stored value of cells that are not counted
    std::map<double, Weighted> levels_; ///< hierarchical volumes: by the volume of a cell
    Weighted* level_ = nullptr;
    Moments total_;
    MeanOrigin origin_;
    Extreme min_, max_;
    Product product_;
    std::vector<BandStatistics> bands_;   ///< scratch: of a slab
    std::vector<SliceStatistics> slices_; ///< scratch: one per slice of a slab
    SliceStatistics slice_;               ///< of the slice that comes in pieces
    std::vector<std::byte> foreground_;   ///< scratch: cells of a slab without those of the background
    StatisticsResult result_;
};

} // namespace vkt
