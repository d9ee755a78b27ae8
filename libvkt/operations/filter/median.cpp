// Median: the middle value of a box around each voxel.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/median.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/operations/filter/local_filter.h"

namespace vkt {

/// About as far as the box reaches, so that few neighbours are ranked for each voxel.
Index3 median_tile(Index3 radius) {
    auto const edge = [](std::int64_t r, std::int64_t least) { return std::clamp<std::int64_t>(2 * r, least, 32); };
    return {edge(radius.x, 32), edge(radius.y, 16), edge(radius.z, 16)};
}

namespace {

constexpr std::int64_t most_radius = 64;

bool has_network(Index3 r) { return r.x == r.y && (r.x == 1 || r.x == 2) && (r.z == r.x || r.z == 0); }

/// Rank filter with the rank in the middle: boxes have an odd number of voxels. Exact for all types: the result is one
/// of the values. NaN counts as larger than all numbers, so that a result is NaN only where most of the box is.
/// 3^3 and 5^3 run through networks of 110 and 1,400 least and greatest instructions a register of voxels, 3^2 and 5^2
/// of 30 and 200; other boxes through a histogram of ranks that slides along, at about 2 (2 ry + 1)(2 rz + 1) updates a
/// voxel.
class Median : public LocalFilter {
public:
    std::string_view name() const override { return "filter median"; }
    Texts texts() const override {
        return {"Replace each voxel by the median of a box around it.",
                "Removes specks and keeps edges. The box has 2 R + 1 voxels along each axis. The result is one of the "
                "values of the box, so that it is exact for every data type. NaN counts as larger than all numbers."
                "\n\n"
                "Accuracy: Exact: voxels are chosen.",
                {{"The median of 3 x 3 x 3 voxels", "vkt filter median volume.nrrd --radius 1 -o calm.nrrd"},
                 {"Slice by slice, in a region only",
                  "vkt filter median volume.nrrd --radius 2,2,0 --roi 25%:75%,:,: -o calm.nrrd"}}};
    }

    void parameters(Parameters& parameters) override {
        parameters.option("radius", radius_, "R",
                          "the box reaches R voxels to either side: one number or X,Y,Z, 0 to 64");
        LocalFilter::parameters(parameters);
    }

    void check() const override {
        LocalFilter::check();
        radius_.check(most_radius);
    }

    std::size_t fit(Index3 largest, Execution const& execution) override {
        if (has_network(reach_) || reach_ == Index3{}) return 0;
        Index3 const tile = median_tile(reach_);
        Index3 const most{std::min(tile.x, largest.x), std::min(tile.y, largest.y), std::min(tile.z, largest.z)};
        auto const around = (most.x + 2 * reach_.x) * (most.y + 2 * reach_.y) * (most.z + 2 * reach_.z);
        constexpr std::int64_t bytes = 16 + 4 + 8 + 4; // entry, rank, value, count
        return static_cast<std::size_t>(around * bytes * std::max(1, execution.threads));
    }

    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const override {
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

    void prepare(Header const& in, Index3 /*cell_width*/) override { reach_ = window(in); }

    void filter(ConstView in, AnyView out, Execution const& execution) override {
        median_of_boxes(in, out, reach_, execution);
    }

private:
    /// The radius that is worked with.
    Index3 window(Header const& in) const {
        Index3 const flat = without_copies(in, radius_.voxels); // as many copies of all voxels have the same median
        return has_network(radius_.voxels) && !has_network(flat) && flat != Index3{} ? radius_.voxels : flat;
    }

    Radius radius_;
};

} // namespace

VKT_OPERATION(Median, "filter median")

} // namespace vkt
