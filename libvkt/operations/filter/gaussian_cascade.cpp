// Cascades: splines, the Gaussian that they leave to do, the distance to the one asked for, and the cheapest choice.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/gaussian_cascade.h"

#include "libvkt/operations/filter/kernels/gaussian_cascade.h"
#include "libvkt/operations/filter/local_filter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace vkt {
namespace {

using Real = long double;

// Wide steps gain nothing more, and the distance takes longer to find.
constexpr std::array<std::int64_t, 14> steps{2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64};
constexpr double most_sigma = 65536;

/// The centred B-spline of odd degree n.
Real spline(int n, Real x) {
    Real sum = 0, sign = 1, binomial = 1, factorial = 1;
    for (int k = 2; k <= n; ++k) factorial *= k;
    Real const at = -std::abs(x) + static_cast<Real>(n + 1) / 2; // on the side with few terms
    for (int k = 0; k <= n + 1 && at - k > 0; ++k) {
        Real power = 1; // std::pow takes a hundred times as long, and plans are made of thousands
        for (int i = 0; i < n; ++i) power *= at - k;
        sum += sign * binomial * power;
        binomial *= static_cast<Real>(n + 1 - k) / (k + 1);
        sign = -sign;
    }
    return sum / factorial;
}

/// What convolutions of the parts need: sampled splines, from the middle on.
struct Parts {
    std::vector<Real> before, coarse;     ///< from the middle on, of unit sum
    std::vector<std::vector<Real>> after; ///< of each phase, from the first node on
};

/// Half the L1 distance of the cascade's kernel to the infinite Gaussian, for the phase with the largest.
double distance(CascadeAxis const& axis, Parts const& parts, double sigma) {
    auto const d = axis.step, p = axis.before.radius, r = axis.coarse.radius;
    std::int64_t const most = (r + axis.taps) * d + p + d;
    std::vector<double> gauss(static_cast<std::size_t>(most + 1));
    Real const mass = gaussian_mass(sigma);
    double inside = 0;
    for (std::int64_t k = most; k >= 0; --k) {
        double const x = static_cast<double>(k) / sigma;
        double const value = static_cast<double>(std::exp(-0.5 * x * x) / mass);
        gauss[static_cast<std::size_t>(k)] = value;
        inside += value * (k == 0 ? 1 : 2);
    }
    double const beyond = std::max(0.0, 1 - inside) + 1e-14;
    auto const weight = [](std::vector<Real> const& from, std::int64_t k) {
        return static_cast<double>(from[static_cast<std::size_t>(std::abs(k))]);
    };
    std::vector<double> before;
    for (std::int64_t k = -p; k <= p; ++k) before.push_back(weight(parts.before, k));
    double worst = 0;
    for (std::int64_t phase = 0; phase <= d / 2; ++phase) { // the others are mirror images
        auto const& after = parts.after[static_cast<std::size_t>(phase)];
        std::vector<double> kernel(static_cast<std::size_t>(2 * most + 1));
        for (std::int64_t node = -r; node < axis.taps + r; ++node) {
            double share = 0;
            for (std::int64_t k = std::max<std::int64_t>(0, node - r); k <= std::min(axis.taps - 1, node + r); ++k)
                share += static_cast<double>(after[static_cast<std::size_t>(k)]) * weight(parts.coarse, node - k);
            double* const to = kernel.data() + most + (node - axis.left) * d - phase - p;
            for (std::size_t k = 0; k < before.size(); ++k) to[k] += share * before[k];
        }
        double sum = beyond;
        for (std::int64_t k = -most; k <= most; ++k)
            sum += std::abs(kernel[static_cast<std::size_t>(k + most)] - gauss[static_cast<std::size_t>(std::abs(k))]);
        worst = std::max(worst, sum / 2);
    }
    return worst;
}

/// Splines of this degree, with a Gaussian of `cut` standard deviations between them. What the splines take from the
/// variance and the fourth moment is made good by the Gaussian.
std::optional<CascadeAxis> cascade_axis(double sigma, std::int64_t step, int degree, double cut) {
    double const knots = sigma / static_cast<double>(step), boxes = 2 * (degree + 1);
    double const variance = knots * knots - boxes / 12;
    if (variance < 0.5) return std::nullopt;
    double const s = std::sqrt(variance);
    CascadeAxis axis;
    axis.step = step;
    axis.taps = degree + 1;
    axis.left = (degree - 1) / 2;

    Parts parts;
    for (std::int64_t k = 0; 2 * k < (degree + 1) * step; ++k)
        parts.before.push_back(spline(degree, static_cast<Real>(k) / static_cast<Real>(step)) /
                               static_cast<Real>(step));
    double const fourth = boxes / 120 / (variance * variance) / 24;
    auto const radius = static_cast<std::int64_t>(std::ceil(cut * s));
    Real sum = 0;
    for (std::int64_t k = 0; k <= radius; ++k) {
        Real const x = static_cast<Real>(k) / s, x2 = x * x;
        Real const tap = std::exp(-x2 / 2) * (1 + fourth * (x2 * x2 - 6 * x2 + 3));
        if (!(tap > 0)) return std::nullopt;
        parts.coarse.push_back(tap);
        sum += (k == 0 ? 1 : 2) * tap;
    }
    for (Real& tap : parts.coarse) tap /= sum;
    axis.before = nested_taps(parts.before);
    axis.coarse = nested_taps(parts.coarse);
    for (std::int64_t phase = 0; phase < step; ++phase) {
        std::vector<Real> after;
        for (std::int64_t k = 0; k < axis.taps; ++k)
            after.push_back(
                spline(degree, static_cast<Real>(phase) / static_cast<Real>(step) - static_cast<Real>(k - axis.left)));
        Real together = after.front();
        for (std::int64_t k = 1; k < axis.taps; ++k) {
            Real const w = after[static_cast<std::size_t>(axis.tap(k))];
            together += w;
            double const share = static_cast<double>(w / together);
            axis.shares.push_back(std::min(share, 1 - 0x1p-53));
            axis.single_shares.push_back(std::min(static_cast<float>(share), 1 - 0x1p-24F));
        }
        parts.after.push_back(std::move(after));
    }
    axis.truncation = distance(axis, parts, sigma);
    return axis;
}

/// The shortest Gaussian between splines with which the distance is small enough.
std::optional<CascadeAxis> cascade_within(double sigma, std::int64_t step, int degree, double truncation) {
    constexpr std::array<double, 9> cuts{2.5, 3, 3.5, 4, 4.5, 5, 5.5, 6, 7};
    auto best = cascade_axis(sigma, step, degree, cuts.back());
    if (!best || best->truncation > truncation) return std::nullopt;
    std::size_t low = 0, high = cuts.size() - 1;
    while (low < high) {
        std::size_t const middle = std::midpoint(low, high);
        auto shorter = cascade_axis(sigma, step, degree, cuts[middle]);
        if (shorter && shorter->truncation <= truncation) {
            best = std::move(shorter);
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return best;
}

/// Multiply-adds a voxel, along axes of n voxels: y is thinned first and refined last, then x, then z.
double cost_of(std::array<CascadeAxis const*, 3> const& axes, Index3 n) {
    std::array<double, 3> extended{}, share{}, taps{}, coarse{};
    for (std::size_t i = 0; i < 3; ++i) {
        CascadeAxis const& axis = *axes[i];
        auto const size = static_cast<double>(n[static_cast<int>(i)]);
        extended[i] = static_cast<double>(axis.wide_nodes(n[static_cast<int>(i)]) * axis.step) / size;
        share[i] = 1 / static_cast<double>(axis.step);
        taps[i] = axis.step == 1 ? 0 : static_cast<double>(axis.taps);
        coarse[i] = axis.coarse.radius == 0 ? 0 : static_cast<double>(2 * axis.coarse.radius + 1);
    }
    double const thin = extended[0] * extended[1] * share[0] * share[1];
    return taps[1] * (extended[1] + 1) + taps[0] * share[1] * (extended[0] * extended[1] + 1) +
           taps[2] * (thin * extended[2] + share[0] * share[1]) +
           share[0] * share[1] * share[2] * extended[2] *
               (coarse[1] * extended[0] + coarse[0] + coarse[2] / extended[2]);
}

/// Of all steps and degrees that suit the sigma.
std::vector<CascadeAxis> cascades_within(double sigma, double truncation) {
    std::vector<CascadeAxis> axes;
    for (std::int64_t const step : steps) {
        double const knots = sigma / static_cast<double>(step);
        if (knots < 1.2 || (knots > 16 && step < 48)) continue;
        for (int const degree : {3, 5})
            if (auto axis = cascade_within(sigma, step, degree, truncation)) axes.push_back(std::move(*axis));
    }
    return axes;
}

} // namespace

GaussianRounding CascadeAxis::rounding(double unit) const {
    GaussianRounding error = before.rounding(unit);
    error += coarse.rounding(unit);
    if (taps == 1) return error;
    GaussianRounding worst;
    for (std::int64_t phase = 0; phase < step; ++phase) {
        GaussianRounding own;
        for (std::int64_t k = 0; k + 1 < taps; ++k)
            own = nested_step(own, shares[static_cast<std::size_t>(phase * (taps - 1) + k)], unit * (1 + 4 * unit));
        worst.range = std::max(worst.range, own.range);
        worst.magnitude = std::max(worst.magnitude, own.magnitude);
    }
    error += worst;
    return error;
}

Span nodes_under(CascadeAxis const& axis, Span voxels) {
    return {floor_div(voxels.lower, axis.step) - axis.left,
            floor_div(voxels.upper - 1, axis.step) - axis.left + axis.taps};
}

Span wide_nodes_under(CascadeAxis const& axis, Span voxels) {
    Span const nodes = nodes_under(axis, voxels);
    return {nodes.lower - axis.coarse.radius, nodes.upper + axis.coarse.radius};
}

Span voxels_under(CascadeAxis const& axis, Span voxels) {
    Span const nodes = wide_nodes_under(axis, voxels);
    return {(nodes.lower - 1) * axis.step + 1 - axis.before.radius,
            (nodes.upper - 1) * axis.step + axis.before.radius + 1};
}

std::optional<GaussianCascade> gaussian_cascade(Vec3 const& sigma, Index3 dims, Boundary boundary, double truncation,
                                                std::array<GaussianTaps, 3> const& direct) {
    std::array<std::vector<CascadeAxis>, 3> choices;
    std::array<std::vector<CascadeAxis>, 3> found; // for the sigma of an axis, unless one before has the same
    bool any = false;
    for (int i = 0; i < 3; ++i) {
        auto& choice = choices[static_cast<std::size_t>(i)];
        CascadeAxis& plain = choice.emplace_back();
        plain.before = nested_taps({1});
        plain.coarse = direct[static_cast<std::size_t>(i)];
        plain.truncation = plain.coarse.truncation;
        if (plain.coarse.radius == 0 || sigma[i] > most_sigma) continue;
        int same = 0;
        while (sigma[same] != sigma[i]) ++same;
        auto& axes = found[static_cast<std::size_t>(same)];
        if (axes.empty()) axes = cascades_within(sigma[i], truncation);
        for (CascadeAxis const& axis : axes) {
            // Slices that wrap around come from the engine, and should do so once.
            if (i == 2 && boundary == Boundary::wrap && axis.reach(1) > dims.z) continue;
            choice.push_back(axis);
            any = true;
        }
    }
    if (!any) return std::nullopt;
    std::optional<GaussianCascade> best;
    std::array<CascadeAxis const*, 3> chosen{};
    for (auto const& x : choices[0])
        for (auto const& y : choices[1])
            for (auto const& z : choices[2]) {
                if (x.step == 1 && y.step == 1 && z.step == 1) continue;
                double const cost = cost_of({&x, &y, &z}, dims);
                if (best && cost >= best->cost) continue;
                if (!best) best.emplace();
                best->cost = cost;
                chosen = {&x, &y, &z};
            }
    for (std::size_t i = 0; i < 3; ++i) best->axes[i] = *chosen[i];
    return best;
}

Box cascade_input(CascadePasses const& passes, Box const& output) {
    Box box;
    for (int i = 0; i < 3; ++i) {
        Span const voxels =
            voxels_under(passes.cascade->axes[static_cast<std::size_t>(i)], {output.lower[i], output.upper[i]});
        box.lower[i] = voxels.lower;
        box.upper[i] = voxels.upper;
    }
    return inside_volume(box, passes.direct->dims, passes.direct->boundary);
}

CascadeLayout::CascadeLayout(CascadePasses const& passes, Index3 region) {
    auto const& axes = passes.cascade->axes;
    auto const pitch_of = [](std::int64_t n) { return (n + cascade_margin + 15) / 16 * 16 + 16; };
    std::int64_t const height = passes.direct->run_height;
    wide_x = axes[0].wide_nodes(region.x);
    wide_y = axes[1].wide_nodes(region.y);
    x = axes[0].nodes(region.x);
    y = axes[1].nodes(region.y);
    wide_pitch = pitch_of(wide_x);
    pitch = pitch_of(x);
    thin_slots = axes[2].reach(height);
    if (passes.direct->boundary != Boundary::wrap) thin_slots = std::min(thin_slots, passes.direct->dims.z);
    wide_slots = axes[2].wide_nodes(height);
    slots = axes[2].nodes(height);
    raw_slots = axes[2].step == 1 ? 0 : wide_slots;

    std::int64_t const deep = 2 * axes[1].before.radius + 1,
                       columns = std::min(axes[0].reach(region.x), passes.direct->dims.x);
    row_pitch = pitch_of(std::max(columns, region.x));
    rows = std::clamp<std::int64_t>((std::int64_t{1} << 15) / row_pitch, 4, 32);
    phase_pitch = pitch_of(wide_x + 2 * axes[0].before.radius / axes[0].step);
    strip = std::clamp<std::int64_t>((std::int64_t{1} << 15) / deep / 16 * 16, 256, 2048) + cascade_margin;
    std::int64_t const thinning = deep * strip + rows * row_pitch + 2 * axes[0].step * phase_pitch,
                       refining = (axes[1].taps + 1) * row_pitch + (1 + 2 * axes[0].step) * pitch;
    scratch = pitch_of(std::max({thinning, refining, wide_pitch}));
}

} // namespace vkt
