// vkt chart: error against time of a pipeline, on one's own data.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/io/output_file.h"
#include "shell/command.h"
#include "shell/plot.h"
#include "shell/short_number.h"
#include "shell/terminal.h"
#include "shell/trade_off.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace vkt::shell {
namespace {

class Chart : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.positional("pipeline", pipeline_, "operations on one volume, or up to a picture, quoted as one word");
        p.positional("volume", volume_, "a file of any known format, a stream, or '-' (default)").optional();
        p.option("within", within_, "E|P%",
                 "end with the fastest setting whose error is at most E, or P% of the range");
        p.option("in", in_, "SECONDS",
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
        if (within_ && in_) throw Error(ErrorKind::usage, "only one of --within and --in can be asked for");
        if (within_) allowed(*within_, 1);
        if (in_ && !(*in_ > 0)) throw Error(ErrorKind::usage, text("--in ", *in_, " is no time"));
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
        Source& source = *inputs.front();
        if (!source.next_volume()) throw Error(ErrorKind::data, "the input holds no volume");
        if (source.header().dry_run) throw PlannedOnly();
        TradeOffRequest request;
        request.pipeline = pipeline_;
        if (!kept_.empty()) request.kept = split(kept_, ',');
        request.roi = roi_;
        request.seconds = budget_;
        request.execution = context.execution();
        TradeOff const found = measure_trade_off(request, source);
        if (source.next_volume()) context.note("the input holds several volumes: only the first is charted");
        if (output_ != "-") write(found);
        TradeOffPoint const* const choice = chosen(found);
        if (csv_)
            print(csv(found));
        else if (context.json())
            print(json(found, choice) + "\n");
        else
            print(table(found, choice));
        if (choice == nullptr) {
            context.note(in_ ? "no setting is as fast as --in asks for"
                             : "no setting is as exact as --within asks for");
            return 1;
        }
        return check_ && exceeded(found) > 0 ? 1 : 0;
    }

private:
    bool ends_in(char const* suffix) const { return lower_case(output_).ends_with(suffix); }

    static double allowed(std::string const& words, double range) {
        bool const share = words.ends_with('%');
        double const value = parse_double(share ? words.substr(0, words.size() - 1) : words);
        if (!(value >= 0)) throw Error(ErrorKind::usage, text("--within ", words, " is no error"));
        return share ? value / 100 * range : value;
    }

    static std::int64_t exceeded(TradeOff const& found) {
        return std::count_if(found.points.begin(), found.points.end(), [](auto const& p) { return p.exceeded(); }) +
               (found.check && found.check->error > found.check->bound ? 1 : 0);
    }

    /// The setting that was asked for; by default the fastest one that is as exact as what was given promises to be.
    TradeOffPoint const* chosen(TradeOff const& found) const {
        TradeOffPoint const* best = nullptr;
        double limit = 0;
        if (within_) {
            limit = allowed(*within_, found.range());
        } else if (!in_) {
            for (auto const& p : found.points)
                if (p.given) limit = std::max(p.max_error, p.bound.value_or(0));
        }
        for (auto const& p : found.points) { // the fastest first
            if (in_) {
                if (p.whole_seconds <= *in_ && (best == nullptr || p.max_error < best->max_error)) best = &p;
            } else if (best == nullptr && p.max_error <= limit) {
                best = &p;
            }
        }
        return best;
    }

    /// A line for the shell that does it.
    std::string command(TradeOffPoint const& point) const {
        std::string line = volume_ == "-" ? "" : text("read ", shell_quoted(volume_), " | ");
        line += join(point.stages, " | ");
        return text("vkt pipe --threads ", point.threads, point.gpu ? " --device gpu " : " ", shell_quoted(line),
                    " -o OUT");
    }

    /// Where it was measured, and what share of the whole that is.
    static std::string place(TradeOff const& found) {
        bool const draws = found.picture.x > 0;
        std::string const share =
            found.scale() > 1 ? text(", 1/", short_number(found.scale()), draws ? " of the pixels" : " of the voxels")
                              : "";
        if (draws) return text("pictures of ", found.picture.x, "x", found.picture.y, share);
        return text(to_text(found.part), " of ", to_text(found.whole), share);
    }

    static std::string share_of(double value, double range) {
        return range > 0 ? short_number(100 * value / range) + "%" : value == 0 ? "0%" : "-";
    }

