// Affine transforms: where the result lies, and what becomes of a region.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/affine_transform.h"

#include "libvkt/core/fine_region.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/text.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/resample/resample_size.h"

#include <cmath>

namespace vkt {
namespace {

/// A lattice along the same axes as another.
struct Lattice {
    Index3 dims;
    Vec3 first;          ///< position of its first voxel in voxels of the other
    Vec3 width{1, 1, 1}; ///< size of its voxels in voxels of the other
};

/// True if the axes of the world that the volume spans change places, or directions, and nothing else happens: the
/// spacings then go along.
bool turns_axes(Affine const& forward, Vec3 spacing, Vec3& width) {
    Vec3 result;
    int used = 0;
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
            double const length = std::abs(forward.column[static_cast<std::size_t>(a)][b]) * spacing[b] / spacing[a];
            if (length < 1e-9) continue;
            if (std::abs(length - 1) > 1e-9) return false;
            result[b] = spacing[a] / spacing[b];
            used += 1 << (4 * b);
        }
    if (used != 0x111) return false;
    width = result;
    return true;
}

/// The least lattice that holds the cells of all voxels where they have moved to; around the middle of what it holds.
Lattice enclosing(Affine const& source_map, Index3 dims, Vec3 spacing) {
    Affine const forward = inverse(source_map);
    Lattice result;
    turns_axes(forward, spacing, result.width);
    for (int b = 0; b < 3; ++b) {
        double low = forward.offset[b], high = low;
        for (int a = 0; a < 3; ++a) {
            double const step = forward.column[static_cast<std::size_t>(a)][b];
            double const last = static_cast<double>(dims[a]) - 0.5;
            low += std::min(-0.5 * step, step * last);
            high += std::max(-0.5 * step, step * last);
        }
        double const n = std::ceil((high - low) / result.width[b] - same_voxel);
        if (!(n <= static_cast<double>(max_extent)))
            throw Error(ErrorKind::usage, text("the result would have ", n, " voxels along an axis"));
        result.dims[b] = std::max<std::int64_t>(1, static_cast<std::int64_t>(n));
        double const voxels = static_cast<double>(result.dims[b]);
        double const first = 0.5 * (low + high) + (0.5 - 0.5 * voxels) * result.width[b];
        double const whole = std::nearbyint(first);
        result.first[b] = std::abs(first - whole) < 1e-9 ? whole + 0.0 : first;
    }
    return result;
}

} // namespace

Vec3 AffineTransform::fixed_point(std::optional<Vec3> const& about, Moved const& moved) {
    if (!about) return moved.middle;
    Vec3 result;
    for (int a = 0; a < 3; ++a) result[a] = (*about)[a] - static_cast<double>(moved.lower[a]);
    return result;
}

void AffineTransform::sampling_parameters(Parameters& p) {
    p.flag("expand", expand_, "make the grid as large as the moved volume needs, with the same voxels");
    p.option("like", like_.file, "FILE", "the grid of this volume, instead of the input's own");
    p.option("roi", region_, "REGION",
             "move the content of this region only, within it; of voxels that it covers partly their share");
    p.option("method", method_, "METHOD",
             "auto (default): linear, averaging where voxels of the result are wider than those of the input; or "
             "nearest, linear, cubic, bspline3, bspline5, lanczos3");
    p.option(
        "tolerance", tolerance_, "T|P%",
        "choose the cheapest of nearest, linear, cubic and lanczos3 whose estimated error is at most T, a physical "
        "value, or P% of the value range, after a look at the voxels");
    p.option("boundary", boundary_, "RULE",
             "how the volume continues outside, instead of a background: mirror, clamp, wrap or border[:VALUE]");
    p.option("background", background_, "VALUE", "value where the result lies outside the moved volume (0)");
}

std::vector<Knob> AffineTransform::knobs() const {
    if (tolerance_) return {InterpolationChoice::knob()};
    return {{"method", {"nearest", "linear", "cubic", "lanczos3", "bspline3", "bspline5"}, "bspline5", false}};
}

void AffineTransform::check() const {
    if (tolerance_) check_interpolation_tolerance(*tolerance_, method_.has_value());
    if (boundary_ && background_)
        throw Error(ErrorKind::usage, "--boundary continues the volume everywhere: --background does not apply");
    if (expand_ && !like_.file.empty())
        throw Error(ErrorKind::usage, "--like says how large the result is: --expand does not apply");
    if (!region_.empty() && (expand_ || !like_.file.empty()))
        throw Error(ErrorKind::usage,
                    text("--roi keeps the grid: ", expand_ ? "--expand" : "--like", " does not apply"),
                    "crop the region first, to have it alone");
}

