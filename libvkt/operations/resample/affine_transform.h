// Moving the content of a volume by an affine map: what rotate, scale and affine have in common.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/affine.h"
#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/reference_volume.h"
#include "libvkt/operations/resample/interpolation_choice.h"
#include "libvkt/operations/resample/kernels/covered_region.h"
#include "libvkt/operations/resample/resample_method.h"
#include "libvkt/operations/resample/resample_onto.h"

#include <optional>

namespace vkt {

/// The methods that sample at a position.
enum class SamplingMethod : std::uint8_t {};
template <> struct EnumNames<SamplingMethod> {
    static std::vector<std::pair<SamplingMethod, char const*>> all() {
        std::vector<std::pair<SamplingMethod, char const*>> result;
        for (auto const& [method, name] : EnumNames<ResampleMethod>::all())
            if (method == ResampleMethod::automatic || interpolant_of(method) != nullptr)
                result.emplace_back(static_cast<SamplingMethod>(method), name);
        return result;
    }
};

/// Resamples a volume whose content is moved: onto its own grid, one that holds all of it, or another volume's; or
/// inside a region, which is then treated as a volume of its own. Voxels that the region covers partly become a mean of
/// what moves there and what they were, by the share that is covered, but for nearest, whose region has the voxels with
/// centres in it. The type stays, rounded half to even and saturated.
/// Maps under which all voxels fall on voxels move bytes.
class AffineTransform : public Operation, public Tunable, public Prepared {
public:
    Shape shape() const override { return Shape::geometric; }
    ReferenceVolume* like() override { return &like_; }
    std::string_view volume_file() const override { return "like"; }
    void take_volume(Source& opened) override { like_.take(opened); }
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Operation* preparation() override { return preparation_; }
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const& whole) const override { return layout_.in_place ? layout_.box : whole; }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    void after_scan(Plan& plan) const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

protected:
    void sampling_parameters(Parameters& p);
    /// What moves: all of the volume, or a region of it, in voxels of its own.
    struct Moved {
        Header header;
        Index3 lower; ///< the voxel of the volume that is its voxel (0,0,0)
        Vec3 middle;  ///< in its voxels; of a region whose ends lie between voxels, that of the region
    };
    /// The map from positions in the result to positions in the input, both in voxels of what moves.
    virtual Affine source_map(Moved const& moved) const = 0;
    /// The point that stays, in voxels of what moves: one given in voxels of the volume, or its middle.
    static Vec3 fixed_point(std::optional<Vec3> const& about, Moved const& moved);

private:
    /// Where the result lies, and what values are in it.
    struct Layout {
        Header output;
        Box box; ///< the region in voxels of the output; all of it without one
        Index3 region_dims;
        bool in_place = false; ///< only the region moves
        /// … whose ends lie between voxels, some of which it covers partly
        std::optional<CoveredRegion> covered;
        Placement placement;
        OntoValues values;
        std::optional<double> other_background; ///< physical, if it is another than was meant
    };
    Layout layout_for(Header const& input) const;
    Placement place_result(Header const& input, Header& output) const;
    std::optional<InterpolationChoice> choice_for(Header const& input, Layout const& layout) const;
    /// Of what may be chosen the last one looks furthest.
    ResampleMethod first_method(bool chooses) const {
        return chooses ? InterpolationChoice::candidates.back()
                       : static_cast<ResampleMethod>(method_.value_or(SamplingMethod{}));
    }
    Onto onto_by(ResampleMethod method, Layout const& layout) const;
    /// What a covered region adds to the error of a plan.
    void describe_covering(Plan& plan) const;
    void run_in_place(ConstView in, AnyView to, Execution const& execution);

    std::optional<SamplingMethod> method_;
    std::optional<ValueTolerance> tolerance_;
    std::optional<BoundaryRule> boundary_;
    std::optional<double> background_;
    bool expand_ = false;
    Roi region_;
    ReferenceVolume like_;

    Layout layout_;
    std::optional<Onto> onto_;
    std::optional<InterpolationChoice> choice_; ///< with a tolerance
    Operation* preparation_ = nullptr;
    Losses losses_;
    Buffer window_, moved_, beyond_;
};

} // namespace vkt
