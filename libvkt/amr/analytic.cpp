// Analytic fields of synthetic trees.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/analytic.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vkt::analytic {

namespace {

/// Clouds: position relative to the mid-plane of the domain and radius of the shell around them, in domain widths.
struct Cloud {
    Vec3 at;
    double radius, amplitude;
};

constexpr Cloud clouds[] = {{{0.30, 0.35, 0.00}, 0.050, 200},
                            {{0.68, 0.25, 0.06}, 0.035, 600},
                            {{0.55, 0.72, -0.04}, 0.065, 100},
                            {{0.18, 0.80, 0.35}, 0.020, 20}};
constexpr double disk_height = 0.05;

Factor make(Factor::Shape shape, double centre, double scale) { return {shape, centre, scale}; }

/// Smallest and largest distance of a box from a point.
std::pair<double, double> distances(Vec3 lower, Vec3 upper, Vec3 point) {
    double nearest = 0, farthest = 0;
    for (int a = 0; a < 3; ++a) {
        double const gap = std::max({lower[a] - point[a], 0.0, point[a] - upper[a]});
        double const reach = std::max(std::abs(point[a] - lower[a]), std::abs(upper[a] - point[a]));
        nearest += gap * gap;
        farthest += reach * reach;
    }
    return {std::sqrt(nearest), std::sqrt(farthest)};
}

Vec3 place(Cloud const& cloud, Vec3 extent) {
    // Domains other than the SILCC-like one may be flatter than wide: clouds stay inside.
    return {cloud.at.x * extent.x, cloud.at.y * extent.y,
            std::clamp(0.5 * extent.z + cloud.at.z, 0.1 * extent.z, 0.9 * extent.z)};
}

} // namespace

double Factor::value(double p) const {
    double const t = (p - centre) / scale;
    switch (shape) {
    case Shape::one:
        return 1;
    case Shape::linear:
        return t;
    case Shape::sech_squared: {
        double const c = 1 / std::cosh(t);
        return c * c;
    }
    case Shape::gaussian:
        return std::exp(-t * t);
    case Shape::wave:
        break;
    }
    return std::sin(t);
}

double Factor::average(double low, double high) const {
    double const a = (low - centre) / scale, b = (high - centre) / scale;
    switch (shape) {
    case Shape::one:
        return 1;
    case Shape::linear:
        return 0.5 * (a + b);
    // Differences of tanh and erf are taken on the side of zero where they do not cancel to noise.
    case Shape::sech_squared:
        return std::sinh(b - a) / (std::cosh(a) * std::cosh(b)) / (b - a);
    case Shape::gaussian: {
        double const half_root_pi = 0.5 / std::numbers::inv_sqrtpi;
        double const integral = a > 0   ? std::erfc(a) - std::erfc(b)
                                : b < 0 ? std::erfc(-b) - std::erfc(-a)
                                        : std::erf(b) - std::erf(a);
        return half_root_pi * integral / (b - a);
    }
    case Shape::wave:
        break;
    }
    return (std::cos(a) - std::cos(b)) / (b - a);
}

std::vector<Term> terms_of(AmrField field, Index3 logical_dims) {
    using Shape = Factor::Shape;
    Vec3 const n{static_cast<double>(logical_dims.x), static_cast<double>(logical_dims.y),
                 static_cast<double>(logical_dims.z)};
    if (field == AmrField::constant) return {Term{}};
    if (field == AmrField::linear) {
        std::vector<Term> terms(3);
        for (int a = 0; a < 3; ++a) {
            terms[static_cast<std::size_t>(a)].amplitude = a + 1;
            terms[static_cast<std::size_t>(a)].factor[a] = make(Shape::linear, 0, n[a]);
        }
        return terms;
    }
    Factor const sheet = make(Shape::sech_squared, 0.5 * n.z, disk_height * n.x);
    std::vector<Term> terms{{1e-3, {}}, {1, {{}, {}, sheet}}};
    Term ripple{0.5,
                {make(Shape::wave, 0, n.x / (6 * std::numbers::pi)), make(Shape::wave, 0, n.y / (4 * std::numbers::pi)),
                 sheet}};
    terms.push_back(ripple);
    for (Cloud const& cloud : clouds) {
        Vec3 const centre = place(cloud, {1, n.y / n.x, n.z / n.x});
        Term term{cloud.amplitude, {}};
        for (int a = 0; a < 3; ++a) term.factor[a] = make(Shape::gaussian, centre[a] * n.x, 0.5 * cloud.radius * n.x);
        terms.push_back(term);
    }
    return terms;
}

double feature_distance(Vec3 lower, Vec3 upper, Vec3 extent, int levels_to_finest) {
    double best = 1e3 + 1e3 * extent.z;
    for (Cloud const& cloud : clouds) {
        auto const [nearest, farthest] = distances(lower, upper, place(cloud, extent));
        best = std::min(best, std::max({0.0, nearest - cloud.radius, cloud.radius - farthest}));
    }
    // The mid-plane stays two levels coarser than the shells.
    if (levels_to_finest > 2) {
        double const middle = 0.5 * extent.z;
        best = std::min(best, std::max({0.0, lower.z - middle, middle - upper.z}));
    }
    return best;
}

} // namespace vkt::analytic

namespace vkt {

double amr_field_value(AmrField field, Index3 logical_dims, Vec3 position) {
    double sum = 0;
    for (auto const& term : analytic::terms_of(field, logical_dims))
        sum += term.amplitude * term.factor[0].value(position.x) * term.factor[1].value(position.y) *
               term.factor[2].value(position.z);
    return sum;
}

double amr_field_average(AmrField field, Index3 logical_dims, Vec3 lower, Vec3 upper) {
    double sum = 0;
    for (auto const& term : analytic::terms_of(field, logical_dims)) {
        double product = term.amplitude;
        for (int a = 0; a < 3; ++a) product *= term.factor[a].average(lower[a], upper[a]);
        sum += product;
    }
    return sum;
}

} // namespace vkt
