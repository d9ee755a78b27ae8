// Resample of hierarchical volumes: onto which grid, by which reconstruction, and what becomes of the values.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/cells.h"
#include "libvkt/amr/device_sampler.h"
#include "libvkt/core/frame.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/operations/resample/resample.h"

#include <algorithm>

namespace vkt {

Reconstruction Resample::reconstruction() const {
    switch (method.value_or(ResampleMethod::basis)) {
    case ResampleMethod::basis:
        return Reconstruction::basis;
    case ResampleMethod::nearest:
        return Reconstruction::nearest;
    case ResampleMethod::average:
        return Reconstruction::average;
    case ResampleMethod::automatic:
        return Reconstruction::automatic;
    case ResampleMethod::linear:
    case ResampleMethod::area:
    case ResampleMethod::cubic:
    case ResampleMethod::bspline3:
    case ResampleMethod::bspline5:
    case ResampleMethod::lanczos3:
        break;
    }
    throw Error(ErrorKind::usage,
                text("--method ", enum_name(*method), " is for structured volumes, and this one is hierarchical"),
                text("use --method ", method == ResampleMethod::area ? "average" : "basis"));
}

SampleGrid Resample::tree_grid(Header const& input) const {
    GridRequest request;
    request.roi = roi;
    request.world_roi = world_roi;
    request.spacing = spacing;
    if (!like_.file.empty()) return grid_like(input);
    if (cells) request.cells = cells->value;
    if (scale || dims) {
        Header region = input;
        region.dims = plan_grid(input, request).dims; // without any of the others: the region's finest cells
        request.dims = target_dims(region);
    }
    return plan_grid(input, request);
}

/// The grid of --like in finest cells.
SampleGrid Resample::grid_like(Header const& input) const {
    Header const& like = like_.header();
    Placement const p = place(geometry_beside(input, like), like.dims, input.geometry);
    if (!p.upright())
        throw Error(ErrorKind::usage, text("the grid of ", like_.file, " is turned against the bricks"),
                    "make a grid first: vkt resample --cells 50M | vkt resample --like");
    SampleGrid grid;
    grid.dims = like.dims;
    grid.step = p.scale;
    for (int a = 0; a < 3; ++a) grid.lower[a] = p.offset[a] + 0.5 - 0.5 * p.scale[a];
    return grid;
}

Header Resample::header_on_grid(Header const& input) const {
    Header header = gridded_header(input, tree_grid(input));
    if (!like_.file.empty()) take_grid(input, header);
    return header;
}

std::unique_ptr<Resample> Resample::value_change() const {
    if (mask || !changes_values()) return nullptr;
    auto values = std::make_unique<Resample>();
    values->dtype = dtype;
    values->bytes_per_voxel = bytes_per_voxel;
    values->dist = dist;
    values->voxel_mapping = voxel_mapping;
    return values;
}

Plan Resample::plan_tree(Header const& input) const {
    if (tolerance)
        throw Error(ErrorKind::usage, "--tolerance is for structured volumes, and this one is hierarchical",
                    "use --method basis, average or nearest");
    if (boundary)
        throw Error(ErrorKind::usage, "--boundary is for structured volumes, and this one is hierarchical",
                    "say with --background what stands where there is no cell");
    Plan plan;
    plan.output = header_on_grid(input);
    plan.method = enum_name(reconstruction());
    if (!mask && reconstruction() != Reconstruction::nearest) {
        bool const in_double = is_integer(input.dtype) || input.dtype == DataType::float64;
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = std::max(in_double ? 1e-15 : 1e-6, storing_error(input.dtype));
    }
    plan.cost = 16;
    plan.slab_hint = tile::extent_z;
    plan.state_bytes = static_cast<std::size_t>(input.brick_count) * Reconstructor::bytes_per_brick;
    double const stored_background = background_in(input);
    if (mask) {
        plan.output.dtype = DataType::uint8;
        plan.output.values = {};
        plan.output.units.clear();
    } else if (auto const values = value_change()) {
        Header const grid_header = plan.output;
        plan.output = values->plan({&grid_header, 1}).output;
        if (!plan.error.exact())
            plan.error.magnitude = std::max(plan.error.magnitude, storing_error(plan.output.dtype));
    }
    // A reconstruction is a definition: its weights are positive and sum to 1.
    auto values = values_read(input, plan);
    if (values) values = values->with(input.values.physical(stored_background));
    plan.passing = mask ? ErrorPassing::moved(ValueInterval{0, 1}) : ErrorPassing::averaged(1, values);
    if (mask) plan.passing.gain = {0};
    // Cells are chosen then, and so is the background, if the type holds it.
    bool const held = with_type(input.dtype, [&]<class T>(T) {
        return static_cast<double>(store_cell<T>(stored_background)) == stored_background;
    });
    if (!mask && reconstruction() == Reconstruction::nearest && !value_change() && held)
        plan.passing.storing = ErrorPassing::Storing::moves;
    check_wanted(plan.output);
    return plan;
}

void Resample::begin_tree(Header const& input) {
    values_ = value_change();
    Header const grid_header = header_on_grid(input);
    if (values_) begun(*values_, {&grid_header, 1});
}

std::optional<Volume> Resample::take_whole(Volume input, Execution const&) {
    SampleGrid const grid = tree_grid(input_);
    reconstructor_.emplace(std::move(input), grid, reconstruction(), background_in(input_));
    return {};
}

bool Resample::runs_on_gpu() const {
    return !from_tree_ || (!mask && DeviceSampler::computes(reconstruction(), input_.dtype));
}

void Resample::reconstruct_tree(AnyView out, Execution const& execution) {
    if (!mask && !values_) return reconstructor_->run(out, execution);
    DataType const type = reconstructor_->header().dtype;
    samples_.reserve(static_cast<std::size_t>(out.box.voxels()) * size_of(type));
    AnyView const samples = dense_view(samples_.write(out.space), type, out.box, out.space);
    if (mask) return reconstructor_->run(samples, out, execution);
    reconstructor_->run(samples, execution);
    ConstView const from = samples;
    values_->run({&from, 1}, out, execution);
}

} // namespace vkt
