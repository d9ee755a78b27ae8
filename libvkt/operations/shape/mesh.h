// Mesh: closed surfaces of a value or of labels, as triangles.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/shape/surface.h"

#include "libvkt/engine/operation.h"

#include <map>
#include <optional>
#include <vector>

namespace vkt {

/// Makes the surface between voxels at or above a physical value and those below it, or the surfaces around labels.
/// Vertices lie on the lines between neighbouring voxels, where linear interpolation meets the value, half way for
/// labels; see SurfaceBuilder for what is guaranteed. Surfaces that reach the end of the volume are closed half a voxel
/// beyond the last voxels, which is where the volume ends, or left open. NaN is outside. One pass; labels take another
/// one that finds their bounding boxes. Holds the meshes, a slice and its bits for each.
class MakeMesh : public Operation {
public:
    std::optional<Number> iso;        ///< physical value
    std::vector<std::int64_t> labels; ///< stored values
    bool all_labels = false;          ///< all but 0
    bool open = false;
    Roi roi; ///< as if there were nothing around it

    std::string_view name() const override { return "mesh"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::reduction; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box scanned(Box const& whole) const override { return intersect(whole, region_); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    bool runs_on_gpu() const override { return true; }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}
    /// Of each surface: vertices, triangles, area and volume in world units, Euler characteristic (vertices - edges +
    /// triangles: 2 for each sphere, 2 less for each handle).
    Report report() const override;
    /// That a value has no surface in the volume.
    std::vector<Remark> remarks() const override;

    /// Of the volume just finished: one of a value, one of each label.
    std::vector<Mesh> const& meshes() const { return meshes_; }
    /// Of that volume.
    Header const& header() const { return input_; }

private:
    struct Part {
        SurfaceBuilder builder;
        Box box;
        std::string name;
        std::int64_t label;
    };
    Box region_in(Index3 dims) const { return roi.empty() ? box_of(dims) : roi.resolve(dims); }
    void take(ConstView slices, Execution const& execution);
    void find_labels(ConstView voxels);
    Report row_of(Mesh const& mesh) const;

    Header input_;
    Box region_;
    bool finding_ = false, scans_again_ = false;
    std::size_t held_ = 0;              ///< bytes, besides the mesh
    std::map<std::int64_t, Box> boxes_; ///< of labels
    std::vector<Part> parts_;
    std::vector<std::byte> slice_; ///< one that comes in pieces of some rows
    std::vector<Mesh> meshes_;
    std::int64_t inside_ = 0; ///< voxels at or above the value
    Execution execution_;
};

} // namespace vkt
