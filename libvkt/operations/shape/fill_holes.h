// Filling what objects enclose.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/shape/components.h"
#include "libvkt/operations/shape/kernels/device_components.h"

#include <memory>
#include <optional>
#include <vector>

namespace vkt {

/// A hole is a component of voxels that are (physically) zero which touches no face of the volume; axes of
/// one voxel have no faces, so that slices are what they are in two dimensions. Its voxels get the
/// value of the voxel before its first one in x-fastest order, which belongs to what encloses it, or the value given.
/// All else is copied, bit for bit. NaN is no hole, and closes one. Two passes; tables as for Label.
class FillHoles : public Operation {
public:
    int connectivity = 6; ///< of the holes
    std::optional<Number> value;
    std::optional<std::int64_t> max_size; ///< voxels
    Roi roi;                              ///< as if it were the volume; all else is copied

    std::string_view name() const override { return "fill-holes"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    /// On a GPU the values come in a second pass.
    bool scans_again() const override { return device_ && passes_ == 1 && !stored_ && filled_ > 0; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<Remark> remarks() const override;
    bool reports() const override { return true; }
    /// How many holes were filled, and how many voxels.
    Report report() const override;

private:
    /// The part of whole rows that lies in the region, in voxels of the region.
    ConstView in_region(ConstView rows) const;
    bool fills(ComponentFacts const& hole) const;
    void number_on_device();

    Header input_;
    Box region_;
    std::optional<double> zero_;
    Components components_;
    std::unique_ptr<DeviceComponents> device_; ///< instead, if they are looked for on a GPU
    Execution scanned_on_;
    int passes_ = 0;
    std::int64_t holes_ = 0;           ///< that are filled
    std::vector<VoxelBytes> fillings_; ///< of holes by their name less 1
    std::optional<VoxelBytes> stored_; ///< the value given
    bool fits_ = true;                 ///< … as it is
    std::uint64_t filled_ = 0;         ///< voxels
};

} // namespace vkt
