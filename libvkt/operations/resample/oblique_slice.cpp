// Oblique slices: where the pixels lie, and what becomes of the layers of a slab.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/oblique_slice.h"

#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/resample/kernels/background.h"
#include "libvkt/operations/resample/resample_size.h"
#include "libvkt/operations/voxels/axis_order.h"

#include <cmath>
#include <limits>
#include <utility>

namespace vkt {
namespace {

/// Directions of the world, of length 1 and at right angles.
struct Frame {
    Vec3 x, y, normal;
};

/// Of the axes that are equally near the last one, as slices are across z without further words.
int nearest_axis(Geometry const& geometry, Vec3 normal) {
    int result = 0;
    double most = -1;
    for (int a = 0; a < 3; ++a) {
        double const along = std::abs(dot(geometry.direction[static_cast<std::size_t>(a)], normal));
        if (along < most - 1e-9) continue;
        most = along;
        result = a;
    }
    return result;
}

Vec3 in_plane(Vec3 v, Vec3 normal) { return v - normal * dot(v, normal); }

Frame frame_of(ObliquePlane const& plane, Geometry const& geometry) {
    Vec3 const& n = *plane.normal;
    Frame frame;
    frame.normal = unit(n * (1 / std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)}))); // no square overflows
    if (plane.up) {
        Vec3 const& u = *plane.up;
        Vec3 const up = unit(u * (1 / std::max({std::abs(u.x), std::abs(u.y), std::abs(u.z)})));
        Vec3 const down = in_plane(up, frame.normal) * -1;
        if (length(down) < 1e-6)
            throw Error(ErrorKind::usage, "--up runs along the normal: it is no direction in the plane");
        frame.y = unit(down);
        frame.x = unit(cross(frame.y, frame.normal));
        return frame;
    }
    auto const axes = axes_without(nearest_axis(geometry, frame.normal));
    auto const direction = [&](std::size_t k) { return geometry.direction[static_cast<std::size_t>(axes[k])]; };
    frame.x = unit(in_plane(direction(0), frame.normal));
    frame.y = unit(cross(frame.normal, frame.x));
    if (dot(frame.y, direction(1)) < 0) frame.y = frame.y * -1;
    return frame;
}

/// From one voxel to the next along a direction of length 1; what is the spacing of an axis but for rounding is it.
double step_along(Geometry const& geometry, Vec3 direction) {
    Geometry linear = geometry;
    linear.origin = {};
    double const step = 1 / length(world_to_index(linear, direction));
    for (int a = 0; a < 3; ++a)
        if (std::abs(step - geometry.spacing[a]) < 1e-12 * step) return geometry.spacing[a];
    return step;
}

/// Half of what the volume covers along a direction of length 1, faces included.
double half_extent(Header const& volume, Vec3 direction) {
    double sum = 0;
    for (int a = 0; a < 3; ++a)
        sum += 0.5 * static_cast<double>(volume.dims[a]) * volume.geometry.spacing[a] *
               std::abs(dot(volume.geometry.direction[static_cast<std::size_t>(a)], direction));
    return sum;
}

/// Voxels of that width that cover an extent.
std::int64_t count_over(double extent, double width) {
    double const n = std::ceil(extent / width - same_voxel);
    if (!(n <= static_cast<double>(max_extent)))
        throw Error(ErrorKind::usage, text("the slice would have ", n, " voxels along an axis"));
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(n));
}

/// The input's own numbers, where every voxel of the grid is one of its voxels.
Geometry picked(Geometry const& input, Affine const& map) {
    Geometry result;
    result.origin = index_to_world(input, map.offset);
    for (std::size_t a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
            double const sign = map.column[a][b];
            if (sign == 0) continue;
            result.spacing[static_cast<int>(a)] = input.spacing[b];
            Vec3 const along = input.direction[static_cast<std::size_t>(b)];
            result.direction[a] = sign > 0 ? along : along * -1 + Vec3{};
        }
    return result;
}

void check_direction(std::optional<Vec3> const& v, char const* name) {
    if (!v) return;
    if (!std::isfinite(v->x) || !std::isfinite(v->y) || !std::isfinite(v->z))
        throw Error(ErrorKind::usage, text(name, ": not finite"));
    if (*v == Vec3{}) throw Error(ErrorKind::usage, text(name, ": 0,0,0 is no direction"));
}

