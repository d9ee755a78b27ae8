// Median, host side: radius, method and cost.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/median.h"

#include "libvkt/engine/travelled.h"
#include "libvkt/operations/filter/kernels/median.h"

namespace vkt {

VKT_OPERATION(Median, "filter median")

namespace {

constexpr std::int64_t most_radius = 64;

bool has_network(Index3 r) { return r.x == r.y && (r.x == 1 || r.x == 2) && (r.z == r.x || r.z == 0); }

} // namespace

Texts Median::texts() const {
    return {
        "Replace each voxel by the median of a box around it.",
        "Removes specks and keeps edges. The box has 2 R + 1 voxels along each axis. The result is one of the values "
        "of the box, so that it is exact for every data type. NaN counts as larger than all numbers."
        "\n\n"
        "Accuracy: Exact: voxels are chosen.",
        {{"The median of 3 x 3 x 3 voxels", "vkt filter median volume.nrrd --radius 1 -o calm.nrrd"},
         {"Slice by slice, in a region only",
          "vkt filter median volume.nrrd --radius 2,2,0 --roi 25%:75%,:,: -o calm.nrrd"}}};
}

void Median::parameters(Parameters& parameters) {
    parameters.option("radius", radius_, "R", "the box reaches R voxels to either side: one number or X,Y,Z, 0 to 64");
    LocalFilter::parameters(parameters);
}

void Median::check() const {
    LocalFilter::check();
    radius_.check(most_radius);
}

void Median::describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const {
    Index3 const radius = window(in), edges = Radius{radius}.edges();
    plan.passing = ErrorPassing::moved(values_read(in, plan)); // an order statistic
    if (radius == Index3{}) {
        plan.shift = Index3{};
        plan.method = "copy";
        plan.cost = 0;
        return;
    }
    plan.method = has_network(radius) ? text("selection network, ", edges.x, "x", edges.y, "x", edges.z)
                                      : text("sliding histogram of ranks, ", edges.x, "x", edges.y, "x", edges.z);
    plan.cost = !has_network(radius) ? 300 * static_cast<double>(edges.y * edges.z)
                : radius.z == 0      ? (radius.x == 1 ? 30 : 200)
                : radius.x == 1      ? 110
                                     : 1400;
    plan.slab_hint = std::max<std::int64_t>(8, 2 * radius.z);
}

void Median::prepare(Header const& in, Index3 /*cell_width*/) { reach_ = window(in); }

Index3 Median::window(Header const& in) const {
    Index3 const flat = without_copies(in, radius_.voxels); // as many copies of all voxels have the same median
    return has_network(radius_.voxels) && !has_network(flat) && flat != Index3{} ? radius_.voxels : flat;
}

std::size_t Median::fit(Index3 largest, Execution const& execution) {
    if (has_network(reach_) || reach_ == Index3{}) return 0;
    Index3 const tile = median_tile(reach_);
    Index3 const most{std::min(tile.x, largest.x), std::min(tile.y, largest.y), std::min(tile.z, largest.z)};
    auto const around = (most.x + 2 * reach_.x) * (most.y + 2 * reach_.y) * (most.z + 2 * reach_.z);
    constexpr std::int64_t bytes = 16 + 4 + 8 + 4; // entry, rank, value, count
    return static_cast<std::size_t>(around * bytes * std::max(1, execution.threads));
}

void Median::filter(ConstView in, AnyView out, Execution const& execution) {
    median_of_boxes(in, out, reach_, execution);
}

/// About as far as the box reaches, so that few neighbours are ranked for each voxel.
Index3 median_tile(Index3 radius) {
    auto const edge = [](std::int64_t r, std::int64_t least) { return std::clamp<std::int64_t>(2 * r, least, 32); };
    return {edge(radius.x, 32), edge(radius.y, 16), edge(radius.z, 16)};
}

} // namespace vkt
