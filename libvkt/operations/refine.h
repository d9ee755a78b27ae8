// Refine: a structured volume as a hierarchical one, with fine bricks only where the voxels need them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/refine.h"
#include "libvkt/engine/operation.h"

namespace vkt {

/// What resampling makes of the result at the voxels' centres differs by no more than the tolerance; see
/// vkt::refine(). The volume is held whole, since a tree has no slabs: its size and 8/7 doubles for every eighth voxel.
class Refine : public Operation {
public:
    RefineOptions options; ///< tolerance and background in physical values here
    std::optional<double> background;

    std::string_view name() const override { return "refine"; }
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) override;
    bool run_tree(Volume const& input, Volume& output, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
};

} // namespace vkt
