// Flip: reverses the order of the voxels along one axis, of the whole volume or inside a region of it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/edit.h"
#include "libvkt/engine/operation.h"

namespace vkt {

/// Mirrors a volume along x, y or z: out(i) = in(lower + upper - 1 - i) inside the region, untouched outside of it.
/// Exact for every data type (a permutation of bytes), one read and one write. A flip of the whole volume reverses the
/// direction of the axis as well, so that voxels keep their world positions; a flip of a region moves voxels in the
/// world and leaves the geometry alone. z needs its input in reverse order (Access::random).
class Flip : public Operation {
public:
    Flip() = default;
    explicit Flip(Axis axis, Roi region = {}) : axis_(axis), region_(std::move(region)) {}

    std::string_view name() const override { return "flip"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    /// Throws Error{usage} if the region does not lie in the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    /// Throws Error{usage} for a region: its mirror image would cut bricks.
    std::optional<BrickSequence> move_bricks(BrickSequence input, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

protected:
    /// Empty: the whole volume.
    virtual Roi region() const { return region_; }

    Axis axis_ = Axis::x;

private:
    Box region_in(Index3 dims) const;
    Box mirrored(Box part) const;

    Roi region_;

    Box box_; ///< the region in voxels
};

/// volkit's spelling of a flip within a region, which must be given.
class FlipRange : public Flip {
public:
    Texts texts() const override;
    void parameters(Parameters& parameters) override;

protected:
    Roi region() const override { return roi_of(first_, last_); }

private:
    Index3 first_, last_;
};

/// Reverses the cells of bricks along an axis.
MoveCells mirrored_cells(Axis axis);

} // namespace vkt
