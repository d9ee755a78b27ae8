// Points over logarithmic axes: laid out once, as lines, discs and words, and drawn as pixels or as SVG.
// SPDX-License-Identifier: MIT
#include "libvkt/render/scatter_chart.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

namespace vkt::render {
namespace {

struct Line {
    double x0, y0, x1, y1;
    Color color;
};
struct Disc {
    double x, y, radius;
    bool filled;
    Color color;
    std::string tip;
};
struct Word {
    double x, y;
    enum class Anchor : std::uint8_t { start, middle, end } anchor;
    std::string text;
    bool small; ///< told in SVG only
};
struct Layout {
    std::vector<Line> lines;
    std::vector<Disc> discs;
    std::vector<Word> words;
};

constexpr Color ink{0.15, 0.15, 0.15}, grid_color{0.88, 0.88, 0.88}, blue{0.20, 0.38, 0.65}, grey{0.6, 0.6, 0.6},
    red{0.80, 0.15, 0.12};

/// From a positive number to its place between two ends, by decades.
struct Axis {
    double low, high; ///< log10, whole numbers
    double from, to;  ///< pixels
    double at(double value) const { return from + (std::log10(value) - low) / (high - low) * (to - from); }
};

Axis axis_over(std::vector<double> const& values, double from, double to) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (double const v : values) {
        if (!(v > 0) || !std::isfinite(v)) continue;
        low = std::min(low, std::floor(std::log10(v)));
        high = std::max(high, std::ceil(std::log10(v)));
    }
    if (!std::isfinite(low)) low = high = 0;
    if (high <= low) high = low + 1;
    return {low, high, from, to};
}

Layout lay_out(ScatterChart const& chart, double width, double height) {
    constexpr double left = 70, right = 24, top = 34, below = 64;
    std::vector<double> xs, ys;
    bool zeros = false;
    for (auto const& p : chart.points) {
        xs.push_back(p.x);
        ys.push_back(p.y);
        if (p.predicted_x) xs.push_back(*p.predicted_x);
        if (p.predicted_y) ys.push_back(*p.predicted_y);
        zeros = zeros || p.y == 0 || p.predicted_y == 0.0;
    }
    double const floor = height - below, lowest = zeros ? floor - 24 : floor;
    Axis const x = axis_over(xs, left, width - right), y = axis_over(ys, lowest, top);
    auto const place = [&](double value) {
        return value > 0 && std::isfinite(value) ? y.at(value) : value > 0 ? top : floor;
    };

    Layout page;
    auto const step_of = [](Axis const& axis) { return std::max(1.0, std::ceil((axis.high - axis.low) / 10)); };
    for (double decade = x.low; decade <= x.high; decade += step_of(x)) {
        double const at = x.at(std::pow(10, decade));
        page.lines.push_back({at, top, at, floor, grid_color});
        page.words.push_back({at, floor + 16, Word::Anchor::middle, text("1e", decade), false});
    }
    for (double decade = y.low; decade <= y.high; decade += step_of(y)) {
        double const at = y.at(std::pow(10, decade));
        page.lines.push_back({left, at, width - right, at, grid_color});
        page.words.push_back({left - 6, at + 4, Word::Anchor::end, text("1e", decade), false});
    }
    if (zeros) page.words.push_back({left - 6, floor + 4, Word::Anchor::end, "0", false});
    page.lines.push_back({left, floor, width - right, floor, ink});
    page.lines.push_back({left, top, left, floor, ink});
    page.words.push_back({0.5 * (left + width - right), height - 16, Word::Anchor::middle, chart.x_label, false});
    page.words.push_back({8, 20, Word::Anchor::start, chart.y_label, false});
    page.words.push_back({width - right, 20, Word::Anchor::end, chart.title, false});

    std::vector<ScatterPoint const*> front;
    for (auto const& p : chart.points) {
        Color const color = p.wrong ? red : p.front ? blue : grey;
        double const px = x.at(p.x), py = place(p.y);
        if (p.predicted_x || p.predicted_y) {
            double const qx = p.predicted_x && *p.predicted_x > 0 ? x.at(*p.predicted_x) : px;
            double const qy = p.predicted_y ? place(*p.predicted_y) : py;
            page.lines.push_back({px, py, qx, qy, color});
            page.discs.push_back({qx, qy, 3.5, false, color, text("predicted: ", p.label)});
        }
        page.discs.push_back({px, py, 4, true, color, p.label});
        if (p.front) front.push_back(&p);
    }
    std::sort(front.begin(), front.end(), [](auto const* a, auto const* b) { return a->x < b->x; });
    for (std::size_t i = 0; i < front.size(); ++i) {
        double const px = x.at(front[i]->x), py = place(front[i]->y);
        bool const last_third = px > left + 0.66 * (width - left - right);
        page.words.push_back({px + (last_third ? -7 : 7), py - 7, last_third ? Word::Anchor::end : Word::Anchor::start,
                              front[i]->label, true});
        if (i + 1 == front.size()) continue;
        double const qx = x.at(front[i + 1]->x), qy = place(front[i + 1]->y);
        page.lines.push_back({px, py, qx, py, blue}); // what is reached in this time, until the next is
        page.lines.push_back({qx, py, qx, qy, blue});
    }
    return page;
}

std::string escaped(std::string const& text) {
    std::string result;
    for (char const c : text)
        result += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
    return result;
}

std::string hex(Color const& color) {
    constexpr std::string_view digits = "0123456789abcdef";
    std::string result = "#";
    for (double const share : {color.red, color.green, color.blue}) {
        auto const byte = static_cast<std::size_t>(std::lround(255 * share));
        result += digits[byte / 16];
        result += digits[byte % 16];
    }
    return result;
}

std::string pixels(double value) { return to_text(std::round(10 * value) / 10); }

/// Three columns and five rows a letter: a digit holds the bits of a row.
std::string_view glyph(char c) {
    constexpr std::array<std::string_view, 26> letters{"25755", "65656", "34443", "65556", "74647", "74644", "34553",
                                                       "55755", "72227", "11152", "55655", "44447", "57755", "65555",
                                                       "25552", "65644", "25563", "65655", "34216", "72222", "55557",
                                                       "55552", "55775", "55255", "55222", "71247"};
    constexpr std::array<std::string_view, 10> digits{"75557", "26227", "71747", "71717", "55711",
                                                      "74717", "74757", "71111", "75757", "75717"};
    if (c >= 'a' && c <= 'z') return letters[static_cast<std::size_t>(c - 'a')];
    if (c >= 'A' && c <= 'Z') return letters[static_cast<std::size_t>(c - 'A')];
    if (c >= '0' && c <= '9') return digits[static_cast<std::size_t>(c - '0')];
    switch (c) {
    case '-':
        return "00700";
    case '+':
        return "02720";
    case '.':
        return "00002";
    case ',':
        return "00024";
    case ':':
        return "02020";
    case '/':
        return "11244";
    case '%':
        return "51245";
    case '|':
        return "22222";
    case '(':
        return "24442";
    case ')':
        return "21112";
    default:
        return "00000";
    }
}

class Canvas {
public:
    Canvas(int width, int height) {
        image_.width = width;
        image_.height = height;
        image_.pixels.assign(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0F);
        for (std::size_t i = 3; i < image_.pixels.size(); i += 4) image_.pixels[i] = 1;
    }
    void set(double x, double y, Color const& color) {
        auto const column = static_cast<std::int64_t>(std::floor(x)), row = static_cast<std::int64_t>(std::floor(y));
        if (column < 0 || row < 0 || column >= image_.width || row >= image_.height) return;
        float* const p = image_.pixels.data() + 4 * (row * image_.width + column);
        p[0] = static_cast<float>(srgb_to_linear(color.red));
        p[1] = static_cast<float>(srgb_to_linear(color.green));
        p[2] = static_cast<float>(srgb_to_linear(color.blue));
        p[3] = 0;
    }
    void draw(Line const& line) {
        double const length = std::max({1.0, std::abs(line.x1 - line.x0), std::abs(line.y1 - line.y0)});
        for (double i = 0; i <= length; ++i)
            set(line.x0 + (line.x1 - line.x0) * i / length, line.y0 + (line.y1 - line.y0) * i / length, line.color);
    }
    void draw(Disc const& disc) {
        for (double dy = -std::ceil(disc.radius); dy <= disc.radius; ++dy)
            for (double dx = -std::ceil(disc.radius); dx <= disc.radius; ++dx) {
                double const r = std::hypot(dx, dy);
                if (r <= disc.radius && (disc.filled || r > disc.radius - 1.5))
                    set(disc.x + dx, disc.y + dy, disc.color);
            }
    }
    void draw(Word const& word) {
        constexpr double dot = 2, letter = 4 * dot;
        double const wide = letter * static_cast<double>(word.text.size());
        double x = word.x - (word.anchor == Word::Anchor::start ? 0
                             : word.anchor == Word::Anchor::end ? wide
                                                                : wide / 2);
        for (char const c : word.text) {
            std::string_view const rows = glyph(c);
            for (int row = 0; row < 5; ++row)
                for (int column = 0; column < 3; ++column) {
                    int const bits = rows[static_cast<std::size_t>(row)] - '0';
                    if ((bits >> (2 - column) & 1) == 0) continue;
                    for (int i = 0; i < 4; ++i)
                        set(x + dot * column + i % 2, word.y - 5 * dot + dot * row + i / 2, ink);
                }
            x += letter;
        }
    }
    Image take() { return std::move(image_); }

private:
    Image image_;
};

} // namespace

