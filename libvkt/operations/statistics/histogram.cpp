// Histogram: passes, levels of trees, texts.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/histogram.h"

#include "libvkt/amr/tree.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/io/whole_text.h"
#include "libvkt/operations/common/foreground.h"
#include "libvkt/operations/statistics/kernels/histogram.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace vkt {

VKT_OPERATION(Histogram, "histogram")

namespace {

constexpr std::size_t most_histogram_text = std::size_t{64} << 20; // no 65536 bins take more

constexpr std::string_view mergeable_mark = "vkt histogram 1";

/// Every line of a report: what lies below the first bin, the bins, above the last one, NaN.
template <class F> void for_each_line(HistogramResult const& r, F const& line) {
    std::size_t const n = r.counts.size();
    line("-inf", r.edges.front(), r.under, nullptr);
    for (std::size_t i = 0; i < n; ++i)
        line(r.edges[i], r.edges[i + 1], r.counts[i], r.volumes.empty() ? nullptr : &r.volumes[i]);
    line(r.edges.back(), "inf", r.over, nullptr);
    line("nan", "nan", r.nan, nullptr);
}

} // namespace

std::uint64_t HistogramResult::largest() const { return *std::max_element(counts.begin(), counts.end()); }

void HistogramResult::add(HistogramResult const& other) {
    if (edges != other.edges)
        throw Error(ErrorKind::data,
                    text("histograms of different bins: ", counts.size(), " from ", edges.front(), " to ", edges.back(),
                         ", and ", other.counts.size(), " from ", other.edges.front(), " to ", other.edges.back()),
                    "make them with the same --range and --bins");
    if (volumes.empty() != other.volumes.empty())
        throw Error(ErrorKind::data, "histograms of volumes of both kinds, structured and hierarchical");
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += other.counts[i];
    for (std::size_t i = 0; i < volumes.size(); ++i) volumes[i] += other.volumes[i];
    under += other.under;
    over += other.over;
    nan += other.nan;
}

std::string to_json(HistogramResult const& r) {
    auto const list = [](auto const& values) {
        std::string items;
        for (auto const& value : values) items += text(items.empty() ? "" : ", ", value);
        return text("[", items, "]");
    };
    std::string const volumes = r.volumes.empty() ? "" : text(",\n  \"volumes\": ", list(r.volumes));
    std::string const mark = r.mergeable ? text(",\n  \"mergeable\": \"", mergeable_mark, "\"") : "";
    return text("{\n  \"low\": ", r.edges.front(), ",\n  \"high\": ", r.edges.back(),
                ",\n  \"counts\": ", list(r.counts), ",\n  \"nan\": ", r.nan, ",\n  \"under\": ", r.under,
                ",\n  \"over\": ", r.over, ",\n  \"edges\": ", list(r.edges), volumes, mark, "\n}");
}

std::string to_csv(HistogramResult const& r) {
    std::string lines = r.volumes.empty() ? "low,high,count\n" : "low,high,count,volume\n";
    for_each_line(r, [&](std::string const& low, std::string const& high, std::uint64_t count, double const* volume) {
        lines += text(low, ",", high, ",", count);
        if (!r.volumes.empty()) lines += volume != nullptr ? text(",", *volume) : std::string(",");
        lines += "\n";
    });
    return lines;
}

std::string to_table(HistogramResult const& r) {
    std::vector<Report> rows;
    for_each_line(r, [&](std::string const& low, std::string const& high, std::uint64_t count, double const* volume) {
        Report row;
        row.add_number("low", low).add_number("high", high).add_number("count", text(count));
        if (!r.volumes.empty()) row.add("volume", volume != nullptr ? text(*volume) : std::string());
        rows.push_back(std::move(row));
    });
    return Report::table(rows);
}

