// Statistics of volumes as an operation: of all voxels, of a mask, of each label or slice, and of parts that add up.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/spool.h"
#include "libvkt/io/whole_text.h"
#include "libvkt/operations/common/stepped_region.h"
#include "libvkt/operations/statistics/grouped_statistics.h"
#include "libvkt/operations/statistics/statistics.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

namespace {

/// What the rows' keys are; empty of a volume's only row.
char const* key_name(GroupedBy by) {
    switch (by) {
    case GroupedBy::label:
        return "label";
    case GroupedBy::x:
        return "x";
    case GroupedBy::y:
        return "y";
    case GroupedBy::z:
        return "z";
    case GroupedBy::volume:
        break;
    }
    return "";
}

constexpr std::size_t most_statistics_text = std::size_t{1} << 30; // of partial results

Report named(std::string const& name) {
    Report report;
    if (!name.empty()) report.add("name", std::string_view(name));
    return report;
}

/// The mask and the labels of each volume; those of a file that holds one go with all.
class Beside {
public:
    explicit Beside(std::vector<std::unique_ptr<Source>> const& sources) : sources_(sources) {}
    void next() {
        if (sources_.empty()) return;
        for (auto const& source : sources_) {
            bool& one = one_[source.get()];
            if (!one && source->next_volume()) continue;
            one = one || volumes_ == 1;
            if (!one || !source->rewind() || !source->next_volume())
                throw Error(ErrorKind::data, "the mask or the labels hold fewer volumes than the input",
                            "a single volume is used with each of a series if it is a file");
        }
        ++volumes_;
    }
    void end() {
        for (auto const& source : sources_)
            if (!one_[source.get()] && source->next_volume())
                throw Error(ErrorKind::data, "the mask or the labels hold more volumes than the input");
    }

private:
    std::vector<std::unique_ptr<Source>> const& sources_;
    std::map<Source const*, bool> one_; ///< found to hold one volume
    std::size_t volumes_ = 0;           ///< so far
};

/// Reports what Statistics, or GroupedStatistics, find in each volume of each input. With `merged` no volume is read
/// but what was printed as mergeable before.
class Stats : public Operation {
public:
    std::vector<std::string> files, merged;
    std::string mask, labels; ///< volumes beside the only input
    std::optional<Axis> axis; ///< a row for each slice across it
    bool mergeable = false;   ///< reports are exact partial results, in JSON

