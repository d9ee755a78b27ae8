// Exact Euclidean distances of voxels to the nearest voxel that is zero, or of the other kind.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/line_passes.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/filter/gaussian.h"

#include <array>
#include <optional>

namespace vkt {

/// From the centre of every voxel that is neither (physically) zero nor NaN to the centre of the nearest other voxel,
/// in float32, 0 at those; infinite where there is none. What lies outside of the volume counts as nothing. With
/// `both`, voxels that are zero hold minus the distance to the nearest that is not. Squares of distances are whole
/// numbers where the ratio of the spacings is one of small integers, and then exact; otherwise they round to float32
/// once. Three passes over lines, in place, in memory or in the spool; cost grows with the distances up to 20 voxels
/// and no more beyond.
class Distance : public Operation, public LinePasses {
public:
    bool both = false;
    LengthUnit unit = LengthUnit::world;
    Roi roi; ///< only its voxels count, as if they were the volume; all others become 0

    std::string_view name() const override { return "distance"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    /// Throws Error{usage} in world units if the axes are not perpendicular.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    /// What every thread beside the first holds for its lines.
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    /// Lines of up to 22000 voxels, whose tables fit into the memory that threads of a GPU share.
    bool runs_on_gpu() const override;
    Box lines() const override { return region_; }
    std::int64_t lines_together() const override;
    void pass_x(ConstView in, AnyView out, Execution const& execution) override;
    void pass(Axis axis, AnyView lines, Execution const& execution) override;
    std::vector<Remark> remarks() const override;

private:
    struct Steps {
        bool whole = true;               ///< squares are whole numbers of the unit squared, see DistancePass
        std::array<double, 3> weights{}; ///< of a squared step along each axis
        double unit = 1;
    };
    /// Sizes of voxels in the unit of the distances.
    Vec3 spacing_in(Header const& in) const { return unit == LengthUnit::world ? in.geometry.spacing : Vec3{1, 1, 1}; }
    Steps steps_in(Header const& in) const;

    Header input_;
    Box region_;
    std::optional<double> zero_;
    Steps steps_;
    std::int64_t nan_ = 0, objects_ = 0; ///< voxels that are, so far
};

} // namespace vkt
