// What a measured trade-off of time and error looks like.
// SPDX-License-Identifier: MIT
#include "shell/chart/trade_off_report.h"

#include "libvkt/core/error.h"
#include "libvkt/core/report.h"
#include "libvkt/core/text.h"
#include "shell/short_number.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

namespace vkt::shell {
namespace {

/// A line for the shell that does it.
std::string command(TradeOffPoint const& point, std::string const& volume) {
    std::string line = volume == "-" ? "" : text("read ", shell_quoted(volume), " | ");
    line += join(point.stages, " | ");
    return text("vkt pipe --threads ", point.threads, point.gpu ? " --device gpu " : " ", shell_quoted(line),
                " -o OUT");
}

/// Where it was measured, and what share of the whole that is.
std::string place(TradeOff const& found) {
    bool const draws = found.picture.x > 0;
    std::string const share =
        found.scale() > 1 ? text(", 1/", short_number(found.scale()), draws ? " of the pixels" : " of the voxels") : "";
    std::int64_t const pictures = found.picture.z / 3;
    std::string const count = pictures > 1 ? text(pictures, " ") : "";
    if (draws) return text(count, "pictures of ", found.picture.x, "x", found.picture.y, share);
    return text(to_text(found.part), " of ", to_text(found.whole), share);
}

std::string share_of(double value, double range) {
    return range > 0 ? short_number(100 * value / range) + "%" : value == 0 ? "0%" : "-";
}

std::string or_nothing(std::optional<double> const& value) { return value ? to_text(*value) : ""; }

} // namespace

void TradeOffGoal::check() const {
    if (within && seconds) throw Error(ErrorKind::usage, "only one of --within and --in can be asked for");
    if (within && !(within->number >= 0 && std::isfinite(within->number)))
        throw Error(
            ErrorKind::usage,
            text("--within ", within->number, within->percent ? "%" : "", " is not a finite number >= 0"),
            "it is an error in units of values (display levels of a picture), or with % a share of their range");
    if (seconds && !(*seconds > 0)) throw Error(ErrorKind::usage, text("--in ", *seconds, " is no time"));
}

TradeOffPoint const* TradeOffGoal::choose(TradeOff const& found) const {
    TradeOffPoint const* best = nullptr;
    double limit = 0;
    bool const all = found.part == box_of(found.whole);
    if (within && !all && !(found.range() > 0)) return nullptr; // nothing happens there
    if (within) {
        limit = within->within(found.range());
    } else if (!seconds) {
        for (auto const& p : found.points)
            if (p.given) limit = std::max(p.max_error, p.bound.value_or(0));
    }
    for (auto const& p : found.points) { // the fastest first
        if (seconds) {
            if (p.whole_seconds <= *seconds && (best == nullptr || p.max_error < best->max_error)) best = &p;
        } else if (best == nullptr && p.max_error <= limit) {
            best = &p;
        }
    }
    return best;
}

std::string TradeOffGoal::purpose(TradeOff const& found) const {
    if (within)
        return text("fastest within ", short_number(within->within(found.range())),
                    found.part == box_of(found.whole) ? "" : " in the part that was measured");
    if (seconds) return text("most exact in ", *seconds, " s");
    return "fastest that keeps what the given setting promises";
}

std::int64_t TradeOffReport::exceeded() const {
    return std::count_if(found.points.begin(), found.points.end(), [](auto const& p) { return p.exceeded(); }) +
           (found.check && found.check->error > found.check->bound ? 1 : 0);
}

std::string TradeOffReport::predicted_by() const { return found.calibrated ? "calibration" : "given setting"; }

std::string TradeOffReport::table(bool with_chart) const {
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
        row.add(found.calibrated ? "calibrated" : "predicted",
                p.predicted ? short_number(*p.predicted) : std::string("-"));
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
    if (with_chart) result += "\n" + drawn(plot(), PlotFormat::terminal);
    result += text(
        "\n* no other setting is faster and more exact. Errors: to the reference",
        draws ? ""
              : "; own_error: to the same method without\nrounding and truncation, which is what the bound is about",
        ".\nSeconds: medians of warm repeats in memory; reading and writing files is not in them.\n",
        found.calibrated ? "Calibrated: by what vkt doctor --calibrate measured of this machine.\n"
        : draws          ? "Predicted: the plan's steps or paths at the speed of what was given, shared evenly by the\n"
                           "threads.\n"
                         : "Predicted: the plan's operations at the speed of what was given, shared evenly by the "
                           "threads.\n");
    if (std::int64_t const n = exceeded(); n > 0)
        result += text("\n", n, n == 1 ? " error is" : " errors are", " LARGER THAN PREDICTED\n");
    if (choice != nullptr)
        result +=
            text("\n", purpose, " (", short_number(choice->whole_seconds), " s, error ",
                 short_number(choice->max_error), unit, ", ", choice->label, "):\n", command(*choice, volume), "\n");
    return result;
}

std::string TradeOffReport::csv() const {
    std::string result = "seconds,whole_seconds,predicted_seconds,max_error,rms_error,own_error,bound,operations,"
                         "threads,device,front,given,clipped,repeats,predicted_by,pipeline\n";
    for (auto const& p : found.points) {
        std::string line = join(p.stages, " | "), quoted;
        for (char const c : line) quoted += c == '"' ? "\"\"" : std::string(1, c);
        result += text(p.seconds, ",", p.whole_seconds, ",", or_nothing(p.predicted), ",", p.max_error, ",",
                       p.rms_error, ",", p.own_error, ",", or_nothing(p.bound), ",", p.operations, ",", p.threads, ",",
                       p.gpu ? "gpu" : "cpu", ",", p.front ? 1 : 0, ",", p.given ? 1 : 0, ",", p.lossy ? 1 : 0, ",",
                       p.repeats, ",", predicted_by(), ",\"", quoted, "\"\n");
    }
    return result;
}

std::string TradeOffReport::json() const {
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
    report.add("predicted_by", predicted_by());
    report.add("settings", found.settings).add("range", found.range()).add("units", found.units);
    report.add("points", std::move(rows)).add("exceeded", exceeded());
    report.add("command", choice != nullptr ? command(*choice, volume) : std::string());
    return report.json();
}

Plot TradeOffReport::plot() const {
    Plot plot;
    Index3 const dims = found.part.dims();
    plot.title = text(pipeline, ", ", dims.x, "x", dims.y, "x", dims.z);
    plot.x_label = found.picture.x > 0 ? text("time of a picture of ", found.picture.x, "x", found.picture.y)
                                       : "time of the part that was measured";
    plot.x_unit = "s";
    plot.y_label = text("largest error", found.units.empty() ? "" : " in ", found.units);
    for (auto const& p : found.points)
        plot.points.push_back({p.seconds, p.max_error, p.predicted, p.bound, p.front, p.exceeded(), p.label});
    return plot;
}

} // namespace vkt::shell
