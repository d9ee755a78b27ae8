// Annotations: where they stand, lines and boxes, text.
// SPDX-License-Identifier: MIT
#include "libvkt/render/annotate.h"

#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/render/font.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vkt::render {

namespace {

constexpr double edge = 0.8; ///< half the width of thin lines, in pixels

struct Point {
    double x, y;
};

/// A font in a size.
class Lettering {
public:
    /// As large as a picture of this size wants it.
    Lettering(Annotation const& annotation, int width, int height)
        : font_(annotation.font.empty() ? default_font() : annotation.font),
          size_(std::max(9.0, std::min(height / 32.0, width / 24.0))) {}

    double size() const { return size_; }
    int pixels() const { return static_cast<int>(std::lround(size_)); }
    int pitch() const { return static_cast<int>(std::lround(1.3 * size_)); } ///< from line to line
    TextLine text(std::string const& words) const { return draw_text(font_, size_, words); }

private:
    std::string font_;
    double size_;
};

/// A picture that is drawn on: coverage of pixels and their middles, from the top left.
class Canvas : public Lettering {
public:
    Canvas(Image& image, Lettering lettering) : Lettering(std::move(lettering)), image_(image) {}

    void blend(int x, int y, double coverage, Color const& color) {
        if (x < 0 || y < 0 || x >= image_.width || y >= image_.height || !(coverage > 0)) return;
        float* const p =
            image_.pixels.data() +
            4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image_.width) + static_cast<std::size_t>(x));
        auto const share = static_cast<float>(std::min(coverage, 1.0));
        double const light[3] = {srgb_to_linear(color.red), srgb_to_linear(color.green), srgb_to_linear(color.blue)};
        for (std::size_t c = 0; c < 3; ++c) p[c] = (1 - share) * p[c] + share * static_cast<float>(light[c]);
        p[3] *= 1 - share;
    }
    void box(int x0, int y0, int x1, int y1, Color const& color) {
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x) blend(x, y, 1, color);
    }
    /// A frame of one pixel around [x0, x1) x [y0, y1).
    void frame(int x0, int y0, int x1, int y1, Color const& color) {
        box(x0 - 1, y0 - 1, x1 + 1, y0, color);
        box(x0 - 1, y1, x1 + 1, y1 + 1, color);
        box(x0 - 1, y0, x0, y1, color);
        box(x1, y0, x1 + 1, y1, color);
    }
    void line(Point a, Point b, double half, Color const& color) {
        double const dx = b.x - a.x, dy = b.y - a.y, squared = dx * dx + dy * dy;
        auto const low = [&](double u, double v) { return static_cast<int>(std::floor(std::min(u, v) - half - 1)); };
        auto const high = [&](double u, double v) { return static_cast<int>(std::ceil(std::max(u, v) + half + 1)); };
        for (int y = low(a.y, b.y); y <= high(a.y, b.y); ++y)
            for (int x = low(a.x, b.x); x <= high(a.x, b.x); ++x) {
                double const px = x + 0.5 - a.x, py = y + 0.5 - a.y;
                double const t = squared > 0 ? std::clamp((px * dx + py * dy) / squared, 0.0, 1.0) : 0;
                blend(x, y, half + 0.5 - std::hypot(px - t * dx, py - t * dy), color);
            }
    }
    /// Over a faint outline of the other shade, so that it can be read on anything.
    void put(TextLine const& line, int x, int y, Color const& ink) {
        auto const at = [&](int u, int v) {
            bool const inside = u >= 0 && v >= 0 && u < line.width && v < line.height;
            std::size_t const i = static_cast<std::size_t>(v) * static_cast<std::size_t>(line.width);
            return inside ? line.coverage[i + static_cast<std::size_t>(u)] / 255.0 : 0.0;
        };
        double const other = ink.red > 0.5 ? 0 : 1;
        for (int v = -1; v <= line.height; ++v)
            for (int u = -1; u <= line.width; ++u) {
                double near = 0;
                for (int k = 0; k < 9; ++k) near = std::max(near, at(u + k % 3 - 1, v + k / 3 - 1));
                blend(x + u, y + v, 0.7 * near, {other, other, other});
            }
        for (int v = 0; v < line.height; ++v)
            for (int u = 0; u < line.width; ++u) blend(x + u, y + v, at(u, v), ink);
    }
    int width() const { return image_.width; }
    int height() const { return image_.height; }

private:
    Image& image_;
};

double luminance(Color const& c) {
    return 0.2126 * srgb_to_linear(c.red) + 0.7152 * srgb_to_linear(c.green) + 0.0722 * srgb_to_linear(c.blue);
}

