// Statistics of volumes as an operation: of all voxels, of a mask, of each label or slice, and of parts that add up.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/common/stepped_region.h"
#include "libvkt/operations/statistics/grouped_statistics.h"
#include "libvkt/operations/statistics/statistics.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Reports what Statistics, or GroupedStatistics, find in each volume of each input. With `merged` no volume is read
/// but what was printed as mergeable before.
class Stats : public Operation {
public:
    std::vector<std::string> files, merged;
    std::string mask, labels; ///< volumes beside the only input
    std::optional<Axis> axis; ///< a row for each slice across it
    bool mergeable = false;   ///< reports are exact partial results, in JSON

    std::string_view name() const override { return "stats"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return static_cast<int>(input_names().size()); }
    std::vector<std::string> input_names() const override;
    void parameters(Parameters& p) override;
    void check() const override;
    bool prints(ReportForm form) const override { return !mergeable || form == ReportForm::json; }
    Plan plan(std::span<Header const> inputs) const override { return statistics_.plan(inputs); }
    void begin(std::span<Header const> inputs, Plan const& plan) override { statistics_.begin(inputs, plan); }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override;
    bool runs_on_gpu() const override {
        return !grouped() && !statistics_.roi.has_steps() && statistics_.runs_on_gpu();
    }

private:
    bool grouped() const { return !mask.empty() || !labels.empty() || axis; }
    GroupedBy by() const;
    GroupedResult in_whole(GroupedResult result) const;
    GroupedResult sum_of_parts() const;
    Report measured(Source& source, std::vector<std::unique_ptr<Source>> const& beside, std::string const& name,
                    Measurement const& to);
    Report report_of(std::string const& name, GroupedResult const& result, ReportForm form) const;

    Statistics statistics_;
    SteppedRegion stepped_;
};

} // namespace vkt
