// Resampling to another grid, of the same extent or another volume's: by an interpolant or an area average.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/interpolation_choice.h"
#include "libvkt/operations/reference_volume.h"
#include "libvkt/operations/remarks.h"
#include "libvkt/operations/resample_method.h"
#include "libvkt/operations/resample_onto.h"
#include "libvkt/operations/volkit_header.h"

#include <array>
#include <memory>

namespace vkt {

/// A number of cells: "50000000", "50M" (k, M, G: thousands, millions, thousands of millions).
struct CellCount {
    std::int64_t value = 0;
};
template <> struct ValueText<CellCount> : OneWord {
    static CellCount read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(CellCount v) { return {to_text(v.value)}; }
};

/// Numbers of voxels along x, y and z; 0 stands for "auto", in proportion to the others.
struct WantedDims {
    WantedDims(Index3 v) : value(v) {}
    Index3 value;
};
/// Three words or one with commas, any but not all of them "auto".
template <> struct ValueText<WantedDims> {
    static constexpr int min_words = 3, max_words = 3;
    static std::vector<std::string> choices() { return {}; }
    static WantedDims read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(WantedDims v);
};

/// Samples are cell-centred: output o lies at (o + 1/2) n_in / n_out - 1/2; the outer faces stay where they are. auto
/// takes the area average of axes that shrink and linear interpolation of axes that grow. nearest permutes bytes; the
/// axes that keep their length are copied; nearest, linear and area keep the type (round half to even); the others can
/// leave the range of their input, so that unsigned types become float32 (float64 from 32 bits on) unless a type is
/// given. When shrinking cubic (Keys, a = -1/2) and lanczos3 are stretched, splines are sampled several times. Sums are
/// in double, of 64-bit integers in 128-bit ones. A constant border enters the sums as it is, whatever the type. One
/// pass: a row of output is the weighted sum of the input rows in its footprint, then of their voxels; about one
/// multiply-add per input voxel when shrinking. --like puts the volume onto another's grid, see Onto. Hierarchical
/// volumes become structured ones: basis, nearest, average or auto, see Reconstruction; basis by default.
class Resample : public Operation, public Tunable, public Prepared {
public:
    std::optional<Vec3> scale;
    std::optional<WantedDims> dims;
    std::optional<Vec3> spacing;          ///< world units of the result's voxels
    std::optional<CellCount> cells;       ///< about this many voxels, cubes as nearly as possible
    std::optional<ResampleMethod> method; ///< automatic for structured volumes, basis for hierarchical ones
    std::optional<double> tolerance;      ///< of the interpolation, in units of values: chooses the method
    Roi roi;                              ///< hierarchical volumes: the region in finest cells
    WorldRoi world_roi;                   ///< the same in world units
    std::optional<double> background;     ///< physical value where there is no cell, or no voxel under another's grid
    bool mask = false;                    ///< hierarchical volumes: 1 where there are cells, 0 in holes, as uint8
    std::optional<BoundaryRule> boundary;
    std::optional<DataType> dtype;
    std::optional<int> bytes_per_voxel;
    std::optional<Vec3> dist;
    std::optional<VoxelMapping> voxel_mapping;

    std::string_view name() const override { return "resample"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    ReferenceVolume* like() override { return &like_; }
    void parameters(Parameters& p) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) override;
    Operation* preparation() override { return preparation_; }
    Box footprint(Box const& output, int input) const override;
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    void after_scan(Plan& plan) const override;
    /// Sums of columns, which every thread has of its own, and inputs whose axes changed places.
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void take_tree(Volume input) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool runs_from_tree_on_gpu() const override;
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

private:
    Index3 target_dims(Header const& input) const;
    /// `extent`: of what is resampled, where its ends lie between voxels.
    Index3 target_dims(Header const& input, Vec3 extent) const;
    Plan planned(Header const& input);
    Plan plan_region(Header const& input);
    SampleGrid tree_grid(Header const& input) const;
    Reconstruction reconstruction() const;
    void refuse_tree_options() const;
    Plan plan_tree(Header const& input);
    Plan plan_onto(Header const& input, Placement const& placement);
    SampleGrid grid_like(Header const& input) const;
    void take_grid(Header const& input, Header& output) const;
    double background_in(Header const& volume) const;
    void reconstruct_tree(AnyView out, Execution const& execution);
    bool changes_values() const { return dtype || bytes_per_voxel || dist || voxel_mapping; }
    ResampleMethod used() const;
    ResampleKernel kernel_of(std::int64_t n_in, std::int64_t n_out) const;
    void choose_header(Header const& input, bool moves, Header& output);
    std::string describe() const;
    bool sums_exactly(DataType input) const;
    bool sums_in_integers(DataType input) const;
    ErrorBound error_of(Header const& input, Header const& output) const;

    enum class Algorithm : std::uint8_t { copy, convert, nearest, halving, whole, weighted };

    Index3 from_, to_;
    ReferenceVolume like_;                      ///< the grid of the result
    std::optional<Affine> region_map_;          ///< grids, with --roi: from voxels of the result to those of the input
    std::optional<InterpolationChoice> choice_; ///< with a tolerance
    std::optional<ResampleMethod> chosen_;      ///< by it
    Plan plan_of_chosen_;
    bool coarser_ = false; ///< voxels of the result are wider than those of the input along an axis
    Header input_;
    std::optional<Onto> onto_; ///< planned for a grid of another extent, or a turned one
    Operation* preparation_ = nullptr;
    std::array<WeightTable, 3> tables_;
    Algorithm algorithm_ = Algorithm::copy;
    double scale_value_ = 1, offset_value_ = 0; ///< from stored input values to stored output values
    double border_ = 0;                         ///< stored input value
    Losses counts_;
    DataType out_type_ = DataType::uint8;
    Buffer scratch_; ///< device: sums in double before they change type

    bool from_tree_ = false; ///< planned for a hierarchical volume
    SampleGrid grid_;
    DataType tree_type_ = DataType::float32;
    double stored_background_ = 0;
    std::optional<Reconstructor> reconstructor_;
    std::unique_ptr<Resample> values_; ///< what changes after reconstruction: type and value map
    Buffer samples_;                   ///< a region before its values change
};

} // namespace vkt
