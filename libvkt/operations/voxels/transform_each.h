// Transform by a function of the program's own: called for every voxel with its index and value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/engine/operation.h"

#include <functional>

namespace vkt {

/// What a voxel becomes, of its index and its physical value.
using VoxelFunction = std::function<double(Index3 index, double value)>;

/// Calls the function once for every voxel, from one thread, in the order of memory: x fastest, then y, then z. Values
/// are physical, as float64 holds them: 64-bit integers of 2^53 or more are rounded, and counted. Results are stored in
/// the volume's type and value map, or another type, rounded half to even and saturated, and what that lost is counted.
/// What the function throws comes out of apply(). Structured volumes only.
///
///     TransformEach halve([](Index3 index, double value) { return index.z > 10 ? value / 2 : value; });
///     Volume const result = apply(halve, {volume}, ExecutionOptions().execution());
class TransformEach : public Operation {
public:
    explicit TransformEach(VoxelFunction function) : function_(std::move(function)) {}

    std::string_view name() const override { return "transform"; }
    Shape shape() const override { return Shape::pointwise; }
    void parameters(Parameters& parameters) override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override;
    std::vector<Remark> remarks() const override;

private:
    Box region_in(Index3 dims) const { return region_.empty() ? box_of(dims) : region_.resolve(dims); }

    VoxelFunction function_;
    std::optional<DataType> dtype_;
    Roi region_;
    Box box_;
    Header input_, planned_;
    Losses losses_;
    std::int64_t inexact_ = 0;
};

} // namespace vkt
