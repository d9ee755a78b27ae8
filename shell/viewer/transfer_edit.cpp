// Editing of transfer functions: knots, colours, presets, axes.
// SPDX-License-Identifier: MIT
#include "shell/viewer/transfer_edit.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/output_file.h"
#include "libvkt/render/transfer_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

namespace vkt::shell::viewer {

namespace {

using render::Color;
using render::Histogram;

double share_of(TransferEdit const& edit, double value) {
    return ValueAxis{edit.lower, edit.upper, edit.logarithmic}.place(value);
}

Color mixed(Color const& a, Color const& b, double f) {
    return {std::lerp(a.red, b.red, f), std::lerp(a.green, b.green, f), std::lerp(a.blue, b.blue, f)};
}

template <class Knot> std::size_t place_of(std::vector<Knot> const& knots, double value) {
    auto const after =
        std::upper_bound(knots.begin(), knots.end(), value, [](double v, Knot const& k) { return v < k.value; });
    return static_cast<std::size_t>(after - knots.begin());
}

/// A value between those of the neighbours.
template <class Knot> double between_neighbours(std::vector<Knot> const& knots, std::size_t i, double value) {
    if (!std::isfinite(value)) return knots[i].value;
    if (i > 0) value = std::max(value, knots[i - 1].value);
    if (i + 1 < knots.size()) value = std::min(value, knots[i + 1].value);
    return value;
}

/// The points that a line through them cannot do without (Ramer 1972, Douglas and Peucker 1973), of rows x and y, in
/// which it is straight. `shown` says what a y stands for, `tolerance` by how much that may be missed.
template <class Shown, class Tolerance>
void keep_bends(std::vector<std::array<double, 2>> const& line, std::size_t first, std::size_t last, Shown const& shown,
                Tolerance const& tolerance, std::vector<bool>& keep) {
    keep[first] = keep[last] = true;
    bool missed = false;
    double worst = 0;
    std::size_t at = 0;
    for (std::size_t i = first + 1; i < last; ++i) {
        double const width = line[last][0] - line[first][0];
        double const f = width > 0 ? (line[i][0] - line[first][0]) / width : 1;
        double const y = std::lerp(line[first][1], line[last][1], f), wanted = shown(line[i][1]);
        missed = missed || std::abs(shown(y) - wanted) > tolerance(wanted);
        if (std::abs(y - line[i][1]) > worst) worst = std::abs(y - line[i][1]), at = i;
    }
    if (!missed || at == 0) return;
    keep_bends(line, first, at, shown, tolerance, keep);
    keep_bends(line, at, last, shown, tolerance, keep);
}

} // namespace

double ValueAxis::place(double value) const {
    if (!(upper > lower)) return value < lower ? 0 : 1;
    if (logarithmic && lower > 0) return value > 0 ? std::log(value / lower) / std::log(upper / lower) : -1e9;
    return (value - lower) / (upper - lower);
}

double ValueAxis::value(double place) const {
    if (logarithmic && lower > 0 && upper > lower) return lower * std::pow(upper / lower, place);
    return std::lerp(lower, upper, place);
}

namespace {
constexpr double decades = 4;
}

double OpacityAxis::place(double alpha) const {
    if (!logarithmic) return alpha;
    return alpha > 0 ? std::max(0.0, 1 + std::log10(alpha) / decades) : 0;
}

double OpacityAxis::alpha(double place) const {
    double const p = std::clamp(place, 0.0, 1.0);
    if (!logarithmic) return p;
    return p > 0 ? std::pow(10.0, decades * (p - 1)) : 0;
}

Color color_at(TransferEdit const& edit, double value) {
    if (edit.colors.empty()) return render::colormap(edit.colormap, std::clamp(share_of(edit, value), 0.0, 1.0));
    std::size_t const after = place_of(edit.colors, value);
    if (after == 0) return edit.colors.front().color;
    if (after == edit.colors.size()) return edit.colors.back().color;
    ColorKnot const &a = edit.colors[after - 1], &b = edit.colors[after];
    return mixed(a.color, b.color, (value - a.value) / (b.value - a.value));
}

double alpha_at(TransferEdit const& edit, double value) {
    std::size_t const after = place_of(edit.knots, value);
    if (after == 0) return edit.knots.front().alpha;
    if (after == edit.knots.size()) return edit.knots.back().alpha;
    OpacityKnot const &a = edit.knots[after - 1], &b = edit.knots[after];
    return render::alpha_between(a.alpha, b.alpha, (value - a.value) / (b.value - a.value));
}

std::size_t add_knot(TransferEdit& edit, OpacityKnot knot) {
    knot.alpha = std::clamp(knot.alpha, 0.0, 1.0);
    std::size_t const at = place_of(edit.knots, knot.value);
    edit.knots.insert(edit.knots.begin() + static_cast<std::ptrdiff_t>(at), knot);
    return at;
}

std::size_t move_knot(TransferEdit& edit, std::size_t index, OpacityKnot to) {
    edit.knots[index] = {between_neighbours(edit.knots, index, to.value), std::clamp(to.alpha, 0.0, 1.0)};
    return index;
}

void remove_knot(TransferEdit& edit, std::size_t index) {
    if (edit.knots.size() > 1) edit.knots.erase(edit.knots.begin() + static_cast<std::ptrdiff_t>(index));
}

void set_domain(TransferEdit& edit, double lower, double upper, bool along) {
    if (!std::isfinite(lower) || !std::isfinite(upper) || !(lower < upper)) return;
    ValueAxis const from{edit.lower, edit.upper, edit.logarithmic};
    edit.lower = lower, edit.upper = upper;
    if (!(lower > 0)) edit.logarithmic = false;
    if (!along) return;
    ValueAxis const to{lower, upper, from.logarithmic && lower > 0};
    for (OpacityKnot& k : edit.knots) k.value = to.value(from.place(k.value));
    for (ColorKnot& c : edit.colors) c.value = to.value(from.place(c.value));
}

void own_colors(TransferEdit& edit, std::size_t count) {
    if (!edit.colors.empty()) return;
    std::vector<ColorKnot> colors;
    ValueAxis const axis{edit.lower, edit.upper, edit.logarithmic};
    for (std::size_t i = 0; i < count; ++i) {
        double const share = static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(count, 2) - 1);
        colors.push_back({axis.value(share), render::colormap(edit.colormap, share)});
    }
    edit.colors = std::move(colors);
}

