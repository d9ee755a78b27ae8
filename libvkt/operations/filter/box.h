// Box: the mean of a box around each voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/local_filter.h"

namespace vkt {

/// Mean of the box of 2 r + 1 voxels along each axis, rounded once to the volume's type; value maps are kept. Sums of
/// integers are exact below 2^53 (64-bit integers are rounded to 53 bits first), those of floats are in float64; they
/// are made of parts of the box, never by taking away, so that no residue stays of a large value. The cost does not
/// depend on the radius along y and z, and on its logarithm along x.
class BoxMean : public LocalFilter {
public:
    std::string_view name() const override { return "filter box"; }
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
    Radius radius_;
    DataType type_ = DataType::uint8;
    Buffer around_;
};

/// Largest radius of windows whose cost does not depend on it.
inline constexpr std::int64_t most_window_radius = 4096;

} // namespace vkt
