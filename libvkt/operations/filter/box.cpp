// Box, host side: radius, bound and memory.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/box.h"

#include "libvkt/engine/travelled.h"
#include "libvkt/operations/filter/kernels/box_window.h"

#include <cmath>
#include <limits>

namespace vkt {

VKT_OPERATION(BoxMean, "filter box")

namespace {

double count_of(Index3 radius) {
    return static_cast<double>(2 * radius.x + 1) * static_cast<double>(2 * radius.y + 1) *
           static_cast<double>(2 * radius.z + 1);
}

} // namespace

std::size_t box_sum_bytes(DataType type, Index3 radius) {
    if (!is_integer(type) || size_of(type) > 2) return 8;
    return std::max(highest_of(type), -lowest_of(type)) * count_of(radius) < 0x1p31 ? 4 : 8;
}

BoxLayout::BoxLayout(Index3 dims, Index3 radius, std::size_t value_bytes, int threads) {
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    Index3 const w = Radius{radius}.edges();
    auto const bytes = static_cast<std::int64_t>(value_bytes);
    // A tile for each thread, and those that look at the least around them.
    bands = layers = 1;
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    for (std::int64_t b = std::min<std::int64_t>(threads, dims.y); b > 0; --b) {
        std::int64_t const l = std::clamp<std::int64_t>(threads / b, 1, dims.z);
        std::int64_t const seen = (parts(dims.y, b) + 2 * radius.y) * (parts(dims.z, l) + 2 * radius.z);
        if (seen >= least) continue;
        least = seen;
        bands = b;
        layers = l;
    }
    std::int64_t const rows = parts(dims.y, bands), fit = (std::int64_t{1} << 18) / (w.y * bytes) / 64 * 64;
    constexpr std::int64_t most_register = 64; // bytes
    std::int64_t const lanes = most_register / bytes;
    pitch = parts(dims.x, lanes) * lanes;
    line = parts(dims.x + 2 * radius.x, lanes) * lanes;
    together = std::clamp<std::int64_t>((4 << 10) / (line * bytes), 1, rows + 2 * radius.y); // in the first cache
    columns = std::min(std::clamp<std::int64_t>(fit, 64, 1024), pitch);
    slice = rows * pitch + lanes; // no power of two apart
    kept = std::min(radius.z, dims.z);
    values = (radius.z > 0 ? w.z + 1 + kept : 0) * slice + 2 * together * line + (rows + 2 * radius.y + 1) * line +
             (w.y + 2) * columns + 8 * lanes;
    values = parts(values, lanes) * lanes;
}

std::size_t box_window_bytes(Index3 dims, Index3 radius, std::size_t value_bytes, Execution const& execution) {
    if (execution.device == Device::gpu) // rows, then columns of them
        return static_cast<std::size_t>(dims.x * 2 * (dims.y + radius.y) * (dims.z + 2 * radius.z)) * value_bytes;
    BoxLayout const layout(dims, radius, value_bytes, std::max(1, execution.threads));
    return static_cast<std::size_t>(layout.tiles() * layout.values) * value_bytes;
}

Texts BoxMean::texts() const {
    return {"Replace each voxel by the mean of a box around it.",
            "The box has 2 R + 1 voxels along each axis; the cost hardly depends on R. The data type is kept; integers "
            "are summed exactly and round half to even."
            "\n\n"
            "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
            "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
            {{"The mean of 5 x 5 x 5 voxels", "vkt filter box volume.nrrd --radius 2 -o mean.nrrd"}}};
}

void BoxMean::parameters(Parameters& parameters) {
    parameters.option("radius", radius_, "R", "the box reaches R voxels to either side: one number or X,Y,Z");
    LocalFilter::parameters(parameters);
}

void BoxMean::check() const {
    LocalFilter::check();
    radius_.check(most_window_radius);
}

void BoxMean::describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const {
    require_border_voxel(in);
    Index3 const radius = without_copies(in, radius_.voxels);
    DataType const type = in.dtype;
    plan.passing = ErrorPassing::averaged(1, values_read(in, plan));
    if (radius == Index3{}) {
        plan.passing.storing = ErrorPassing::Storing::moves;
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return;
    }
    Index3 const edges = Radius{radius}.edges();
    plan.method = text("windows of sums, ", edges.x, "x", edges.y, "x", edges.z,
                       box_sum_bytes(type, radius) == 4 ? ", int32" : ", float64");
    double const steps = std::log2(static_cast<double>(std::max({edges.x, edges.y, edges.z})));
    plan.cost = box_sum_bytes(type, radius) == 4 ? 32 * steps : 50 * steps + 10;
    plan.slab_hint = std::max<std::int64_t>(8, 8 * radius.z);
    bool const whole = is_integer(type);
    if (whole && size_of(type) < 8 && count_of(radius) * (highest_of(type) - lowest_of(type)) < 0x1p53) return;
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.magnitude = (static_cast<double>(edges.x + edges.y + edges.z) + 4) * 0x1p-53 + storing_error(type);
    plan.error.absolute = std::abs(in.values.slope) * storing_floor(type);
    plan.error.limit(type, in.values.slope, std::nullopt);
}

void BoxMean::prepare(Header const& in, Index3 /*cell_width*/) {
    reach_ = without_copies(in, radius_.voxels);
    folds_ = true;
    type_ = in.dtype;
}

std::size_t BoxMean::fit(Index3 largest, Execution const& execution) {
    if (reach_ == Index3{}) return 0;
    return box_window_bytes(largest, reach_, box_sum_bytes(type_, reach_), execution) +
           outside_bytes(largest, type_, execution);
}

void BoxMean::filter(ConstView in, AnyView out, Execution const& execution) {
    mean_of_boxes(with_outside(in, out.box, around_, execution), out, reach_, beyond_, losses_, execution);
}

} // namespace vkt
