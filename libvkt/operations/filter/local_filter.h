// What filters of a neighbourhood have in common: boundary rule, region, and the voxels around that they need.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/core/buffer.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/filter/kernels/continuation.h"

namespace vkt {

/// Voxels that a box reaches to either side of its centre: one number for all axes, or X,Y,Z.
struct Radius {
    Index3 voxels{1, 1, 1};

    /// Edges of the box.
    Index3 edges() const { return {2 * voxels.x + 1, 2 * voxels.y + 1, 2 * voxels.z + 1}; }
    /// Throws Error{usage} unless all are in 0…most.
    void check(std::int64_t most) const;
};

template <> struct ValueText<Radius> : OneWord {
    static Radius read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(Radius const& radius);
};

/// A region with what a filter sees around it, cut to the volume. Slices wrap outside, and so do rows unless all of
/// them are needed.
Box inside_volume(Box seen, Index3 dims, Boundary boundary);

/// Base of filters whose result at a voxel is made of the voxels in a box around it. What lies outside the volume is
/// what the boundary rule says, in the type of the volume; voxels outside the region keep their values. In hierarchical
/// volumes the voxels around a cell are cells of its own level, of which radii count so many; sigmas, which are
/// lengths, count finest cells.
class LocalFilter : public Operation {
public:
    explicit LocalFilter(Boundary boundary = Boundary::mirror) : boundary_{boundary, 0} {}

    Shape shape() const override { return Shape::neighbourhood; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    /// Throws Error{usage} if there is a region: levels do not know where it lies.
    Plan plan_level(Header const& level, Index3 cell_width) const override;
    void begin_level(Header const& level, Index3 cell_width, Plan const& plan) override;
    /// Grown by the reach, with or without a region: the slices that a window keeps are then always the next ones.
    /// Cut to the volume if the filter knows how that goes on.
    Box footprint(Box const& output, int) const override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override { return losses_.counters(); }
    std::vector<Remark> remarks() const override;

protected:
    /// Describes the filter for a volume, or a level of a tree whose cells are so many finest cells wide: what of the
    /// plan is not that of a copy.
    virtual void describe(Header const& in, Index3 cell_width, Plan& plan) const = 0;
    /// Such a volume begins: reach_, and what else filter() works with.
    virtual void prepare(Header const& in, Index3 cell_width) = 0;
    /// Computes out.box, which lies in the region; `in` covers it grown by the reach, what is cut off left out.
    virtual void filter(ConstView in, AnyView out, Execution const& execution) = 0;

    /// Stores what lies outside the region: the values as they are.
    virtual void outside(ConstView in, AnyView out, Execution const& execution);
    /// Throws Error{usage} if the border value is no voxel of the volume's type: filters would compute with another.
    void require_border_voxel(Header const& in) const;

    bool has_region() const { return !region_.empty(); }
    /// Whether all voxels along an axis are the same one: there is one, and the boundary rule makes copies of it.
    bool is_flat(Header const& in, int axis) const;
    /// A radius without the axes that are flat, for filters that copies of their window change nothing about.
    Index3 without_copies(Header const& in, Index3 radius) const;

    /// For kernels that do not, on GPUs: `in` with what lies outside, in the buffer; and the bytes that this has.
    ConstView with_outside(ConstView in, Box const& output, Buffer& buffer, Execution const& execution) const;
    std::size_t outside_bytes(Index3 largest, DataType type, Execution const& execution) const;

    Index3 reach_;       ///< voxels that results depend on, to either side
    bool folds_ = false; ///< filter() finds what lies outside the volume itself, as beyond_ says
    Continuation beyond_;
    BoundaryRule boundary_;
    Losses losses_; ///< of the volume so far

private:
    Plan plan_on(Header const& in, Index3 cell_width) const;
    void begin_on(Header const& in, Index3 cell_width, Plan const& plan);
    Box region_in(Index3 dims) const { return region_.empty() ? box_of(dims) : region_.resolve(dims); }

    Roi region_;
    Box box_;        ///< the region
    Header planned_; ///< output
};

} // namespace vkt
