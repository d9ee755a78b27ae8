// Test fields: each is a function that fills a piece of a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/make.h"

#include "libvkt/operations/rows.h"
#include "libvkt/operations/volkit_header.h"
#include "libvkt/operations/wide.h"

#include <cmath>

namespace vkt {

struct BallField {
    Vec3 center;
    double radius = 1, inside = 1, outside = 0;
    SphereEdge edge = SphereEdge::hard;
};
struct MarschnerLobbField {
    Index3 dims;
    double frequency = 6, amplitude = 0.25, low = 0, high = 1;
};
struct NoiseField {
    Index3 dims;
    std::uint64_t seed = 0;
    double low = 0, high = 1;
};

VKT_CPU_KERNEL(fill_box, (AnyView out, VoxelBytes const& voxel, Execution const& execution), (out, voxel, execution))
VKT_CPU_KERNEL(make_ramp,
               (AnyView out, Axis axis, double first, double last, std::int64_t n, Execution const& execution),
               (out, axis, first, last, n, execution))
VKT_CPU_KERNEL(make_checkerboard,
               (AnyView out, std::int64_t period, double low, double high, Execution const& execution),
               (out, period, low, high, execution))
VKT_CPU_KERNEL(make_ball, (AnyView out, BallField const& field, Tally& tally, Execution const& execution),
               (out, field, tally, execution))
VKT_CPU_KERNEL(make_marschner_lobb, (AnyView out, MarschnerLobbField const& field, Execution const& execution),
               (out, field, execution))
VKT_CPU_KERNEL(make_noise, (AnyView out, NoiseField const& field, Execution const& execution), (out, field, execution))

#ifndef __CUDACC__
namespace VKT_BACKEND {
namespace {

/// Calls f(x, y, z, n, to) for pieces of rows and stores the doubles it leaves in to; returns what did not fit.
template <class F> Tally fill_rows(AnyView out, Execution const& execution, F const& f) {
    Tally tally;
    for_each_segment(execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) double row[row_piece];
        for (std::int64_t i = 0; i < n; i += row_piece) {
            std::int64_t const m = std::min(row_piece, n - i);
            f(x + i, y, z, m, row);
            driver::add(tally, store_row(out.type, static_cast<double const*>(row), out.at(x + i, y, z), m));
        }
    });
    return tally;
}

/// cos(2 pi u) from its Taylor series on a quarter turn: the same bits wherever IEEE arithmetic holds, to 1e-15.
double cos_turns(double u) {
    u -= std::nearbyint(u);
    u = u < 0 ? -u : u;
    bool const flip = u > 0.25;
    u = flip ? 0.5 - u : u;
    double const x = u * 6.283185307179586476925, x2 = x * x;
    double term = 1, sum = 1;
    for (int k = 1; k <= 12; ++k) {
        term *= -x2 / static_cast<double>((2 * k - 1) * (2 * k));
        sum += term;
    }
    return flip ? -sum : sum;
}

/// Philox4x32-10: blocks [first, first + n) of four words each.
void philox(std::uint64_t first, std::int64_t n, std::uint64_t seed, std::uint32_t* words) {
#pragma omp simd
    for (std::int64_t b = 0; b < n; ++b) {
        std::uint64_t const block = first + static_cast<std::uint64_t>(b);
        auto c0 = static_cast<std::uint32_t>(block), c1 = static_cast<std::uint32_t>(block >> 32);
        std::uint32_t c2 = 0, c3 = 0;
        auto k0 = static_cast<std::uint32_t>(seed), k1 = static_cast<std::uint32_t>(seed >> 32);
        for (int round = 0; round < 10; ++round) {
            std::uint64_t const p0 = std::uint64_t{0xD2511F53u} * c0, p1 = std::uint64_t{0xCD9E8D57u} * c2;
            c0 = static_cast<std::uint32_t>(p1 >> 32) ^ c1 ^ k0;
            c2 = static_cast<std::uint32_t>(p0 >> 32) ^ c3 ^ k1;
            c1 = static_cast<std::uint32_t>(p1);
            c3 = static_cast<std::uint32_t>(p0);
            k0 += 0x9E3779B9u;
            k1 += 0xBB67AE85u;
        }
        words[4 * b] = c0;
        words[4 * b + 1] = c1;
        words[4 * b + 2] = c2;
        words[4 * b + 3] = c3;
    }
}

template <class T> void noise(View<T> out, Box const& box, NoiseField const& field, Execution const& execution) {
    constexpr std::int64_t words_per_voxel = sizeof(T) == 8 ? 2 : 1;
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) std::uint32_t words[2 * row_piece + 8];
        for (std::int64_t i = 0; i < n; i += row_piece) {
            std::int64_t const m = std::min(row_piece, n - i);
            std::int64_t const word = (x + i + field.dims.x * (y + field.dims.y * z)) * words_per_voxel;
            std::int64_t const last = word + m * words_per_voxel - 1;
            philox(static_cast<std::uint64_t>(word / 4), last / 4 - word / 4 + 1, field.seed, words);
            std::uint32_t const* const w = words + word % 4;
            T* const to = &out(x + i, y, z);
            double const low = field.low, width = field.high - field.low;
            for (std::int64_t j = 0; j < m; ++j) {
                std::uint64_t bits = w[j * words_per_voxel];
                if constexpr (words_per_voxel == 2) bits |= static_cast<std::uint64_t>(w[2 * j + 1]) << 32;
                if constexpr (std::is_integral_v<T>) {
                    // bits / 2^k of the number of integers, rounded down: no integer is more than 2^-k likelier
                    Int128 const from = round_to<T>(field.low),
                                 count = static_cast<Int128>(round_to<T>(field.high)) - from + 1;
                    to[j] = static_cast<T>(
                        from + static_cast<Int128>((static_cast<Unsigned128>(bits) * static_cast<Unsigned128>(count)) >>
                                                   (32 * words_per_voxel)));
                } else if constexpr (sizeof(T) == 8) {
                    to[j] = low + width * (static_cast<double>(bits >> 11) * 0x1p-53);
                } else {
                    to[j] = round_to<T>(low + width * (static_cast<double>(bits) * 0x1p-32));
                }
            }
        }
    });
}

} // namespace

