// Fill: sets all voxels, or those of a region, to one value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/common/number.h"

namespace vkt {

/// Sets voxels to a physical value, that is to header.values.stored(value) rounded half to even into the volume's type.
/// A value outside the type's range saturates and is reported; so is NaN, which integers hold as 0. Exact otherwise.
/// Without a region the whole volume is filled. One write per voxel, plus a copy of what lies outside the region.
class Fill : public Operation {
public:
    Fill() = default;
    explicit Fill(Number value, Roi region = {}) : region_(std::move(region)), value_(value) {}

    std::string_view name() const override { return "fill"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::pointwise; }
    void parameters(Parameters& parameters) override;
    /// Throws Error{usage} if the region does not lie in the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    /// Throws Error{usage} if the region is given twice or by half.
    void check() const override;
    /// In hierarchical volumes cells with centres in the region are filled.
    void enter_level(Index3 cell_width, Index3 first) override { inside_.enter_level(cell_width, first); }
    bool uses_position() const override { return first_ || !region_.empty(); }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return {&filled_}; }
    std::vector<Remark> remarks() const override;

protected:
    /// What it is filled with, a physical value.
    virtual Number value_in(Header const& /*in*/) const { return value_; }

    Roi region_;
    std::optional<Index3> first_, last_; ///< volkit's way to name the region

private:
    Roi region() const { return first_ ? roi_of(*first_, *last_) : region_; }
    Number stored_in(Header const& in) const;

    Number value_;
    LevelRegion inside_;
    std::int64_t filled_ = 0; ///< voxels, or cells
    Number physical_;         ///< the value that was meant
    Number stored_;           ///< … before rounding
    DataType type_ = DataType::uint8;
};

/// volkit's fill with a range, which must be given.
class FillRange : public Fill {
public:
    Texts texts() const override;
    void check() const override;
};

/// Makes a region, which must be given, background: a physical value, or what the volume's attribute "background" says,
/// or 0. The extent stays.
class Delete : public Fill {
public:
    Delete() = default;
    explicit Delete(Roi region, std::optional<Number> background = {});

    std::string_view name() const override { return "delete"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;

protected:
    Number value_in(Header const& in) const override;

private:
    std::optional<Number> background_;
};

} // namespace vkt
