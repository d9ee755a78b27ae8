// A plane of a volume at any angle, sampled: the oblique slices of multi-planar reformats.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/operations/resample/affine_transform.h"
#include "libvkt/operations/resample/resample_onto.h"
#include "libvkt/operations/voxels/kernels/project.h"

#include <optional>

namespace vkt {

/// What becomes of the layers of a thick slice.
enum class SlabProjection : std::uint8_t { mean, max, min };
template <> struct EnumNames<SlabProjection> {
    static std::vector<std::pair<SlabProjection, char const*>> all() {
        return {{SlabProjection::mean, "mean"}, {SlabProjection::max, "max"}, {SlabProjection::min, "min"}};
    }
};

/// Where the plane lies and how it is sampled. Points and directions are of the world.
struct ObliquePlane {
    std::optional<Vec3> normal;      ///< of any length but 0
    std::optional<Vec3> at;          ///< a point of the plane; the middle of the volume
    std::optional<Vec3> up;          ///< upwards in a picture: against the rows
    std::optional<double> spacing;   ///< of pixels, along both their axes
    std::optional<double> thickness; ///< of the slab around the plane
    std::optional<SlabProjection> project;
    std::optional<SamplingMethod> method;
    std::optional<double> background; ///< physical

    /// Throws Error{usage} for what cannot be, and for what is given without a normal.
    void check() const;
};

/// The rows and columns of the result cover the volume as it is seen along the normal, around its middle, wherever the
/// plane is: planes of one normal have pixels that lie over one another. Without an upward direction they run as those
/// of the slice across the volume's axis nearest to the normal: x along the first of the axes that are left, as nearly
/// as the plane allows, y to the side of the other one. With one, columns run against it, and rows so that the picture
/// is what is seen by who looks along the normal. Along a direction voxels are as long as it takes to get from one
/// voxel of the input to the next, so that along its axes they are the input's own. Where all pixels fall on voxels
/// bytes are moved. A slab is as many layers of samples as it takes for them to be no farther apart than the input's
/// voxels, spread evenly; those outside of the volume, and what is not a number, are left out.
class ObliqueSlice : public Operation, public Prepared {
public:
    explicit ObliqueSlice(ObliquePlane const& plane) : plane_(plane) {}

    std::string_view name() const override { return "slice"; }
    Shape shape() const override { return Shape::geometric; }
    /// Throws Error{usage} if the plane does not meet the volume.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Operation* preparation() override { return preparation_; }
    Box footprint(Box const& output, int input) const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

private:
    struct Layout {
        Header output;
        Index3 from;    ///< of the input
        Index3 samples; ///< of the grid: the pixels, and layers
        Placement placement;
        OntoValues values;
        double stored_background = 0;
        std::optional<double> other_background;   ///< physical, if it is another than was meant
        Projection projection = Projection::mean; ///< of stored values

        bool thick() const { return samples.z > 1; }
    };
    Layout layout_for(Header const& input) const;
    Onto onto_for(Layout const& layout, double background) const;
    Box layers_of(Box const& output) const;

    ObliquePlane plane_;
    Layout layout_;
    std::optional<Onto> onto_;
    Operation* preparation_ = nullptr;
    Losses losses_;
    Buffer layers_, pixels_;
};

} // namespace vkt