void make_ramp(AnyView out, Axis axis, double first, double last, std::int64_t n, Execution const& execution) {
    auto const steps = static_cast<double>(std::max<std::int64_t>(n - 1, 1));
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        for (std::int64_t i = 0; i < m; ++i) {
            std::int64_t const at = axis == Axis::x ? x + i : axis == Axis::y ? y : z;
            to[i] = first + (last - first) * static_cast<double>(at) / steps;
        }
    });
}

void make_checkerboard(AnyView out, std::int64_t period, double low, double high, Execution const& execution) {
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        std::int64_t const rest = y / period + z / period;
        for (std::int64_t i = 0; i < m; ++i) to[i] = (((x + i) / period + rest) & 1) == 0 ? low : high;
    });
}

void make_ball(AnyView out, BallField const& field, Tally& tally, Execution const& execution) {
    tally += fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        Vec3 p{0, static_cast<double>(y) - field.center.y, static_cast<double>(z) - field.center.z};
        for (std::int64_t i = 0; i < m; ++i) {
            p.x = static_cast<double>(x + i) - field.center.x;
            double const square = p.x * p.x + p.y * p.y + p.z * p.z;
            if (field.edge == SphereEdge::distance)
                to[i] = std::sqrt(square) - field.radius;
            else if (field.edge == SphereEdge::hard)
                to[i] = square <= field.radius * field.radius ? field.inside : field.outside;
            else
                to[i] = field.outside + (field.inside - field.outside) * ball_coverage(p, field.radius);
        }
    });
}

void make_marschner_lobb(AnyView out, MarschnerLobbField const& field, Execution const& execution) {
    auto const position = [](std::int64_t i, std::int64_t n) {
        return static_cast<double>(2 * i + 1 - n) / static_cast<double>(n);
    };
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        double const v = position(y, field.dims.y), w = position(z, field.dims.z);
        double const depth = 1 - cos_turns(w / 4 - 0.25); // 1 - sin(pi z / 2)
        for (std::int64_t i = 0; i < m; ++i) {
            double const u = position(x + i, field.dims.x);
            double const wave = cos_turns(field.frequency * cos_turns(std::sqrt(u * u + v * v) / 4));
            double const value = (depth + field.amplitude * (1 + wave)) / (2 * (1 + field.amplitude));
            to[i] = field.low + (field.high - field.low) * value;
        }
    });
}

void make_noise(AnyView out, NoiseField const& field, Execution const& execution) {
    for_each_type(out.type, [&]<class T>(T) { noise<T>(out.as<T>(), out.box, field, execution); });
}

} // namespace VKT_BACKEND
#endif