void check_length(std::optional<double> const& v, char const* name) {
    if (v && !(std::isfinite(*v) && *v > 0))
        throw Error(ErrorKind::usage, text(name, ": ", *v, " is no length above 0"));
}

} // namespace

void ObliquePlane::check() const {
    if (!normal) {
        char const* const without = at           ? "--at"
                                    : up         ? "--up"
                                    : spacing    ? "--spacing"
                                    : thickness  ? "--thickness"
                                    : project    ? "--project"
                                    : method     ? "--method"
                                    : background ? "--background"
                                                 : nullptr;
        if (without != nullptr)
            throw Error(ErrorKind::usage, text(without, " is for planes at any angle, which --normal X,Y,Z asks for"));
        return;
    }
    check_direction(normal, "--normal");
    check_direction(up, "--up");
    if (at && !(std::isfinite(at->x) && std::isfinite(at->y) && std::isfinite(at->z)))
        throw Error(ErrorKind::usage, "--at: not finite");
    check_length(spacing, "--spacing");
    check_length(thickness, "--thickness");
    if (project && !thickness) throw Error(ErrorKind::usage, "--project is for a slab: it needs --thickness T");
}

ObliqueSlice::Layout ObliqueSlice::layout_for(Header const& input) const {
    Layout layout;
    layout.from = input.dims;
    layout.output = input;
    layout.output.part.reset();
    Geometry const& geometry = input.geometry;
    Frame const frame = frame_of(plane_, geometry);
    Vec3 middle_index;
    for (int a = 0; a < 3; ++a) middle_index[a] = 0.5 * static_cast<double>(input.dims[a] - 1);
    Vec3 const middle = index_to_world(geometry, middle_index);

    double const across = step_along(geometry, frame.normal), thickness = plane_.thickness.value_or(0);
    double const place_along = plane_.at ? dot(*plane_.at - middle, frame.normal) : 0;
    double const half = half_extent(input, frame.normal);
    if (std::abs(place_along) > half + 0.5 * thickness + same_voxel * across)
        throw Error(ErrorKind::usage,
                    text("the plane does not meet the volume, which begins ", std::abs(place_along) - half, " from it"),
                    text("its middle is at ", middle.x, ",", middle.y, ",", middle.z));

    Geometry grid;
    grid.direction = {frame.x, frame.y, frame.normal};
    grid.origin = middle + frame.normal * place_along;
    for (int a = 0; a < 2; ++a) {
        Vec3 const along = grid.direction[static_cast<std::size_t>(a)];
        double const width = plane_.spacing.value_or(step_along(geometry, along));
        std::int64_t const n = count_over(2 * half_extent(input, along), width);
        grid.spacing[a] = width;
        grid.origin = grid.origin + along * ((0.5 - 0.5 * static_cast<double>(n)) * width);
        layout.output.dims[a] = layout.samples[a] = n;
    }
    layout.output.dims.z = 1;
    layout.samples.z = plane_.thickness ? count_over(thickness, across) : 1;
    layout.output.geometry = grid;
    layout.output.geometry.spacing.z = plane_.thickness.value_or(across);

    grid.spacing.z = layout.thick() ? thickness / static_cast<double>(layout.samples.z) : across;
    grid.origin = grid.origin + frame.normal * ((0.5 - 0.5 * static_cast<double>(layout.samples.z)) * grid.spacing.z);
    layout.placement = place(grid, layout.samples, geometry);
    if (layout.placement.whole() && !plane_.thickness) layout.output.geometry = picked(geometry, layout.placement.map);
    check_wanted(layout.output);

    Background const background = background_in(layout.output, plane_.background, input);
    layout.stored_background = background.stored;
    if (background.other) layout.other_background = layout.output.values.physical(background.stored);
    layout.values.in = layout.values.out = input.dtype;
    if (!layout.thick()) return layout;
    bool const wide = input.dtype == DataType::float64 || (is_integer(input.dtype) && size_of(input.dtype) >= 4);
    layout.values.out = wide ? DataType::float64 : DataType::float32;
    bool const flips = input.values.slope < 0;
    switch (plane_.project.value_or(SlabProjection::mean)) {
    case SlabProjection::mean:
        layout.projection = Projection::mean;
        break;
    case SlabProjection::max:
        layout.projection = flips ? Projection::min : Projection::max;
        break;
    case SlabProjection::min:
        layout.projection = flips ? Projection::max : Projection::min;
        break;
    }
    return layout;
}

