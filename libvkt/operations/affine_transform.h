// Moving the content of a volume by an affine map: what rotate, scale and affine have in common.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/affine.h"
#include "libvkt/core/boundary_rule.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/interpolation_choice.h"
#include "libvkt/operations/reference_volume.h"
#include "libvkt/operations/resample_method.h"
#include "libvkt/operations/resample_onto.h"

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
/// inside a region, which is then treated as a volume of its own. The type stays, rounded half to even and saturated.
/// Maps under which all voxels fall on voxels move bytes.
class AffineTransform : public Operation, public Tunable, public Prepared {
public:
    Shape shape() const override { return Shape::geometric; }
    ReferenceVolume* like() override { return &like_; }
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) override;
    Operation* preparation() override { return preparation_; }
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const& whole) const override { return in_place_ ? box_ : whole; }
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
    /// The map from positions in the result to positions in the input, both in voxels of a lattice whose voxel (0,0,0)
    /// is voxel `lower` of the volume: all of the volume, or the region.
    virtual Affine source_map(Header const& lattice, Index3 lower) const = 0;
    /// The point that stays, given in voxels of the volume: in voxels of a lattice of so many at `lower`, by default
    /// its middle, or that of the region.
    Vec3 fixed_point(std::optional<Vec3> const& about, Index3 dims, Index3 lower) const;

private:
    Placement place_result(Header const& input, Header& output) const;
    void take_method(ResampleMethod method);

    std::optional<SamplingMethod> method_;
    std::optional<double> tolerance_;
    std::optional<BoundaryRule> boundary_;
    std::optional<double> background_;
    bool expand_ = false;
    Roi region_;
    ReferenceVolume like_;

    Box box_; ///< the region in voxels of the output; all of it without one
    Index3 region_dims_;
    bool in_place_ = false; ///< only the region moves
    Vec3 middle_;           ///< of the region, in voxels from its first
    Placement placement_;
    OntoValues values_;
    std::optional<Onto> onto_;
    std::optional<InterpolationChoice> choice_; ///< with a tolerance
    Operation* preparation_ = nullptr;
    std::optional<double> other_background_; ///< physical, if it is another than was meant
    Losses losses_;
    DataType type_ = DataType::uint8;
    Buffer window_;
};

} // namespace vkt
