// vkt stats: all aggregates of a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"
#include "libvkt/operations/statistics.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

class Stats : public Consumer {
public:
    void parameters(Parameters& p) override { statistics_.parameters(p); }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        std::vector<Report> reports;
        Source& source = *inputs.front();
        while (source.next_volume()) {
            reduce(source, statistics_, context.execution(), context.stage_info());
            if (!source.header().dry_run) reports.push_back(report(statistics_.result()));
        }
        if (!reports.empty()) context.print(context.json() ? Report::json(reports) : Report::text(reports));
        return 0;
    }

private:
    Statistics statistics_;
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
         "world volume that the last line states. Cells that hold the volume's background are not counted.",
         {{"Of a volume", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"},
          {"Of a part, for a program",
           "vkt make noise --dims 40 40 40 --dtype uint8 | vkt stats --roi 10:30,10:30,: --json"},
          {"Median and tails", "vkt stats volume.nrrd --percentiles 1,50,99"}}});
}

} // namespace vkt::shell
