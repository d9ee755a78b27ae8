// Transfer functions: opacity to extinction, knots, tables with integrals, domains.
// SPDX-License-Identifier: MIT
#include "libvkt/render/transfer.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

bool in_unit_range(double value) { return value >= 0 && value <= 1; }

Knot knot_at(std::vector<Knot> const& knots, double value) {
    auto const after =
        std::upper_bound(knots.begin(), knots.end(), value, [](double v, Knot const& k) { return v < k.value; });
    if (after == knots.begin()) return knots.front();
    if (after == knots.end()) return knots.back();
    Knot const &a = *(after - 1), &b = *after;
    double const f = (value - a.value) / (b.value - a.value);
    auto const mix = [f](double p, double q) { return p + f * (q - p); };
    return {value, mix(a.extinction, b.extinction), mix(a.red, b.red), mix(a.green, b.green), mix(a.blue, b.blue)};
}

using Density = std::array<double, 4>;

Density density_of(Knot const& k) {
    return {k.extinction, k.extinction * k.red, k.extinction * k.green, k.extinction * k.blue};
}

/// Mean density between two values that lie within one segment of the knots: extinction and colour are linear there,
/// so their product is a parabola and Simpson's rule is exact.
Density mean_density(Knot const& a, Knot const& b) {
    Knot const middle{0, (a.extinction + b.extinction) / 2, (a.red + b.red) / 2, (a.green + b.green) / 2,
                      (a.blue + b.blue) / 2};
    Density const p = density_of(a), q = density_of(middle), r = density_of(b);
    Density mean;
    for (std::size_t i = 0; i < 4; ++i) mean[i] = (p[i] + 4 * q[i] + r[i]) / 6;
    return mean;
}

} // namespace

void TransferFunction::check_and_sort() {
    if (points.empty()) throw Error(ErrorKind::usage, "the transfer function has no points");
    for (ControlPoint const& p : points) {
        if (!std::isfinite(p.value)) throw Error(ErrorKind::usage, "a value of the transfer function is not finite");
        if (!in_unit_range(p.alpha) || !in_unit_range(p.color.red) || !in_unit_range(p.color.green) ||
            !in_unit_range(p.color.blue))
            throw Error(ErrorKind::usage,
                        text("the transfer function has a colour or opacity outside 0 to 1 at value ", p.value));
    }
    if (!(unit >= 0) || !std::isfinite(unit)) throw Error(ErrorKind::usage, "the unit distance must be positive");
    std::stable_sort(points.begin(), points.end(), [](auto const& a, auto const& b) { return a.value < b.value; });
}

double extinction_of(double alpha) {
    if (alpha <= 0) return 0;
    if (alpha >= 1) return most_extinction;
    return std::min(-std::log1p(-alpha), most_extinction);
}

TransferFunction transfer_from_lut(std::vector<double> const& rgba, double lower, double upper) {
    if (rgba.empty() || rgba.size() % 4 != 0)
        throw Error(ErrorKind::usage, text("--rgba-lookup-table takes r g b a for every entry; ",
                                           static_cast<std::int64_t>(rgba.size()), " numbers are no multiple of 4"));
    TransferFunction transfer;
    std::size_t const n = rgba.size() / 4;
    for (std::size_t i = 0; i < n; ++i) {
        double const share = n > 1 ? static_cast<double>(i) / static_cast<double>(n - 1) : 0.5;
        transfer.points.push_back(
            {std::lerp(lower, upper, share), {rgba[4 * i], rgba[4 * i + 1], rgba[4 * i + 2]}, rgba[4 * i + 3]});
    }
    transfer.check_and_sort();
    return transfer;
}

/// Chords between two colours: from black to white so many that none is off by more than an eighth of a display level.
constexpr int fewest_chords = 16;
constexpr double chords_of_full_range = 48;

double Rescaling::of(double stored) const { return std::clamp(stored * scale - offset * scale, -limit, limit); }

std::vector<Knot> knots_of(TransferFunction const& transfer, ValueMap const& values, Rescaling const& rescaling,
                           double unit, double scale) {
    std::vector<Knot> knots;
    auto const add = [&](double value, double extinction, Color c) {
        if (!transfer.linear_colors) c = {srgb_to_linear(c.red), srgb_to_linear(c.green), srgb_to_linear(c.blue)};
        knots.push_back({rescaling.of(values.stored(value)), extinction, c.red, c.green, c.blue});
    };
    auto const extinction = [&](double alpha) {
        return std::min(extinction_of(alpha) * scale, most_extinction) / unit;
    };
    for (std::size_t i = 0; i < transfer.points.size(); ++i) {
        ControlPoint const& p = transfer.points[i];
        if (i > 0) {
            // Straight lines between sRGB colours bend in linear light.
            ControlPoint const& o = transfer.points[i - 1];
            double const apart = std::max({std::abs(p.color.red - o.color.red), std::abs(p.color.green - o.color.green),
                                           std::abs(p.color.blue - o.color.blue)});
            bool const straight = transfer.linear_colors || o.value == p.value || apart == 0;
            int const parts =
                straight ? 1 : std::max(fewest_chords, static_cast<int>(std::ceil(chords_of_full_range * apart)));
            for (int k = 1; k < parts; ++k) {
                double const f = k / static_cast<double>(parts);
                auto const mix = [f](double a, double b) { return std::lerp(a, b, f); };
                add(mix(o.value, p.value), mix(extinction(o.alpha), extinction(p.alpha)),
                    {mix(o.color.red, p.color.red), mix(o.color.green, p.color.green),
                     mix(o.color.blue, p.color.blue)});
            }
        }
        add(p.value, extinction(p.alpha), p.color);
    }
    if (values.slope < 0) std::reverse(knots.begin(), knots.end());
    return knots;
}