Placement AffineTransform::place_result(Header const& input, Header& output) const {
    Moved whole{input, {}, {}};
    for (int a = 0; a < 3; ++a) whole.middle[a] = 0.5 * static_cast<double>(input.dims[a] - 1);
    if (!like_.file.empty()) {
        Header const& like = like_.header();
        output.dims = like.dims;
        output.geometry = like.geometry;
        take_world(like, output);
        if (!(like.dims == input.dims && same_place(like, input))) output.part.reset();
        Affine const grid = index_to_index(geometry_beside(input, like), input.geometry);
        return place(composed(source_map(whole), grid), like.dims);
    }
    Affine map = source_map(whole);
    if (expand_) {
        Lattice const lattice = enclosing(map, input.dims, input.geometry.spacing);
        Affine grid;
        for (int a = 0; a < 3; ++a) grid.column[static_cast<std::size_t>(a)][a] = lattice.width[a];
        grid.offset = lattice.first;
        map = composed(map, grid);
        bool const same = lattice.dims == input.dims && lattice.first == Vec3{} && lattice.width == Vec3{1, 1, 1};
        if (!same) {
            output.geometry.origin = index_to_world(input.geometry, lattice.first);
            for (int a = 0; a < 3; ++a) output.geometry.spacing[a] *= lattice.width[a];
            output.dims = lattice.dims;
            output.part.reset();
        }
    }
    return place(map, output.dims);
}

AffineTransform::Layout AffineTransform::layout_for(Header const& input) const {
    if (input.kind == Kind::hierarchical)
        throw Error(ErrorKind::usage,
                    text("the cells of a hierarchical volume cannot be moved: they would leave the bricks"),
                    "make it a grid first: vkt resample --cells 50M");
    Layout layout;
    layout.output = input;
    if (region_.empty()) {
        layout.placement = place_result(input, layout.output);
        layout.box = box_of(layout.output.dims);
        layout.region_dims = input.dims;
    } else {
        FineRegion const region = resolve_fine(region_, input.dims);
        bool const nearest = method_ && static_cast<ResampleMethod>(*method_) == ResampleMethod::nearest;
        if (region.partly() && !nearest) {
            layout.box = region.touched();
            layout.covered.emplace();
            layout.covered->continues = boundary_.has_value();
            for (int a = 0; a < 3; ++a) {
                auto const first = static_cast<double>(layout.box.lower[a]);
                layout.covered->lower[a] = region.lower[a] - first;
                layout.covered->upper[a] = region.upper[a] - first;
            }
        } else if (region.voxels.empty()) {
            throw Error(ErrorKind::usage, text("--roi ", region_.text, " holds no voxel's centre"),
                        "centres lie at 0.5, 1.5, …: ends are counted from the outer face of the first voxel");
        } else {
            layout.box = region.voxels;
        }
        layout.in_place = true;
        layout.region_dims = layout.box.dims();
        Moved part{input, layout.box.lower, region.middle_from(layout.box.lower)};
        part.header.dims = layout.region_dims;
        part.header.geometry = cropped(input.geometry, layout.box.lower);
        layout.placement = place(source_map(part), layout.region_dims);
        if (layout.covered) layout.covered->map = layout.placement.map;
    }
    check_wanted(layout.output);
    layout.values.in = layout.values.out = input.dtype;
    Background background;
    if (boundary_)
        layout.values.border = input.values.stored(boundary_->value);
    else
        background = background_in(layout.output, background_, input);
    layout.values.background = background.stored;
    if (layout.covered) {
        layout.values.out = DataType::float64; // rounded once, with what it is put upon
        layout.covered->background = background.stored;
    }
    if (background.other) layout.other_background = layout.output.values.physical(background.stored);
    return layout;
}

std::optional<InterpolationChoice> AffineTransform::choice_for(Header const& input, Layout const& layout) const {
    if (!tolerance_ || layout.placement.whole()) return std::nullopt;
    return InterpolationChoice(input, layout.in_place ? layout.box : box_of(input.dims), layout.placement.between(),
                               *tolerance_);
}

Onto AffineTransform::onto_by(ResampleMethod method, Layout const& layout) const {
    auto boundary = boundary_;
    if (layout.covered && !boundary) boundary = BoundaryRule{Boundary::clamp, 0}; // where it ends is decided later
    return Onto(layout.placement, layout.region_dims, layout.box.dims(), method, boundary, layout.values);
}

void AffineTransform::describe_covering(Plan& plan) const {
    plan.method += ", parts of voxels by their share";
    plan.error.kind = std::max(plan.error.kind, ErrorBound::Kind::bound);
    plan.error.magnitude += 8 * 0x1p-53 + storing_error(plan.output.dtype);
    plan.error.absolute += std::abs(plan.output.values.slope) * storing_floor(plan.output.dtype);
    plan.passing.storing = ErrorPassing::Storing::computes;
}

Plan AffineTransform::plan(std::span<Header const> inputs) const {
    Header const& input = inputs.front();
    Layout const layout = layout_for(input);
    auto const choice = choice_for(input, layout);
    Onto const onto = onto_by(first_method(choice.has_value()), layout);
    Plan plan;
    plan.output = layout.output;
    onto.describe(plan);
    onto.pass(input, plan);
    if (layout.covered) describe_covering(plan);
    if (choice) choice->announce(plan);
    if (layout.in_place) plan.shift.reset();
    return plan;
}

