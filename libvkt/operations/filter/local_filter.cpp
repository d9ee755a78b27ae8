// Filters of a neighbourhood: options, checks, and what lies outside the region.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/local_filter.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/kernels/convert.h"

#include <cmath>

namespace vkt {

Radius ValueText<Radius>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string_view const word = w.front();
    if (word.find(',') == std::string_view::npos) {
        std::int64_t const r = ValueText<std::int64_t>::read(w, name);
        return {{r, r, r}};
    }
    std::vector<std::string> const parts = parts_of(w, name);
    if (parts.size() != 3)
        throw Error(ErrorKind::usage, text(name, ": '", word, "' is neither one whole number nor three: X,Y,Z"));
    Radius radius;
    for (int axis = 0; axis < 3; ++axis)
        radius.voxels[axis] = ValueText<std::int64_t>::read({parts[static_cast<std::size_t>(axis)]}, name);
    return radius;
}

std::vector<std::string> ValueText<Radius>::write(Radius const& radius) {
    Index3 const& r = radius.voxels;
    return {r.x == r.y && r.y == r.z ? to_text(r.x) : text(r.x, ",", r.y, ",", r.z)};
}

void Radius::check(std::int64_t most) const {
    for (int axis = 0; axis < 3; ++axis)
        if (voxels[axis] < 0 || voxels[axis] > most)
            throw Error(ErrorKind::usage, text("--radius ", voxels[axis], " is not in 0 to ", most));
}

Box inside_volume(Box box, Index3 dims, Boundary boundary) {
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t const n = dims[axis];
        bool const outside = box.lower[axis] < 0 || box.upper[axis] > n;
        if (!outside) continue;
        if (boundary == Boundary::wrap) {
            // The engine fetches slices of the other end, and rows where that is not all of them.
            if (axis == 2 || (axis == 1 && box.dims().y < n)) continue;
            box.lower[axis] = 0;
            box.upper[axis] = n;
        }
        box.lower[axis] = std::max<std::int64_t>(box.lower[axis], 0);
        box.upper[axis] = std::min(box.upper[axis], n);
    }
    return box;
}

void LocalFilter::parameters(Parameters& parameters) {
    parameters.option("boundary", boundary_, "RULE",
                      "how the volume continues outside: mirror, clamp, wrap, border[:VALUE]");
    parameters.option("roi", region_, "REGION", "filter only the voxels of this region");
}

void LocalFilter::check() const {
    if (!std::isfinite(boundary_.value))
        throw Error(ErrorKind::usage, "--boundary border: the value is not a finite number");
}

Plan LocalFilter::plan(std::span<Header const> inputs) const { return plan_on(inputs[0], {1, 1, 1}); }

void LocalFilter::begin(std::span<Header const> inputs, Plan const& plan) { begin_on(inputs[0], {1, 1, 1}, plan); }

Plan LocalFilter::plan_on(Header const& in, Index3 cell_width) const {
    check();
    static_cast<void>(region_in(in.dims)); // or it is refused
    Plan plan;
    plan.output = in;
    plan.boundary = boundary_.boundary;
    if (boundary_.boundary == Boundary::border) plan.border_value = in.values.stored(boundary_.value);
    describe(in, cell_width, plan);
    return plan;
}

void LocalFilter::begin_on(Header const& in, Index3 cell_width, Plan const& plan) {
    losses_ = {};
    box_ = region_in(in.dims);
    planned_ = plan.output;
    beyond_ = {in.dims, plan.boundary, plan.border_value};
    prepare(in, cell_width);
}

Box LocalFilter::footprint(Box const& output, int) const {
    Box const seen = grow(output, reach_);
    return folds_ ? inside_volume(seen, beyond_.dims, beyond_.boundary) : seen;
}

ConstView LocalFilter::with_outside(ConstView in, Box const& output, Buffer& buffer, Execution const& execution) const {
    Box const seen = grow(output, reach_);
    if (execution.space() == Space::host || in.box.contains(seen)) return in;
    // All that is there: columns that wrap around come from the other end.
    Box window = seen;
    for (int axis = 0; axis < 3; ++axis) {
        window.lower[axis] = std::min(seen.lower[axis], in.box.lower[axis]);
        window.upper[axis] = std::max(seen.upper[axis], in.box.upper[axis]);
    }
    Space const space = execution.space();
    buffer.reserve(static_cast<std::size_t>(window.voxels()) * size_of(in.type));
    AnyView const all = dense_view(buffer.write(space), in.type, window, space);
    copy_region(in, all.part(in.box), execution);
    fill_border(all, in.box, beyond_.dims, beyond_.boundary, beyond_.border_value, execution);
    return all;
}

std::size_t LocalFilter::outside_bytes(Index3 largest, DataType type, Execution const& execution) const {
    if (!folds_ || execution.space() == Space::host) return 0;
    return static_cast<std::size_t>(grow(box_of(largest), reach_).voxels()) * size_of(type);
}

Plan LocalFilter::plan_level(Header const& level, Index3 cell_width) const {
    if (!region_.empty())
        throw Error(ErrorKind::usage, text(name(), " --roi works on structured volumes only"),
                    "crop the hierarchical volume first: vkt crop --roi");
    return plan_on(level, cell_width);
}

void LocalFilter::begin_level(Header const& level, Index3 cell_width, Plan const& plan) {
    begin_on(level, cell_width, plan);
}

void LocalFilter::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = intersect(out.box, box_);
    if (inside != out.box) outside(inputs[0].part(out.box), out, execution);
    if (!inside.empty()) filter(inputs[0], out.part(inside), execution);
}

void LocalFilter::outside(ConstView in, AnyView out, Execution const& execution) {
    if (in.type == out.type)
        copy_region(in, out, execution);
    else
        convert_values(in, out, losses_, execution);
}

bool LocalFilter::is_flat(Header const& in, int axis) const {
    return in.dims[axis] == 1 && boundary_.boundary != Boundary::border;
}

Index3 LocalFilter::without_copies(Header const& in, Index3 radius) const {
    for (int axis = 0; axis < 3; ++axis)
        if (is_flat(in, axis)) radius[axis] = 0;
    return radius;
}

void LocalFilter::require_border_voxel(Header const& in) const {
    if (boundary_.boundary != Boundary::border) return;
    double const stored = in.values.stored(boundary_.value);
    bool const held = is_integer(in.dtype) ? stored >= lowest_of(in.dtype) && stored <= highest_of(in.dtype) &&
                                                 std::abs(stored - std::nearbyint(stored)) <= 1e-9 * std::abs(stored)
                                           : std::abs(stored) <= highest_of(in.dtype);
    if (!held)
        throw Error(ErrorKind::usage,
                    text("--boundary border:", boundary_.value, " is no voxel of a ", in.dtype, " volume",
                         in.values == ValueMap{} ? "" : " with this value map"),
                    "convert the volume first: vkt convert --dtype float32");
}

std::vector<Remark> LocalFilter::remarks() const { return store_remarks(losses_, planned_.voxels(), planned_.dtype); }

} // namespace vkt