std::vector<Knot> bends_of(std::vector<Knot> const& knots) {
    double greatest = 0;
    for (Knot const& k : knots) greatest = std::max(greatest, k.extinction);
    double const allowed = 1e-10 * greatest; // opacities near 1 were rounded to that
    constexpr double any = std::numeric_limits<double>::infinity();
    std::vector<Knot> bends{knots.front()};
    double least = -any, most = any; // slopes that keep to all knots since the last bend
    for (std::size_t i = 1; i < knots.size(); ++i) {
        auto const width = [&] { return knots[i].value - bends.back().value; };
        auto const rise = [&] { return knots[i].extinction - bends.back().extinction; };
        if (width() > 0 && !(rise() >= least * width() && rise() <= most * width())) {
            bends.push_back(knots[i - 1]);
            least = -any, most = any;
        }
        if (width() > 0) {
            least = std::max(least, (rise() - allowed) / width());
            most = std::min(most, (rise() + allowed) / width());
        } else if (std::abs(rise()) > allowed) { // the other side of a step
            bends.push_back(knots[i]);
            least = -any, most = any;
        }
    }
    if (knots.size() > 1) bends.push_back(knots.back());
    return bends;
}

TransferTable::TransferTable(std::vector<Knot> const& knots, int nodes) : count_(std::max(nodes, 2)) {
    double lower = knots.front().value, upper = knots.back().value;
    // Positions are floats: nodes are no closer together than these are, and begin at one of them. Closer than the
    // least distance their number per value would not be a float.
    constexpr double least_gap = 0x1p-126;
    double const gap = std::max(std::max(std::abs(lower), std::abs(upper)) * 0x1p-23, least_gap);
    // A domain without extent is a step: below the value the first knot holds, from the value on the last one. Values
    // that were interpolated may be a few roundings lower.
    bool const step = !(upper > lower);
    if (step) upper -= 8 * gap;
    lower = std::min(lower, upper - (step ? 16 : 1) * count_ * gap);
    // Downwards, because what the first node holds goes on below it.
    auto const nearest = static_cast<float>(lower);
    lower = nearest > lower ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
    double const width = (upper - lower) / (count_ - 1);
    origin_ = static_cast<float>(lower);
    scale_ = static_cast<float>(1 / width);

    std::vector<Density> density(static_cast<std::size_t>(count_));
    double greatest = 0;
    for (std::size_t i = 0; i < density.size(); ++i)
        density[i] =
            density_of(i + 1 < density.size() ? knot_at(knots, lower + static_cast<double>(i) * width) : knots.back());
    if (knots.front().value == knots.back().value) density.front() = density_of(knots.front());
    for (Knot const& k : knots) greatest = std::max(greatest, k.extinction);

    // Where knots lie between two nodes, what the straight line misses is given to both, so that no spike is lost.
    std::vector<Density> const sampled = density;
    std::size_t next = 0;
    for (std::size_t i = 0; i + 1 < density.size(); ++i) {
        double const a = lower + static_cast<double>(i) * width, b = a + width;
        while (next < knots.size() && knots[next].value <= a) ++next;
        if (next >= knots.size() || knots[next].value >= b) continue;
        Density integral{};
        Knot from = knot_at(knots, a);
        double begin = a;
        for (;;) {
            bool const inside = next < knots.size() && knots[next].value < b;
            // Just before a step the knot that ends it counts, just behind it the one that begins it.
            Knot const to = inside ? knots[next] : knot_at(knots, b);
            double const end = inside ? to.value : b;
            Density const mean = mean_density(from, to);
            for (std::size_t c = 0; c < 4; ++c) integral[c] += mean[c] * (end - begin) / width;
            if (!inside) break;
            from = to, begin = end, ++next;
        }
        double const missed = integral[0] - (sampled[i][0] + sampled[i + 1][0]) / 2;
        if (std::abs(missed) < 1e-3 * greatest) continue;
        for (std::size_t c = 0; c < 4; ++c) {
            double const half = (integral[c] - (sampled[i][c] + sampled[i + 1][c]) / 2) / 2;
            density[i][c] = std::max(0.0, density[i][c] + half);
            density[i + 1][c] = std::max(0.0, density[i + 1][c] + half);
        }
    }

    nodes_.resize(2 * density.size());
    Density running{};
    auto const quad = [](Density const& d) {
        return Quad{static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2]),
                    static_cast<float>(d[3])};
    };
    greatest_.emplace_back();
    for (std::size_t i = 0; i < density.size(); ++i) {
        nodes_[2 * i] = quad(running);
        nodes_[2 * i + 1] = quad(density[i]);
        greatest_[0].push_back(static_cast<float>(density[i][0]));
        if (i + 1 < density.size())
            for (std::size_t c = 0; c < 4; ++c) running[c] += (density[i][c] + density[i + 1][c]) / 2;
    }
    std::size_t blind = 0;
    while (blind < density.size() && !(greatest_[0][blind] > 0)) ++blind;
    hidden_ = blind == density.size() ? table_limit : blind == 0 ? -table_limit : static_cast<float>(blind - 1);
    for (std::size_t span = 1; 2 * span <= density.size(); span *= 2) {
        std::vector<float> const& below = greatest_.back();
        std::vector<float> level(below.size() - span);
        for (std::size_t i = 0; i < level.size(); ++i) level[i] = std::max(below[i], below[i + span]);
        greatest_.push_back(std::move(level));
    }
}

