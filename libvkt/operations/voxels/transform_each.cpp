// Transform by a function, row by row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/transform_each.h"

#include "libvkt/kernel/border.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/remarks.h"

#include <algorithm>
#include <cmath>

namespace vkt {

void TransformEach::parameters(Parameters& parameters) {
    parameters.option("dtype", dtype_, "TYPE", "data type of the result");
    parameters.option("roi", region_, "REGION", "call the function for the voxels of this region only");
}

Plan TransformEach::plan(std::span<Header const> inputs) const {
    if (inputs[0].kind == Kind::hierarchical)
        throw Error(ErrorKind::usage, "a function of whole indices has no meaning on a hierarchical volume",
                    "use an expression, or make it a grid first: vkt resample --cells 50M");
    static_cast<void>(region_in(inputs[0].dims)); // or it is refused
    Plan plan;
    plan.output = inputs[0];
    if (dtype_) plan.output.dtype = *dtype_;
    plan.method = "a function of the caller's";
    plan.error = ErrorBound::none_known();
    plan.cost = 20;
    return plan;
}

void TransformEach::begin(std::span<Header const> inputs, Plan const& plan) {
    input_ = inputs[0];
    planned_ = plan.output;
    box_ = region_in(input_.dims);
    losses_ = {};
    inexact_ = 0;
}

void TransformEach::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    ConstView const from = inputs[0].part(out.box);
    Box const inside = intersect(out.box, box_);
    if (!(inside == out.box)) {
        if (from.type == out.type)
            copy_region(from, out, execution);
        else
            convert_values(from, out, losses_, execution);
    }
    if (inside.empty()) return;
    bool const wide = is_integer(from.type) && size_of(from.type) == 8;
    std::int64_t const piece = baseline::row_piece;
    double values[baseline::row_piece];
    for (std::int64_t z = inside.lower.z; z < inside.upper.z; ++z)
        for (std::int64_t y = inside.lower.y; y < inside.upper.y; ++y)
            for (std::int64_t x = inside.lower.x; x < inside.upper.x; x += piece) {
                std::int64_t const n = std::min(piece, inside.upper.x - x);
                baseline::load_row(from.type, from.at(x, y, z), values, n);
                for (std::int64_t i = 0; i < n; ++i) {
                    if (wide && std::abs(values[i]) >= 0x1p53) ++inexact_;
                    double const result = function_({x + i, y, z}, input_.values.physical(values[i]));
                    values[i] = planned_.values == ValueMap{} ? result : planned_.values.stored(result);
                }
                losses_ += baseline::store_row(out.type, static_cast<double const*>(values), out.at(x, y, z), n);
            }
}

std::vector<std::int64_t*> TransformEach::counters() {
    auto all = losses_.counters();
    all.push_back(&inexact_);
    return all;
}

std::vector<Remark> TransformEach::remarks() const {
    std::vector<Remark> result = store_remarks(losses_, planned_.voxels(), planned_.dtype);
    if (inexact_ > 0)
        result.push_back({text(share_text(inexact_, planned_.voxels()), " of 2^53 or more, given with 53 bits"), true});
    return result;
}

} // namespace vkt
