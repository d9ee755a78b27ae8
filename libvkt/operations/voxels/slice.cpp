// Slice: which plane, and what becomes of its values.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/slice.h"

#include "libvkt/operations/voxels/kernels/permute.h"

namespace vkt {

std::array<int, 3> axes_without(int axis) { return {axis == 0 ? 1 : 0, axis == 2 ? 1 : 2, axis}; }

Header with_axes(Header const& in, std::array<int, 3> const& axes) {
    Header result = in;
    for (std::size_t k = 0; k < 3; ++k) {
        auto const own = static_cast<int>(k);
        result.dims[own] = in.dims[axes[k]];
        result.geometry.spacing[own] = in.geometry.spacing[axes[k]];
        result.geometry.direction[k] = in.geometry.direction[static_cast<std::size_t>(axes[k])];
        if (!in.part) continue;
        result.part->global_dims[own] = in.part->global_dims[axes[k]];
        result.part->offset[own] = in.part->offset[axes[k]];
        result.part->halo[own] = in.part->halo[axes[k]];
    }
    return result;
}

VKT_OPERATION(Slice, "slice")

Texts Slice::texts() const {
    return {
        "Take a slice of a volume, as a volume or as a picture.",
        "The result has one slice; it keeps its place in the world. As .png or .pgm it is a grey picture, a pixel a "
        "voxel, the first row on top: of uint8 and uint16 as they are, of all types with --range. "
        "As .exr or .pfm it holds the values as floats."
        "\n\n"
        "Accuracy: Exact: bytes are moved, world positions survive.",
        {{"A picture of a slice of a CT", "vkt slice volume.nrrd --z 12 --range 0:200 -o slice.png"},
         {"The middle, as values", "vkt slice volume.nrrd --axis x | vkt stats"}}};
}

void Slice::parameters(Parameters& parameters) {
    parameters.option("axis", axis, "AXIS", "axis to cut across (z); without an index its middle");
    parameters.option("x", index[0], "N", "the slice with this x; negative numbers count from the end");
    parameters.option("y", index[1], "N", "the slice with this y");
    parameters.option("z", index[2], "N", "the slice with this z");
    parameters.option("range", range, "LO:HI|minmax|pA:pB", "map these values to 0 … 255, as uint8");
}

int Slice::sliced_axis() const {
    for (std::size_t a = 0; a < 3; ++a)
        if (index[a]) return static_cast<int>(a);
    return axis ? static_cast<int>(*axis) : 2;
}

void Slice::check() const {
    int const given = (index[0] ? 1 : 0) + (index[1] ? 1 : 0) + (index[2] ? 1 : 0);
    if (given > 1) throw Error(ErrorKind::usage, "a slice has one index: give one of --x, --y and --z");
    if (axis && given == 1 && sliced_axis() != static_cast<int>(*axis))
        throw Error(ErrorKind::usage, text("--axis ", enum_name(*axis), " and the index are about different axes"));
}

Box Slice::plane_in(Index3 dims) const {
    int const across = sliced_axis();
    std::int64_t const n = dims[across], asked = index[static_cast<std::size_t>(across)].value_or(n / 2);
    std::int64_t const at = asked < 0 ? asked + n : asked;
    if (at < 0 || at >= n)
        throw Error(ErrorKind::usage,
                    text("--", enum_name(static_cast<Axis>(across)), " ", asked,
                         " is outside of the volume, which has ", n, " slices across it"),
                    text("the first is 0, the last ", n - 1));
    Box plane = box_of(dims);
    plane.lower[across] = at;
    plane.upper[across] = at + 1;
    return plane;
}

Header Slice::cut_out(Header const& in) const {
    Box const plane = plane_in(in.dims);
    Header cut = in;
    cut.dims = plane.dims();
    cut.geometry = cropped(in.geometry, plane.lower);
    if (cut.part) cut.part = {cut.part->global_dims, cut.part->offset + plane.lower, {}};
    return with_axes(cut, axes_without(sliced_axis()));
}

Convert Slice::conversion() const {
    Convert convert;
    convert.range = range;
    convert.dtype = DataType::uint8;
    return convert;
}

Plan Slice::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    Header const slice = cut_out(in);
    Plan plan;
    if (range) {
        plan = conversion().plan({&slice, 1});
        plan.method = "copy, " + plan.method;
        return plan;
    }
    plan.output = slice;
    plan.method = "copy";
    plan.cost = 0;
    plan.passing = ErrorPassing::moved(values_of(in));
    if (sliced_axis() == 2) plan.shift = plane_in(in.dims).lower;
    return plan;
}

void Slice::begin(std::span<Header const> inputs, Plan const& plan) {
    Header const& in = inputs[0];
    axes_ = axes_without(sliced_axis());
    plane_ = plane_in(in.dims);
    type_ = in.dtype;
    if (!range) return;
    Header const slice = cut_out(in);
    convert_ = conversion();
    convert_.begin({&slice, 1}, plan);
}

Box Slice::footprint(Box const& output, int) const {
    Box box = plane_;
    for (std::size_t k = 0; k < 2; ++k) {
        box.lower[axes_[k]] = output.lower[static_cast<int>(k)];
        box.upper[axes_[k]] = output.upper[static_cast<int>(k)];
    }
    return box;
}

std::size_t Slice::fit(Index3 largest, Execution const&) {
    return range ? static_cast<std::size_t>(box_of(largest).voxels()) * size_of(type_) : 0;
}

void Slice::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const in = inputs[0].part(footprint(out.box, 0));
    if (!range) return permute_box(in, out, axes_, {}, execution);
    staging_.reserve(static_cast<std::size_t>(out.box.voxels()) * size_of(type_));
    AnyView const staged = dense_view(staging_.write(out.space), type_, out.box, out.space);
    permute_box(in, staged, axes_, {}, execution);
    ConstView const slice = staged;
    convert_.run({&slice, 1}, out, execution);
}

std::vector<Remark> Slice::remarks() const {
    if (!range) return {};
    std::vector<Remark> result = convert_.remarks();
    for (Remark& remark : result) remark.lossy = false; // to cut off is what a range is for
    return result;
}

} // namespace vkt
