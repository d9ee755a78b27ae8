// Transform: an expression computed for every voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/voxels/program.h"

#include <vector>

namespace vkt {

/// Each voxel becomes what an expression (see Expression) makes of it, of its neighbours, of its position and of the
/// voxels there of other volumes on the same grid. All values are physical ones.
///
/// Computed in float64; in float32, operation by operation, where volumes and result are 8- or 16-bit integers, float16
/// or float32, and every whole number on the way stays below 2^24, so that integers come out exactly; a result of an
/// integer type must be whole throughout for that. + - * / sqrt and comparisons are those of IEEE 754; other functions
/// are within 4 units in the last place of float64 before they are stored.
///
/// Type of the result: with a region that of the first volume. Else that of the volumes whose values enter (see
/// promoted()); float32, or float64 for 32-bit and wider types, where a function that yields fractions is among them or
/// their value maps differ; of positions, comparisons and numbers alone the smallest integer type that holds all that
/// can come out, or float64.
class Transform : public Operation, public Tunable {
public:
    std::string expression;
    std::optional<DataType> dtype;

    std::string_view name() const override { return "transform"; }
    Texts texts() const override;
    Shape shape() const override;
    /// As many as the expression names; without one, as many as there may be.
    int inputs() const override;
    void parameters(Parameters& parameters) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    /// Throws Error{usage} if there is a region, or if the expression asks for extents: levels know neither.
    Plan plan_level(Header const& level, Index3 cell_width) const override;
    void begin_level(Header const& level, Index3 cell_width, Plan const& plan) override;
    /// Positions are those of the cells' centres, in finest cells; regions hold cells with centres in them.
    void enter_level(Index3 cell_width, Index3 first) override;
    bool uses_position() const override { return program_.positions || !region_.empty(); }
    Box footprint(Box const& output, int input) const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return losses_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    /// What is planned, or begun: volumes, or a level of a tree whose cells are so many finest cells wide.
    struct Place {
        std::span<Header const> inputs;
        bool on_level = false;
        Index3 cell_width{1, 1, 1};

        bool whole_positions() const { return inputs[0].kind == Kind::structured && cell_width == Index3{1, 1, 1}; }
    };
    Plan plan_for(Place const& place, Expression const& parsed) const;
    void begin_for(Place const& place, Expression const& parsed, Plan const& plan);
    std::vector<Values> values(Place const& place, Expression const& parsed, bool whole) const;
    void choose_type(Place const& place, Expression const& parsed, Header& output) const;
    bool fits_float(Place const& place, Expression const& parsed, Header const& output) const;
    void choose_border(std::span<Header const> inputs, Expression const& parsed, Plan& plan) const;

    std::optional<BoundaryRule> boundary_;
    Roi region_;

    std::optional<Shape> begun_shape_; ///< asked for often: parsed once a volume
    Program program_;
    std::vector<ValueMap> maps_; ///< of the inputs
    std::vector<Box> reach_;     ///< offsets that each input is looked at
    Header planned_;             ///< output
    ProgramPlace place_;
    Geometry geometry_; ///< of voxels or finest cells; of a level's cells where there are neighbours
    bool on_level_ = false;
    LevelRegion inside_;
    bool in_float_ = false, counts_undefined_ = false;
    std::vector<std::byte> workspace_;
    TransformLosses losses_;
};

} // namespace vkt