    std::string_view name() const override { return "stats"; }
    Texts texts() const override {
        return {"Count, extremes and where they are, sum, mean, variance, product of a volume.",
                "One pass, and some more for percentiles. Values are physical (slope * stored + intercept). Sums of "
                "integers are exact; the result is the same bit for bit for every number of threads and slab height. "
                "NaN is counted and otherwise left out; infinities count as values. variance and stddev divide by the "
                "number of values. The product comes with the logarithm of its magnitude and its sign, which are known "
                "where it is too large for a number. Hierarchical volumes: these count every cell once; weighted_mean "
                "and weighted_variance weight cells by their volume, weighted_sum is the integral over the world "
                "volume that the last line states. Cells that hold the volume's background are not counted."
                "\n\n"
                "Accuracy: Counts, extremes and their places, percentiles, and sums of integers of up to 32 bits, are "
                "exact; mean and variance of other types to about 1e-15 of the largest magnitude and its square "
                "(estimate).",
                {{"Of a volume", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"},
                 {"Of a part, for a program",
                  "vkt make noise --dims 40 40 40 --dtype uint8 | vkt stats --roi 10:30,10:30,: --json"},
                 {"Median and tails", "vkt stats volume.nrrd --percentiles 1,50,99"},
                 {"The same of every slice", "vkt stats volume.nrrd --per z --percentiles 1,50,99 --csv"},
                 {"Of each component of what is bright", "vkt threshold volume.nrrd --otsu | vkt label -o labels.nrrd "
                                                         "&& vkt stats volume.nrrd --labels labels.nrrd"},
                 {"Parts, joined", "vkt stats volume.nrrd --roi :,:,0:9 --mergeable > a.json && vkt stats volume.nrrd "
                                   "--roi :,:,9: --mergeable > b.json && vkt stats --merge a.json b.json"}}};
    }

    Shape shape() const override { return Shape::reduction; }
    int inputs() const override { return static_cast<int>(input_names().size()); }
    std::vector<std::string> input_names() const override {
        if (!merged.empty()) return {};
        std::vector<std::string> names = files.empty() ? std::vector<std::string>{"-"} : files;
        if (!mask.empty()) names.push_back(mask);
        if (!labels.empty()) names.push_back(labels);
        return names;
    }

    void parameters(Parameters& p) override {
        p.positional("in", files, "inputs: files of any known format, a stream, or '-' (the default)").optional();
        statistics_.parameters(p);
        p.option("mask", mask, "FILE", "only voxels where this volume, of the same dims and place, is not 0");
        p.option("labels", labels, "FILE", "a row for each label in this volume of integers, 0 among them");
        p.option("per", axis, "AXIS", "a row for each slice across this axis: x, y or z");
        p.flag("mergeable", mergeable, "print JSON that --merge takes").not_in_history();
        p.option("merge", merged, "FILE...", "join what --mergeable printed, instead of reading volumes");
    }

    void check() const override {
        if (!labels.empty() && axis) throw Error(ErrorKind::usage, "--labels and --per both name the rows: give one");
        if (statistics_.percentiles() && mergeable)
            throw Error(ErrorKind::usage, "--percentiles cannot be joined",
                        "vkt histogram --mergeable counts parts that add up");
        if (!merged.empty() && (grouped() || !files.empty() || !statistics_.roi.empty() || statistics_.percentiles()))
            throw Error(ErrorKind::usage,
                        "--merge reads no volumes: --roi, --mask, --labels and --per were for the parts");
        if ((!mask.empty() || !labels.empty()) && files.size() > 1)
            throw Error(ErrorKind::usage, "--mask and --labels go with one input");
    }

    bool prints(ReportForm form) const override { return !mergeable || form == ReportForm::json; }
    Plan plan(std::span<Header const> inputs) const override { return statistics_.plan(inputs); }
    void begin(std::span<Header const> inputs, Plan const& plan) override { statistics_.begin(inputs, plan); }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    void measure(Measurement& to) override {
        if (!merged.empty()) return to.report(report_of("", sum_of_parts(), to.form));
        if (statistics_.roi.has_steps()) {
            stepped_.take(to.inputs, statistics_.roi);
            statistics_.roi = {};
        }
        std::size_t const volumes = files.empty() ? 1 : files.size();
        std::vector<std::unique_ptr<Source>> beside;
        for (std::size_t i = volumes; i < to.inputs.size(); ++i) beside.push_back(std::move(to.inputs[i]));
        for (std::size_t i = 0; i < volumes; ++i) {
            Source& source = *to.inputs[i];
            Beside others(beside);
            to.attempt(volumes, [&] {
                while (source.next_volume()) {
                    others.next();
                    bool const planned = source.header().dry_run;
                    Report report = measured(source, beside, volumes > 1 && to.named ? files[i] : "", to);
                    if (!planned) to.report(std::move(report));
                }
                others.end();
            });
        }
    }

    bool runs_on_gpu() const override { return statistics_.runs_on_gpu(); }

private:
    bool grouped() const { return !mask.empty() || !labels.empty() || axis; }
    GroupedBy by() const {
        if (!labels.empty()) return GroupedBy::label;
        if (!axis) return GroupedBy::volume;
        return *axis == Axis::x ? GroupedBy::x : *axis == Axis::y ? GroupedBy::y : GroupedBy::z;
    }

    /// Slices and extremes as they are counted in the whole volume.
    GroupedResult in_whole(GroupedResult result) const {
        bool const slices = result.by != GroupedBy::volume && result.by != GroupedBy::label;
        auto const number_of = [&](std::int64_t key) {
            if (!slices) return key;
            Index3 const slice = stepped_.in_whole({key, key, key});
            return result.by == GroupedBy::x ? slice.x : result.by == GroupedBy::y ? slice.y : slice.z;
        };
        std::map<std::int64_t, PartialStatistics> groups;
        for (auto& [key, partial] : result.groups) {
            partial.min.where = stepped_.in_whole(partial.min.where);
            partial.max.where = stepped_.in_whole(partial.max.where);
            groups.emplace(number_of(key), partial);
        }
        result.groups = std::move(groups);
        std::map<std::int64_t, std::vector<Percentile>> percentiles;
        for (auto& [key, of_group] : result.percentiles) percentiles.emplace(number_of(key), std::move(of_group));
        result.percentiles = std::move(percentiles);
        return result;
    }

    GroupedResult sum_of_parts() const {
        std::optional<GroupedResult> sum;
        for (std::string const& file : merged) {
            GroupedResult part = grouped_from_json(whole_text(file, most_statistics_text), file);
            if (sum)
                sum->add(part);
            else
                sum = std::move(part);
        }
        return *sum;
    }

    Report measured(Source& source, std::vector<std::unique_ptr<Source>> const& beside, std::string const& name,
                    Measurement const& to) {
        if (!grouped()) {
            if (mergeable && source.header().kind != Kind::structured)
                throw Error(ErrorKind::usage, "--mergeable: statistics of hierarchical volumes cannot be joined");
            reduce(source, statistics_, to.execution, to.info);
            if (source.header().dry_run) return {};
            Report report = named(name);
            StatisticsResult result = statistics_.result();
            if (!result.hierarchical) {
                result.argmin = stepped_.in_whole(result.argmin);
                result.argmax = stepped_.in_whole(result.argmax);
            }
            report_into(report, result);
            if (mergeable) {
                GroupedResult all;
                all.type = source.header().dtype;
                all.values = source.header().values;
                all.groups[0] = statistics_.partial();
                report.write_as(ReportForm::json, to_json(in_whole(all)));
            }
            return report;
        }
        GroupedStatistics groups;
        groups.roi = statistics_.roi;
        groups.by = by();
        groups.percents = statistics_.percents();
        // Percentiles take several passes over what is read beside the volume, too.
        constexpr std::size_t share = 4;
        std::vector<std::unique_ptr<Source>> kept;
        auto const readable = [&](Source& from) -> Source* {
            bool const once = from.access() == Access::forward && !source.header().dry_run && !from.header().dry_run;
            if (!statistics_.percentiles() || !once) return &from;
            kept.push_back(spooled(from, share, to.execution, to.info));
            return kept.back().get();
        };
        if (!mask.empty()) groups.mask = readable(*beside.front());
        if (!labels.empty()) groups.labels = readable(*beside.back());
        reduce(*readable(source), groups, to.execution, to.info);
        for (auto const& other : beside)
            if (other.get() == groups.mask || other.get() == groups.labels) other->finish();
        return report_of(name, in_whole(groups.result()), to.form);
    }

    Report report_of(std::string const& name, GroupedResult const& result, ReportForm form) const {
        Report report = named(name);
        std::vector<Report> rows;
        for (auto const& [key, partial] : result.groups) {
            StatisticsResult of_row = result_of(partial, result.type, result.values);
            if (auto const found = result.percentiles.find(key); found != result.percentiles.end())
                of_row.percentiles = found->second;
            if (result.by == GroupedBy::volume) {
                report_into(report, of_row);
                continue;
            }
            rows.emplace_back().add_number(key_name(result.by), result.key_text(key));
            report_into(rows.back(), of_row);
        }
        if (result.by != GroupedBy::volume) {
            if (form == ReportForm::text)
                report.write_as(ReportForm::text, rows.empty() ? "no voxels\n" : Report::table(rows));
            report.add(result.by == GroupedBy::label ? "labels" : "slices", std::move(rows));
        }
        if (mergeable) report.write_as(ReportForm::json, to_json(result));
        return report;
    }

    Statistics statistics_;
    SteppedRegion stepped_;
};

} // namespace

VKT_OPERATION(Stats, "stats")

} // namespace vkt