/// sRGB of the transfer function at a value, in straight lines as it is drawn.
Color color_at(TransferFunction const& transfer, double value) {
    auto const& points = transfer.points;
    auto const linear = [&](double v) { return transfer.linear_colors ? v : srgb_to_linear(v); };
    auto const of = [&](ControlPoint const& p) {
        return std::array{linear(p.color.red), linear(p.color.green), linear(p.color.blue)};
    };
    auto const next = std::find_if(points.begin(), points.end(), [&](auto const& p) { return p.value > value; });
    std::array<double, 3> light{};
    if (next == points.begin() || next == points.end()) {
        light = of(next == points.end() ? points.back() : points.front());
    } else {
        double const share = (value - (next - 1)->value) / (next->value - (next - 1)->value);
        auto const a = of(*(next - 1)), b = of(*next);
        for (std::size_t c = 0; c < 3; ++c) light[c] = a[c] + share * (b[c] - a[c]);
    }
    return {linear_to_srgb(light[0]), linear_to_srgb(light[1]), linear_to_srgb(light[2])};
}

void draw_color_bar(Canvas& canvas, RenderReport const& report, std::string const& units, Color const& ink) {
    auto const size = static_cast<int>(std::lround(canvas.size()));
    double const lower = report.domain.lower, upper = report.domain.upper;
    if (!(upper > lower)) return;
    std::vector<double> const ticks = ticks_of(lower, upper);
    double const step = ticks.size() > 1 ? ticks[1] - ticks[0] : upper - lower;
    std::vector<TextLine> labels;
    int widest = 0;
    for (double const tick : ticks) {
        labels.push_back(canvas.text(tick_text(tick, step)));
        widest = std::max(widest, labels.back().width);
    }
    int const x1 = canvas.width() - size - widest - size / 2, x0 = x1 - size;
    int const y0 = canvas.height() / 5, y1 = canvas.height() - canvas.height() / 5;
    for (int y = y0; y < y1; ++y) {
        double const share = (y1 - y - 0.5) / (y1 - y0);
        canvas.box(x0, y, x1, y + 1, color_at(report.transfer, std::lerp(lower, upper, share)));
    }
    canvas.frame(x0, y0, x1, y1, ink);
    for (std::size_t i = 0; i < ticks.size(); ++i) {
        double const y = y1 - (ticks[i] - lower) / (upper - lower) * (y1 - y0);
        int const row = std::clamp(static_cast<int>(std::floor(y)), y0, y1 - 1);
        canvas.box(x1, row, x1 + size / 4 + 1, row + 1, ink);
        canvas.put(labels[i], x1 + size / 2, row - labels[i].height / 2, ink);
    }
    if (units.empty()) return;
    TextLine const unit = canvas.text(units);
    canvas.put(unit, std::min(x0, canvas.width() - size / 2 - unit.width), y0 - unit.height - size / 2, ink);
}

/// As much of the words as is no wider; what is left out leaves dots.
std::string fitting(Lettering const& letters, std::string words, int width) {
    if (letters.text(words).width <= width) return words;
    while (!words.empty() && letters.text(words + "...").width > width) {
        do words.pop_back();
        while (!words.empty() && (static_cast<unsigned char>(words.back()) & 0xC0U) == 0x80U); // rests of a character
        if (!words.empty() && static_cast<unsigned char>(words.back()) >= 0xC0U) words.pop_back();
    }
    return words + "...";
}

/// A caption in lines no wider than the picture, and no more of them than a third of it has room for; what is left out
/// leaves dots.
std::vector<std::string> caption_lines(Lettering const& letters, std::string const& caption, int width, int height) {
    int const room = std::max(1, width - 2 * letters.pixels());
    auto const most = static_cast<std::size_t>(std::max(1, height / 3 / letters.pitch()));
    std::vector<std::string> lines;
    for (std::string const& paragraph : split(caption, '\n')) {
        std::string line;
        for (std::string const& word : split(paragraph, ' ')) {
            std::string longer = line.empty() ? word : line + " " + word;
            if (!line.empty() && letters.text(longer).width > room) {
                lines.push_back(std::move(line));
                longer = word;
            }
            line = std::move(longer);
        }
        lines.push_back(std::move(line));
    }
    if (lines.size() > most) {
        lines.resize(most);
        lines.back() += " ...";
    }
    for (std::string& line : lines) line = fitting(letters, std::move(line), room);
    return lines;
}

/// A colour and what it stands for.
struct LegendRow {
    std::string words;
    Color color;
};