std::size_t add_color(TransferEdit& edit, double value) {
    own_colors(edit);
    Color const color = color_at(edit, value);
    std::size_t const at = place_of(edit.colors, value);
    edit.colors.insert(edit.colors.begin() + static_cast<std::ptrdiff_t>(at), {value, color});
    return at;
}

std::size_t move_color(TransferEdit& edit, std::size_t index, double value) {
    edit.colors[index].value = between_neighbours(edit.colors, index, value);
    return index;
}

void remove_color(TransferEdit& edit, std::size_t index) {
    if (edit.colors.size() > 1) edit.colors.erase(edit.colors.begin() + static_cast<std::ptrdiff_t>(index));
}

double rounded_within(double value, double tolerance) {
    std::array<char, 64> digits{};
    for (int count = 1; count < std::numeric_limits<double>::max_digits10; ++count) {
        auto const written =
            std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::general, count);
        double const rounded = parse_double({digits.data(), written.ptr});
        if (std::abs(rounded - value) <= tolerance) return rounded;
    }
    return value;
}

namespace {

/// As many digits as a hand on a screen means, so that commands stay short. What is drawn has these numbers, too.
struct Shortening {
    double span = 1; ///< of the colours
    static constexpr double share = 1e-6;
    double value(double v) const { return rounded_within(v, share * std::min(span, std::abs(v))); }
    static double alpha(double a) { return rounded_within(a, share * a); }
    static Color color(Color const& c) {
        return {rounded_within(c.red, share), rounded_within(c.green, share), rounded_within(c.blue, share)};
    }
};

} // namespace