void AffineTransform::begin(std::span<Header const> inputs, Plan const&) {
    Header const& input = inputs.front();
    losses_ = {};
    layout_ = layout_for(input);
    choice_ = choice_for(input, layout_);
    onto_.emplace(onto_by(first_method(choice_.has_value()), layout_));
    preparation_ = layout_.in_place || choice_ ? nullptr : onto_->take_coefficients();
}

void AffineTransform::scan(ConstView slab, Execution const&) { choice_->scan(slab); }

void AffineTransform::scan_end() { onto_.emplace(onto_by(choice_->choose(layout_.placement.coarser()), layout_)); }

void AffineTransform::after_scan(Plan& plan) const {
    if (!choice_) return;
    Plan chosen;
    chosen.output = plan.output;
    onto_->describe(chosen);
    Header input = plan.output; // of the same type and map of values
    onto_->pass(input, chosen);
    if (layout_.covered) describe_covering(chosen);
    choice_->settle(chosen, plan);
}

Box AffineTransform::footprint(Box const& output, int) const {
    if (!layout_.in_place) return onto_->footprint(output);
    Box const part = intersect(output, layout_.box);
    if (part.empty()) return output;
    Box source = onto_->footprint({part.lower - layout_.box.lower, part.upper - layout_.box.lower});
    if (source.empty()) return output;
    source = {source.lower + layout_.box.lower, source.upper + layout_.box.lower};
    // What lies beyond the region is made of it.
    bool const leaves = !(intersect(source, layout_.box) == source);
    if (leaves) source = layout_.box;
    for (int a = 0; a < 3; ++a) {
        source.lower[a] = std::min(source.lower[a], output.lower[a]);
        source.upper[a] = std::max(source.upper[a], output.upper[a]);
    }
    return source;
}

std::size_t AffineTransform::fit(Index3 largest, Execution const&) {
    auto const voxels = static_cast<std::size_t>(largest.x * largest.y * largest.z);
    return onto_->held(largest) + (layout_.covered ? 9 * voxels : 0);
}

void AffineTransform::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (out.box.empty()) return;
    ConstView const in = inputs.front();
    if (!layout_.in_place) return onto_->run(in, out, losses_, execution);
    copy_region(in.part(out.box), out, execution);
    Box const part = intersect(out.box, layout_.box);
    if (part.empty()) return;
    AnyView const to = out.part(part).moved_to(part.lower - layout_.box.lower);
    if (!layout_.covered) return run_in_place(in, to, execution);
    auto const voxels = static_cast<std::size_t>(part.voxels());
    moved_.reserve(voxels * sizeof(double));
    beyond_.reserve(voxels);
    AnyView const moved = dense_view(moved_.write(execution.space()), DataType::float64, to.box, execution.space());
    AnyView const beyond = dense_view(beyond_.write(execution.space()), DataType::uint8, to.box, execution.space());
    run_in_place(in, moved, execution);
    Losses found;
    cover_region(moved, in.part(part).moved_to(to.box.lower), to, *layout_.covered, beyond, found, execution);
    *onto_->outside_counter() += found.undefined;
    losses_ += {found.clipped, found.nan, 0};
}

/// What moves into a part of the region, in voxels of it.
void AffineTransform::run_in_place(ConstView in, AnyView to, Execution const& execution) {
    Box const needed = onto_->footprint(to.box), whole = box_of(layout_.region_dims);
    if (needed.empty()) return onto_->run(in, to, losses_, execution);
    if (intersect(needed, whole) == needed) {
        Box const there{needed.lower + layout_.box.lower, needed.upper + layout_.box.lower};
        return onto_->run(in.part(there).moved_to(needed.lower), to, losses_, execution);
    }
    // A region that is wrapped around.
    Box window = whole;
    for (int a = 0; a < 3; ++a) {
        window.lower[a] = std::min(window.lower[a], needed.lower[a]);
        window.upper[a] = std::max(window.upper[a], needed.upper[a]);
    }
    window_.reserve(static_cast<std::size_t>(window.voxels()) * size_of(layout_.values.in));
    AnyView const filled = dense_view(window_.write(execution.space()), layout_.values.in, window, execution.space());
    copy_region(in.part(layout_.box), filled.part(whole), execution);
    fill_border(filled, whole, layout_.region_dims, boundary_->boundary, 0, execution);
    onto_->run(ConstView(filled).part(needed), to, losses_, execution);
}

std::vector<std::int64_t*> AffineTransform::counters() {
    auto all = losses_.counters();
    if (onto_) all.push_back(onto_->outside_counter());
    return all;
}

std::vector<Remark> AffineTransform::remarks() const {
    Index3 const n = layout_.box.dims();
    std::int64_t const voxels = n.x * n.y * n.z;
    std::vector<Remark> result = store_remarks(losses_, voxels, layout_.values.in);
    if (choice_)
        if (auto const remark = choice_->remark()) result.push_back(*remark);
    if (onto_ && onto_->outside() > 0)
        result.push_back(outside_remark(onto_->outside(), voxels, "the moved volume", layout_.other_background));
    return result;
}

} // namespace vkt
