// Slice: a plane of a volume, as a volume of one slice or as a picture.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/voxels/convert.h"

namespace vkt {

/// The voxels with one index along an axis. The axes that are left keep their order and become x and y; origin, spacing
/// and directions move along, so that voxels keep their world positions. Bytes are moved. With a range, values in it
/// are mapped to 0 … 255 as Convert does (uint8), percentiles being those of the slice.
class Slice : public Operation {
public:
    std::optional<Axis> axis;
    std::array<std::optional<std::int64_t>, 3> index; ///< negative: from the end
    std::optional<RangeOption> range;

    std::string_view name() const override { return "slice"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// Throws Error{usage} if the index lies outside of the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const&) const override { return plane_; }
    void scan(ConstView slab, Execution const& execution) override { convert_.scan(slab, execution); }
    void scan_end() override { convert_.scan_end(); }
    bool scans_again() const override { return convert_.scans_again(); }
    void after_scan(Plan& plan) const override { convert_.after_scan(plan); }
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    /// But for percentiles.
    bool runs_on_gpu() const override { return !range || convert_.runs_on_gpu(); }
    bool scans_on_gpu() const override { return runs_on_gpu(); }
    std::vector<std::int64_t*> counters() override { return convert_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    int sliced_axis() const;
    Box plane_in(Index3 dims) const;
    /// The plane as a volume, with the values of the input.
    Header cut_out(Header const& in) const;
    /// Of what is cut out, with a range.
    Convert conversion() const;

    std::array<int, 3> axes_{0, 1, 2}; ///< axis k of the result is axis axes_[k] of the input; the last is sliced
    Box plane_;                        ///< of the input
    DataType type_ = DataType::uint8;  ///< of the input
    Convert convert_;
    Buffer staging_;
};

/// The axes that remain without one, and it: {0, 2, 1} for y.
std::array<int, 3> axes_without(int axis);
/// A header with its axes in another order: axis k is axis axes[k] of `in`. Voxels keep their world positions.
Header with_axes(Header const& in, std::array<int, 3> const& axes);

} // namespace vkt
