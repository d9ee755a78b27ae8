// LDR-FLIP: colours as an eye at a distance sees them, edges and points, in the paper's names and constants.
// SPDX-License-Identifier: MIT
#include "libvkt/render/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vkt::render {

namespace {

using Color3 = std::array<double, 3>;
using Matrix = std::array<Color3, 3>; // by rows

constexpr double to_xyz_rational[3][4] = {{10135552, 8788810, 4435075, 24577794},
                                          {2613072, 8788810, 887015, 12288897},
                                          {1425312, 8788810, 70074185, 73733382}};

Color3 operator*(Matrix const& m, Color3 const& v) {
    Color3 out{};
    for (std::size_t i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    return out;
}

Matrix inverse(Matrix const& m) {
    auto const minor = [&](std::size_t r, std::size_t c) {
        std::size_t const r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
        return m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
    };
    double const det = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    Matrix out{};
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) out[r][c] = minor(c, r) / det;
    return out;
}

/// Linear sRGB, XYZ relative to its white, and the opponent space YCxCz.
struct Spaces {
    Matrix to_xyz{}, from_xyz{};
    Color3 white{};
    Spaces() {
        for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t c = 0; c < 3; ++c) to_xyz[r][c] = to_xyz_rational[r][c] / to_xyz_rational[r][3];
        from_xyz = inverse(to_xyz);
        white = to_xyz * Color3{1, 1, 1};
    }
    Color3 relative(Color3 const& linear) const {
        Color3 const xyz = to_xyz * linear;
        return {xyz[0] / white[0], xyz[1] / white[1], xyz[2] / white[2]};
    }
    Color3 opponent(Color3 const& linear) const {
        Color3 const t = relative(linear);
        return {116 * t[1] - 16, 500 * (t[0] - t[1]), 200 * (t[1] - t[2])};
    }
    Color3 linear(Color3 const& ycxcz) const {
        double const y = (ycxcz[0] + 16) / 116;
        return from_xyz * Color3{(y + ycxcz[1] / 500) * white[0], y * white[1], (y - ycxcz[2] / 200) * white[2]};
    }
    /// L*a*b*, its chroma scaled by lightness (Hunt).
    Color3 hunt_lab(Color3 const& linear) const {
        Color3 t = relative(linear);
        constexpr double delta = 6.0 / 29;
        for (double& v : t) v = v > delta * delta * delta ? std::cbrt(v) : v / (3 * delta * delta) + 4.0 / 29;
        double const lightness = 116 * t[1] - 16;
        return {lightness, 0.01 * lightness * 500 * (t[0] - t[1]), 0.01 * lightness * 200 * (t[1] - t[2])};
    }
};

double hyab(Color3 const& a, Color3 const& b) { return std::abs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]); }

/// Weights from -radius to radius.
struct Line {
    std::vector<double> weights;
    int radius() const { return static_cast<int>(weights.size() / 2); }
};

struct Plane {
    int width, height;
    std::vector<double> values;
};

/// A picture filtered along x and then along y, replicated at its edges.
Plane filtered(Plane const& in, Line const& along_x, Line const& along_y) {
    auto const width = static_cast<std::size_t>(in.width);
    Plane across{in.width, in.height, std::vector<double>(in.values.size())}, out = across;
#pragma omp parallel for schedule(static)
    for (int y = 0; y < in.height; ++y) {
        double const* const row = in.values.data() + static_cast<std::size_t>(y) * width;
        int const r = along_x.radius();
        for (int x = 0; x < in.width; ++x) {
            double sum = 0;
            for (int k = -r; k <= r; ++k)
                sum += along_x.weights.data()[k + r] * row[std::clamp(x + k, 0, in.width - 1)];
            across.values[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)] = sum;
        }
    }
#pragma omp parallel for schedule(static)
    for (int y = 0; y < in.height; ++y) {
        double* const row = out.values.data() + static_cast<std::size_t>(y) * width;
        int const r = along_y.radius();
        for (int k = -r; k <= r; ++k) {
            double const weight = along_y.weights.data()[k + r];
            double const* const from =
                across.values.data() + static_cast<std::size_t>(std::clamp(y + k, 0, in.height - 1)) * width;
            for (std::size_t x = 0; x < width; ++x) row[x] += weight * from[x];
        }
    }
    return out;
}

/// e^(-rate k^2) for k from -radius to radius.
Line gaussian(double rate, int radius) {
    Line line;
    for (int k = -radius; k <= radius; ++k) line.weights.push_back(std::exp(-rate * k * k));
    return line;
}

double sum_of(Line const& line) {
    double sum = 0;
    for (double const w : line.weights) sum += w;
    return sum;
}

/// What an eye resolves in one opponent channel: one or two Gaussians (the paper's a and b).
struct Contrast {
    double a1, b1, a2, b2;
};
constexpr Contrast achromatic{1, 0.0047, 0, 1e-5}, red_green{1, 0.0053, 0, 1e-5}, blue_yellow{34.1, 0.04, 13.5, 0.025};