#if VKT_HOST

VKT_OPERATION(MakeCheckerboard, "make checkerboard")
VKT_OPERATION(MakeConstant, "make constant")
VKT_OPERATION(MakeMarschnerLobb, "make marschner-lobb")
VKT_OPERATION(MakeNoise, "make noise")
VKT_OPERATION(MakeRamp, "make ramp")
VKT_OPERATION(MakeSphere, "make sphere")

namespace {

[[noreturn]] void refuse_value(DataType type, Number const& value, std::string_view option) {
    throw Error(ErrorKind::usage, text("--", option, ": ", type, " cannot hold ", to_text(value)),
                "choose another --dtype");
}

} // namespace

void MakeField::parameters(Parameters& p) {
    p.option("dims", dims, "X Y Z", "numbers of voxels").needed();
    p.option("dtype", dtype, "TYPE", "data type (float32)").alias("data-format");
    p.option("spacing", spacing, "S|SX,SY,SZ", "size of a voxel in world units (1)");
    p.option("origin", origin, "X,Y,Z", "world position of the centre of the first voxel (0,0,0)");
}

void MakeField::check() const {
    if (!dims) throw Error(ErrorKind::usage, "--dims is missing", "say for example --dims 64 64 64");
    check_dims(*dims, dtype, "dims");
    check_spacing(spacing, "spacing");
    for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(origin[axis]))
            throw Error(ErrorKind::usage, text("--origin: ", origin[axis], " is not finite"));
}

void MakeField::check_value(double value, std::string_view option) const {
    bool const held = is_integer(dtype) ? value >= lowest_of(dtype) && value <= highest_of(dtype) : fits(dtype, value);
    if (!held) refuse_value(dtype, value, option);
}

Plan MakeField::plan(std::span<Header const>) {
    Plan plan;
    plan.output.dims = dims.value_or(Index3{1, 1, 1});
    plan.output.dtype = dtype;
    plan.output.geometry.spacing = spacing;
    plan.output.geometry.origin = origin;
    plan.method = "generated";
    plan.access = Access::forward;
    return plan;
}

namespace {

void declare_levels(Parameters& p, std::optional<double>& low, std::optional<double>& high) {
    p.option("low", low, "VALUE", "smaller stored value (0)");
    p.option("high", high, "VALUE", "larger stored value (1, or the largest of an integer type)");
}

void check_levels(double low, double high) {
    if (!std::isfinite(low) || !std::isfinite(high) || low > high)
        throw Error(ErrorKind::usage, text("--low ", low, " and --high ", high, " are not an ascending pair"));
    if (!std::isfinite(high - low))
        throw Error(ErrorKind::usage, text("--low ", low, " and --high ", high, " are too far apart"));
}

} // namespace

void MakeConstant::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("value", value, "VALUE", "stored value (0)");
}
void MakeConstant::check() const {
    MakeField::check();
    check_value(value.value, "value");
    if (!fits(dtype, value)) refuse_value(dtype, value, "value"); // 2^64 looks like the largest uint64 in double
}
void MakeConstant::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    fill_box(out, voxel_bytes(dtype, value), execution);
}

void MakeRamp::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("axis", axis, "AXIS", "axis along which values change (x)");
    p.option("first", first, "VALUE", "value of the first voxel (0)");
    p.option("last", last, "VALUE", "value of the last voxel (as many steps of 1 beyond the first as there are)");
}
double MakeRamp::last_value() const {
    return last.value_or(first + static_cast<double>((*dims)[static_cast<int>(axis)] - 1));
}
void MakeRamp::check() const {
    MakeField::check();
    check_value(first, "first");
    check_value(last_value(), "last");
    double const end = last_value(), steps = static_cast<double>((*dims)[static_cast<int>(axis)]);
    if (!std::isfinite(first) || !std::isfinite(end) || !std::isfinite((end - first) * steps))
        throw Error(ErrorKind::usage, text("--first ", first, " and --last ", end, " are infinite or too far apart"));
}
void MakeRamp::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    make_ramp(out, axis, first, last_value(), (*dims)[static_cast<int>(axis)], execution);
}

