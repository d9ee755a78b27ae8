// Refine: physical values become stored ones; the work is libvkt/amr/refine.cpp.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/refine.h"

#include "libvkt/core/text.h"

#include <cmath>

namespace vkt {

VKT_OPERATION(Refine, "refine")

void Refine::parameters(Parameters& p) {
    p.option("tolerance", options.tolerance, "T", "largest difference at voxel centres, in physical values").needed();
    p.option("block-size", options.block, "N", "cells of a block along each axis, 1 to 64 (8)");
    p.option("levels", options.levels, "N", "most levels, 1 to 16 (8)");
    p.option("method", options.method, "METHOD", "the reconstruction that keeps to the tolerance: basis or nearest");
    p.option("background", background, "VALUE", "leave out blocks that stay within the tolerance of this value");
}

void Refine::check() const {
    if (!(options.tolerance >= 0))
        throw Error(ErrorKind::usage, text("--tolerance ", options.tolerance, " is negative"));
    if (options.method != Reconstruction::basis && options.method != Reconstruction::nearest)
        throw Error(ErrorKind::usage,
                    text("--method ", enum_name(options.method), " cannot promise a tolerance at voxel centres"),
                    "use --method basis or --method nearest");
}

Plan Refine::plan(std::span<Header const> inputs) {
    if (inputs.front().kind == Kind::hierarchical)
        throw Error(ErrorKind::usage, "the volume is hierarchical already", "make it a grid first: vkt resample");
    Plan plan;
    plan.output = inputs.front();
    plan.output.kind = Kind::hierarchical; // how many bricks is known when all voxels are
    plan.output.level_count = 1;
    plan.method = text("blocks of ", options.block, " cells a side, at most ", options.levels, " levels, ",
                       enum_name(options.method));
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.absolute = options.tolerance;
    plan.passing = ErrorPassing::averaged(1, values_of(inputs.front()));
    plan.cost = 16;
    plan.state_bytes = inputs.front().bytes() + static_cast<std::size_t>(inputs.front().voxels() / 7) * sizeof(double);
    return plan;
}

bool Refine::run_tree(Volume const& input, Volume& output, Execution const& execution) {
    ValueMap const values = input.header().values;
    RefineOptions stored = options;
    stored.tolerance /= std::abs(values.slope);
    if (background) stored.background = values.stored(*background);
    output = refine(input, stored, execution);
    return true;
}

void Refine::run(std::span<ConstView const>, AnyView, Execution const&) {
    throw Error(ErrorKind::failure, "refine makes no slabs");
}

} // namespace vkt
