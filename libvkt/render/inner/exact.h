// The reference integrator: double precision, exact values of depth in every piece of a ray, no table, no step.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/march.h"
#include "libvkt/render/inner/pieces.h"

namespace vkt::render {

/// How many knots lie at or before a value.
VKT_HD int knots_before(Knot const* knots, int count, double value) {
    int low = 0, high = count;
    while (low < high) {
        int const middle = (low + high) / 2;
        if (knots[middle].value > value)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/// Extinction per world length and colour straight from the knots; constant beyond the ends.
VKT_HD Knot evaluate(Knot const* knots, int count, double value) {
    int const i = knots_before(knots, count, value);
    if (i == 0) return knots[0];
    if (i == count) return knots[count - 1];
    Knot const &a = knots[i - 1], &b = knots[i];
    double const f = (value - a.value) / (b.value - a.value);
    return {value, a.extinction + f * (b.extinction - a.extinction), a.red + f * (b.red - a.red),
            a.green + f * (b.green - a.green), a.blue + f * (b.blue - a.blue)};
}

/// Where a monotone stretch of a cubic passes a value that lies between those at its ends.
VKT_HD double passing_of(Cubic const& f, double value, double from, double to) {
    double const begin = f(from), end = f(to);
    bool const rising = end > begin;
    double low = from, high = to, s = from + (to - from) * ((value - begin) / (end - begin));
    if (!(s > low && s < high)) s = 0.5 * (low + high);
    for (int i = 0; i < 60; ++i) {
        double const off = f(s) - value;
        if (off == 0) return s;
        if ((off < 0) == rising)
            low = s;
        else
            high = s;
        double const slope = (3 * f.a * s + 2 * f.b) * s + f.c, newton = s - off / slope;
        double const next = newton > low && newton < high ? newton : 0.5 * (low + high);
        if (std::abs(next - s) < 1e-15) return next;
        s = next;
    }
    return s;
}

/// visit(from, to, i) in order over the stretches of a cubic over [0, 1] along which all values lie between knots
/// i - 1 and i, until it returns false; false if it did. `least` and `greatest` bound the values.
template <class Visit>
VKT_HD bool between_knots(Knot const* knots, int count, Cubic const& f, double least, double greatest, Visit&& visit) {
    int const first = knots_before(knots, count, least);
    bool const one = first == count || knots[first].value > greatest; // all values are between the same knots
    if (one) return visit(0.0, 1.0, first);
    double cuts[3];
    int n = extrema(f, cuts);
    cuts[n++] = 1;
    double from = 0;
    for (int k = 0; k < n; from = cuts[k], ++k) {
        double const to = cuts[k], begin = f(from), end = f(to);
        int i = knots_before(knots, count, begin);
        if (end >= begin) {
            for (; i < count && knots[i].value < end; ++i) {
                if (knots[i].value == knots[i > 0 ? i - 1 : 0].value && i > 0) continue; // the other side of a step
                double const next = passing_of(f, knots[i].value, from, to);
                if (!visit(from, next, i)) return false;
                from = next;
            }
        } else {
            while (i > 0 && knots[i - 1].value >= begin) --i; // it goes down from there
            for (; i > 0 && knots[i - 1].value > end; --i) {
                if (i < count && knots[i - 1].value == knots[i].value) continue;
                double const next = passing_of(f, knots[i - 1].value, from, to);
                if (!visit(from, next, i)) return false;
                from = next;
            }
        }
        if (!visit(from, to, i)) return false;
    }
    return true;
}

/// Extinction along cubics whose values lie between two neighbouring knots.
struct KnotGap {
    Knot const &a, &b;
    double per_value, rise;

    VKT_HD KnotGap(Knot const* knots, int count, int i) // between knots i - 1 and i
        : a(knots[i > 0 ? i - 1 : 0]), b(knots[i < count ? i : count - 1]),
          per_value(b.value > a.value ? 1 / (b.value - a.value) : 0), rise((b.extinction - a.extinction) * per_value) {}

    VKT_HD bool shows() const { return a.extinction > 0 || b.extinction > 0; }
    VKT_HD double extinction(Cubic const& f, double s) const {
        double const extinction = a.extinction + rise * (f(s) - a.value);
        return extinction > 0 ? extinction : 0; // next to a knot it may round to less
    }
    /// Integral of the extinction over s: two Gauss points are exact for a cubic.
    VKT_HD double depth(Cubic const& f, double from, double to) const {
        constexpr double offset = 0.28867513459481288; // 1 / (2 sqrt 3)
        double const middle = 0.5 * (from + to), width = to - from;
        return 0.5 * width * (extinction(f, middle - offset * width) + extinction(f, middle + offset * width));
    }
    /// Where the depth from `from` on is `wanted`, which it is at `to` at the latest.
    VKT_HD double place_of_depth(Cubic const& f, double wanted, double from, double to) const {
        double low = from, high = to;
        for (int i = 0; i < 60 && high - low > 1e-12; ++i) {
            double const middle = 0.5 * (low + high), off = depth(f, from, middle) - wanted;
            (off < 0 ? low : high) = middle;
            // From the middle, where the bracket halves, to where the slope says.
            double const newton = middle - off / extinction(f, middle);
            if (!(newton > low && newton < high)) continue;
            (depth(f, from, newton) < wanted ? low : high) = newton;
        }
        return high;
    }
};

/// Radiance before it is rounded.
struct ExactRadiance {
    double red, green, blue, transmittance;
};

/// Light gathered along a ray, piece by piece: within a lattice cell the value is a cubic, and where that runs between
/// two neighbouring knots extinction and colours are cubics too. So the depth of a piece is exact, and its light is a
/// smooth integral, which five Gauss points in parts that are not deep give to ten digits.
struct ExactMarch {
    static constexpr double deepest = 0.5;       ///< part, in optical depth
    static constexpr double invisible = 30;      ///< depth of which no float tells more
    static constexpr double most_parts = 0x1p16; ///< of a piece; only the first ones of such a piece are seen
    Knot const* knots;
    int count;
    Counters* counters;
    double red = 0, green = 0, blue = 0, depth = 0;

    VKT_HD bool done() const { return depth > invisible; }

    /// Adds the cubic from `from` to `to`, of which `world` is the length of [0, 1]. All values lie between knots i - 1
    /// and i.
    VKT_HD void add_piece(Cubic const& f, double from, double to, int i, double world) {
        KnotGap const gap(knots, count, i);
        if (!(to > from) || !gap.shows()) return;
        double const whole = gap.depth(f, from, to) * world;
        if (!(whole > 0)) return;
        double const wanted = std::ceil(whole / deepest);
        int const parts = wanted < most_parts ? static_cast<int>(wanted) : static_cast<int>(most_parts);
        for (int k = 0; k < parts && !done(); ++k) {
            double const begin = from + (to - from) * k / parts, end = from + (to - from) * (k + 1) / parts;
            add_part(f, begin, end, gap, world);
        }
    }

    VKT_HD void add_part(Cubic const& f, double from, double to, KnotGap const& gap, double world) {
        constexpr double place[5] = {0.046910077030668004, 0.23076534494715845, 0.5, 0.76923465505284155,
                                     0.953089922969332};
        constexpr double weight[5] = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                      0.23931433524968324, 0.11846344252809454};
        Knot const &a = gap.a, &b = gap.b;
        double sum = 0, r = 0, g = 0, bl = 0;
        for (int k = 0; k < 5; ++k) {
            double const s = from + (to - from) * place[k];
            double const w = weight[k] * gap.extinction(f, s) * std::exp(-world * gap.depth(f, from, s));
            double const share = (f(s) - a.value) * gap.per_value;
            sum += w;
            r += w * (a.red + share * (b.red - a.red));
            g += w * (a.green + share * (b.green - a.green));
            bl += w * (a.blue + share * (b.blue - a.blue));
        }
        double const through = world * gap.depth(f, from, to);
        ++counters->segments;
        counters->samples += 5;
        if (!(sum > 0)) return;
        double const share = std::exp(-depth) * -std::expm1(-through) / sum;
        red += share * r, green += share * g, blue += share * bl;
        depth += through;
    }

    /// Adds one cell. `least` and `greatest` bound its values.
    VKT_HD void add_cell(Cubic const& f, double least, double greatest, double world) {
        between_knots(
            knots, count, f, least, greatest, [&](double from, double to, int i) __attribute__((always_inline)) {
                add_piece(f, from, to, i, world);
                return !done();
            });
    }
};

template <class S>
VKT_HD ExactRadiance exact_integral(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ExactMarch march{scene.knots, scene.knot_count, &counters};
    ++counters.rays;
    each_piece(
        sampler, scene, ray, S::skips_exactly, [&](auto const& piece) __attribute__((always_inline)) {
            if (piece.missing) return true;
            return piece.each_cubic([&](Cubic const& f, double from, double to) __attribute__((always_inline)) {
                march.add_cell(f, static_cast<double>(piece.least), static_cast<double>(piece.greatest),
                               (to - from) * piece.width * ray.world_per_lattice);
                return !march.done();
            });
        });
    return {march.red, march.green, march.blue, std::exp(-march.depth)};
}

template <class S>
VKT_HD Radiance exact_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    ExactRadiance const r = exact_integral(sampler, scene, ray, counters);
    return {static_cast<float>(r.red), static_cast<float>(r.green), static_cast<float>(r.blue),
            static_cast<float>(r.transmittance)};
}

} // namespace vkt::render