void apply(TransferEdit const& edit, render::RenderSettings& settings) {
    Shortening const shortened{edit.upper - edit.lower};
    settings.transfer.reset();
    settings.lut.clear();
    settings.preset.reset();
    if (!edit.colors.empty() || edit.logarithmic) {
        settings.transfer = function_of(edit);
        for (auto& p : settings.transfer->points)
            p = {shortened.value(p.value), shortened.color(p.color), shortened.alpha(p.alpha)};
        settings.colormap.clear();
        settings.opacity = settings.domain = "auto";
        return;
    }
    settings.colormap = edit.colormap;
    settings.domain = text(shortened.value(edit.lower), ":", shortened.value(edit.upper));
    settings.opacity.clear();
    for (OpacityKnot const& k : edit.knots) {
        if (!settings.opacity.empty()) settings.opacity += ",";
        settings.opacity += text(shortened.value(k.value), ":", shortened.alpha(k.alpha));
    }
}

render::TransferFunction function_of(TransferEdit const& edit) {
    render::TransferFunction function;
    std::vector<double> values;
    if (edit.colors.empty()) {
        constexpr int parts = 64;
        ValueAxis const axis{edit.lower, edit.upper, edit.logarithmic};
        for (int i = 0; i <= parts; ++i) values.push_back(axis.value(i / static_cast<double>(parts)));
    }
    for (ColorKnot const& c : edit.colors) values.push_back(c.value);
    std::erase_if(values, [&](double v) {
        return std::any_of(edit.knots.begin(), edit.knots.end(), [&](OpacityKnot const& k) { return k.value == v; });
    });
    // Several knots at one value are a step, so that all of them stay.
    for (OpacityKnot const& k : edit.knots) function.points.push_back({k.value, color_at(edit, k.value), k.alpha});
    for (double const v : values) function.points.push_back({v, color_at(edit, v), alpha_at(edit, v)});
    function.check_and_sort();
    return function;
}

TransferEdit edit_of(render::TransferFunction const& function, std::string const& colormap) {
    TransferEdit edit;
    auto const& points = function.points;
    edit.lower = points.front().value, edit.upper = points.back().value;
    if (!(edit.lower < edit.upper)) edit.upper = edit.lower + std::max(1e-6, 1e-6 * std::abs(edit.lower));
    edit.colormap = colormap.empty() ? "viridis" : colormap;
    double greatest = 1e-9;
    for (auto const& p : points) greatest = std::max(greatest, p.alpha);
    std::vector<std::array<double, 2>> line;
    line.reserve(points.size());
    for (auto const& p : points) line.push_back({p.value, render::extinction_of(p.alpha)});
    std::vector<bool> keep(points.size(), false);
    keep_bends(
        line, 0, points.size() - 1, [](double extinction) { return -std::expm1(-extinction); },
        [&](double alpha) { return 0.02 * std::max(alpha, 0.1 * greatest); }, keep);
    for (std::size_t i = 0; i < points.size(); ++i)
        if (keep[i]) edit.knots.push_back({points[i].value, points[i].alpha});
    if (!colormap.empty()) return edit;
    auto const shown = [&](double c) { return function.linear_colors ? render::linear_to_srgb(c) : c; };
    auto const color_of = [&](std::size_t i) {
        Color const& c = points[i].color;
        return Color{shown(c.red), shown(c.green), shown(c.blue)};
    };
    std::fill(keep.begin(), keep.end(), false);
    for (double Color::*channel : {&Color::red, &Color::green, &Color::blue}) {
        for (std::size_t i = 0; i < points.size(); ++i) line[i][1] = color_of(i).*channel;
        keep_bends(
            line, 0, points.size() - 1, [](double c) { return c; }, [](double) { return 1.0 / 255; }, keep);
    }
    for (std::size_t i = 0; i < points.size(); ++i)
        if (keep[i]) edit.colors.push_back({points[i].value, color_of(i)});
    return edit;
}

