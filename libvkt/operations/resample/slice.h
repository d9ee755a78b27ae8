// Slice: a plane of a volume, as a volume of one slice or as a picture.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/operations/resample/oblique_slice.h"
#include "libvkt/operations/voxels/convert.h"

#include <array>
#include <optional>

namespace vkt {

/// The voxels with one index along an axis. The axes that are left keep their order and become x and y; origin, spacing
/// and directions move along, so that voxels keep their world positions. Bytes are moved. With a range, values in it
/// are mapped to 0 … 255 as Convert does (uint8), percentiles being those of the slice. With a normal the plane lies at
/// any angle, and is sampled, see ObliqueSlice.
class Slice : public Operation, public Prepared {
public:
    std::optional<Axis> axis;
    std::array<std::optional<std::int64_t>, 3> index; ///< negative: from the end
    std::optional<RangeOption> range;
    ObliquePlane oblique;

    std::string_view name() const override { return "slice"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// Throws Error{usage} if the index, or the plane, lies outside of the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    /// The sampled plane.
    Operation* preparation() override { return sampled_plane_ ? &*sampled_plane_ : nullptr; }
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const& whole) const override { return sampled_plane_ ? whole : plane_; }
    void scan(ConstView slab, Execution const& execution) override { convert_.scan(slab, execution); }
    void scan_end() override { convert_.scan_end(); }
    bool scans_again() const override { return convert_.scans_again(); }
    void after_scan(Plan& plan) const override { convert_.after_scan(plan); }
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return convert_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    int sliced_axis() const;
    Box plane_in(Index3 dims) const;
    /// The plane as a volume, with the values of the input.
    Header cut_out(Header const& in) const;
    /// Of what is cut out, with a range.
    Convert conversion() const;
    Plan plan_oblique(std::span<Header const> inputs) const;

    std::array<int, 3> axes_{0, 1, 2}; ///< axis k of the result is axis axes_[k] of the input; the last is sliced
    Box plane_;                        ///< of the input
    DataType type_ = DataType::uint8;  ///< of the input
    std::optional<ObliqueSlice> sampled_plane_;
    Convert convert_;
    Buffer staging_;
};

} // namespace vkt