Plane seen(Plane const& in, Contrast const& c, double ppd) {
    constexpr double pi = std::numbers::pi;
    int const radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * pi * pi)) * ppd));
    Line const one = gaussian(pi * pi / (c.b1 * ppd * ppd), radius),
               two = gaussian(pi * pi / (c.b2 * ppd * ppd), radius);
    double const s1 = c.a1 * std::sqrt(pi / c.b1), s2 = c.a2 * std::sqrt(pi / c.b2);
    double const total = s1 * sum_of(one) * sum_of(one) + s2 * sum_of(two) * sum_of(two);
    Plane out = filtered(in, one, one);
    for (double& v : out.values) v *= s1 / total;
    if (s2 == 0) return out;
    Plane const more = filtered(in, two, two);
    for (std::size_t i = 0; i < out.values.size(); ++i) out.values[i] += more.values[i] * s2 / total;
    return out;
}

/// Strength of edges (first derivative) or points (second) at every pixel.
std::vector<double> features(Plane const& lightness, double ppd, bool points) {
    double const sd = 0.5 * 0.082 * ppd;
    int const radius = static_cast<int>(std::ceil(3 * sd));
    Line const smooth = gaussian(1 / (2 * sd * sd), radius);
    Line steep = smooth;
    for (int k = -radius; k <= radius; ++k) steep.weights.data()[k + radius] *= points ? k * k / (sd * sd) - 1 : -k;
    double above = 0, below = 0;
    for (double const w : steep.weights) (w < 0 ? below : above) += std::abs(w);
    for (double& w : steep.weights) w /= (w < 0 ? below : above) * sum_of(smooth);
    Plane const x = filtered(lightness, steep, smooth), y = filtered(lightness, smooth, steep);
    std::vector<double> strength(x.values.size());
    for (std::size_t i = 0; i < strength.size(); ++i) strength[i] = std::hypot(x.values[i], y.values[i]);
    return strength;
}

/// What both pipelines need of one picture.
struct SeenPicture {
    std::vector<Color3> colors; ///< Hunt-adjusted L*a*b* of what the eye resolves
    std::vector<double> edges, points;
};

SeenPicture view_of(Image const& image, Spaces const& spaces, double ppd) {
    std::size_t const n = image.pixels.size() / 4;
    std::array<Plane, 3> planes;
    for (Plane& plane : planes) plane = {image.width, image.height, std::vector<double>(n)};
    Plane lightness = planes[0];
    for (std::size_t i = 0; i < n; ++i) {
        Color3 linear{};
        for (std::size_t c = 0; c < 3; ++c)
            linear[c] = std::clamp(static_cast<double>(image.pixels[4 * i + c]), 0.0, 1.0);
        Color3 const opponent = spaces.opponent(linear);
        for (std::size_t c = 0; c < 3; ++c) planes[c].values[i] = opponent[c];
        lightness.values[i] = (opponent[0] + 16) / 116;
    }
    SeenPicture view;
    view.edges = features(lightness, ppd, false);
    view.points = features(lightness, ppd, true);
    planes = {seen(planes[0], achromatic, ppd), seen(planes[1], red_green, ppd), seen(planes[2], blue_yellow, ppd)};
    view.colors.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        Color3 linear = spaces.linear({planes[0].values[i], planes[1].values[i], planes[2].values[i]});
        for (double& v : linear) v = std::clamp(v, 0.0, 1.0);
        view.colors[i] = spaces.hunt_lab(linear);
    }
    return view;
}

} // namespace

std::vector<float> flip(Image const& reference, Image const& test, double pixels_per_degree) {
    constexpr double qc = 0.7, pc = 0.4, pt = 0.95, qf = 0.5;
    Spaces const spaces;
    SeenPicture const one = view_of(reference, spaces, pixels_per_degree),
                      other = view_of(test, spaces, pixels_per_degree);
    double const most = std::pow(hyab(spaces.hunt_lab({0, 1, 0}), spaces.hunt_lab({0, 0, 1})), qc), knee = pc * most;
    std::vector<float> errors(one.colors.size());
    for (std::size_t i = 0; i < errors.size(); ++i) {
        double const e = std::pow(hyab(one.colors[i], other.colors[i]), qc);
        double const color = e < knee ? pt / knee * e : pt + (e - knee) / (most - knee) * (1 - pt);
        double const feature =
            std::max(std::abs(one.edges[i] - other.edges[i]), std::abs(one.points[i] - other.points[i]));
        double const share = std::clamp(std::pow(feature / std::numbers::sqrt2, qf), 0.0, 1.0);
        errors[i] = static_cast<float>(std::pow(color, 1 - share));
    }
    return errors;
}

double mean_flip(Image const& reference, Image const& test) {
    std::vector<float> const errors = flip(reference, test);
    double sum = 0;
    for (float const error : errors) sum += static_cast<double>(error);
    return sum / static_cast<double>(errors.size());
}

} // namespace vkt::render
