// vkt stats: all aggregates of a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics.h"
#include "shell/command.h"
#include "shell/report.h"

namespace vkt::shell {
namespace {

class Stats : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.option("roi", roi_, "X0:X1,Y0:Y1,Z0:Z1", "look only at these voxels (half-open)");
    }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        std::vector<Report> reports;
        Source& source = *inputs.front();
        while (source.next_volume()) {
            Statistics statistics;
            statistics.roi = roi_;
            reduce(source, statistics, context.execution(), context.stage_info());
            if (!source.header().dry_run) reports.push_back(report(statistics.result()));
        }
        if (!reports.empty()) context.print(context.json() ? Report::json(reports) : Report::text(reports));
        return 0;
    }

private:
    static Report report(StatisticsResult const& r) {
        Report report;
        report.add("count", r.count).add("nan", r.nan).add("inf", r.inf);
        report.add_number("min", r.min_text).add_number("max", r.max_text);
        if (r.valid)
            report.add("argmin", r.argmin).add("argmax", r.argmax);
        else
            report.add_number("argmin", "nan").add_number("argmax", "nan");
        report.add_number("sum", r.sum_text);
        report.add("mean", r.mean).add("variance", r.variance).add("stddev", r.stddev);
        if (r.hierarchical)
            report.add("weighted_sum", r.weighted_sum)
                .add("weighted_mean", r.weighted_mean)
                .add("weighted_variance", r.weighted_variance)
                .add("volume", r.volume);
        return report;
    }

    Roi roi_;
};

} // namespace

Command stats_command() {
    return consumer_command<Stats>(
        {"Count, extremes and where they are, sum, mean, variance of a volume.",
         "One pass. Values are physical (slope * stored + intercept). Sums of integers are exact; the result is the "
         "same bit for "
         "bit for every number of threads and slab height. NaN is counted and otherwise left out; infinities count as "
         "values. "
         "variance and stddev divide by the number of values. Hierarchical volumes: these count every cell once; "
         "weighted_mean and weighted_variance weight cells by their volume, weighted_sum is the integral over the "
         "world volume that the last line states.",
         {{"Of a volume", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"},
          {"Of a part, for a program",
           "vkt make noise --dims 40 40 40 --dtype uint8 | vkt stats --roi 10:30,10:30,: --json"}}});
}

} // namespace vkt::shell
