// Project: a volume reduced along one axis to an image.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/voxels/kernels/project.h"

namespace vkt {

template <> struct EnumNames<Projection> {
    static std::vector<std::pair<Projection, char const*>> all() {
        return {{Projection::max, "max"}, {Projection::min, "min"}, {Projection::mean, "mean"},
                {Projection::sum, "sum"}, {Projection::std, "std"}, {Projection::median, "median"}};
    }
};

/// One slice, whose x and y are the axes that are left and whose single voxel across covers the volume's extent. NaN is
/// left out, and counted; a line of nothing else gives NaN, and the sum 0. Infinities are values.
///
/// max, min and median are of the input's type (of an even number of voxels the median is the mean of the middle two,
/// rounded half to even); mean and std float32, float64 where the type has more digits than that holds; sums of
/// integers int64 or uint64, exact and saturated, of floats float64. std divides by the number of values. Value maps
/// are kept or composed, so that physical values are those of the projection. All but the median see every voxel once,
/// as it comes, and hold the image; sums are taken voxel by voxel in double precision, compensated for float64, so that
/// slabs and threads do not matter. The median holds whole lines. GPUs add in the same order but for sums and
/// deviations along rows, which stay within the same bounds.
class Project : public Operation {
public:
    Projection kind = Projection::max;
    Axis axis = Axis::z;
    Roi roi; ///< only these voxels: the image is that of the volume cropped to them

    std::string_view name() const override { return "project"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    /// Empty but for medians: all else has been seen by then.
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const& whole) const override { return intersect(whole, region_.box); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override {}
    std::size_t fit(Index3 largest, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

private:
    /// Accumulators of what was asked for, in stored values; nothing was added yet.
    ProjectionState state_for(Header const& in) const;
    /// Those of the voxels of the region, by its own numbers, that a slab has.
    Box taken_of(Box const& slab) const;
    /// Voxels of a region with steps, by its own numbers, gathered out of the slab that has them.
    ConstView gathered(ConstView const& slab, Box const& taken);

    SteppedBox region_;
    Index3 dims_; ///< of the region
    Buffer gathered_;
    DataType type_ = DataType::uint8;
    ProjectionState state_;
    std::int64_t nan_ = 0; ///< of medians
    Losses counts_;
};

} // namespace vkt
