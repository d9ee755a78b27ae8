// The histogram of a volume, partial ones that can be added up, and their texts.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/common/stepped_region.h"
#include "libvkt/operations/statistics/bins.h"
#include "libvkt/operations/statistics/range_option.h"
#include "libvkt/operations/statistics/voxel_counts.h"

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Counts of physical values. Infinities are under or over the range.
struct HistogramResult {
    std::vector<std::string> edges; ///< one more than bins, as numbers that read back as themselves
    std::vector<std::uint64_t> counts;
    std::uint64_t under = 0, over = 0, nan = 0;
    /// Hierarchical volumes: the world volume of the cells of each bin; empty otherwise.
    std::vector<double> volumes;
    bool mergeable = false;

    std::uint64_t largest() const;
    /// Bins of the same edges are added up. Throws Error{data} if the edges differ, or only one of them has volumes.
    void add(HistogramResult const& other);
};

/// An object with low, high, counts, nan, under, over, edges and perhaps volumes.
std::string to_json(HistogramResult const& result);
/// Lines of low, high, count: what is under the range first, then the bins, what is over it, and NaN.
std::string to_csv(HistogramResult const& result);
/// The same in aligned columns, for people.
std::string to_table(HistogramResult const& result);
/// Bars of characters, several bins a line where there are more than `lines`; their lengths are logarithmic if asked.
std::string to_bars(HistogramResult const& result, int lines, int width, bool logarithmic);
/// Those that to_json() wrote as mergeable, added up per file. Throws Error{data} for anything else.
HistogramResult histogram_from_json(std::string_view json, std::string const& name);

/// Counts values in equal bins (see Bins) from LO to HI, by default the extremes of the finite values; a range of a
/// single value is widened by 1/2 to both sides. Exact: counts depend on nothing but the values. Cells of hierarchical
/// volumes count one by one, and once more by their volume; those that hold the background do not count.
///
/// One pass with a range of numbers or of types of at most 16 bits; one to four more to find the range.
class Histogram : public Operation {
public:
    Roi roi;                         ///< part to look at; empty: all
    bool mergeable = false;          ///< reports are JSON that add up
    std::vector<std::string> merged; ///< files of such, to be added up instead of reading a volume

    std::string_view name() const override { return "histogram"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return merged.empty() ? 1 : 0; }
    void parameters(Parameters& p) override;
    void check() const override;
    bool prints(ReportForm form) const override { return !mergeable || form == ReportForm::json; }
    void measure(Measurement& to) override;
    Report report() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Header const& header() const { return input_; } ///< of the volume just counted
    void enter_level(Index3 cell_width, Index3 first) override;
    bool uses_position() const override { return !(region_.finest() == box_of(input_.dims)); }
    Box scanned(Box const& whole) const override { return intersect(whole, region_.box()); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    bool runs_on_gpu() const override { return merged.empty(); }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}

    HistogramResult const& result() const { return result_; }

private:
    Bins bins_between(RangeScan const& ends, Header const& in) const;
    void finish();
    void count(ConstView cells, Execution const& execution);

    SteppedRegion stepped_;
    static constexpr int usual_bins = 256;
    static RangeOption minmax() { return {{true, Number(0)}, {true, Number(100)}}; }
    int bin_count_ = usual_bins;
    RangeOption range_ = minmax();

    Header input_;
    LevelRegion region_;
    std::optional<double> background_;
    std::optional<RangeScan> ends_;
    bool range_known_ = false, scans_again_ = false;
    bool by_pattern_ = false; ///< values are counted while their range is looked for
    Bins bins_, counted_in_;
    std::map<double, VoxelCounts> levels_; ///< counts by the volume of a cell, in finest cells
    VoxelCounts* counts_ = nullptr;
    std::vector<std::byte> foreground_;
    HistogramResult result_;
};

} // namespace vkt