std::string to_bars(HistogramResult const& r, int lines, int width, bool logarithmic) {
    std::size_t const n = r.counts.size(), groups = std::min(n, static_cast<std::size_t>(std::max(1, lines)));
    std::vector<std::uint64_t> sums(groups);
    for (std::size_t i = 0; i < n; ++i) sums[i * groups / n] += r.counts[i];
    std::vector<std::array<std::string, 3>> columns;
    std::array<std::size_t, 3> widths{};
    for (std::size_t g = 0; g < groups; ++g) {
        std::size_t const first = (g * n + groups - 1) / groups, end = ((g + 1) * n + groups - 1) / groups;
        columns.push_back({r.edges[first], r.edges[end], text(sums[g])});
        for (std::size_t c = 0; c < 3; ++c) widths[c] = std::max(widths[c], columns.back()[c].size());
    }
    auto const height = [&](std::uint64_t count) {
        auto const value = static_cast<double>(count);
        return logarithmic ? std::log1p(value) : value;
    };
    double const tallest = std::max(height(*std::max_element(sums.begin(), sums.end())), 1e-300);
    auto const room = static_cast<double>(
        std::max<std::ptrdiff_t>(10, width - static_cast<std::ptrdiff_t>(widths[0] + widths[1] + widths[2]) - 6));
    std::string result;
    for (std::size_t g = 0; g < groups; ++g) {
        for (std::size_t c = 0; c < 3; ++c)
            result += std::string(widths[c] - columns[g][c].size(), ' ') + columns[g][c] + "  ";
        // What is there shows, however little.
        auto const length = static_cast<std::size_t>(std::ceil(height(sums[g]) / tallest * room));
        result += std::string(length, '#') + "\n";
    }
    return result + text("under ", r.under, ", over ", r.over, ", NaN ", r.nan, "\n");
}

HistogramResult histogram_from_json(std::string_view json, std::string const& name) {
    using Json = nlohmann::json;
    auto const malformed = [&] {
        return Error(ErrorKind::data, text("'", name, "' is no partial histogram"),
                     "they are what vkt histogram --mergeable prints");
    };
    Json const root = Json::parse(json, nullptr, false);
    if (!root.is_object() && !root.is_array()) throw malformed();
    std::optional<HistogramResult> sum;
    for (Json const& part : root.is_array() ? root : Json::array({root})) {
        HistogramResult r;
        auto const count = [&](Json const& value) {
            if (!value.is_number_unsigned()) throw malformed();
            return value.get<std::uint64_t>();
        };
        if (!part.is_object() || !part.contains("mergeable") || part["mergeable"] != mergeable_mark) throw malformed();
        for (char const* const key : {"edges", "counts", "nan", "under", "over"})
            if (!part.contains(key)) throw malformed();
        if (!part["edges"].is_array() || !part["counts"].is_array() || part["counts"].empty() ||
            part["edges"].size() != part["counts"].size() + 1 || part["counts"].size() > Bins::most)
            throw malformed();
        for (Json const& edge : part["edges"]) {
            if (!edge.is_number()) throw malformed();
            r.edges.push_back(edge.is_number_integer() ? edge.dump() : to_text(edge.get<double>()));
        }
        for (Json const& value : part["counts"]) r.counts.push_back(count(value));
        r.nan = count(part["nan"]);
        r.under = count(part["under"]);
        r.over = count(part["over"]);
        if (part.contains("volumes")) {
            if (!part["volumes"].is_array() || part["volumes"].size() != r.counts.size()) throw malformed();
            for (Json const& value : part["volumes"]) {
                if (!value.is_number()) throw malformed();
                r.volumes.push_back(value.get<double>());
            }
        }
        r.mergeable = true;
        if (sum)
            sum->add(r);
        else
            sum = std::move(r);
    }
    if (!sum) throw malformed();
    return *sum;
}

Texts Histogram::texts() const {
    return {
        "Count how often values occur.",
        "Values are physical (slope * stored + intercept) and counted in bins of equal width, half-open but for the "
        "last; what lies outside of the range, infinities too, is under or over, NaN counts for itself. Counts are "
        "exact. A table, on a terminal bars; JSON with --json, a picture with -o of .png or .svg. Cells of "
        "hierarchical volumes count one by one, and once more by their volume."
        "\n\n"
        "Accuracy: Counts are exact.",
        {{"Bars of a logarithmic height", "vkt histogram volume.nrrd --bins 16 --log"},
         {"A picture, without the rarest values", "vkt histogram volume.nrrd --range p1:p99 -o histogram.png"},
         {"Parts of a volume, counted apart and added up",
          "vkt histogram volume.nrrd --roi :,:,0:9 --range 0:255 --mergeable -o a.json && vkt histogram volume.nrrd "
          "--roi :,:,9: --range 0:255 --mergeable -o b.json && vkt histogram --merge a.json b.json --csv"}}};
}

