// Pad: how much, and which part of the volume the border continues.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/pad.h"

#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/voxels/kernels/pad.h"

#include <cmath>

namespace vkt {
namespace {

std::int64_t parse_count(std::string const& digits, std::string_view name) {
    std::int64_t const count = digits.empty() ? 0 : ValueText<std::int64_t>::read({digits}, name);
    if (count < 0 || count > max_extent)
        throw Error(ErrorKind::usage, text(name, ": ", digits, " is not a number of voxels to add"),
                    count < 0 ? "vkt crop takes voxels away" : "");
    return count;
}

/// The range of voxels that stand at [begin, end) of a line of n voxels.
std::pair<std::int64_t, std::int64_t> folded_range(std::int64_t begin, std::int64_t end, std::int64_t n,
                                                   Boundary boundary) {
    if (boundary == Boundary::border) return {std::max<std::int64_t>(begin, 0), std::min(end, n)};
    if (boundary != Boundary::clamp && end - begin >= 2 * n) return {0, n};
    if (boundary == Boundary::clamp) return {fold(begin, n, boundary), fold(end - 1, n, boundary) + 1};
    std::pair<std::int64_t, std::int64_t> range{n, 0};
    for (std::int64_t i = begin; i < end; ++i) {
        std::int64_t const from = fold(i, n, boundary);
        range = {std::min(range.first, from), std::max(range.second, from + 1)};
    }
    return range;
}

} // namespace

Padding ValueText<Padding>::read(std::vector<std::string> const& w, std::string_view name) {
    std::vector<std::string> parts = split(w.front(), ',');
    if (parts.size() == 1 && parts.front().find(':') == std::string::npos) parts.resize(3, parts.front());
    if (parts.size() != 3 || w.front().empty())
        throw Error(ErrorKind::usage, text(name, ": '", w.front(), "' is not X0:X1,Y0:Y1,Z0:Z1"),
                    "for example 2:3,0:0,5:5, or 4,4,0 for both sides of x and y");
    Padding result;
    for (int axis = 0; axis < 3; ++axis) {
        std::string const& part = parts[static_cast<std::size_t>(axis)];
        std::size_t const colon = part.find(':');
        result.below[axis] = parse_count(part.substr(0, colon), name);
        result.above[axis] =
            colon == std::string::npos ? result.below[axis] : parse_count(part.substr(colon + 1), name);
    }
    return result;
}

std::vector<std::string> ValueText<Padding>::write(Padding const& v) {
    return {text(v.below.x, ":", v.above.x, ",", v.below.y, ":", v.above.y, ",", v.below.z, ":", v.above.z)};
}

VKT_OPERATION(Pad, "pad")

Texts Pad::texts() const {
    return {
        "Add voxels around a volume.",
        "The origin moves so that voxels keep their world positions. What is added is a value, 0 by default, or "
        "continues the volume: mirror, clamp or wrap."
        "\n\n"
        "Accuracy: Exact: bytes are moved, world positions survive; a value that is added is correctly rounded once.",
        {{"A frame of four voxels", "vkt pad volume.nrrd --by 4 -o framed.nrrd"},
         {"Below and above, mirrored", "vkt pad volume.nrrd --by 0:0,2:3,10:0 --boundary mirror | vkt info"}}};
}

void Pad::parameters(Parameters& parameters) {
    parameters
        .option("by", by, "X0:X1,Y0:Y1,Z0:Z1", "voxels to add below and above each axis; N or X,Y,Z for both sides")
        .needed();
    parameters.option("boundary", boundary, "RULE", "what they are: border[:VALUE] (default), mirror, clamp or wrap");
    parameters.option("value", value, "VALUE", "physical value of the border (0)");
}

void Pad::check() const {
    if (!value) return;
    if (boundary.boundary != Boundary::border)
        throw Error(ErrorKind::usage, text("--value is for --boundary border, not ", enum_name(boundary.boundary)));
    if (boundary.value != 0)
        throw Error(ErrorKind::usage, "--boundary border:VALUE and --value say the same: give one of them");
}

Number Pad::stored_in(Header const& in) const {
    return in.values == ValueMap{} ? border() : Number(in.values.stored(border().value));
}

Plan Pad::plan(std::span<Header const> inputs) const {
    Header const& in = inputs[0];
    Number const stored = stored_in(in);
    Plan plan;
    plan.output = in;
    plan.output.part.reset(); // what is added lies in no larger volume
    plan.output.geometry = cropped(in.geometry, Index3{} - by.below);
    bool const back = boundary.boundary == Boundary::mirror || boundary.boundary == Boundary::wrap;
    if (by == Padding{}) plan.shift = Index3{};
    if (back && by.below.z + by.above.z > 0) plan.access = Access::random;
    plan.output.dims = in.dims + by.below + by.above;
    for (int axis = 0; axis < 3; ++axis)
        if (plan.output.dims[axis] > max_extent)
            throw Error(ErrorKind::usage,
                        text("--by: the result would have ", plan.output.dims[axis], " voxels along an axis"));
    plan.method = "copy, " + enum_name(boundary.boundary);
    auto values = values_of(in);
    if (boundary.boundary == Boundary::border) {
        if (values) values = values->with(in.values.physical(stored.value));
        plan.passing = ErrorPassing::moved(values);
        plan.passing.more = std::abs(in.values.slope) * storing_loss(in.dtype, stored);
    } else {
        plan.passing = ErrorPassing::moved(values);
    }
    plan.cost = 0;
    return plan;
}

void Pad::begin(std::span<Header const> inputs, Plan const&) {
    dims_ = inputs[0].dims;
    type_ = inputs[0].dtype;
    stored_ = stored_in(inputs[0]);
}

Box Pad::footprint(Box const& output, int) const {
    Box result;
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t const below = by.below[axis];
        auto const [begin, end] =
            folded_range(output.lower[axis] - below, output.upper[axis] - below, dims_[axis], boundary.boundary);
        result.lower[axis] = begin;
        result.upper[axis] = end;
    }
    return result.empty() ? Box{} : result;
}

void Pad::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    pad_box(inputs[0], out, {by.below, dims_, boundary.boundary, voxel_bytes(type_, stored_)}, execution);
}

std::vector<Remark> Pad::remarks() const {
    if (boundary.boundary != Boundary::border) return {};
    return value_remarks(border(), stored_, type_,
                         box_of(dims_ + by.below + by.above).voxels() - box_of(dims_).voxels());
}

} // namespace vkt
