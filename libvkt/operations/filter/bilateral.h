// Bilateral filter: smooths what is alike and near, and keeps edges.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/tunable.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/filter/kernels/bilateral.h"
#include "libvkt/operations/filter/local_filter.h"

#include <optional>

namespace vkt {

/// The mean of the box around each voxel, each neighbour weighted by a Gaussian of its distance and one of the
/// difference of its value (Tomasi and Manduchi 1998). The box reaches 2.5 sigma, rounded up, as in ITK, or a given
/// radius, up to 32 voxels. Every weight is computed, to the digits of float32; of 32- and 64-bit types in float64, to
/// which 64-bit integers are rounded. The type is kept. What is not finite has no weight, and stays as it is. In
/// hierarchical volumes voxels are cells of their own level.
class BilateralFilter : public LocalFilter, public Tunable {
public:
    std::string_view name() const override { return "filter bilateral"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// How far the box reaches, in sigmas.
    std::vector<Knob> knobs() const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 cell_width, Plan& plan) const override;
    void prepare(Header const& in, Index3 cell_width) override;
    void filter(ConstView in, AnyView out, Execution const& execution) override;

private:
    BilateralRule rule_for(Header const& in, Index3 cell_width) const;

    Vec3 sigma_{1, 1, 1};
    double range_sigma_ = 0;
    LengthUnit unit_ = LengthUnit::voxel;
    std::optional<Radius> radius_;
    BilateralRule rule_;
    DataType type_ = DataType::uint8;
};

/// Memory of a thread that computes with neighbours.
std::size_t stencil_bytes(DataType type, Index3 radius);

} // namespace vkt
