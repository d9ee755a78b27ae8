// Label: connected components, numbered by their first voxel.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/verifiable.h"
#include "libvkt/operations/shape/components.h"
#include "libvkt/operations/shape/kernels/device_components.h"

#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace vkt {

/// Voxels that are neither (physically) zero nor NaN form components; every other voxel becomes 0. Components are
/// numbered 1, 2, … by their first voxel in x-fastest order, as SciPy does. Exact. Two passes over the input: one
/// joins runs of voxels, the other writes; what is held is 4 bytes a run and 72 a component, whatever the slabs are. On
/// a GPU that is a bit a voxel, 4 bytes for 32 voxels and 12 a run; by value, two bits a voxel and 28 a run.
class Label : public Operation, public Verifiable {
public:
    int connectivity = 6;  ///< 6, 18 or 26
    bool by_value = false; ///< only equal values belong together
    std::optional<std::int64_t> keep_largest;
    std::int64_t min_size = 1; ///< voxels
    DataType dtype = DataType::uint32;
    Roi roi; ///< only its voxels count, as if they were the volume; all others become 0

    std::string_view name() const override { return "label"; }
    Texts texts() const override;
    /// Not a neighbourhood: how far a component reaches, nobody knows.
    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    Box scanned(Box const& whole) const override { return intersect(whole, region_); }
    void scan(ConstView slab, Execution const& execution) override;
    /// Throws Error{failure} if there are more labels than the type has room for.
    void scan_end() override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return runs_on_gpu(); }
    std::vector<Remark> remarks() const override;
    bool reports() const override { return true; }
    /// How many components there are, and size, bounding box and centroid of those that are labelled.
    Report report() const override;
    /// By a flood from each voxel that none has reached.
    std::optional<WrongVoxel> wrong_voxel(ConstView input, ConstView output) const override;

private:
    void choose(std::span<ComponentFacts const> all);
    std::vector<std::uint32_t> chosen_names(std::size_t components) const;
    /// True if all components are labelled, whatever their sizes.
    bool takes_all() const { return !keep_largest && min_size <= 1; }
    /// What these rows have of the region, with the region's lower corner at 0.
    ConstView in_region(ConstView rows) const;

    Header input_;
    Box region_;
    std::optional<double> zero_;
    Components components_;
    std::unique_ptr<DeviceComponents> device_; ///< instead, if they are looked for on a GPU
    Execution scanned_on_;
    std::int64_t found_ = 0;              ///< components
    std::vector<std::uint32_t> labelled_; ///< numbers of the components that are labelled, in the order of the labels;
                                          ///< on a GPU none if all are
    std::int64_t nan_ = 0;
};

} // namespace vkt