namespace {

struct Shape {
    char const* name;
    std::function<TransferEdit(Histogram const&, TransferEdit const&)> make;
};

TransferEdit over(double lower, double upper, std::string map, std::vector<OpacityKnot> knots) {
    TransferEdit edit;
    edit.lower = lower, edit.upper = upper;
    edit.colormap = std::move(map);
    edit.knots = std::move(knots);
    return edit;
}

/// The same colours, opacities at shares of their span.
TransferEdit shaped(TransferEdit edit, std::vector<OpacityKnot> shares) {
    ValueAxis const axis{edit.lower, edit.upper, edit.logarithmic};
    for (OpacityKnot& k : shares) k.value = axis.value(k.value);
    edit.knots = std::move(shares);
    return edit;
}

double percentile(Histogram const& h, double p) { return h.percentile(p); }

TransferEdit edit_of(render::Preset const& preset) {
    TransferEdit edit = over(preset.lower, preset.upper, preset.colormap, {});
    edit.logarithmic = preset.logarithmic;
    for (auto const& [value, alpha] : preset.opacities) edit.knots.push_back({value, alpha});
    return edit;
}

/// A preset that the command line has as well.
Shape of_kind(char const* name, render::DataKind kind) {
    return {name, [kind](Histogram const& h, auto const&) { return edit_of(render::preset_of(kind, h)); }};
}

/// Values at which more voxels lie than around them, the most frequent first, background left out.
std::vector<double> modes(Histogram const& h, std::size_t most) {
    std::size_t const n = h.bins.size(), reach = std::max<std::size_t>(2, n / 64);
    std::vector<double> smooth(n);
    for (std::size_t i = 0; i < n; ++i) {
        std::size_t const first = i > reach / 2 ? i - reach / 2 : 0, last = std::min(n - 1, i + reach / 2);
        for (std::size_t k = first; k <= last; ++k) smooth[i] += std::log1p(static_cast<double>(h.bins[k]));
        smooth[i] /= static_cast<double>(last - first + 1);
    }
    std::vector<std::pair<double, double>> found;
    for (std::size_t i = reach; i + reach < n; ++i) {
        auto const from = smooth.begin() + static_cast<std::ptrdiff_t>(i - reach);
        auto const to = smooth.begin() + static_cast<std::ptrdiff_t>(i + reach + 1);
        if (smooth[i] > 0 && smooth[i] >= *std::max_element(from, to)) found.emplace_back(-smooth[i], h.center(i));
    }
    std::sort(found.begin(), found.end());
    std::vector<double> values;
    for (auto const& peak : found) {
        double const value = peak.second;
        double const apart = (h.greatest - h.least) / 20;
        bool const new_one =
            std::all_of(values.begin(), values.end(), [&](double v) { return std::abs(v - value) > apart; });
        if (new_one && values.size() < most) values.push_back(value);
    }
    std::sort(values.begin(), values.end());
    return values;
}

std::vector<Shape> const& shapes() {
    static std::vector<Shape> const all{
        {"ramp",
         [](auto const&, auto const& now) {
             return shaped(now, {{0, 0}, {1, 0.3}});
         }},
        {"tent",
         [](auto const&, auto const& now) {
             return shaped(now, {{0.3, 0}, {0.5, 0.3}, {0.7, 0}});
         }},
        {"step",
         [](auto const&, auto const& now) {
             return shaped(now, {{0.5, 0}, {0.5, 0.5}});
         }},
        {"peaks",
         [](Histogram const& h, TransferEdit const& now) {
             TransferEdit edit = now;
             double const width = (h.greatest - h.least) / 50;
             edit.knots.clear();
             for (double const v : modes(h, 4))
                 for (OpacityKnot const& k : {OpacityKnot{v - width, 0}, {v, 0.2}, {v + width, 0}})
                     edit.knots.push_back(k);
             if (edit.knots.empty()) return shaped(now, {{0, 0}, {1, 0.3}});
             std::stable_sort(edit.knots.begin(), edit.knots.end(),
                              [](auto const& a, auto const& b) { return a.value < b.value; });
             return edit;
         }},
        {"highest tenth",
         [](Histogram const& h, TransferEdit const& now) {
             TransferEdit edit = now;
             edit.knots = {{percentile(h, 0.9), 0}, {percentile(h, 0.99), 0.2}, {percentile(h, 0.999), 0.5}};
             return edit;
         }},
        of_kind("CT: bone", render::DataKind::ct_bone),
        of_kind("CT: soft tissue and bone", render::DataKind::ct),
        of_kind("CT: lung", render::DataKind::ct_lung),
        of_kind("CT: contrast and stents", render::DataKind::ct_contrast),
        of_kind("MR", render::DataKind::mr),
        of_kind("fluorescence", render::DataKind::fluorescence),
        of_kind("density", render::DataKind::density),
        {"labels",
         [](Histogram const& h, auto const&) {
             double const top = std::max(h.greatest, 1.0);
             return over(1, top > 1 ? top : 2, "turbo", {{0.5, 0}, {0.5, 0.5}});
         }},
    };
    return all;
}

} // namespace

