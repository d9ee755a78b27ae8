// Median: the middle value of a box around each voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/local_filter.h"

namespace vkt {

/// Rank filter with the rank in the middle: boxes have an odd number of voxels. Exact for all types: the result is one
/// of the values. NaN counts as larger than all numbers, so that a result is NaN only where most of the box is.
/// 3^3 and 5^3 run through networks of 110 and 1,400 least and greatest instructions a register of voxels, 3^2 and 5^2
/// of 30 and 200; other boxes through a histogram of ranks that slides along, at about 2 (2 ry + 1)(2 rz + 1) updates a
/// voxel.
class Median : public LocalFilter {
public:
    std::string_view name() const override { return "filter median"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 cell_width, Plan& plan) const override;
    void prepare(Header const& in, Index3 cell_width) override;
    void filter(ConstView in, AnyView out, Execution const& execution) override;

private:
    /// The radius that is worked with.
    Index3 window(Header const& in) const;

    Radius radius_;
};

} // namespace vkt
