// Threshold: 1 where the value lies in a range, 0 elsewhere.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/number_range.h"
#include "libvkt/operations/voxels/kernels/threshold.h"
#include "libvkt/operations/voxels/otsu.h"

#include <memory>

namespace vkt {

/// Masks in uint8. `above` and `below` are strict, both ends of `range` belong to it, and `otsu` is above the threshold
/// that separates the finite voxels into the two classes of least variance (see Otsu). Physical values are compared, as
/// slope * stored + intercept is in float64; without a value map stored ones, exactly, whatever the types. NaN is 0
/// everywhere, and counted. One read and one write; otsu reads once or twice before.
class Threshold : public Operation {
public:
    std::optional<Number> above, below;
    std::optional<NumberRange> range;
    bool otsu = false;
    Roi roi; ///< all voxels outside of it become 0, and otsu does not look at them

    std::string_view name() const override { return "threshold"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::pointwise; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void enter_level(Index3 cell_width, Index3 first) override;
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    bool uses_position() const override { return !roi.empty(); }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return {&nan_}; }
    std::vector<Remark> remarks() const override;
    bool reports() const override { return true; }
    /// Numbers of voxels, and the bounds in physical values: "above" alone if otsu chose it.
    Report report() const override;

private:
    Box region_in(Header const& in) const;

    ThresholdRule rule_;
    std::unique_ptr<Otsu> found_;
    bool scans_again_ = false;
    Box inside_, finest_inside_; ///< the region, in voxels of the level and in finest cells
    std::int64_t voxels_ = 0, nan_ = 0;
};

} // namespace vkt