void Histogram::parameters(Parameters& p) {
    p.option("bins", bin_count_, "N", "bins, 1 to 65536");
    p.option("range", range_, "LO:HI|minmax|pA:pB", "values to count; the others are under or over");
    p.option("roi", roi, "X0:X1,Y0:Y1,Z0:Z1", "look only at these voxels (half-open); X0:X1:S is every S-th");
    p.flag("mergeable", mergeable, "print JSON that --merge takes; --range must be numbers");
    p.option("merge", merged, "FILE...", "add up what --mergeable printed, instead of reading a volume");
}

void Histogram::check() const {
    if (bin_count_ < 1 || bin_count_ > Bins::most)
        throw Error(ErrorKind::usage, text("--bins ", bin_count_, " is not between 1 and ", Bins::most));
    if (!merged.empty() && (!roi.empty() || bin_count_ != usual_bins || !(range_ == minmax())))
        throw Error(ErrorKind::usage, "--merge reads no volume: --bins, --range and --roi were for the parts");
    if (mergeable && merged.empty() && range_.depends())
        throw Error(ErrorKind::usage, "--mergeable needs the same range for all parts", "say --range LO:HI");
}

void Histogram::measure(Measurement& to) {
    if (merged.empty()) {
        if (roi.has_steps()) {
            stepped_.take(to.inputs, roi);
            roi = {};
        }
        return Operation::measure(to);
    }
    std::optional<HistogramResult> sum;
    for (std::string const& file : merged) {
        HistogramResult part = histogram_from_json(whole_text(file, most_histogram_text), file);
        if (sum)
            sum->add(part);
        else
            sum = std::move(part);
    }
    result_ = std::move(*sum);
    result_.mergeable = mergeable;
    to.report(report());
}

Report Histogram::report() const {
    Report report;
    return report.write_as(ReportForm::text, to_table(result_))
        .write_as(ReportForm::json, to_json(result_))
        .write_as(ReportForm::csv, to_csv(result_));
}

Plan Histogram::plan(std::span<Header const> inputs) const {
    check();
    Header const& in = inputs.front();
    static_cast<void>(LevelRegion(roi, in)); // or it is refused
    RangeScan const ends(range_, in);
    if (!range_.depends()) static_cast<void>(bins_between(ends, in)); // the same
    bool const small = size_of(in.dtype) <= 2, by_pattern = range_.depends() && small;
    Plan plan;
    plan.output = in;
    plan.scans = range_.depends() && !by_pattern;
    plan.method = text("counting in ", bin_count_, " bins", plan.scans ? ", after their range" : "");
    plan.cost = 24 + (range_.depends() ? 16 : 0) + (plan.scans && ends.has_percentiles() ? 120 : 0);
    plan.state_bytes =
        (static_cast<std::size_t>(bin_count_) + (by_pattern ? 65536 : 0) + 3) * 8 * 3 + ends.state_bytes();
    if (small) plan.state_bytes += std::size_t{4} << 18; // threads count words
    return plan;
}

void Histogram::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    bool const tree = input_.kind == Kind::hierarchical;
    region_ = {roi, input_};
    background_ = tree ? stored_background(input_) : std::nullopt;
    levels_.clear();
    counts_ = tree ? nullptr : &levels_[1];
    result_ = {};
    scans_again_ = false;
    ends_.emplace(range_, input_);
    range_known_ = !range_.depends();
    by_pattern_ = !range_known_ && size_of(input_.dtype) <= 2;
    bins_ = range_known_ ? bins_between(*ends_, input_) : Bins();
    counted_in_ = range_known_ ? bins_ : by_pattern_ ? Bins::of_patterns(input_.dtype) : Bins();
}

void Histogram::enter_level(Index3 cell_width, Index3 first) {
    region_.enter_level(cell_width, first);
    counts_ = &levels_[static_cast<double>(cell_width.x) * static_cast<double>(cell_width.y) *
                       static_cast<double>(cell_width.z)];
}

void Histogram::scan(ConstView slab, Execution const& execution) {
    Box const box = uses_position() || input_.kind == Kind::structured ? intersect(slab.box, region_.box()) : slab.box;
    if (box.empty()) return;
    ConstView const part = slab.part(box);
    count(background_ ? without_background(part, *background_, foreground_) : part, execution);
}

