// Test fields: each is a function that fills a piece of a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/make.h"

#include "libvkt/core/wide.h"
#include "libvkt/operations/common/volkit_header.h"
#include "libvkt/operations/voxels/kernels/fill.h"
#include "libvkt/operations/voxels/kernels/make.h"
#include "libvkt/operations/voxels/kernels/make_covered.h"

#include <cmath>

namespace vkt {

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

Texts MakeCheckerboard::texts() const {
    return {
        "Make cubes of two alternating values.",
        "Accuracy: Fields of integers are exact; those of floats are computed in double precision and rounded once.",
        {{"Cubes of four voxels", "vkt make checkerboard --dims 32 32 32 --period 4 --dtype uint8 | vkt stats"}}};
}
Texts MakeConstant::texts() const {
    return {"Make a volume of one value.",
            "Accuracy: The value is correctly rounded once.",
            {{"All sevens", "vkt make constant --dims 16 16 8 --dtype uint8 --value 7 | vkt stats"}}};
}
Texts MakeMarschnerLobb::texts() const {
    return {
        "Make the test signal of Marschner and Lobb.",
        "On [-1, 1] in each axis, sampled at voxel centres; with 40 voxels an axis close to the limit that the "
        "samples can hold."
        "\n\n"
        "Accuracy: Fields of integers are exact; those of floats are computed in double precision and rounded once.",
        {{"As in the paper", "vkt make marschner-lobb --dims 40 40 40 | vkt stats"}}};
}
Texts MakeNoise::texts() const {
    return {"Make uniform white noise.",
            "Philox4x32-10, counted by voxel: any part of a volume has the same noise as the whole."
            "\n\n"
            "Accuracy: Exact: from a counter; the same seed gives the same bytes on every machine.",
            {{"Bytes", "vkt make noise --dims 64 48 32 --dtype uint8 --seed 7 | vkt stats"}}};
}
Texts MakeRamp::texts() const {
    return {
        "Make values that rise along an axis.",
        "By default a voxel's value is its index."
        "\n\n"
        "Accuracy: Fields of integers are exact; those of floats are computed in double precision and rounded once.",
        {{"From 0 to 1 along z", "vkt make ramp --dims 16 16 33 --axis z --to 1 | vkt stats"}}};
}
Texts MakeSphere::texts() const {
    return {
        "Make a ball.",
        "With a hard edge, with each voxel's exact share inside, or as signed distance to the surface. Radius and "
        "centre count voxels."
        "\n\n"
        "Accuracy: Fields of integers are exact; those of floats are computed in double precision and rounded once.",
        {{"A ball with soft edges", "vkt make sphere --dims 64 64 64 --radius 20 --edge coverage | vkt stats"},
         {"Distance field", "vkt make sphere --dims 64 64 64 --edge distance | vkt stats"}}};
}

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

Plan MakeField::plan(std::span<Header const>) const {
    Plan plan;
    plan.output.dims = dims.value_or(Index3{1, 1, 1});
    plan.output.dtype = dtype;
    plan.output.geometry.spacing = spacing;
    plan.output.geometry.origin = origin;
    plan.method = "generated";
    plan.passing = ErrorPassing::moved({}); // given
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
    p.option("from", first, "VALUE", "value of the first voxel (0)");
    p.option("to", last, "VALUE", "value of the last voxel (as many steps of 1 beyond the first as there are)");
}
double MakeRamp::last_value() const {
    return last.value_or(first + static_cast<double>((*dims)[static_cast<int>(axis)] - 1));
}
void MakeRamp::check() const {
    MakeField::check();
    check_value(first, "from");
    check_value(last_value(), "to");
    double const end = last_value(), steps = static_cast<double>((*dims)[static_cast<int>(axis)]);
    if (!std::isfinite(first) || !std::isfinite(end) || !std::isfinite((end - first) * steps))
        throw Error(ErrorKind::usage, text("--from ", first, " and --to ", end, " are infinite or too far apart"));
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
    Losses losses;
    if (edge == SphereEdge::coverage)
        make_covered_ball(out, field, losses, execution);
    else
        make_ball(out, field, losses, execution);
    if (edge != SphereEdge::distance) return; // the others were checked, and double rounds the largest uint64 up
    counts_.clipped += losses.clipped;
    counts_.nan += losses.nan;
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

} // namespace vkt
