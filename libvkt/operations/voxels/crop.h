// Crop: keeps the voxels of a region, given in voxels, in world units, or by another volume's extent.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/reference_volume.h"

namespace vkt {

/// Keeps a region, or every n-th voxel of it, and moves the origin so that voxels keep their world positions. Exact for
/// every data type. Only what is kept is asked for, so that a seekable source reads no more than that.
class Crop : public Operation {
public:
    Crop() = default;
    explicit Crop(Roi region) : region_(std::move(region)) {}
    explicit Crop(WorldRoi region) : world_(std::move(region)) {}

    std::string_view name() const override { return "crop"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    /// Throws Error{usage} unless exactly one region is given.
    void check() const override;
    /// Throws Error{usage} if the region is empty or does not lie in the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    /// Keeps the bricks that any reconstruction inside the region needs.
    std::optional<BrickSequence> move_bricks(BrickSequence input, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    /// Crops to the extent of another volume: voxels whose centres lie between its outer faces.
    ReferenceVolume* like() override { return &like_; }
    std::string_view volume_file() const override { return "like"; }
    void take_volume(Source& opened) override { like_.take(opened); }

private:
    SteppedBox wanted(Header const& in) const;

    Roi region_;
    WorldRoi world_;
    ReferenceVolume like_;
    SteppedBox box_;
};

} // namespace vkt
