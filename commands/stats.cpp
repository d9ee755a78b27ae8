// vkt stats: all aggregates of volumes, of masks, labels and slices, and of parts that add up.
// SPDX-License-Identifier: MIT
#include "libvkt/core/report.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/operations/grouped_statistics.h"
#include "shell/command.h"

namespace vkt::shell {
namespace {

/// One line: of a volume, or of the label or slice that the key names.
struct Row {
    std::string key;
    StatisticsResult result;
};

/// One volume's statistics.
struct Found {
    std::string name; ///< of the input, where there are several
    std::vector<Row> rows;
    GroupedResult groups; ///< what the rows are of, and what --mergeable prints
};

std::string csv_word(std::string const& word) {
    if (word.find_first_of(",\"\n\r") == std::string::npos) return word;
    std::string quoted = "\"";
    for (char const c : word) quoted += c == '"' ? "\"\"" : std::string(1, c);
    return quoted + "\"";
}

/// A line of names and a line of values; what is not a number is "nan" or "inf".
std::pair<std::string, std::string> csv_lines(StatisticsResult const& r) {
    std::string names = "count,nan,inf,min,max,argmin_x,argmin_y,argmin_z,argmax_x,argmax_y,argmax_z,sum,mean,variance,"
                        "stddev,product,product_log,product_sign";
    auto const index = [&](Index3 i) { return r.valid ? text(i.x, ",", i.y, ",", i.z) : std::string("nan,nan,nan"); };
    std::string values = text(r.count, ",", r.nan, ",", r.inf, ",", r.min_text, ",", r.max_text, ",", index(r.argmin),
                              ",", index(r.argmax), ",", r.sum_text, ",", r.mean, ",", r.variance, ",", r.stddev, ",",
                              r.product, ",", r.product_log, ",", r.product_sign);
    for (Percentile const& p : r.percentiles) {
        names += text(",p", p.percent);
        values += text(",", p.digits);
    }
    if (r.hierarchical) {
        names += ",weighted_sum,weighted_mean,weighted_variance,volume";
        values += text(",", r.weighted_sum, ",", r.weighted_mean, ",", r.weighted_variance, ",", r.volume);
    }
    return {names, values};
}

class Stats : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.positional("in", files_, "inputs: files of any known format, a stream, or '-' (the default)").optional();
        statistics_.parameters(p);
        p.option("mask", mask_, "FILE", "only voxels where this volume, of the same dims and place, is not 0");
        p.option("labels", labels_, "FILE", "a row for each label in this volume of integers, 0 among them");
        p.option("per", axis_, "AXIS", "a row for each slice across this axis: x, y or z");
        p.flag("csv", csv_, "print CSV: names, then a line for each volume or row").not_in_history();
        p.flag("mergeable", mergeable_, "print JSON that --merge takes").not_in_history();
        p.option("merge", merged_, "FILE...", "join what --mergeable printed, instead of reading volumes");
    }
    void check() const override {
        if (!labels_.empty() && axis_) throw Error(ErrorKind::usage, "--labels and --per both name the rows: give one");
        if (csv_ && mergeable_) throw Error(ErrorKind::usage, "--csv and --mergeable contradict each other");
        if (statistics_.percentiles() && (grouped() || mergeable_))
            throw Error(ErrorKind::usage, "--percentiles are of whole volumes and regions, and cannot be joined",
                        "vkt histogram --mergeable counts parts that add up");
        if (!merged_.empty() && (grouped() || !files_.empty() || !statistics_.roi.empty() || statistics_.percentiles()))
            throw Error(ErrorKind::usage,
                        "--merge reads no volumes: --roi, --mask, --labels and --per were for the parts");
    }
    std::vector<std::string> input_names() const override {
        if (!merged_.empty()) return {};
        std::vector<std::string> names = files_.empty() ? std::vector<std::string>{"-"} : files_;
        if (!mask_.empty()) names.push_back(mask_);
        if (!labels_.empty()) names.push_back(labels_);
        return names;
    }
    int inputs() const override { return merged_.empty() ? 1 : 0; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        std::vector<Found> found;
        if (!merged_.empty()) {
            found.push_back(from_groups("", merged()));
        } else {
            std::size_t const volumes = inputs.size() - (mask_.empty() ? 0 : 1) - (labels_.empty() ? 0 : 1);
            std::vector<std::unique_ptr<Source>> beside;
            for (std::size_t i = volumes; i < inputs.size(); ++i) beside.push_back(std::move(inputs[i]));
            if (!beside.empty() && volumes > 1) throw Error(ErrorKind::usage, "--mask and --labels go with one input");
            for (std::size_t i = 0; i < volumes; ++i) {
                std::string const name = files_.empty() ? "-" : files_[i];
                while (inputs[i]->next_volume()) {
                    bool const planned = inputs[i]->header().dry_run;
                    Found one = found_in(*inputs[i], beside, context);
                    one.name = volumes > 1 ? name : "";
                    if (!planned) found.push_back(std::move(one));
                }
            }
        }
        if (!found.empty()) context.print(text_of(found, context.json()));
        return 0;
    }

private:
    bool grouped() const { return !mask_.empty() || !labels_.empty() || axis_; }

    GroupedBy by() const {
        if (!labels_.empty()) return GroupedBy::label;
        if (!axis_) return GroupedBy::volume;
        return *axis_ == Axis::x ? GroupedBy::x : *axis_ == Axis::y ? GroupedBy::y : GroupedBy::z;
    }