float TransferTable::greatest_extinction(float lowest, float highest) const {
    if (!(lowest <= highest)) return 0;
    // Interpolation between equal values is exact; otherwise it may pass the ends by a rounding error.
    Nodes const nodes = nodes_of(lowest, highest, lowest == highest ? 0.0F : 1.0F / 64);
    auto const first = static_cast<std::size_t>(nodes.first), last = static_cast<std::size_t>(nodes.last);
    std::size_t level = 0;
    while ((std::size_t{2} << level) <= last - first + 1) ++level;
    return std::max(greatest_[level][first], greatest_[level][last + 1 - (std::size_t{1} << level)]);
}

TransferTable::Nodes TransferTable::nodes_of(float lowest, float highest, float slack) const {
    TableView const table = view();
    float const from = table_position(table, lowest), to = table_position(table, highest);
    auto const node = [&](float x) {
        return static_cast<std::int32_t>(std::clamp(x, 0.0F, static_cast<float>(count_ - 1)));
    };
    return {node(std::floor(std::min(from, to) - slack)), node(std::ceil(std::max(from, to) + slack))};
}

std::vector<std::uint32_t> TransferTable::visible_before() const {
    std::vector<std::uint32_t> before{0};
    for (float const extinction : greatest_[0]) before.push_back(before.back() + (extinction > 0 ? 1 : 0));
    return before;
}

double Histogram::percentile(double p) const {
    std::int64_t const finite = total - missing - infinite;
    if (finite <= 0 || bins.empty()) return least;
    double const wanted = std::clamp(p, 0.0, 1.0) * static_cast<double>(finite);
    double below = 0;
    for (std::size_t i = 0; i < bins.size(); ++i) {
        auto const count = static_cast<double>(bins[i]);
        if (count > 0 && below + count >= wanted)
            return value_at(static_cast<double>(i) + std::clamp((wanted - below) / count, 0.0, 1.0));
        below += count;
    }
    return greatest;
}

Domain resolve_domain(std::string const& text_of, Histogram const& histogram) {
    if (text_of == "auto" || text_of == "minmax" || text_of.empty())
        return {text_of, histogram.least, histogram.greatest};
    auto const fail = [&] {
        return Error(ErrorKind::usage, text("--domain '", text_of, "' is not LO:HI, minmax, pA:pB or auto"),
                     "for example --domain 0:255 or --domain p1:p99");
    };
    auto const parts = split(text_of, ':');
    if (parts.size() != 2 || parts[0].empty() || parts[1].empty()) throw fail();
    auto const read = [&](std::string const& part) {
        if (part.front() != 'p' && part.front() != 'P') return parse_double(part);
        double const p = parse_double(part.substr(1));
        if (!(p >= 0 && p <= 100)) throw fail();
        return histogram.percentile(p / 100);
    };
    Domain domain{text_of, read(parts[0]), read(parts[1])};
    // Two percentiles may meet; what is written is no range if it names one of them twice.
    bool const numbers = is_number(parts[0]) && is_number(parts[1]);
    if (parts[0] == parts[1] || (numbers && domain.lower == domain.upper))
        throw Error(ErrorKind::usage, text("--domain '", text_of, "' holds a single value"),
                    "give LO:HI with LO below HI; --opacity VALUE:A,VALUE:A places opacities at values");
    if (domain.lower > domain.upper)
        throw Error(ErrorKind::usage, text("--domain '", text_of, "': ", parts[0], " is not below ", parts[1]),
                    "LO:HI begins with the lower end; --colormap NAME:reverse turns the colours round");
    if (!std::isfinite(domain.lower) || !std::isfinite(domain.upper)) throw fail();
    return domain;
}

} // namespace vkt::render
