// Linear filters, host side: types, value maps, bound and cost.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/linear_filter.h"

#include "libvkt/engine/travelled.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace vkt {

namespace {

/// Sum of the magnitudes of all weights along an axis, and of the weights.
double magnitude_of(AxisTaps const& taps) {
    double sum = 0;
    for (std::size_t k = 0; k < taps.taps.size(); ++k) {
        double const w = std::abs(taps.taps[k]);
        bool const middle = k == 0 && taps.kind != AxisTaps::Kind::plain;
        if (taps.kind == AxisTaps::Kind::plain || (middle && taps.kind == AxisTaps::Kind::even))
            sum += w;
        else if (!middle)
            sum += (taps.kind == AxisTaps::Kind::zero_sum || taps.kind == AxisTaps::Kind::average ? 4 : 2) * w;
    }
    return sum + (taps.kind == AxisTaps::Kind::average ? 1 : 0);
}
/// What is in between, at most, if the voxels are of magnitude 1.
double growth_of(std::vector<AxisTaps> const& all) {
    double most = 4; // differences of differences
    for (AxisTaps const& taps : all) most = std::max(most, 2 * magnitude_of(taps));
    return most;
}
/// The power of two that leaves room for what is in between.
double headroom_of(double growth, bool wide) {
    // Beyond that, results would be too large as well.
    return std::exp2(-std::ceil(std::min(std::log2(growth), wide ? 900.0 : 100.0)));
}
double total_of(AxisTaps const& taps) {
    if (taps.kind == AxisTaps::Kind::average) return 1;
    double sum = 0;
    if (taps.kind == AxisTaps::Kind::plain)
        for (double const w : taps.taps) sum += w;
    if (taps.kind == AxisTaps::Kind::even)
        for (std::size_t k = 0; k < taps.taps.size(); ++k) sum += (k == 0 ? 1 : 2) * taps.taps[k];
    return sum;
}

/// What the taps make of copies of one value: that, times a number.
AxisTaps of_copies(AxisTaps const& taps) {
    if (taps.kind == AxisTaps::Kind::average) return {AxisTaps::Kind::average, {1}};
    return {AxisTaps::Kind::even, {total_of(taps)}};
}

AxisTaps const& of(std::vector<AxisTaps> const& all, int index) { return all[static_cast<std::size_t>(index)]; }

/// What a voxel of magnitude 1 can become, the sum of all weights, and how many roundings there are.
struct Weight {
    double magnitude = 0, total = 0;
    std::int64_t steps = 0;
};
Weight weight_of(SeparableSum const& sum) {
    Weight weight;
    std::vector<double> parts(static_cast<std::size_t>(sum.parts), 0);
    for (auto const& term : sum.terms) {
        auto const& plane = sum.planes[static_cast<std::size_t>(term.plane)];
        auto const &x = of(sum.x, plane.x), &y = of(sum.y, plane.y), &z = of(sum.z, term.z);
        parts[static_cast<std::size_t>(term.part)] +=
            std::abs(term.weight) * magnitude_of(x) * magnitude_of(y) * magnitude_of(z);
        weight.total += term.weight * total_of(x) * total_of(y) * total_of(z);
        weight.steps = std::max(weight.steps, x.radius() + y.radius() + z.radius());
    }
    for (double const part : parts) weight.magnitude += part * part;
    weight.magnitude = std::sqrt(weight.magnitude);
    weight.steps = 2 * weight.steps + 9 + static_cast<std::int64_t>(sum.terms.size());
    return weight;
}
Weight weight_of(DenseKernel const& kernel) {
    Weight weight;
    for (Tap const& tap : kernel.taps) {
        weight.magnitude += std::abs(tap.weight);
        weight.total += tap.weight;
    }
    weight.steps = static_cast<std::int64_t>(kernel.taps.size()) + 3;
    return weight;
}

} // namespace

AxisTaps central_difference(double spacing) { return {AxisTaps::Kind::odd, {0, 0.5 / spacing}}; }
AxisTaps second_difference(double spacing) { return {AxisTaps::Kind::zero_sum, {0, 1 / spacing / spacing}}; }

