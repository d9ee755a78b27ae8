// vkt histogram: see libvkt/operations/statistics/histogram.h; what is drawn of it: bars on a terminal, pictures.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/histogram.h"

#include "libvkt/formats/picture_texts.h"
#include "libvkt/formats/series.h"
#include "libvkt/io/output_file.h"
#include "libvkt/render/bar_chart.h"
#include "shell/measure.h"
#include "shell/terminal.h"

#include <cmath>

namespace vkt::shell {
namespace {

class HistogramCommand : public Measure {
public:
    HistogramCommand() : Measure(std::make_unique<Histogram>()) {}
    void parameters(Parameters& p) override {
        Measure::parameters(p);
        p.flag("log", log_, "bars as long as the logarithm of 1 + count");
        p.option("output", output_, "OUT", "output file: .png and .svg are pictures, .csv and .json tables")
            .short_form('o')
            .not_in_history();
        p.flag("force", force_, "overwrite an existing output file").not_in_history();
    }
    void check() const override {
        Measure::check();
        if (is_picture() && (csv() || !operation().prints(ReportForm::text)))
            throw Error(ErrorKind::usage, text("'", output_, "' is a picture: --csv and --mergeable are text"));
        if (ends_in(".json") && csv()) contradict("JSON", "--csv");
        if (ends_in(".csv") && !operation().prints(ReportForm::text)) contradict("CSV", "--mergeable");
        for (char const* const suffix :
             {".pdf", ".eps", ".ps", ".jpg", ".jpeg", ".gif", ".bmp", ".tif", ".tiff", ".webp"})
            if (ends_in(suffix))
                throw Error(ErrorKind::usage, text("'", output_, "': files of that kind are not written"),
                            "end the name in .png or .svg; .csv and .json are tables, other names a text");
        if (log_ && csv()) throw Error(ErrorKind::usage, "--log is about bars, --csv has none");
        if (output_ != "-") check_output(numbered_path(output_, 0), force_);
    }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        if (context.json() && is_picture()) contradict("a picture", "--json");
        if (context.json() && ends_in(".csv")) contradict("CSV", "--json");
        return Measure::consume(inputs, context);
    }

protected:
    void found(Operation const& histogram) override {
        auto const& counted = static_cast<Histogram const&>(histogram);
        results_.push_back(counted.result());
        headers_.push_back(counted.header());
    }
    void print(std::vector<Report> const& reports, ReportForm form, Context& context) const override {
        if (is_picture()) return draw(context.stage_info());
        if (form == ReportForm::text && ends_in(".csv")) form = ReportForm::csv;
        if (form == ReportForm::text && ends_in(".json")) form = ReportForm::json;
        if (form == ReportForm::text && (log_ || (output_ == "-" && output_is_terminal())))
            return write(output_, bars());
        write(output_, Report::print(reports, form));
    }

private:
    bool is_picture() const { return ends_in(".png") || ends_in(".svg"); }
    bool ends_in(char const* suffix) const { return lower_case(output_).ends_with(suffix); }
    [[noreturn]] void contradict(char const* kind, char const* option) const {
        throw Error(ErrorKind::usage,
                    text("'", output_, "' is the name of ", kind, ", ", option, " asks for another form"),
                    text("leave out ", option, ", or give the file another name"));
    }

    std::string bars() const {
        std::string all;
        for (HistogramResult const& result : results_)
            all += text(all.empty() ? "" : "\n", to_bars(result, 32, 80, log_));
        return all;
    }

    void draw(StageInfo const& stage) const {
        if (results_.size() > 1 && !is_numbered(output_))
            throw Error(ErrorKind::usage, "the input holds several volumes, but -o names one picture",
                        "give a place for the number: -o histogram-%04d.png");
        for (std::size_t i = 0; i < results_.size(); ++i) {
            render::BarChart const chart = chart_of(results_[i]);
            std::string const path = numbered_path(output_, static_cast<std::int64_t>(i));
            if (ends_in(".svg")) {
                write(path, render::to_svg(chart));
            } else {
                PictureTexts texts = texts_of_history(folded(history_step(stage, {headers_[i]})));
                texts.emplace_back("Range", text(chart.low, ":", chart.high));
                texts.emplace_back("Tallest bar", chart.top);
                auto const png = render::to_png(render::draw(chart, 640, 360), render::chart_background(), texts);
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

    std::vector<HistogramResult> results_;
    std::vector<Header> headers_; ///< of what they count
    std::string output_ = "-";
    bool log_ = false, force_ = false;
};

} // namespace

Command histogram_command() {
    Command command = operation_command("histogram");
    command.operation = nullptr;
    command.consumer = [] { return std::make_unique<HistogramCommand>(); };
    return command;
}

} // namespace vkt::shell