Onto ObliqueSlice::onto_for(Layout const& layout, double background) const {
    OntoValues values = layout.values;
    values.background = background;
    auto const method = static_cast<ResampleMethod>(plane_.method.value_or(SamplingMethod{}));
    return Onto(layout.placement, layout.from, layout.samples, method, std::nullopt, values);
}

Plan ObliqueSlice::plan(std::span<Header const> inputs) const {
    Header const& input = inputs.front();
    Layout const layout = layout_for(input);
    Onto const onto = onto_for(layout, layout.stored_background);
    Plan plan;
    plan.output = layout.output;
    onto.describe(plan);
    onto.pass(input, plan);
    if (!layout.thick()) return plan;
    bool const averages = layout.projection == Projection::mean;
    bool const exact = plan.error.exact() && !averages && !(is_integer(input.dtype) && size_of(input.dtype) == 8);
    auto const n = static_cast<double>(layout.samples.z);
    plan.shift.reset();
    plan.method +=
        text(", ", enum_name(plane_.project.value_or(SlabProjection::mean)), " of ", layout.samples.z, " layers");
    plan.cost = n * (plan.cost + 1);
    if (exact) return plan;
    // The layers as they are kept, the sum of them, and storing the result.
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.magnitude +=
        (averages ? (n + 1) * 0x1p-53 : 0) + 2 * storing_error(layout.values.out) + storing_error(plan.output.dtype);
    plan.passing.storing = ErrorPassing::Storing::computes;
    return plan;
}

void ObliqueSlice::begin(std::span<Header const> inputs, Plan const&) {
    layout_ = layout_for(inputs.front());
    losses_ = {};
    onto_.emplace(
        onto_for(layout_, layout_.thick() ? std::numeric_limits<double>::quiet_NaN() : layout_.stored_background));
    preparation_ = onto_->take_coefficients();
}

Box ObliqueSlice::layers_of(Box const& output) const {
    Box box = output;
    box.lower.z = 0;
    box.upper.z = layout_.samples.z;
    return box;
}

Box ObliqueSlice::footprint(Box const& output, int) const { return onto_->footprint(layers_of(output)); }

std::size_t ObliqueSlice::fit(Index3 largest, Execution const& execution) {
    largest.z = layout_.samples.z;
    std::size_t const held = onto_->fit(largest, execution);
    if (!layout_.thick()) return held;
    // The layers, their projection, and its accumulators.
    std::size_t const pixels = static_cast<std::size_t>(largest.x * largest.y);
    std::size_t const value = size_of(layout_.values.out);
    return held + pixels * (value * static_cast<std::size_t>(largest.z + 1) + 24);
}

void ObliqueSlice::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (out.box.empty()) return;
    if (!layout_.thick()) return onto_->run(inputs.front(), out, losses_, execution);
    Space const space = execution.space();
    DataType const type = layout_.values.out;
    Box const box = layers_of(out.box);
    auto const bytes_of = [&](Box const& of) { return static_cast<std::size_t>(of.voxels()) * size_of(type); };
    layers_.reserve(bytes_of(box));
    pixels_.reserve(bytes_of(out.box));
    AnyView const layers = dense_view(layers_.write(space), type, box, space);
    onto_->run(inputs.front(), layers, losses_, execution);
    Index3 const n = box.dims();
    AnyView const pixels = dense_view(pixels_.write(space), type, box_of({n.x, n.y, 1}), space);
    ProjectionState state(layout_.projection, type, 2, n);
    project_add(state, ConstView(layers).moved_to({}), execution);
    Losses none;
    project_store(state, pixels, none, execution);
    store_or_background(ConstView(pixels).moved_to(out.box.lower), out, layout_.stored_background, losses_, execution);
}

std::vector<std::int64_t*> ObliqueSlice::counters() {
    auto all = losses_.counters();
    if (onto_) all.push_back(onto_->outside_counter());
    return all;
}

std::vector<Remark> ObliqueSlice::remarks() const {
    std::int64_t const pixels = layout_.output.voxels();
    Losses stored = losses_;
    std::int64_t const outside = layout_.thick() ? std::exchange(stored.undefined, 0) : onto_->outside();
    std::vector<Remark> result = store_remarks(stored, pixels, layout_.output.dtype);
    if (outside > 0) result.push_back(outside_remark(outside, pixels, "the volume", layout_.other_background));
    return result;
}

} // namespace vkt