Image draw(ScatterChart const& chart, int width, int height) {
    Layout const page = lay_out(chart, width, height);
    Canvas canvas(width, height);
    for (auto const& line : page.lines) canvas.draw(line);
    for (auto const& disc : page.discs) canvas.draw(disc);
    for (auto const& word : page.words)
        if (!word.small) canvas.draw(word);
    return canvas.take();
}

std::string to_svg(ScatterChart const& chart) {
    constexpr double width = 860, height = 520;
    Layout const page = lay_out(chart, width, height);
    std::string svg = text("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 ", width, " ", height,
                           "\" font-family=\"sans-serif\" font-size=\"12\">\n"
                           "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n");
    for (auto const& line : page.lines)
        svg += text("<line x1=\"", pixels(line.x0), "\" y1=\"", pixels(line.y0), "\" x2=\"", pixels(line.x1),
                    "\" y2=\"", pixels(line.y1), "\" stroke=\"", hex(line.color), "\"/>\n");
    for (auto const& disc : page.discs)
        svg += text("<circle cx=\"", pixels(disc.x), "\" cy=\"", pixels(disc.y), "\" r=\"", disc.radius,
                    disc.filled ? "\" fill=\"" : "\" fill=\"white\" stroke=\"", hex(disc.color), "\"><title>",
                    escaped(disc.tip), "</title></circle>\n");
    for (auto const& word : page.words) {
        char const* const anchor = word.anchor == Word::Anchor::start ? "start"
                                   : word.anchor == Word::Anchor::end ? "end"
                                                                      : "middle";
        svg += text("<text x=\"", pixels(word.x), "\" y=\"", pixels(word.y), "\" text-anchor=\"", anchor,
                    word.small ? "\" font-size=\"9\">" : "\">", escaped(word.text), "</text>\n");
    }
    return svg + "</svg>\n";
}

} // namespace vkt::render