    Found found_in(Source& source, std::vector<std::unique_ptr<Source>>& beside, Context& context) {
        if (!grouped()) {
            if (mergeable_ && source.header().kind != Kind::structured)
                throw Error(ErrorKind::usage, "--mergeable: statistics of hierarchical volumes cannot be joined");
            reduce(source, statistics_, context.execution(), context.stage_info());
            if (source.header().dry_run) return {};
            GroupedResult all;
            if (mergeable_) {
                all.type = source.header().dtype;
                all.values = source.header().values;
                all.groups[0] = statistics_.partial();
            }
            return {"", {{"", statistics_.result()}}, std::move(all)};
        }
        GroupedStatistics groups;
        groups.roi = statistics_.roi;
        groups.by = by();
        for (auto const& other : beside)
            if (!other->next_volume())
                throw Error(ErrorKind::data, "the mask or the labels hold fewer volumes than the input");
        if (!mask_.empty()) groups.mask = beside.front().get();
        if (!labels_.empty()) groups.labels = beside.back().get();
        reduce(source, groups, context.execution(), context.stage_info());
        for (auto const& other : beside) other->finish();
        return from_groups("", groups.result());
    }

    /// What the rows' keys are; empty of a volume's only row.
    static char const* key_name(GroupedBy by) {
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

    static Found from_groups(std::string name, GroupedResult result) {
        Found found{std::move(name), {}, std::move(result)};
        GroupedResult const& r = found.groups;
        for (auto const& [key, partial] : r.groups)
            found.rows.push_back({r.key_text(key), result_of(partial, r.type, r.values)});
        return found;
    }

    GroupedResult merged() const {
        std::optional<GroupedResult> sum;
        for (std::string const& file : merged_) {
            auto const bytes = open_bytes(file);
            std::string content;
            constexpr std::size_t most = std::size_t{1} << 30, piece = std::size_t{1} << 16;
            for (std::size_t n = 1; n > 0 && content.size() < most;) {
                std::size_t const before = content.size();
                content.resize(before + piece);
                n = bytes->read(content.data() + before, piece);
                content.resize(before + n);
            }
            GroupedResult part = grouped_from_json(content, file);
            if (sum)
                sum->add(part);
            else
                sum = std::move(part);
        }
        return *sum;
    }

    std::string text_of(std::vector<Found> const& found, bool json) const {
        if (mergeable_) {
            std::string all = found.size() > 1 ? "[\n" : "";
            for (std::size_t i = 0; i < found.size(); ++i) all += text(i > 0 ? ",\n" : "", to_json(found[i].groups));
            return all + (found.size() > 1 ? "\n]\n" : "\n");
        }
        if (csv_) return csv_of(found);
        std::vector<Report> reports;
        std::string tables;
        for (Found const& one : found) {
            bool const rows = one.groups.by != GroupedBy::volume;
            Report report;
            if (!one.name.empty()) report.add("name", std::string_view(one.name));
            if (!rows) {
                report_into(report, one.rows.front().result);
            } else {
                std::vector<Report> const all = reports_of(one);
                report.add(one.groups.by == GroupedBy::label ? "labels" : "slices", all);
                tables += text(tables.empty() ? "" : "\n", all.empty() ? "no voxels\n" : Report::table(all));
            }
            reports.push_back(std::move(report));
        }
        if (json) return Report::json(reports);
        return tables.empty() ? Report::text(reports) : tables;
    }

    static std::vector<Report> reports_of(Found const& found) {
        std::vector<Report> reports;
        for (Row const& row : found.rows) {
            Report& report = reports.emplace_back();
            report.add_number(key_name(found.groups.by), row.key);
            report_into(report, row.result);
        }
        return reports;
    }

    static std::string csv_of(std::vector<Found> const& found) {
        std::string lines, last_names;
        for (Found const& one : found)
            for (Row const& row : one.rows) {
                auto [names, values] = csv_lines(row.result);
                if (std::string const key = key_name(one.groups.by); !key.empty()) {
                    names.insert(0, key + ",");
                    values.insert(0, row.key + ",");
                }
                if (!one.name.empty()) {
                    names.insert(0, "name,");
                    values.insert(0, csv_word(printable(one.name)) + ",");
                }
                if (names != last_names) lines += names + "\n";
                last_names = names;
                lines += values + "\n";
            }
        return lines;
    }

    std::vector<std::string> files_, merged_;
    std::string mask_, labels_;
    std::optional<Axis> axis_;
    bool csv_ = false, mergeable_ = false;
    Statistics statistics_;
};

} // namespace

Command stats_command() {
    return consumer_command<Stats>(
        {"Count, extremes and where they are, sum, mean, variance, product of a volume.",
         "One pass. Values are physical (slope * stored + intercept). Sums of integers are exact; the result is the "
         "same bit for "
         "bit for every number of threads and slab height. NaN is counted and otherwise left out; infinities count as "
         "values. "
         "variance and stddev divide by the number of values. The product comes with the logarithm of its magnitude "
         "and its sign, which are known where it is too large for a number. Hierarchical volumes: these count every "
         "cell once; "
         "weighted_mean and weighted_variance weight cells by their volume, weighted_sum is the integral over the "
         "world volume that the last line states. Cells that hold the volume's background are not counted.",
         {{"Of a volume", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"},
          {"Of a part, for a program",
           "vkt make noise --dims 40 40 40 --dtype uint8 | vkt stats --roi 10:30,10:30,: --json"},
          {"Median and tails", "vkt stats volume.nrrd --percentiles 1,50,99"},
          {"Of each component of what is bright",
           "vkt threshold volume.nrrd --otsu | vkt label -o labels.nrrd && vkt stats volume.nrrd --labels labels.nrrd"},
          {"Parts, joined",
           "vkt stats volume.nrrd --roi :,:,0:9 --mergeable > a.json && vkt stats volume.nrrd --roi :,:,9: "
           "--mergeable > b.json && vkt stats --merge a.json b.json"}}});
}

} // namespace vkt::shell
