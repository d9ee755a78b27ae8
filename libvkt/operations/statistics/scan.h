// Scan: prefix sums in three dimensions, the summed-volume table.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/statistics/kernels/scan.h"

namespace vkt {

/// Every voxel becomes the sum of the box from the first voxel to itself; `exclusive`: of all voxels that lie before it
/// along each of the axes, 0 in the first row, column and slice. Sums of unsigned integers are uint64, of signed ones
/// int64, exact; where 64 bits may not hold them they are taken in 128, saturated and counted. A slope is kept. Floats,
/// and integers whose value map has an intercept, are summed as physical values in float64: float64, and whatever was
/// mapped, with what each addition loses. One pass, with a slice of sums as state; the order of additions, on CPUs
/// along z, then x, then y, on GPUs along x, then y, then z, depends on nothing else.
class Scan : public Operation {
public:
    bool exclusive = false;
    Roi roi; ///< as if it were the volume; all else keeps its values

    std::string_view name() const override { return "scan"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return losses_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    /// Nothing is summed yet.
    ScanState state_for(Header const& in) const;
    void keep(ConstView in, AnyView out, Execution const& execution);

    ScanState state_;
    Box region_;
    Losses losses_;
    bool odd_ = false; ///< voxels that are not finite were seen: without them sums that are not are beyond float64
};

} // namespace vkt
