// vkt chart: error against time of a pipeline, on one's own data.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/formats/picture_texts.h"
#include "libvkt/io/output_file.h"
#include "shell/chart/trade_off.h"
#include "shell/chart/trade_off_report.h"
#include "shell/command.h"
#include "shell/picture/plot.h"
#include "shell/short_number.h"
#include "shell/terminal.h"

#include <memory>
#include <string>
#include <vector>

namespace vkt::shell {
namespace {

class Chart : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.positional("pipeline", pipeline_, "operations on one volume, or up to a picture, quoted as one word");
        p.positional("volume", volume_, "a file of any known format, a stream, or '-' (default)").optional();
        p.option("within", goal_.within, "E|P%",
                 "end with the fastest setting whose error is at most E, or P% of the range");
        p.option("in", goal_.seconds, "SECONDS",
                 "end with the most exact setting that takes at most so long for all of the volume");
        p.option("keep", kept_, "KNOB,...", "knobs to leave as they are given, by their names: threads, method, …");
        p.option("roi", roi_, "REGION", "measure here (default: in the middle, as much as --budget allows)");
        p.option("budget", budget_, "SECONDS", "time that measuring may take, about");
        p.flag("check", check_, "exit code 1 if an error is larger than was predicted");
        p.flag("csv", csv_, "print all settings as CSV");
        p.option("output", output_, "OUT", "output file: .svg and .png are pictures, .csv a table")
            .short_form('o')
            .not_in_history();
        p.flag("force", force_, "overwrite an existing output file").not_in_history();
    }
    void check() const override {
        goal_.check();
        if (!(budget_ > 0 && budget_ <= 86400))
            throw Error(ErrorKind::usage, text("--budget ", budget_, " is not between 0 and 86400 seconds"));
        if (output_ != "-") {
            if (!ends_in(".svg") && !ends_in(".png") && !ends_in(".csv"))
                throw Error(ErrorKind::usage, text("'", output_, "': files of that kind are not written"),
                            "end the name in .svg, .png or .csv");
            if (!ends_in(".csv") && !can_plot())
                throw Error(ErrorKind::resources, "gnuplot, which draws charts, is not installed",
                            "install it (on Debian: gnuplot-nox), or write a table: -o chart.csv");
            check_output(output_, force_);
        }
    }
    std::vector<std::string> input_names() const override { return {volume_}; }
    bool reports() const override { return true; }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        if (csv_ && context.json()) throw Error(ErrorKind::usage, "--csv and --json: the report has one form");
        Source& source = *inputs.front();
        if (!source.next_volume()) throw Error(ErrorKind::data, "the input holds no volume");
        if (source.header().dry_run) throw PlannedOnly();
        TradeOffRequest request;
        request.pipeline = pipeline_;
        if (!kept_.empty()) request.kept = split(kept_, ',');
        request.roi = roi_;
        request.seconds = budget_;
        request.execution = context.execution();
        Header const header = source.header();
        TradeOff const found = measure_trade_off(request, source);
        if (source.next_volume()) context.note("the input holds several volumes: only the first is charted");
        TradeOffReport const report{found, pipeline_, volume_, goal_.choose(found), goal_.purpose(found)};
        if (output_ != "-") write(report, folded(history_step(context.stage_info(), {header})));
        if (csv_)
            print(report.csv());
        else if (context.json())
            print(report.json() + "\n");
        else
            print(report.table(output_is_terminal() && can_plot()));
        if (report.choice == nullptr) {
            context.note(goal_.seconds ? "no setting is as fast as --in asks for"
                                       : "no setting is as exact as --within asks for");
            return 1;
        }
        return check_ && report.exceeded() > 0 ? 1 : 0;
    }

private:
    bool ends_in(char const* suffix) const { return lower_case(output_).ends_with(suffix); }

    void write(TradeOffReport const& report, History const& history) const {
        std::string const content =
            ends_in(".csv")   ? report.csv()
            : ends_in(".svg") ? drawn(report.plot(), PlotFormat::svg)
                              : with_png_texts(drawn(report.plot(), PlotFormat::png), texts_of_history(history));
        OutputFile file(output_, force_);
        file.write(content.data(), content.size());
        file.commit();
    }

    static void print(std::string const& report) {
        OutputFile file("-", false);
        file.write(report.data(), report.size());
        file.commit();
    }

    std::string pipeline_, volume_ = "-", output_ = "-", kept_;
    TradeOffGoal goal_;
    double budget_ = 12;
    Roi roi_;
    bool check_ = false, csv_ = false, force_ = false;
};

} // namespace

Command chart_command() {
    return consumer_command<Chart>(
        {"Error against time of a pipeline, on your own data.",
         "Every knob that trades error for time (method, tolerance, result type, bins, step, paths), the threads and a "
         "GPU if there is one are varied on a part of the volume that lies in memory. Errors are measured against a "
         "float64 "
         "reference and stand beside what the plan predicts; the last line is the command to use.",
         {{"What a wide Gaussian costs, as a picture",
           "vkt chart 'filter gaussian --sigma 4' volume.nrrd -o chart.svg"},
          {"The fastest way to halve a volume within 1 % of its range, in two seconds",
           "vkt chart 'resample --scale 0.5' volume.nrrd --within 1% --budget 2"},
          {"Pictures: how short do the steps have to be?",
           "vkt chart 'render --domain 0:500 --opacity 0,0.2' volume.nrrd --within 2 --budget 2"},
          {"Are the promises kept?", "vkt chart 'filter gaussian --sigma 2' volume.nrrd --budget 2 --check"}}});
}

} // namespace vkt::shell