Index3 SeparableSum::radius() const {
    Index3 r;
    for (auto const& taps : x) r.x = std::max(r.x, taps.radius());
    for (auto const& taps : y) r.y = std::max(r.y, taps.radius());
    for (auto const& taps : z) r.z = std::max(r.z, taps.radius());
    return r;
}

double SeparableSum::cost() const {
    double sum = 0;
    for (auto const& taps : x) sum += static_cast<double>(taps.taps.size());
    for (auto const& plane : planes) sum += static_cast<double>(of(y, plane.y).taps.size());
    for (auto const& term : terms) sum += static_cast<double>(of(z, term.z).taps.size());
    return sum + (parts > 1 ? 20 : 0);
}

Index3 SeparableSum::tile() const {
    Index3 const r = radius();
    // Rows as many as the halo has; all that is kept of the slices around should stay in the second cache.
    std::int64_t const rows = std::clamp<std::int64_t>(2 * r.y, 8, 64);
    auto const row = static_cast<std::int64_t>(planes.size()) * (2 * r.z + 1) * rows * (wide ? 8 : 4);
    return {std::clamp<std::int64_t>((std::int64_t{1} << 19) / row / 64 * 64, 64, 512), rows,
            std::max<std::int64_t>(4, 4 * r.z)};
}

std::size_t SeparableSum::bytes() const {
    Index3 const r = radius(), n = tile();
    auto const rows = static_cast<std::int64_t>(planes.size()) * (2 * r.z + 1) * n.y +
                      static_cast<std::int64_t>(x.size()) * (n.y + 2 * r.y) + parts + 1;
    return static_cast<std::size_t>(rows * (n.x + 2 * r.x + 128) * (wide ? 8 : 4));
}

double SeparableSum::headroom() const {
    double weights = 1;
    for (auto const& term : terms) weights += std::abs(term.weight);
    return headroom_of(growth_of(x) * growth_of(y) * growth_of(z) * weights, wide);
}
double DenseKernel::headroom() const {
    double weights = 1;
    for (Tap const& tap : taps) weights += std::abs(tap.weight);
    return headroom_of(weights, wide);
}

void LinearFilter::parameters(Parameters& parameters) {
    LocalFilter::parameters(parameters);
    if (!keeps_type_)
        parameters.option("dtype", dtype_, "TYPE", "data type of the result (default: float32, or float64)");
}

bool LinearFilter::is_wide(DataType type) {
    return type == DataType::float64 || (is_integer(type) && size_of(type) >= 4);
}

void LinearFilter::set_type(Header const& in, Header& output) const {
    if (keeps_type_) return;
    output.dtype = dtype_.value_or(is_wide(in.dtype) ? DataType::float64 : DataType::float32);
    output.values = {};
}

LinearFilter::Weights LinearFilter::weights_on(Header const& in, Index3 cell_width) const {
    Weights result = weights(in, cell_width);
    bool const flat = is_flat(in, 0) || is_flat(in, 1) || is_flat(in, 2);
    if (result.by_fft || !flat) return result;
    for (int axis = 0; axis < 3; ++axis) {
        if (!is_flat(in, axis)) continue;
        for (AxisTaps& taps : axis == 0 ? result.sum.x : axis == 1 ? result.sum.y : result.sum.z)
            taps = of_copies(taps);
        result.dense.radius[axis] = 0;
        for (Tap& tap : result.dense.taps) tap.at[axis] = 0;
    }
    std::vector<Tap> merged;
    for (Tap const& tap : result.dense.taps) {
        auto const same = std::find_if(merged.begin(), merged.end(), [&](Tap const& m) { return m.at == tap.at; });
        if (same == merged.end())
            merged.push_back(tap);
        else
            same->weight += tap.weight;
    }
    // In the order of a box, which kernels take for one if nothing is missing.
    std::ranges::sort(merged, {}, [](Tap const& tap) { return std::tuple(tap.at.z, tap.at.y, tap.at.x); });
    result.dense.taps = std::move(merged);
    return result;
}