/// As many rows as fit, from the top; the last then says how many more there are. `row` gives them by number.
template <class Row> void draw_legend(Canvas& canvas, std::size_t count, Color const& ink, Row row) {
    auto const size = static_cast<int>(std::lround(canvas.size()));
    int const top = canvas.height() / 5, pitch = 2 * size, room = (canvas.height() - size - top) / pitch;
    std::size_t const rows = std::min(count, static_cast<std::size_t>(std::max(room, 1)));
    std::size_t const shown = rows < count ? rows - 1 : rows;
    std::vector<TextLine> lines;
    std::vector<Color> colors;
    int widest = 0;
    for (std::size_t i = 0; i < shown; ++i) {
        LegendRow const one = row(i);
        colors.push_back(one.color);
        lines.push_back(canvas.text(fitting(canvas, one.words, canvas.width() / 3)));
        widest = std::max(widest, lines.back().width);
    }
    int const x1 = canvas.width() - size - widest - size / 2, x0 = x1 - size;
    int y = top;
    for (std::size_t i = 0; i < shown; ++i, y += pitch) {
        canvas.box(x0, y, x1, y + size, colors[i]);
        canvas.frame(x0, y, x1, y + size, ink);
        canvas.put(lines[i], x1 + size / 2, y + (size - lines[i].height) / 2, ink);
    }
    if (shown == count) return;
    // It is longer than most names, which it does not move to the left.
    TextLine const more = canvas.text(text(shown > 0 ? "and " : "", static_cast<std::int64_t>(count - shown), " more"));
    canvas.put(more, std::min(x0, canvas.width() - size - more.width), y + (size - more.height) / 2, ink);
}

void draw_surfaces(Canvas& canvas, RenderReport const& report, std::string const& units, Color const& ink) {
    draw_legend(canvas, report.isos.size(), ink, [&](std::size_t i) {
        double const iso = report.isos[i];
        std::string const number = six_digits(iso);
        return LegendRow{units.empty() ? number : text(number, " ", units), report.iso_colors[i]};
    });
}

void draw_labels(Canvas& canvas, RenderReport const& report, Color const& ink) {
    draw_legend(canvas, report.labels->size(), ink, [&](std::size_t i) {
        ShownLabel const& label = (*report.labels)[i];
        return LegendRow{label.name.empty() ? to_text(label.label) : printable(label.name), label.color};
    });
}

/// Above `floor`.
void draw_scale_bar(Canvas& canvas, Camera const& camera, std::string const& unit, int floor, Color const& ink) {
    auto const size = static_cast<int>(std::lround(canvas.size()));
    Vec3 const way = camera.target - camera.eye;
    double const height = camera.projection == Projection::orthographic
                              ? camera.height
                              : 2 * std::tan(camera.fov * std::numbers::pi / 360) * length(way);
    double const per_pixel = height / canvas.height();
    double const length = round_length(per_pixel * canvas.width() / 4);
    if (!(length > 0)) return;
    int const x0 = size, x1 = x0 + static_cast<int>(std::lround(length / per_pixel)), y = floor - size;
    int const thick = std::max(1, size / 6);
    canvas.box(x0, y - thick, x1, y, ink);
    canvas.box(x0, y - size / 2, x0 + thick, y, ink);
    canvas.box(x1 - thick, y - size / 2, x1, y, ink);
    TextLine const label = canvas.text(unit.empty() ? to_text(length) : text(length, " ", unit));
    canvas.put(label, std::max(size / 2, (x0 + x1 - label.width) / 2), y - size / 2 - label.height, ink);
}

void draw_axes(Canvas& canvas, Camera const& camera, Color const& ink) {
    double const size = canvas.size(), reach = 2.5 * size;
    Vec3 const forward = unit(camera.target - camera.eye), right = unit(cross(forward, camera.up)),
               up = cross(right, forward);
    Point const center{size * 1.5 + reach, size * 1.5 + reach};
    struct Arm {
        Vec3 way;
        char const* name;
        Color color;
    };
    std::array<Arm, 3> arms{
        {{{1, 0, 0}, "x", {0.9, 0.25, 0.2}}, {{0, 1, 0}, "y", {0.2, 0.7, 0.25}}, {{0, 0, 1}, "z", {0.25, 0.45, 0.95}}}};
    // The furthest first.
    std::stable_sort(arms.begin(), arms.end(),
                     [&](Arm const& a, Arm const& b) { return dot(a.way, forward) > dot(b.way, forward); });
    for (Arm const& arm : arms) {
        Point const way{dot(arm.way, right), -dot(arm.way, up)};
        canvas.line(center, {center.x + reach * way.x, center.y + reach * way.y}, edge * size / 16 + 0.5, arm.color);
        TextLine const name = canvas.text(arm.name);
        double const beyond = reach + 0.7 * size;
        canvas.put(name, static_cast<int>(std::lround(center.x + beyond * way.x - name.width / 2.0)),
                   static_cast<int>(std::lround(center.y + beyond * way.y - name.height / 2.0)), ink);
    }
}

} // namespace

