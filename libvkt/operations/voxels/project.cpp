// Project: types, geometry and value maps of projections.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/project.h"

#include "libvkt/kernel/border.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/voxels/axis_order.h"
#include "libvkt/operations/voxels/kernels/median_lines.h"

#include <algorithm>
#include <cmath>

namespace vkt {
namespace {

constexpr std::size_t gathered_bytes = std::size_t{1} << 20;

} // namespace

VKT_OPERATION(Project, "project")

Texts Project::texts() const {
    return {
        "Reduce a volume along an axis to one slice: max, min, mean, sum, std or median.",
        "The result has one slice, whose axes are those that are left. NaN is left out. All but the median take one "
        "pass, and memory for the slice alone."
        "\n\n"
        "Accuracy: max, min, median and sums of integers are exact; mean, std and sums of floats are estimates: n "
        "roundings in double precision for lines of n voxels, and the rounding to the type.",
        {{"A maximum intensity projection, as a picture",
          "vkt project max volume.nrrd --axis y | vkt slice --range minmax -o mip.png"},
         {"The mean of all slices", "vkt project mean volume.nrrd -o mean.nrrd"}}};
}

void Project::parameters(Parameters& parameters) {
    parameters.positional("what", kind, "max, min, mean, sum, std or median");
    parameters.option("axis", axis, "AXIS", "axis along which voxels are reduced");
    parameters.option("roi", roi, "REGION", "project only the voxels of this region; X0:X1:S is every S-th");
}

ProjectionState Project::state_for(Header const& in) const {
    Projection stored = kind;
    if (in.values.slope < 0 && kind == Projection::max) stored = Projection::min;
    if (in.values.slope < 0 && kind == Projection::min) stored = Projection::max;
    return ProjectionState(stored, in.dtype, static_cast<int>(axis), roi.resolve_steps(in.dims).dims());
}

Plan Project::plan(std::span<Header const> inputs) const {
    Header in = inputs[0];
    SteppedBox const region = roi.resolve_steps(in.dims);
    in.dims = region.dims();
    in.geometry = region.geometry(in.geometry);
    int const along = static_cast<int>(axis);
    DataType const type = in.dtype;
    Header flat = in;
    flat.dims[along] = 1;
    flat.geometry = rescaled(in.geometry, in.dims, flat.dims);
    flat.part.reset();
    Plan plan;
    plan.output = with_axes(flat, axes_without(along));
    Header& out = plan.output;
    auto const n = static_cast<double>(in.dims[along]);
    bool const wide = type == DataType::float64 || (is_integer(type) && size_of(type) >= 4);
    plan.error.kind = ErrorBound::Kind::estimate;
    switch (kind) {
    case Projection::max:
    case Projection::min:
    case Projection::median:
        plan.error = {};
        break;
    case Projection::mean:
        out.dtype = wide ? DataType::float64 : DataType::float32;
        plan.error.magnitude = (is_integer(type) ? 2 : n + 2) * 0x1p-53 + storing_error(out.dtype);
        break;
    case Projection::sum:
        out.dtype = !is_integer(type) ? DataType::float64 : is_signed(type) ? DataType::int64 : DataType::uint64;
        if (!(in.values == ValueMap{})) out.values.intercept *= n;
        if (is_integer(type))
            plan.error = {};
        else
            plan.error.magnitude = n * n * 0x1p-53;
        break;
    case Projection::std:
        out.dtype = wide ? DataType::float64 : DataType::float32;
        out.values = {std::abs(in.values.slope), 0};
        plan.error.magnitude = n * 0x1p-52 + storing_error(out.dtype);
        break;
    }
    auto const values = values_of(in);
    bool const picks = kind == Projection::max || kind == Projection::min || kind == Projection::median;
    plan.passing = picks ? ErrorPassing::moved(values) : ErrorPassing::averaged(1, values);
    // The two middle ones of an even number are averaged; of floats numbers alone count, and who knows how many.
    if (kind == Projection::median && (in.dims[along] % 2 == 0 || !is_integer(type)))
        plan.passing.storing = ErrorPassing::Storing::computes;
    if (kind == Projection::std) // as a function of n values it changes by no more than the largest of their changes
        plan.passing = ErrorPassing::computed(std::sqrt(n / std::max(1.0, n - 1)),
                                              values ? std::optional(ValueInterval{0, values->width()}) : std::nullopt);
    if (kind == Projection::sum) {
        plan.passing = ErrorPassing::summed(n, values);
        if (is_integer(type)) plan.passing.storing = ErrorPassing::Storing::whole;
    }
    bool const sorts = kind == Projection::median;
    plan.method = sorts ? "sorted lines" : "one pass, an accumulator a pixel";
    plan.scans = !sorts;
    plan.cost = n * (sorts ? 40 : kind == Projection::std ? 8 : 3);
    plan.state_bytes = sorts ? 0 : state_for(inputs[0]).bytes() + (region.dense() ? 0 : gathered_bytes);
    return plan;
}

void Project::begin(std::span<Header const> inputs, Plan const&) {
    Header const& in = inputs[0];
    region_ = roi.resolve_steps(in.dims);
    dims_ = region_.dims();
    type_ = in.dtype;
    state_ = state_for(in);
    nan_ = 0;
    counts_ = {};
}

Box Project::footprint(Box const& output, int) const {
    if (kind != Projection::median) return {};
    auto const axes = axes_without(static_cast<int>(axis));
    Box box = box_of(dims_);
    for (int k = 0; k < 2; ++k) {
        int const along = axes[static_cast<std::size_t>(k)];
        box.lower[along] = output.lower[k];
        box.upper[along] = output.upper[k];
    }
    return region_.source(box);
}

Box Project::taken_of(Box const& slab) const {
    Box taken;
    for (int a = 0; a < 3; ++a) {
        std::int64_t const step = region_.step[a], lower = region_.box.lower[a];
        taken.lower[a] = std::max<std::int64_t>((slab.lower[a] - lower + step - 1) / step, 0);
        taken.upper[a] = slab.upper[a] <= lower ? 0 : std::min((slab.upper[a] - 1 - lower) / step + 1, dims_[a]);
    }
    return taken;
}

ConstView Project::gathered(ConstView const& slab, Box const& taken) {
    gathered_.reserve(static_cast<std::size_t>(taken.voxels()) * size_of(slab.type));
    AnyView const to = dense_view(gathered_.write(slab.space), slab.type, taken, slab.space);
    copy_every(slab.part(region_.source(taken)), region_.step, to);
    return to;
}

void Project::scan(ConstView slab, Execution const& execution) {
    Box const taken = taken_of(slab.box);
    if (taken.empty()) return;
    if (region_.dense()) return project_add(state_, slab.part(region_.source(taken)).moved_to(taken.lower), execution);
    if (slab.space == Space::device) return project_add(state_, gathered(slab, taken), execution);
    // A few rows at a time, which stay in the caches.
    std::int64_t const most = static_cast<std::int64_t>(
        std::max<std::size_t>(1, gathered_bytes / (static_cast<std::size_t>(taken.dims().x) * size_of(slab.type))));
    for (std::int64_t z = taken.lower.z; z < taken.upper.z; ++z)
        for (std::int64_t y = taken.lower.y; y < taken.upper.y; y += most) {
            Box const rows{{taken.lower.x, y, z}, {taken.upper.x, std::min(y + most, taken.upper.y), z + 1}};
            project_add(state_, gathered(slab, rows), execution);
        }
}

std::size_t Project::fit(Index3 largest, Execution const& execution) {
    if (kind != Projection::median) return 0;
    int const along = static_cast<int>(axis);
    std::size_t const lines = region_.dense() ? 0 : static_cast<std::size_t>(largest.x * largest.y * dims_[along]);
    if (execution.device == Device::gpu) return 0; // medians are found where the voxels are
    return lines * size_of(type_) +
           median_line_bytes(type_, dims_[along]) * static_cast<std::size_t>(std::max(1, execution.threads));
}

void Project::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    if (kind != Projection::median) return project_store(state_, out, counts_, execution);
    ConstView in = inputs[0].part(footprint(out.box, 0));
    if (!region_.dense()) in = gathered(in, taken_of(in.box));
    median_lines(in, out, static_cast<int>(axis), nan_, execution);
}

std::vector<std::int64_t*> Project::counters() {
    auto all = counts_.counters();
    all.push_back(&nan_);
    all.push_back(&state_.nan);
    return all;
}

std::vector<Remark> Project::remarks() const {
    std::vector<Remark> result;
    std::int64_t const nan = kind == Projection::median ? nan_ : state_.nan;
    if (nan > 0) result.push_back({text(share_text(nan, box_of(dims_).voxels()), " not a number, left out"), false});
    if (counts_.clipped > 0)
        result.push_back({text(counts_.clipped, " sums beyond 64 bits, stored as their nearest end"), true});
    return result;
}

} // namespace vkt
