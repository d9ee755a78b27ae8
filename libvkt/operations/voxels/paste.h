// Copy: a volume pasted into another.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/engine/operation.h"

namespace vkt {

/// The second volume with the voxels of the first in place of its own, from voxel `at` on; without it where the first
/// lies in the world, which must be on the second's lattice. Bytes are moved if type and value map agree; else values
/// are converted: rounded half to even, saturated, counted; with other value maps by way of physical values in float64.
class Paste : public Operation {
public:
    std::string part, into = "-"; ///< paths
    std::optional<Index3> at;

    std::string_view name() const override { return "copy"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    int inputs() const override { return 2; }
    std::vector<std::string> input_names() const override { return {part.empty() ? "-" : part, into}; }
    void parameters(Parameters& parameters) override;
    /// Throws Error{usage} if the part does not lie in the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    Box place_of(Header const& pasted, Header const& whole) const;

    Header part_, into_;
    Box box_; ///< where the part goes
    Losses counts_;
};

} // namespace vkt
