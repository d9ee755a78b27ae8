// Building the tables of a resampling.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/resample_weights.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/wide.h"
#include "libvkt/operations/resample/spline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

namespace vkt {
namespace {

constexpr std::int64_t most_entries = std::int64_t{1} << 26; // 512 MiB per array

std::int64_t floor_quotient(Int128 a, Int128 b) {
    Int128 const q = a / b;
    return static_cast<std::int64_t>(q * b > a ? q - 1 : q);
}

/// Weights of one output voxel before folding: input voxels lower, lower + 1, …
struct Line {
    std::int64_t lower = 0;
    std::vector<double> weights;
};

/// Keys' cubic convolution kernel with a = -1/2 (IEEE Trans. ASSP 29(6), 1981), the Catmull-Rom spline.
/// In long double, as all on the way to a weight, so that weights are right to the last bit of double.
long double cubic(long double t) {
    t = std::abs(t);
    if (t < 1) return (1.5L * t - 2.5L) * t * t + 1;
    if (t < 2) return ((-0.5L * t + 2.5L) * t - 4) * t + 2;
    return 0;
}

/// The sampling ratio in lowest terms: n_in / n_out = a / b.
struct Ratio {
    std::int64_t a, b;
};

Line area_line(std::int64_t o, Ratio r) {
    Int128 const begin = Int128{o} * r.a, end = begin + r.a; // in units of 1/b input voxels
    Line line;
    line.lower = floor_quotient(begin, r.b);
    std::int64_t const last = floor_quotient(end - 1, r.b);
    for (std::int64_t i = line.lower; i <= last; ++i) {
        Int128 const from = std::max(begin, Int128{i} * r.b), to = std::min(end, (Int128{i} + 1) * r.b);
        line.weights.push_back(static_cast<double>(to - from));
    }
    return line;
}

Line linear_line(std::int64_t o, Ratio r) {
    Int128 const position = (2 * Int128{o} + 1) * r.a - r.b, unit = 2 * Int128{r.b};
    Line line;
    line.lower = floor_quotient(position, unit);
    Int128 const fraction = position - Int128{line.lower} * unit;
    line.weights = {static_cast<double>(unit - fraction), static_cast<double>(fraction)};
    return line;
}

long double sinc(long double t) {
    constexpr long double pi = 3.14159265358979323846264338327950288L;
    return t == 0 ? 1 : std::sin(pi * t) / (pi * t);
}

SplinePrefilter const& prefilter(int degree) {
    static SplinePrefilter const cubic(3, 1e-13), quintic(5, 1e-13);
    return degree == 3 ? cubic : quintic;
}

/// The weights of an interpolant at a position `fraction` beyond the input voxel `whole`, of a grid whose voxels are
/// `width` input voxels apart. Wider kernels average what falls between the new voxels: convolution kernels are
/// stretched, splines are sampled several times.
Line smooth_line(ResampleKernel kernel, std::int64_t whole, long double fraction, long double width) {
    if (fraction == 0 && width <= 1) return {whole, {1.0}};
    auto const round = [whole](std::vector<long double> const& weights, std::int64_t lower) {
        long double sum = 0;
        for (long double const w : weights) sum += w;
        Line line{whole + lower, {}};
        for (long double const w : weights) line.weights.push_back(static_cast<double>(w / sum));
        return line;
    };
    if (kernel == ResampleKernel::bspline3 || kernel == ResampleKernel::bspline5) {
        int const degree = kernel == ResampleKernel::bspline3 ? 3 : 5;
        auto const samples = static_cast<std::int64_t>(std::max(1.0L, std::ceil(width - 1e-6L)));
        SplinePrefilter const& filter = prefilter(degree);
        std::int64_t const reach = static_cast<std::int64_t>(width) + 2 + filter.radius + degree;
        std::vector<long double> weights(static_cast<std::size_t>(2 * reach + 1), 0.0L);
        for (std::int64_t s = 0; s < samples; ++s) {
            long double const aside = (static_cast<long double>(s) + 0.5L) / static_cast<long double>(samples) - 0.5L;
            long double const at = samples == 1 ? fraction : fraction + width * aside;
            auto const near = static_cast<std::int64_t>(std::floor(at));
            // Coefficients, and the voxels that they are made of.
            for (std::int64_t j = near - degree / 2; j <= near + 1 + degree / 2; ++j) {
                long double const b = bspline(degree, at - static_cast<long double>(j));
                if (b == 0) continue;
                for (std::int64_t k = -filter.radius; k <= filter.radius; ++k)
                    weights[static_cast<std::size_t>(j + k + reach)] +=
                        b * filter.weight[static_cast<std::size_t>(std::abs(k))];
            }
        }
        return round(weights, -reach);
    }
    long double const stretch = std::max(1.0L, width);
    bool const keys = kernel == ResampleKernel::cubic;
    auto const reach = static_cast<std::int64_t>(std::ceil((keys ? 2 : 3) * stretch)) + 1;
    std::vector<long double> weights;
    for (std::int64_t i = -reach; i <= reach; ++i) {
        long double const t = (static_cast<long double>(i) - fraction) / stretch;
        weights.push_back(keys ? cubic(t) : std::abs(t) >= 3 ? 0 : sinc(t) * sinc(t / 3));
    }
    return round(weights, -reach);
}

Line smooth_line(std::int64_t o, Ratio r, ResampleKernel kernel) {
    Int128 const position = (2 * Int128{o} + 1) * r.a - r.b, unit = 2 * Int128{r.b};
    std::int64_t const whole = floor_quotient(position, unit);
    auto const fraction = static_cast<long double>(position - Int128{whole} * unit) / static_cast<long double>(unit);
    return smooth_line(kernel, whole, fraction, static_cast<long double>(r.a) / static_cast<long double>(r.b));
}

void trim(Line& line) {
    auto& w = line.weights;
    while (w.size() > 1 && w.back() == 0) w.pop_back();
    std::size_t leading = 0;
    while (leading + 1 < w.size() && w[leading] == 0) ++leading;
    w.erase(w.begin(), w.begin() + static_cast<std::ptrdiff_t>(leading));
    line.lower += static_cast<std::int64_t>(leading);
}

/// Leaves out the weights of voxels outside [0, n); half a voxel beyond the ends at most, some tap is always inside.
Line clipped(Line const& line, std::int64_t n) {
    auto const size = static_cast<std::int64_t>(line.weights.size());
    std::int64_t const begin = std::max<std::int64_t>(line.lower, 0), end = std::min(line.lower + size, n);
    if (begin >= end) return {std::min(begin, n - 1), {0.0}}; // all of it is the border's, see reaches()
    return {begin, {line.weights.begin() + (begin - line.lower), line.weights.begin() + (end - line.lower)}};
}

/// Moves weights of voxels outside [0, n) to the voxels that stand for them.
Line folded(Line const& line, std::int64_t n, Boundary boundary) {
    auto const size = static_cast<std::int64_t>(line.weights.size());
    if ((line.lower >= 0 && line.lower + size <= n) || boundary == Boundary::wrap) return line;
    if (boundary == Boundary::border) return clipped(line, n);
    std::int64_t low = n, high = -1;
    for (std::int64_t i = 0; i < size; ++i) {
        std::int64_t const at = fold(line.lower + i, n, boundary);
        low = std::min(low, at);
        high = std::max(high, at);
    }
    Line result{low, std::vector<double>(static_cast<std::size_t>(high - low + 1), 0.0)};
    for (std::int64_t i = 0; i < size; ++i)
        result.weights[static_cast<std::size_t>(fold(line.lower + i, n, boundary) - low)] +=
            line.weights[static_cast<std::size_t>(i)];
    return result;
}

Line line_of(std::int64_t o, Ratio ratio, ResampleKernel kernel) {
    switch (kernel) {
    case ResampleKernel::identity:
        return {o, {1.0}};
    case ResampleKernel::nearest:
        return {floor_quotient((2 * Int128{o} + 1) * ratio.a, 2 * Int128{ratio.b}), {1.0}};
    case ResampleKernel::linear:
        return linear_line(o, ratio);
    case ResampleKernel::area:
        return area_line(o, ratio);
    case ResampleKernel::cubic:
    case ResampleKernel::bspline3:
    case ResampleKernel::bspline5:
    case ResampleKernel::lanczos3:
        return smooth_line(o, ratio, kernel);
    }
    return {};
}

double divisor_of(Ratio ratio, ResampleKernel kernel) {
    if (kernel == ResampleKernel::linear) return 2 * static_cast<double>(ratio.b);
    if (kernel == ResampleKernel::area) return static_cast<double>(ratio.a);
    return 1;
}

/// Weights at a position that need not be rational.
Line placed_line(LinePlacement const& placement, std::int64_t o, ResampleKernel kernel) {
    // Beyond that nothing is inside, and no index overflows.
    double const far = 4 * static_cast<double>(std::int64_t{1} << 50);
    double const p = std::clamp(placement.position(o), -far, far), width = std::abs(placement.scale);
    auto const whole = static_cast<std::int64_t>(std::floor(p));
    double const fraction = p - std::floor(p);
    Line line{whole, {1.0}};
    if (kernel == ResampleKernel::nearest || kernel == ResampleKernel::identity) { // ties that rounding broke are ties
        line.lower = static_cast<std::int64_t>(std::floor(p + (0.5 + 1e-6)));
    } else if (kernel == ResampleKernel::linear) {
        line.weights = {1 - fraction, fraction};
    } else if (kernel == ResampleKernel::area) {
        double const begin = p - width / 2 + 0.5, end = p + width / 2 + 0.5; // in faces: voxel i lies in [i, i + 1)
        line.lower = static_cast<std::int64_t>(std::floor(begin + 1e-9));
        line.weights.clear();
        double sum = 0;
        for (std::int64_t i = line.lower; line.weights.empty() || static_cast<double>(i) < end - 1e-9; ++i) {
            auto const face = static_cast<double>(i);
            line.weights.push_back(std::min(end, face + 1) - std::max(begin, face));
            sum += line.weights.back();
        }
        for (double& w : line.weights) w /= sum;
    } else {
        line = smooth_line(kernel, whole, fraction, width);
    }
    return line;
}

/// What lies far outside a wrapped or bordered line reads the same nearby: no window shall reach out there.
void brought_near(Line& line, std::int64_t n, Boundary boundary) {
    auto const size = static_cast<std::int64_t>(line.weights.size());
    if (boundary == Boundary::wrap && (line.lower < -size || line.lower >= n))
        line.lower = fold(line.lower, n, boundary);
    if (boundary == Boundary::border) line.lower = std::clamp(line.lower, -size, n);
}

[[noreturn]] void refuse(std::int64_t n_in, std::int64_t n_out) {
    throw Error(ErrorKind::resources, text("a line of ", n_in, " voxels is too long to be resampled to ", n_out),
                "crop the volume first, or resample in several steps");
}

} // namespace

std::string_view name_of(ResampleKernel kernel) {
    static constexpr std::array<std::string_view, 8> names{"copy",  "nearest",  "linear",   "area",
                                                           "cubic", "bspline3", "bspline5", "lanczos3"};
    return names[static_cast<std::size_t>(kernel)];
}

WeightTable::WeightTable(std::int64_t n_in, std::int64_t n_out, ResampleKernel kernel, Boundary boundary)
    : kernel_(n_in == n_out ? ResampleKernel::identity : kernel), n_out_(n_out) {
    std::int64_t const divisor = std::gcd(n_in, n_out);
    Ratio const ratio{n_in / divisor, n_out / divisor};
    if (n_out > most_entries || n_in > 16 * most_entries) refuse(n_in, n_out);
    divisor_ = divisor_of(ratio, kernel_);
    step_ = static_cast<double>(n_in) / static_cast<double>(n_out);
    halving_ = kernel_ == ResampleKernel::identity                               ? 1
               : kernel_ == ResampleKernel::area && ratio.a == 2 && ratio.b == 1 ? 2
                                                                                 : 0;
    build(n_in, n_out, boundary, [&](std::int64_t o) { return line_of(o, ratio, kernel_); });
}

double LinePlacement::position(std::int64_t o) const {
    double const p = scale * static_cast<double>(o) + offset, r = std::nearbyint(p);
    return std::abs(p - r) < 1e-9 ? r : p;
}

WeightTable::WeightTable(LinePlacement const& placement, ResampleKernel kernel, Boundary boundary)
    : kernel_(kernel), n_out_(placement.n_out), step_(std::abs(placement.scale)) {
    if (placement.n_out > most_entries || placement.n_in > 16 * most_entries) refuse(placement.n_in, placement.n_out);
    // Means of what lies far outside take time, and show nothing.
    bool const averages =
        kernel_ != ResampleKernel::identity && kernel_ != ResampleKernel::nearest && kernel_ != ResampleKernel::linear;
    double const widest = std::max(65536.0, 4 * static_cast<double>(placement.n_in));
    if (averages && step_ > widest)
        throw Error(ErrorKind::resources,
                    text("voxels ", step_, " times as wide cannot be made of a line of ", placement.n_in),
                    text("at most ", widest, " times are possible; the nearest voxel is taken at any scale"));
    halving_ = kernel_ == ResampleKernel::identity ? 1 : 0;
    build(placement.n_in, placement.n_out, boundary, [&](std::int64_t o) {
        Line line = placed_line(placement, o, kernel_);
        brought_near(line, placement.n_in, boundary);
        return line;
    });
}

template <class LineAt>
void WeightTable::build(std::int64_t n_in, std::int64_t n_out, Boundary boundary, LineAt const& line_at) {
    std::vector<std::int64_t> first, start{0};
    std::vector<double> weights, inside;
    if (kernel_ == ResampleKernel::bspline3) cut_ = prefilter(3).cut;
    if (kernel_ == ResampleKernel::bspline5) cut_ = prefilter(5).cut;
    first.reserve(static_cast<std::size_t>(n_out));
    for (std::int64_t o = 0; o < n_out; ++o) {
        Line line = line_at(o);
        trim(line);
        double sum = 0;
        for (double const w : line.weights) sum += std::abs(w);
        gain_ = std::max(gain_, sum / divisor_);
        std::size_t const taps = line.weights.size();
        bool const crosses = line.lower < 0 || line.lower + static_cast<std::int64_t>(taps) > n_in;
        line = folded(line, n_in, boundary);
        if (boundary == Boundary::border) {
            leaves_out_ = leaves_out_ || crosses;
            inside.push_back(crosses ? std::accumulate(line.weights.begin(), line.weights.end(), 0.0) : divisor_);
        }
        if (weights.size() + line.weights.size() > static_cast<std::size_t>(2 * most_entries)) refuse(n_in, n_out);
        first.push_back(line.lower);
        weights.insert(weights.end(), line.weights.begin(), line.weights.end());
        start.push_back(static_cast<std::int64_t>(weights.size()));
        most_taps_ = std::max(most_taps_, static_cast<std::int64_t>(line.weights.size()));
    }
    first_from_ = end_to_ = first;
    for (std::size_t o = 0; o < first.size(); ++o) {
        end_to_[o] += start[o + 1] - start[o];
        if (o > 0) end_to_[o] = std::max(end_to_[o], end_to_[o - 1]);
    }
    for (std::size_t o = first.size(); o > 1; --o)
        first_from_[o - 2] = std::min(first_from_[o - 2], first_from_[o - 1]);
    total_ = static_cast<std::int64_t>(weights.size());
    if (most_taps_ <= 2)
        for (std::size_t o = 0; o < first.size(); ++o) {
            auto const at = static_cast<std::size_t>(start[o]);
            weights.push_back(weights[at]);
            weights.push_back(start[o + 1] - start[o] == 2 ? weights[at + 1] : 0.0);
        }
    if (!leaves_out_) inside.clear();
    memory_.reserve((first.size() + start.size() + weights.size() + inside.size()) * 8);
    std::byte* const to = memory_.write(Space::host);
    std::memcpy(to, first.data(), first.size() * 8);
    std::memcpy(to + first.size() * 8, start.data(), start.size() * 8);
    std::memcpy(to + (first.size() + start.size()) * 8, weights.data(), weights.size() * 8);
    if (leaves_out_)
        std::memcpy(to + (first.size() + start.size() + weights.size()) * 8, inside.data(), inside.size() * 8);
}

AxisTable WeightTable::taps(Space space) const {
    auto const* const first = reinterpret_cast<std::int64_t const*>(memory_.read(space));
    auto const* const start = first + n_out_;
    auto const* const weight = reinterpret_cast<double const*>(start + n_out_ + 1);
    double const* const pair = most_taps_ <= 2 ? weight + total_ : nullptr;
    double const* const inside = weight + total_ + (most_taps_ <= 2 ? 2 * n_out_ : 0);
    return {first, start, weight, pair, leaves_out_ ? inside : nullptr, divisor_};
}

bool WeightTable::reaches(std::int64_t o) const {
    AxisTable const t = taps(Space::host);
    return std::any_of(t.weight + t.start[o], t.weight + t.start[o + 1], [](double w) { return w != 0; });
}

std::pair<std::int64_t, std::int64_t> WeightTable::footprint(std::int64_t begin, std::int64_t end) const {
    AxisTable const t = taps(Space::host);
    std::int64_t low = t.first[begin], high = low;
    for (std::int64_t o = begin; o < end; ++o) {
        low = std::min(low, t.first[o]);
        high = std::max(high, t.first[o] + t.start[o + 1] - t.start[o]);
    }
    return {low, high};
}

std::pair<std::int64_t, std::int64_t> WeightTable::footprint_forward(std::int64_t begin, std::int64_t end) const {
    return {first_from_[static_cast<std::size_t>(begin)], end_to_[static_cast<std::size_t>(end - 1)]};
}

bool WeightTable::ascends() const {
    AxisTable const t = taps(Space::host);
    for (std::int64_t o = 0; o < n_out_; ++o)
        if (t.first[o] - first_from_[static_cast<std::size_t>(o)] > most_taps_) return false;
    return true;
}

namespace {

double at_once(std::array<WeightTable, 3> const& t) {
    return static_cast<double>(t[1].most_taps() * t[2].most_taps()) * t[0].step() +
           static_cast<double>(t[0].most_taps());
}
double one_by_one(std::array<WeightTable, 3> const& t) {
    return (static_cast<double>(t[2].most_taps()) * t[1].step() + static_cast<double>(t[1].most_taps())) * t[0].step() +
           static_cast<double>(t[0].most_taps());
}

} // namespace

bool in_passes(std::array<WeightTable, 3> const& tables) {
    bool const lobes = std::ranges::any_of(tables, [](WeightTable const& t) {
        return t.kernel() == ResampleKernel::cubic || t.kernel() == ResampleKernel::bspline3 ||
               t.kernel() == ResampleKernel::bspline5 || t.kernel() == ResampleKernel::lanczos3;
    });
    return lobes && 1.25 * one_by_one(tables) < at_once(tables);
}

double multiply_adds(std::array<WeightTable, 3> const& tables) {
    return in_passes(tables) ? one_by_one(tables) : at_once(tables);
}

SumTile::SumTile(std::array<WeightTable, 3> const& tables) {
    constexpr std::int64_t most = std::int64_t{1} << 16; // doubles: 512 KiB
    constexpr std::int64_t most_beside = 4096;           // columns
    auto const outputs = [&](int axis, std::int64_t inputs) {
        WeightTable const& t = tables[static_cast<std::size_t>(axis)];
        double const room = static_cast<double>(inputs - t.most_taps()) / std::max(t.step(), 1e-9);
        return static_cast<std::int64_t>(std::clamp(room, 1.0, 1024.0));
    };
    auto const inputs = [&](int axis, std::int64_t n) {
        WeightTable const& t = tables[static_cast<std::size_t>(axis)];
        return static_cast<std::int64_t>(std::ceil(static_cast<double>(std::min(n, t.outputs())) * t.step())) +
               t.most_taps() + 1;
    };
    x = outputs(0, std::max<std::int64_t>(512, 2 * tables[0].most_taps()));
    columns = inputs(0, x);
    lanes = columns <= most_beside ? most_lanes : 1;
    y = lanes;
    if (!in_passes(tables)) return;
    y = (outputs(1, std::max(most / columns, 3 * tables[1].most_taps())) + lanes - 1) / lanes * lanes;
    rows = inputs(1, y);
}

} // namespace vkt