void MakeCheckerboard::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("period", period, "N", "side of a cube in voxels (1)");
    declare_levels(p, low, high);
}
void MakeCheckerboard::check() const {
    MakeField::check();
    if (period < 1) throw Error(ErrorKind::usage, text("--period: ", period, " is not a positive number of voxels"));
    check_value(low_or_default(low), "low");
    check_value(high_or_default(high), "high");
}
void MakeCheckerboard::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    make_checkerboard(out, period, low_or_default(low), high_or_default(high), execution);
}

void MakeSphere::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("radius", radius, "R", "radius in voxels (0.4 of the smallest extent)");
    p.option("center", center, "X,Y,Z", "centre in voxel indices (the middle)");
    p.option("inside", inside, "VALUE", "stored value inside (1, or the largest of an integer type)");
    p.option("outside", outside, "VALUE", "stored value outside (0)");
    p.option("edge", edge, "EDGE",
             "hard: by voxel centres; coverage: share of the voxel inside; distance: signed distance to the surface");
}
void MakeSphere::check() const {
    MakeField::check();
    if (radius && (!std::isfinite(*radius) || !(*radius > 0)))
        throw Error(ErrorKind::usage, text("--radius: ", *radius, " is not a positive number"));
    check_value(high_or_default(inside), "inside");
    check_value(low_or_default(outside), "outside");
    if (edge == SphereEdge::coverage && !std::isfinite(high_or_default(inside) - low_or_default(outside)))
        throw Error(ErrorKind::usage, "--inside and --outside are infinite or too far apart for --edge coverage");
    if (edge == SphereEdge::distance && (inside || outside))
        throw Error(ErrorKind::usage,
                    "--inside and --outside do not apply to --edge distance, whose values are distances");
    if (edge == SphereEdge::distance && is_integer(dtype) && !is_signed(dtype))
        throw Error(ErrorKind::usage, text("--edge distance is negative inside, which ", dtype, " cannot hold"),
                    "use --dtype float32");
}
Plan MakeSphere::plan(std::span<Header const> inputs) {
    counts_ = {};
    return MakeField::plan(inputs);
}
std::vector<Remark> MakeSphere::remarks() const { return store_remarks(counts_, dims->x * dims->y * dims->z, dtype); }
void MakeSphere::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    Index3 const n = *dims;
    BallField field;
    field.center = center.value_or(
        Vec3{static_cast<double>(n.x - 1) / 2, static_cast<double>(n.y - 1) / 2, static_cast<double>(n.z - 1) / 2});
    field.radius = radius.value_or(0.4 * static_cast<double>(std::min({n.x, n.y, n.z})));
    field.inside = high_or_default(inside);
    field.outside = low_or_default(outside);
    field.edge = edge;
    Tally tally;
    make_ball(out, field, tally, execution);
    if (edge != SphereEdge::distance) return; // the others were checked, and double rounds the largest uint64 up
    counts_.clipped += tally.clipped;
    counts_.nan += tally.nan;
}

void MakeMarschnerLobb::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("frequency", frequency, "F", "f_M of the signal (6)");
    p.option("amplitude", amplitude, "A", "alpha of the signal (0.25)");
    declare_levels(p, low, high);
}
void MakeMarschnerLobb::check() const {
    MakeField::check();
    if (!std::isfinite(frequency) || frequency < 0)
        throw Error(ErrorKind::usage, text("--frequency: ", frequency, " is not a frequency"));
    if (!std::isfinite(amplitude) || amplitude < 0)
        throw Error(ErrorKind::usage, text("--amplitude: ", amplitude, " is not an amplitude"));
    check_levels(low_or_default(low), high_or_default(high));
    check_value(low_or_default(low), "low");
    check_value(high_or_default(high), "high");
}
void MakeMarschnerLobb::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    make_marschner_lobb(out, {*dims, frequency, amplitude, low_or_default(low), high_or_default(high)}, execution);
}

void MakeNoise::parameters(Parameters& p) {
    MakeField::parameters(p);
    p.option("seed", seed, "N", "another seed, other noise (0)");
    declare_levels(p, low, high);
}
void MakeNoise::check() const {
    MakeField::check();
    check_levels(low_or_default(low), high_or_default(high));
    check_value(low_or_default(low), "low");
    check_value(high_or_default(high), "high");
}
void MakeNoise::run(std::span<ConstView const>, AnyView out, Execution const& execution) {
    make_noise(out, {*dims, static_cast<std::uint64_t>(seed), low_or_default(low), high_or_default(high)}, execution);
}

#endif

} // namespace vkt