LinearFilter::Weights LinearFilter::stored_weights(Header const& in, Index3 cell_width) const {
    Weights result = weights_on(in, cell_width);
    result.sum.wide = result.dense.wide = is_wide(in.dtype);
    if (keeps_type_) return result;
    // Physical values: the slope goes into the weights, the intercept times their sum comes on top.
    bool const separable = !result.sum.terms.empty();
    double const total = separable ? weight_of(result.sum).total : weight_of(result.dense).total;
    for (auto& term : result.sum.terms) term.weight *= in.values.slope;
    for (Tap& tap : result.dense.taps) tap.weight *= in.values.slope;
    (separable ? result.sum.offset : result.dense.offset) = in.values.intercept == 0 ? 0 : in.values.intercept * total;
    return result;
}

void LinearFilter::describe(Header const& in, Index3 cell_width, Plan& plan) const {
    set_type(in, plan.output);
    require_border_voxel(in);
    Weights const filter = weights_on(in, cell_width);
    SeparableSum const& sum = filter.sum;
    bool const separable = !sum.terms.empty(), wide = is_wide(in.dtype);
    Weight const weight = separable ? weight_of(sum) : weight_of(filter.dense);
    std::int64_t const reach = separable ? sum.radius().z : filter.dense.radius.z;
    plan.method = filter.method;
    plan.cost = filter.cost > 0 ? filter.cost : separable ? sum.cost() : static_cast<double>(filter.dense.taps.size());
    plan.slab_hint = std::max<std::int64_t>(16, 4 * reach);

    double const unit = wide ? 0x1p-53 : 0x1p-24;
    double const stored = storing_error(plan.output.dtype), steps = static_cast<double>(weight.steps + 2);
    plan.error.kind = ErrorBound::Kind::bound;
    plan.error.magnitude = weight.magnitude * (steps * unit + stored + filter.more_error);
    plan.error.absolute =
        std::abs(in.values.intercept) * weight.magnitude * (4 * unit + stored) +
        steps * std::max(1.0, weight.magnitude * std::abs(in.values.slope)) *
            (storing_floor(wide ? DataType::float64 : DataType::float32) + storing_floor(plan.output.dtype));
    plan.error.limit(in.dtype, in.values.slope, std::nullopt);
    auto const values = values_read(in, plan);
    plan.passing = ErrorPassing::summed(weight.magnitude, values);
    if (has_region()) { // outside of it values stay, in the type of the result
        plan.passing = ErrorPassing::summed(std::max(1.0, weight.magnitude), values);
        if (!keeps_type_) plan.passing.more = values ? values->reach() * stored : stored > 0 ? HUGE_VAL : 0;
    }
}

void LinearFilter::prepare(Header const& in, Index3 cell_width) {
    weights_ = stored_weights(in, cell_width);
    reach_ = weights_.sum.terms.empty() ? weights_.dense.radius : weights_.sum.radius();
    same_ = {{AxisTaps{}}, {AxisTaps{}}, {AxisTaps{}}, {{}}, {{}}, 1, in.values.intercept, is_wide(in.dtype)};
    same_.z[0].taps = {in.values.slope};
    Header output = in;
    set_type(in, output);
    maps_ = !(in.values == output.values);
}

std::vector<Knob> LinearFilter::knobs() const {
    return keeps_type_ ? std::vector<Knob>() : std::vector<Knob>{type_knob()};
}

std::size_t LinearFilter::fit(Index3, Execution const& execution) {
    return weights_.sum.terms.empty() ? 0
                                      : weights_.sum.bytes() * static_cast<std::size_t>(std::max(1, execution.threads));
}

void LinearFilter::filter(ConstView in, AnyView out, Execution const& execution) {
    if (weights_.sum.terms.empty())
        correlate_dense(in, out, weights_.dense, losses_, execution);
    else
        correlate(in, out, weights_.sum, losses_, execution);
}

void LinearFilter::outside(ConstView in, AnyView out, Execution const& execution) {
    if (maps_)
        correlate(in, out, same_, losses_, execution);
    else
        LocalFilter::outside(in, out, execution);
}

} // namespace vkt