std::vector<std::string> preset_names() {
    std::vector<std::string> names;
    for (Shape const& shape : shapes()) names.emplace_back(shape.name);
    return names;
}

TransferEdit preset(std::string const& name, Histogram const& histogram, TransferEdit const& now) {
    for (Shape const& shape : shapes()) {
        if (shape.name != name) continue;
        TransferEdit edit = shape.make(histogram, now);
        if (!(edit.lower < edit.upper)) edit.upper = edit.lower + std::max(1.0, std::abs(edit.lower) * 1e-3);
        return edit;
    }
    throw Error(ErrorKind::usage, text("'", name, "' is not one of ", join(preset_names(), ", ")));
}

ValueAxis grey_axis(Histogram const& histogram) {
    double const lower = histogram.percentile(0.005), upper = histogram.percentile(0.999);
    if (lower < upper) return {lower, upper, false};
    return {histogram.least, histogram.greatest, false}; // most of it is background
}

std::vector<float> log_columns(Histogram const& histogram, ValueAxis const& axis, std::size_t columns) {
    std::vector<double> counts(columns, 0);
    std::vector<std::size_t> gaps;
    std::size_t before = histogram.bins.size();
    for (std::size_t i = 0; i < histogram.bins.size(); ++i) {
        if (histogram.bins[i] == 0) continue;
        if (before < i) gaps.push_back(i - before);
        before = i;
    }
    double step = 1; // between values, in bins
    if (gaps.size() > 3) {
        auto const middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
        std::nth_element(gaps.begin(), middle, gaps.end());
        step = static_cast<double>(*middle);
    }
    // Bins may be narrower or wider than columns: each is shared out by what of it lies in a column.
    for (std::size_t i = 0; i < histogram.bins.size(); ++i) {
        if (histogram.bins[i] == 0) continue;
        double const width = static_cast<double>(columns), center = static_cast<double>(i) + 0.5;
        double from = axis.place(histogram.value_at(center - step / 2)) * width;
        double to = axis.place(histogram.value_at(center + step / 2)) * width;
        if (!(to > from)) to = from + 1e-6;
        from = std::max(from, -1e6);
        double const per_column = static_cast<double>(histogram.bins[i]) / (to - from);
        auto const first = static_cast<std::int64_t>(std::floor(std::max(from, 0.0)));
        for (auto c = first; c < static_cast<std::int64_t>(columns) && static_cast<double>(c) < to; ++c) {
            double const left = std::max(from, static_cast<double>(c)),
                         right = std::min(to, static_cast<double>(c + 1));
            if (right > left) counts[static_cast<std::size_t>(c)] += per_column * (right - left);
        }
    }
    double greatest = 0;
    for (double const c : counts) greatest = std::max(greatest, c);
    std::vector<float> heights(columns, 0.0F);
    if (!(greatest > 0)) return heights;
    for (std::size_t c = 0; c < columns; ++c)
        heights[c] = static_cast<float>(std::log1p(counts[c]) / std::log1p(greatest));
    return heights;
}

void save_transfer(std::string const& path, std::string const& json) {
    if (std::error_code error; std::filesystem::exists(path, error)) try {
            static_cast<void>(render::read_transfer(path));
        } catch (Error const&) {
            throw Error(ErrorKind::io, text("'", path, "' exists, and is no transfer function"), "choose another name");
        }
    OutputFile file(path, true);
    file.write(json.data(), json.size());
    file.commit();
}

} // namespace vkt::shell::viewer