void Histogram::count(ConstView cells, Execution const& execution) {
    if (cells.box.empty()) return;
    if (!range_known_) ends_->scan(cells, execution);
    if (!range_known_ && !by_pattern_) return;
    if (counts_->size() == 0) *counts_ = VoxelCounts(counted_in_.slots());
    count_in_bins(cells, counted_in_, {cells.box, {1, 1, 1}}, counts_->update(execution.space()), execution);
}

/// Bins from ends that are known.
Bins Histogram::bins_between(RangeScan const& ends, Header const& in) const {
    auto const physical = [&](StoredValue const& end) {
        if (in.values == ValueMap{} && end.rest == 0 && end.whole != 0) {
            Number number(end.value());
            number.whole = end.whole;
            return number;
        }
        return Number(in.values.physical(end.value()) + 0.0);
    };
    Number low = range_.low.percentile ? physical(ends.low()) : range_.low.value,
           high = range_.high.percentile ? physical(ends.high()) : range_.high.value;
    if (!std::isfinite(low.value) || !std::isfinite(high.value))
        throw Error(ErrorKind::data, text("the range reaches from ", low.value, " to ", high.value),
                    "give numbers: --range LO:HI");
    bool const empty = low.whole && high.whole ? *low.whole == *high.whole : low.value == high.value;
    if (empty) {
        double const least = 0.5, size = std::abs(low.value);
        if (low.whole && size >= 0x1p48) {
            low = Number(low);
            *low.whole -= 1;
            *high.whole += 1;
            low.value = static_cast<double>(*low.whole);
            high.value = static_cast<double>(*high.whole);
        } else {
            double const by = std::max(least, size * 0x1p-40);
            low = Number(std::max(low.value - by, -std::numeric_limits<double>::max()));
            high = Number(std::min(high.value + by, std::numeric_limits<double>::max()));
        }
    } else if (low.whole && high.whole ? *low.whole > *high.whole : low.value > high.value) {
        throw Error(ErrorKind::data, text("the range is empty: it reaches from ", low.value, " to ", high.value),
                    "give two numbers, or two percentiles");
    }
    return Bins(in.dtype, in.values, low, high, bin_count_);
}

void Histogram::scan_end() {
    scans_again_ = false;
    if (!range_known_) {
        if (ends_->end_pass()) {
            scans_again_ = true;
            return;
        }
        if (!ends_->known())
            throw Error(ErrorKind::data, "no voxel is a finite number: there is no range to count in",
                        "give numbers: --range LO:HI");
        bins_ = bins_between(*ends_, input_);
        range_known_ = true;
        if (!by_pattern_) {
            counted_in_ = bins_;
            scans_again_ = true;
            return;
        }
    }
    finish();
}

void Histogram::finish() {
    std::size_t const n = static_cast<std::size_t>(bins_.count());
    HistogramResult& r = result_;
    r.mergeable = mergeable;
    for (int k = 0; k <= bins_.count(); ++k) r.edges.push_back(bins_.edge_text(k));
    r.counts.assign(n, 0);
    bool const tree = input_.kind == Kind::hierarchical;
    if (tree) r.volumes.assign(n, 0);
    Vec3 const spacing = input_.geometry.spacing;
    for (auto& [cell, counters] : levels_) {
        if (counters.size() == 0) continue; // nothing was counted there
        std::span<std::uint64_t const> const counts = counters.read();
        std::vector<std::uint64_t> slots(bins_.slots());
        if (by_pattern_) {
            for (std::size_t bits = 0; bits < bins_.table().size(); ++bits)
                slots[static_cast<std::size_t>(bins_.table()[bits])] += counts[bits];
        } else {
            slots.assign(counts.begin(), counts.end());
        }
        for (std::size_t k = 0; k < n; ++k) {
            r.counts[k] += slots[k];
            if (tree) r.volumes[k] += cell * static_cast<double>(slots[k]);
        }
        r.under += slots[static_cast<std::size_t>(bins_.under())];
        r.over += slots[static_cast<std::size_t>(bins_.over())];
        r.nan += slots[static_cast<std::size_t>(bins_.missing())];
    }
    for (double& volume : r.volumes) volume *= spacing.x * spacing.y * spacing.z;
}

} // namespace vkt