double round_length(double limit) {
    if (!(limit > 0) || !std::isfinite(limit)) return 0;
    double const decade = std::pow(10, std::floor(std::log10(limit)));
    for (double const factor : {5.0, 2.0})
        if (factor * decade <= limit) return factor * decade;
    return decade;
}

std::string length_unit(Header const& header) {
    auto const found = header.attributes.find("space units");
    if (found == header.attributes.end()) return {};
    auto const units = quoted_entries(found->second);
    if (!units || units->empty()) return {};
    for (std::string const& unit : *units)
        if (unit != units->front()) return {};
    std::string unit = units->front();
    if (unit.size() > 1 && unit.front() == '"' && unit.back() == '"') unit = unit.substr(1, unit.size() - 2);
    return printable(unit);
}

std::vector<double> ticks_of(double lower, double upper) {
    if (!(upper > lower)) return {lower};
    double const step = round_length((upper - lower) / 3);
    std::vector<double> ticks;
    for (double k = std::ceil(lower / step) + 0.0; k * step <= upper && ticks.size() < 16; ++k)
        ticks.push_back(k * step);
    return ticks;
}

std::string tick_text(double value, double step) {
    double const unit = std::floor(std::log10(step)), digits = std::round(value / std::pow(10, unit));
    // A decimal number is rounded once when it is read.
    return digits == 0 ? "0" : to_text(parse_double(text(digits, "e", static_cast<int>(unit))));
}

void Annotation::declare(Parameters& list) {
    list.flag(
        "annotate", key,
        "draw a colour bar with its values, or a legend of labels or surfaces, a scale bar in world units and the "
        "axes into the picture");
    list.option("caption", caption, "TEXT", "write this below the picture");
    list.option("font", font, "FILE", "font for both (default: one that is found, sans serif)");
}

void Annotation::check() const {
    if (!font.empty() && !any()) throw Error(ErrorKind::usage, "--font is for --annotate and --caption");
}

Insets insets_of(Annotation const& annotation, int width, int height) {
    if (!annotation.any()) return {};
    Lettering const letters(annotation, width, height);
    Insets insets;
    constexpr double most = 0.4, bar = 6.5, scale = 2.6; // times the size of letters
    if (annotation.key) {
        insets.right = std::min(most, bar * letters.size() / width);
        insets.bottom = scale * letters.size() / height;
    }
    if (!annotation.caption.empty()) {
        auto const lines = caption_lines(letters, annotation.caption, width, height).size();
        insets.bottom += (static_cast<double>(lines) * letters.pitch() + letters.size() / 2) / height;
    }
    insets.bottom = std::min(most, insets.bottom);
    return insets;
}

void annotate(Image& image, RenderReport const& report, Header const& header, Background const& background,
              Annotation const& annotation) {
    Color const ink = luminance(background.color) > 0.18 ? Color{0, 0, 0} : Color{1, 1, 1};
    Canvas canvas(image, Lettering(annotation, image.width, image.height));
    std::vector<std::string> lines;
    if (!annotation.caption.empty()) lines = caption_lines(canvas, annotation.caption, image.width, image.height);
    int const below = image.height - static_cast<int>(std::lround(canvas.size() / 2));
    int const floor = lines.empty() ? image.height : below - static_cast<int>(lines.size()) * canvas.pitch();
    if (annotation.key) {
        if (report.labels)
            draw_labels(canvas, report, ink);
        else if (report.isos.empty())
            draw_color_bar(canvas, report, header.units, ink);
        else
            draw_surfaces(canvas, report, header.units, ink);
        draw_scale_bar(canvas, report.camera, length_unit(header), floor, ink);
        draw_axes(canvas, report.camera, ink);
    }
    for (std::size_t i = 0; i < lines.size(); ++i) {
        TextLine const line = canvas.text(lines[i]);
        int const lower = below - static_cast<int>(lines.size() - 1 - i) * canvas.pitch();
        canvas.put(line, (canvas.width() - line.width) / 2, lower - line.height, ink);
    }
}

} // namespace vkt::render
