// Resampling to another grid, of the same extent or another volume's: by an interpolant or an area average.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/reference_volume.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/volkit_header.h"
#include "libvkt/operations/resample/interpolation_choice.h"
#include "libvkt/operations/resample/resample_method.h"
#include "libvkt/operations/resample/resample_onto.h"
#include "libvkt/operations/resample/resample_size.h"

#include <array>
#include <memory>

namespace vkt {

/// Samples are cell-centred: output o lies at (o + 1/2) n_in / n_out - 1/2; the outer faces stay where they are. auto
/// takes the area average of axes that shrink and linear interpolation of axes that grow. nearest permutes bytes; the
/// axes that keep their length are copied; nearest, linear and area keep the type (round half to even); the others can
/// leave the range of their input, so that unsigned types become float32 (float64 from 32 bits on) unless a type is
/// given. When shrinking cubic (Keys, a = -1/2) and lanczos3 are stretched, splines are sampled several times. Sums are
/// in double, of 64-bit integers in 128-bit ones. A constant border enters the sums as it is, whatever the type. A row
/// of output is the weighted sum of the input rows in its footprint, then of their voxels: about one multiply-add per
/// input voxel when shrinking; of wide kernels sums along z, y and x follow one another, see in_passes(). --like puts
/// the volume onto another's grid, see Onto. Hierarchical volumes become structured ones: basis, nearest, average or
/// auto, see Reconstruction; basis by default.
class Resample : public Operation, public Tunable, public Prepared {
public:
    std::optional<Vec3> scale;
    std::optional<WantedDims> dims;
    std::optional<Vec3> spacing;             ///< world units of the result's voxels
    std::optional<CellCount> cells;          ///< about this many voxels, cubes as nearly as possible
    std::optional<ResampleMethod> method;    ///< automatic for structured volumes, basis for hierarchical ones
    std::optional<ValueTolerance> tolerance; ///< of the interpolation: chooses the method
    Roi roi;                                 ///< hierarchical volumes: the region in finest cells
    WorldRoi world_roi;                      ///< the same in world units
    std::optional<double> background; ///< physical value where there is no cell, or no voxel under another's grid
    bool mask = false;                ///< hierarchical volumes: 1 where there are cells, 0 in holes, as uint8
    std::optional<BoundaryRule> boundary;
    std::optional<DataType> dtype;
    std::optional<int> bytes_per_voxel;
    std::optional<Vec3> dist;
    std::optional<VoxelMapping> voxel_mapping;

    std::string_view name() const override { return "resample"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    ReferenceVolume* like() override { return &like_; }
    std::string_view volume_file() const override { return "like"; }
    void take_volume(Source& opened) override { like_.take(opened); }
    void parameters(Parameters& p) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Operation* preparation() override { return preparation_; }
    Box footprint(Box const& output, int input) const override;
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    void after_scan(Plan& plan) const override;
    /// Sums of columns, which every thread has of its own, and inputs whose axes changed places.
    std::size_t fit(Index3 largest, Execution const& execution) override;
    /// Of a hierarchical volume, which is kept.
    std::optional<Volume> take_whole(Volume input, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override;
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

private:
    enum class Algorithm : std::uint8_t { copy, convert, nearest, halving, whole, weighted };

    /// Of a structured volume: where the result lies, and the way that takes.
    struct Layout {
        Header output;
        Index3 from, to;
        std::optional<ResampleMethod> chosen;     ///< with a tolerance
        std::optional<Affine> region_map;         ///< with --roi: from voxels of the result to those of the input
        double scale_value = 1, offset_value = 0; ///< from stored input values to stored output values
        std::optional<Onto> onto; ///< a grid of another extent, or a turned one; nothing below counts then
        double border = 0;        ///< stored input value
        std::array<WeightTable, 3> tables;
        Algorithm algorithm = Algorithm::copy;

        bool same_map() const { return scale_value == 1 && offset_value == 0; }
    };
    /// The layout as far as it is known before the voxels are.
    struct Beginning {
        Layout layout;
        std::optional<InterpolationChoice> choice; ///< with a tolerance, and values to interpolate
        bool coarser = false; ///< voxels of the result are wider than those of the input along an axis
    };

    Index3 target_dims(Header const& input) const;
    /// `extent`: of what is resampled, where its ends lie between voxels.
    Index3 target_dims(Header const& input, Vec3 extent) const;
    Beginning beginning(Header const& input) const;
    Layout layout_for(Header const& input, std::optional<ResampleMethod> chosen) const;
    static bool takes_all(Roi const& roi, Index3 dims);
    void lay_region(Header const& input, Layout& layout) const;
    void lay_onto(Header const& input, Placement const& placement, Layout& layout) const;
    void lay_tables(Header const& input, Layout& layout) const;
    void choose_header(Header const& input, bool moves, Layout& layout) const;
    Plan plan_of(Header const& input, Layout const& layout) const;
    void take_grid(Header const& input, Header& output) const;
    double background_in(Header const& volume) const;
    bool changes_values() const { return dtype || bytes_per_voxel || dist || voxel_mapping; }
    ResampleMethod used(Layout const& layout) const {
        return layout.chosen ? *layout.chosen : method.value_or(ResampleMethod::automatic);
    }
    ResampleKernel kernel_of(Layout const& layout, int axis) const;
    static std::string describe(Layout const& layout);
    bool sums_exactly(DataType input, Layout const& layout) const;
    bool sums_in_integers(DataType input, Layout const& layout) const;
    ErrorBound error_of(Header const& input, Layout const& layout) const;

    SampleGrid tree_grid(Header const& input) const;
    SampleGrid grid_like(Header const& input) const;
    Reconstruction reconstruction() const;
    void refuse_tree_options() const;
    Plan plan_tree(Header const& input) const;
    /// The reconstruction as a volume.
    Header header_on_grid(Header const& input) const;
    /// What changes after it, where the grid stays: type and value map; null if nothing does.
    std::unique_ptr<Resample> value_change() const;
    void begin_tree(Header const& input);
    void reconstruct_tree(AnyView out, Execution const& execution);

    ReferenceVolume like_; ///< the grid of the result
    Header input_;
    Layout layout_;
    std::optional<InterpolationChoice> choice_;
    bool coarser_ = false;
    Plan plan_of_chosen_;
    Operation* preparation_ = nullptr;
    Losses counts_;
    Buffer scratch_; ///< device: sums in double before they change type

    bool from_tree_ = false; ///< a hierarchical volume has begun
    std::optional<Reconstructor> reconstructor_;
    std::unique_ptr<Resample> values_; ///< value_change()
    Buffer samples_;                   ///< a region before its values change
};

} // namespace vkt