    std::string table(TradeOff const& found, TradeOffPoint const* choice) const {
        double const scale = found.scale();
        bool const draws = found.picture.x > 0; // of which no bounds are known
        std::string const unit = found.units.empty() ? "" : " " + printable(found.units);
        std::string result = text("measured on ", place(found), ": ", found.settings, "\nreference: ", found.reference,
                                  "; its values span ", short_number(found.range()), unit,
                                  found.check ? text(", at ", found.check->voxels, " voxels within ",
                                                     short_number(found.check->error), " of sums by definition")
                                              : std::string(),
                                  "\n\n");
        std::vector<Report> rows;
        for (auto const& p : found.points) {
            Report row;
            row.add("front", p.front ? "*" : "");
            row.add("seconds", short_number(p.seconds));
            if (scale > 1) row.add("whole", short_number(p.whole_seconds));
            row.add("predicted", p.predicted ? short_number(*p.predicted) : std::string("-"));
            row.add("max_error", short_number(p.max_error));
            row.add("share", share_of(p.max_error, found.range()));
            row.add("rms_error", short_number(p.rms_error));
            if (!draws) row.add("own_error", short_number(p.own_error));
            if (!draws)
                row.add("bound", p.bound ? text(short_number(*p.bound), p.exceeded() ? " EXCEEDED"
                                                                        : p.lossy    ? " (clipped)"
                                                                                     : "")
                                         : std::string("-"));
            row.add("setting", p.label);
            rows.push_back(std::move(row));
        }
        result += Report::table(rows);
        if (output_is_terminal() && can_plot()) result += "\n" + drawn(plot(found), PlotFormat::terminal);
        result += text(
            "\n* no other setting is faster and more exact. Errors: to the reference",
            draws
                ? ""
                : "; own_error: to the same method without\nrounding and truncation, which is what the bound is about",
            ". Seconds: medians of ", draws ? "warm\nrepeats in memory; " : "warm repeats in memory; ",
            draws ? "predicted: the plan's steps or paths" : "predicted:\nthe plan's operations",
            " at the speed of what was given, shared ",
            draws ? "evenly by the\nthreads.\n" : "evenly by the threads.\n");
        if (std::int64_t const n = exceeded(found); n > 0)
            result += text("\n", n, n == 1 ? " error is" : " errors are", " LARGER THAN PREDICTED\n");
        if (choice != nullptr)
            result += text("\n", purpose(found), " (", short_number(choice->whole_seconds), " s, error ",
                           short_number(choice->max_error), unit, ", ", choice->label, "):\n", command(*choice), "\n");
        return result;
    }

    std::string purpose(TradeOff const& found) const {
        if (within_) return text("fastest within ", short_number(allowed(*within_, found.range())));
        if (in_) return text("most exact in ", *in_, " s");
        return "fastest that keeps what the given setting promises";
    }

    static std::string or_nothing(std::optional<double> const& value) { return value ? to_text(*value) : ""; }

    static std::string csv(TradeOff const& found) {
        std::string result = "seconds,whole_seconds,predicted_seconds,max_error,rms_error,own_error,bound,operations,"
                             "threads,device,front,given,clipped,repeats,pipeline\n";
        for (auto const& p : found.points) {
            std::string line = join(p.stages, " | "), quoted;
            for (char const c : line) quoted += c == '"' ? "\"\"" : std::string(1, c);
            result += text(p.seconds, ",", p.whole_seconds, ",", or_nothing(p.predicted), ",", p.max_error, ",",
                           p.rms_error, ",", p.own_error, ",", or_nothing(p.bound), ",", p.operations, ",", p.threads,
                           ",", p.gpu ? "gpu" : "cpu", ",", p.front ? 1 : 0, ",", p.given ? 1 : 0, ",", p.lossy ? 1 : 0,
                           ",", p.repeats, ",\"", quoted, "\"\n");
        }
        return result;
    }

    std::string json(TradeOff const& found, TradeOffPoint const* choice) const {
        double const unknown = std::nan("");
        std::vector<Report> rows;
        for (auto const& p : found.points) {
            Report row;
            row.add("pipeline", join(p.stages, " | ")).add("threads", std::int64_t{p.threads});
            row.add("device", p.gpu ? "gpu" : "cpu").add("label", p.label);
            row.add("seconds", p.seconds).add("whole_seconds", p.whole_seconds);
            row.add("predicted_seconds", p.predicted.value_or(unknown)).add("operations", p.operations);
            row.add("max_error", p.max_error).add("rms_error", p.rms_error).add("own_error", p.own_error);
            row.add("bound", p.bound.value_or(unknown)).add("exceeded", p.exceeded()).add("clipped", p.lossy);
            row.add("front", p.front).add("given", p.given).add("repeats", std::int64_t{p.repeats});
            rows.push_back(std::move(row));
        }
        Report report;
        report.add("dims", found.whole).add("part", to_text(found.part)).add("reference", found.reference);
        report.add("checked_voxels", found.check ? found.check->voxels : std::int64_t{0});
        report.add("check_error", found.check ? found.check->error : unknown);
        report.add("settings", found.settings).add("range", found.range()).add("units", found.units);
        report.add("points", std::move(rows)).add("exceeded", exceeded(found));
        report.add("command", choice != nullptr ? command(*choice) : std::string());
        return report.json();
    }

    Plot plot(TradeOff const& found) const {
        Plot plot;
        Index3 const dims = found.part.dims();
        plot.title = text(pipeline_, ", ", dims.x, "x", dims.y, "x", dims.z);
        plot.x_label = found.picture.x > 0 ? text("time of a picture of ", found.picture.x, "x", found.picture.y)
                                           : "time of the part that was measured";
        plot.x_unit = "s";
        plot.y_label = text("largest error", found.units.empty() ? "" : " in ", found.units);
        for (auto const& p : found.points)
            plot.points.push_back({p.seconds, p.max_error, p.predicted, p.bound, p.front, p.exceeded(), p.label});
        return plot;
    }

    void write(TradeOff const& found) const {
        write(ends_in(".csv") ? csv(found) : drawn(plot(found), ends_in(".svg") ? PlotFormat::svg : PlotFormat::png));
    }

    void write(std::string_view content) const {
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
    std::optional<std::string> within_;
    std::optional<double> in_;
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
