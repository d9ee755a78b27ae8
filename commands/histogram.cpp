// vkt histogram: how often values occur, as text, JSON, CSV or a picture.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/histogram.h"

#include "libvkt/formats/series.h"
#include "libvkt/io/byte_source.h"
#include "libvkt/io/output_file.h"
#include "libvkt/render/bar_chart.h"
#include "shell/command.h"
#include "shell/terminal.h"

#include <cmath>

namespace vkt::shell {
namespace {

class HistogramCommand : public Consumer {
public:
    void parameters(Parameters& p) override {
        histogram_.parameters(p);
        p.flag("log", log_, "bars as long as the logarithm of 1 + count");
        p.flag("csv", csv_, "print CSV: low,high,count");
        p.flag("mergeable", mergeable_, "print JSON that --merge takes; --range must be numbers");
        p.option("merge", merged_, "FILE...", "add up what --mergeable printed, instead of reading a volume");
        p.option("output", output_, "OUT", "output file: .png and .svg are pictures").short_form('o').not_in_history();
        p.flag("force", force_, "overwrite an existing output file").not_in_history();
    }
    void check() const override {
        histogram_.check();
        if (mergeable_ && merged_.empty() && histogram_.range().depends())
            throw Error(ErrorKind::usage, "--mergeable needs the same range for all parts", "say --range LO:HI");
        if (csv_ && mergeable_) throw Error(ErrorKind::usage, "--csv and --mergeable contradict each other");
        if (is_picture() && (csv_ || mergeable_))
            throw Error(ErrorKind::usage, text("'", output_, "' is a picture: --csv and --mergeable are text"));
        if (log_ && csv_) throw Error(ErrorKind::usage, "--log is about bars, --csv has none");
        if (output_ != "-") check_output(numbered_path(output_, 0), force_);
    }
    int inputs() const override { return merged_.empty() ? 1 : 0; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        std::vector<HistogramResult> results;
        if (!merged_.empty()) {
            results.push_back(merged());
        } else {
            Source& source = *inputs.front();
            while (source.next_volume()) {
                reduce(source, histogram_, context.execution(), context.stage_info());
                if (source.header().dry_run) continue;
                results.push_back(histogram_.result());
                results.back().mergeable = mergeable_;
            }
        }
        if (results.empty()) return 0; // a dry run
        if (is_picture())
            draw(results);
        else
            write(output_, text_of(results, context.json() || mergeable_));
        return 0;
    }

private:
    bool is_picture() const { return ends_in(".png") || ends_in(".svg"); }
    bool ends_in(char const* suffix) const { return lower_case(output_).ends_with(suffix); }

    HistogramResult merged() const {
        std::optional<HistogramResult> sum;
        for (std::string const& file : merged_) {
            HistogramResult part = histogram_from_json(whole_text(file), file);
            if (sum)
                sum->add(part);
            else
                sum = std::move(part);
        }
        sum->mergeable = mergeable_;
        return *sum;
    }

    static std::string whole_text(std::string const& file) {
        constexpr std::size_t most = std::size_t{64} << 20; // no 65536 bins take more
        auto const bytes = open_bytes(file);
        std::string content;
        while (content.size() <= most) {
            std::size_t const before = content.size();
            content.resize(before + 65536);
            std::size_t const n = bytes->read(content.data() + before, 65536);
            content.resize(before + n);
            if (n == 0) return content;
        }
        throw Error(ErrorKind::data, text("'", file, "' is too large for a histogram"));
    }

    std::string text_of(std::vector<HistogramResult> const& results, bool json) const {
        std::string all;
        for (std::size_t i = 0; i < results.size(); ++i) {
            HistogramResult const& r = results[i];
            if (json) {
                all += i == 0 ? (results.size() > 1 ? "[\n" : "") : ",\n";
                all += to_json(r);
                continue;
            }
            if (i > 0) all += "\n";
            if (csv_ || ends_in(".csv"))
                all += to_csv(r);
            else if (log_ || (output_ == "-" && output_is_terminal()))
                all += to_bars(r, 32, 80, log_);
            else
                all += to_table(r);
        }
        return all + (json ? (results.size() > 1 ? "\n]\n" : "\n") : "");
    }

    void draw(std::vector<HistogramResult> const& results) const {
        if (results.size() > 1 && !is_numbered(output_))
            throw Error(ErrorKind::usage, "the input holds several volumes, but -o names one picture",
                        "give a place for the number: -o histogram-%04d.png");
        for (std::size_t i = 0; i < results.size(); ++i) {
            render::BarChart const chart = chart_of(results[i]);
            std::string const path = numbered_path(output_, static_cast<std::int64_t>(i));
            if (ends_in(".svg")) {
                write(path, render::to_svg(chart));
            } else {
                auto const png = render::to_png(render::draw(chart, 640, 360), render::chart_background(),
                                                {{"Software", "vkt " VKT_VERSION},
                                                 {"Range", text(chart.low, ":", chart.high)},
                                                 {"Tallest bar", chart.top}});
                write(path, {reinterpret_cast<char const*>(png.data()), png.size()});
            }
        }
    }

    render::BarChart chart_of(HistogramResult const& r) const {
        render::BarChart chart;
        auto const height = [&](std::uint64_t count) {
            auto const value = static_cast<double>(count);
            return log_ ? std::log1p(value) : value;
        };
        double const tallest = height(r.largest());
        for (std::uint64_t const count : r.counts) chart.heights.push_back(tallest > 0 ? height(count) / tallest : 0);
        chart.low = r.edges.front();
        chart.high = r.edges.back();
        chart.top = text(r.largest(), log_ ? " (logarithmic)" : "");
        return chart;
    }

    void write(std::string const& path, std::string_view content) const {
        OutputFile file(path, force_);
        file.write(content.data(), content.size());
        file.commit();
    }

    Histogram histogram_;
    std::vector<std::string> merged_;
    std::string output_ = "-";
    bool log_ = false, csv_ = false, mergeable_ = false, force_ = false;
};

} // namespace

Command histogram_command() {
    return consumer_command<HistogramCommand>(
        {"Count how often values occur.",
         "Values are physical (slope * stored + intercept) and counted in bins of equal width, half-open but for the "
         "last; what lies outside of the range, infinities too, is under or over, NaN counts for itself. Counts are "
         "exact. A table, on a terminal bars; JSON with --json, a picture with -o of .png or .svg. Cells of "
         "hierarchical volumes count one by one, and once more by their volume.",
         {{"Bars of a logarithmic height", "vkt histogram volume.nrrd --bins 16 --log"},
          {"A picture, without the rarest values", "vkt histogram volume.nrrd --range p1:p99 -o histogram.png"},
          {"Parts of a volume, counted apart and added up",
           "vkt histogram volume.nrrd --roi :,:,0:9 --range 0:255 --mergeable -o a.json && vkt histogram volume.nrrd "
           "--roi :,:,9: --range 0:255 --mergeable -o b.json && vkt histogram --merge a.json b.json --csv"}}});
}

} // namespace vkt::shell
