// Editing a volume's header, and declaring an empty volume from nothing but a header.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/volkit_header.h"

namespace vkt {

/// Changes what the header says; voxels stay as they are, and cost nothing unless dims change. New dims reinterpret the
/// same sequence of voxels and must have as many.
class SetHeader : public Operation {
public:
    std::optional<Index3> dims;
    std::optional<Vec3> spacing, dist, origin;
    std::string direction; ///< nine numbers: world directions of x, y, z
    std::optional<std::string> units;
    std::optional<double> slope, intercept;
    std::optional<VoxelMapping> voxel_mapping;
    std::vector<std::string> attributes; ///< KEY=VALUE; KEY= removes

    std::string_view name() const override { return "set"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::geometric; }
    bool runs_on_gpu() const override { return !dims; } // voxels stay where they are
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box footprint(Box const& output, int input) const override;
    /// The cells stay as they are.
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;

private:
    Index3 from_, to_;
};

/// volkit's declare-sv: a volume of zeros. The range of an integer type means [0, 1] unless a mapping says otherwise.
class DeclareStructured : public Operation {
public:
    std::optional<Index3> dims;
    std::optional<DataType> dtype;
    std::optional<int> bytes_per_voxel;
    std::optional<Vec3> dist;
    std::optional<VoxelMapping> voxel_mapping;

    std::string_view name() const override { return "declare-sv"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::source; }
    void parameters(Parameters& p) override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void run(std::span<ConstView const>, AnyView out, Execution const& execution) override;

private:
    DataType type() const;
};

} // namespace vkt
