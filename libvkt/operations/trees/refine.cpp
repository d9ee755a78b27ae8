// Refine: physical values become stored ones; the work is libvkt/amr/refine.cpp.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/trees/refine.h"

#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/statistics/noise_level.h"
#include "libvkt/render/transfer_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

namespace vkt {
namespace {

/// Throws Error{usage} where blocks that are left out could not be read as what they stand for.
void require_background(double physical, Header const& in) {
    double const stored = in.values.stored(physical);
    if (is_integer(in.dtype) && !(stored >= lowest_of(in.dtype) && stored <= highest_of(in.dtype)))
        throw Error(ErrorKind::usage, text("the background ", physical, " cannot be stored in ", in.dtype),
                    "choose another --background");
}

std::size_t bytes_of(Volume const& tree) { return tree.header().bytes() + tree.bricks().bytes(); }

/// How far colour times opacity, or opacity, goes from the least value on, in display levels: at every value that of
/// the four that goes furthest there.
ValueScale scale_of(render::TransferFunction const& transfer, ValueMap const& values) {
    auto const& points = transfer.points;
    double first = values.stored(points.front().value), last = values.stored(points.back().value);
    if (first > last) std::swap(first, last);
    constexpr std::size_t nodes = 16384;
    // A function of one point, or a step alone, still has two ends.
    double const margin = last > first ? (last - first) / nodes : std::max(1e-6, 1e-6 * std::abs(first));
    ValueScale scale;
    scale.low = first - margin;
    scale.high = last + margin;
    auto const look = [&](double physical) {
        auto const next = std::upper_bound(points.begin(), points.end(), physical,
                                           [](double v, auto const& point) { return v < point.value; });
        auto const& b = next == points.end() ? points.back() : *next;
        auto const& a = next == points.begin() ? points.front() : *(next - 1);
        double const t = b.value > a.value ? std::clamp((physical - a.value) / (b.value - a.value), 0.0, 1.0) : 0;
        double const alpha = render::alpha_between(a.alpha, b.alpha, t);
        auto const level = [&](double from, double to) {
            double const mixed = std::lerp(from, to, t);
            return 255 * alpha * (transfer.linear_colors ? render::linear_to_srgb(mixed) : mixed);
        };
        return std::array<double, 4>{level(a.color.red, b.color.red), level(a.color.green, b.color.green),
                                     level(a.color.blue, b.color.blue), 255 * alpha};
    };
    std::array<double, 4> before{};
    double sum = 0;
    for (std::size_t i = 0; i <= nodes; ++i) {
        auto const now = look(
            values.physical(std::lerp(scale.low, scale.high, static_cast<double>(i) / static_cast<double>(nodes))));
        double step = 0;
        for (std::size_t c = 0; c < 4; ++c) step = std::max(step, std::abs(now[c] - before[c]));
        sum += i == 0 ? 0 : step;
        scale.values.push_back(sum);
        before = now;
    }
    return scale;
}

/// What an error of physical values makes of what a metric looks at, at most, and which error makes no more of it.
struct ErrorInMetric {
    std::function<double(double)> of;
    std::function<double(double)> allowed;
};

ErrorInMetric error_of_values() {
    return {[](double e) { return e; }, [](double most) { return most; }};
}

/// A central difference is of two voxels two spacings apart; at a face of voxels that are neighbours.
ErrorInMetric error_of_gradient(Header const& header) {
    double least = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis)
        if (header.dims[axis] > 1) least = std::min(least, header.geometry.spacing[axis]);
    if (!std::isfinite(least)) return error_of_values(); // there is no gradient
    return {[least](double e) { return 2 * e / least; }, [least](double most) { return most * least / 2; }};
}

/// Between whole nodes, one more than the error spans: what the function does between two of them, it may do at once.
ErrorInMetric error_of_levels(ValueScale const& scale) {
    double const width = (scale.high - scale.low) / static_cast<double>(scale.values.size() - 1);
    auto const over = [values = scale.values](std::size_t nodes) {
        double most = 0;
        for (std::size_t i = nodes; i < values.size(); ++i) most = std::max(most, values[i] - values[i - nodes]);
        return nodes < values.size() ? most : values.back() - values.front();
    };
    auto const of = [width, over, last = scale.values.size()](double e) {
        if (e == 0) return 0.0;
        double const nodes = std::ceil(e / width) + 1;
        return over(nodes < static_cast<double>(last) ? static_cast<std::size_t>(nodes) : last);
    };
    auto const allowed = [width, over, last = scale.values.size()](double most) {
        std::size_t fits = 1, beyond = last + 1; // nodes
        while (beyond - fits > 1) {
            std::size_t const tried = fits + (beyond - fits) / 2;
            (over(tried) <= most ? fits : beyond) = tried;
        }
        return static_cast<double>(fits - 1) * width;
    };
    return {of, allowed};
}

} // namespace

VKT_OPERATION(Refine, "refine")

RefineTolerance ValueText<RefineTolerance>::read(std::vector<std::string> const& w, std::string_view name) {
    if (w.front() == "noise") return {0, true};
    return {ValueText<double>::read(w, name), false};
}

BlockSize ValueText<BlockSize>::read(std::vector<std::string> const& w, std::string_view name) {
    if (w.front() == "auto") return {.best = true};
    if (w.front() == "mixed") return {.mixed = true};
    return {.cells = ValueText<std::int64_t>::read(w, name)};
}

Texts Refine::texts() const {
    return {
        "Make a structured volume hierarchical.",
        "Keeps fine blocks only where coarser ones do not reproduce the voxels: what vkt resample makes of the result "
        "at the voxels' centres differs by no more than the tolerance, in values, gradients or what a transfer "
        "function "
        "makes of them. With --tolerance noise that is as much as the noise of the volume explains."
        "\n\n"
        "Accuracy: Cells that are kept fine are exact; elsewhere what resample makes of the result differs from the "
        "voxels by at most the tolerance.",
        {{"Within a hundredth",
          "vkt make sphere --dims 64 48 48 --edge coverage | vkt refine --tolerance 0.01 | vkt info"},
         {"As small as the noise allows", "vkt refine volume.nrrd --tolerance noise | vkt info"},
         {"There and back", "vkt refine volume.nrrd --tolerance 1 | vkt resample --scale 1 | vkt diff volume.nrrd - "
                            "--tolerance 1"}}};
}

void Refine::parameters(Parameters& p) {
    p.option("tolerance", tolerance, "T",
             "largest difference at voxel centres, a physical value, or noise: as much as the volume's noise")
        .needed();
    p.option("metric", metric, "WHAT", "what may differ so much: value, gradient or transfer");
    p.option("transfer", transfer, "FILE",
             "with --metric transfer: the transfer function, a JSON file or the JSON itself");
    p.option(
        "block-size", block, "N",
        "cells of a block along each axis, 1 to 64 (8); mixed (the default to the noise): 2 to 16; auto: the best of "
        "4, 8, 16, mixed");
    p.option("levels", levels, "N", "most levels, 1 to 16");
    p.option("method", method, "METHOD", "the reconstruction that keeps to the tolerance: basis or nearest");
    p.option(
        "dtype", dtype, "TYPE",
        "of the cells: keep, or auto (the default to the noise): the smallest that a quarter of the tolerance allows");
    p.option("background", background, "VALUE", "leave out blocks that stay within the tolerance of this value");
}

void Refine::check() const {
    if (!(tolerance.value >= 0)) throw Error(ErrorKind::usage, text("--tolerance ", tolerance.value, " is negative"));
    if (method != Reconstruction::basis && method != Reconstruction::nearest)
        throw Error(ErrorKind::usage,
                    text("--method ", enum_name(method), " cannot promise a tolerance at voxel centres"),
                    "use --method basis or --method nearest");
    if ((metric == RefineMetric::transfer) == transfer.empty())
        throw Error(ErrorKind::usage, transfer.empty() ? "--metric transfer needs --transfer FILE"
                                                       : "--transfer is for --metric transfer");
    if (metric == RefineMetric::value) return;
    if (tolerance.noise)
        throw Error(ErrorKind::usage, text("--tolerance noise is one of values, not for --metric ", enum_name(metric)));
    if (metric == RefineMetric::gradient && background)
        throw Error(ErrorKind::usage, "--background is a value, and --metric gradient compares none");
}

std::vector<Knob> Refine::knobs() const {
    Knob knob{"tolerance", {}, "0"};
    for (double const share : {16.0, 4.0, 0.25, 0.0625})
        if (tolerance.value > 0) knob.values.push_back(to_text(share * tolerance.value));
    return {knob};
}

BlockSize Refine::blocks() const { return block.value_or(BlockSize{.mixed = tolerance.noise}); }

bool Refine::finds_type() const {
    return dtype.value_or(tolerance.noise ? CellType::automatic : CellType::keep) == CellType::automatic;
}

Plan Refine::plan(std::span<Header const> inputs) const {
    Header const& in = inputs.front();
    if (in.kind == Kind::hierarchical)
        throw Error(ErrorKind::usage, "the volume is hierarchical already", "make it a grid first: vkt resample");
    if (metric == RefineMetric::transfer) static_cast<void>(function()); // or it is refused
    if (background && !finds_type()) require_background(*background, in);
    Plan plan;
    plan.output = in;
    plan.output.kind = Kind::hierarchical; // how many bricks is known when all voxels are
    plan.output.level_count = 1;
    BlockSize const size = blocks();
    plan.method = text("blocks of ",
                       size.best    ? "4, 8, 16 or mixed"
                       : size.mixed ? "2 to 16"
                                    : to_text(size.cells),
                       " cells a side, at most ", levels, " levels, ", enum_name(method),
                       tolerance.noise ? ", as exact as the noise" : "",
                       metric == RefineMetric::value ? std::string() : text(", by ", enum_name(metric)));
    plan.error.kind = tolerance.noise ? ErrorBound::Kind::unknown : ErrorBound::Kind::bound; // until it is scanned
    plan.error.absolute = tolerance.value;
    if (metric == RefineMetric::gradient) plan.error.quantity = "gradients";
    if (metric == RefineMetric::transfer) plan.error.quantity = "display levels";
    if (metric != RefineMetric::value)
        plan.passing.because = text("its tolerance is one of ", enum_name(metric), "s");
    else if (tolerance.noise)
        plan.passing.because = "all voxels are read before the noise is known";
    else
        plan.passing = ErrorPassing::averaged(1, values_of(in));
    plan.cost = size.best ? 8000 : size.mixed ? 3500 : 1500;
    plan.state_bytes = bytes_to_refine(in);
    return plan;
}

/// The volume, once more in another type, the means, trees that may keep all of its voxels, and what compares them with
/// the volume.
std::size_t Refine::bytes_to_refine(Header const& in) const {
    auto const voxels = static_cast<double>(in.voxels());
    BlockSize const size = blocks();
    // Of mixed blocks few stay as small as they can be.
    double const cells = size.best || size.mixed ? 4 : static_cast<double>(size.cells);
    Index3 const n = in.dims;
    double const flat = static_cast<double>((n.x == 1 ? 1 : 0) + (n.y == 1 ? 1 : 0) + (n.z == 1 ? 1 : 0));
    double const bricks = voxels / std::pow(cells, 3 - flat);
    double const volumes = 1 + (finds_type() ? 1 : 0) + (size.best ? 2 : 1);
    double const bytes = volumes * static_cast<double>(in.bytes()) + voxels / 7 * sizeof(double) +
                         bricks * (2 * sizeof(Brick) + Reconstructor::bytes_per_brick);
    return static_cast<std::size_t>(std::min(bytes, 0x1p62));
}

void Refine::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    used_ = noise_ = error_ = 0;
    found_.clear();
    grown_.clear();
}

render::TransferFunction const& Refine::function() const {
    return *function_.of(transfer, [](std::string const& words) {
        auto const function = std::make_shared<render::TransferFunction>(render::transfer_of_word(words));
        function->check_and_sort();
        return std::shared_ptr<render::TransferFunction const>(function);
    });
}

/// Of the block sizes that are asked for the one that takes the fewest bytes.
Volume Refine::best(Volume const& volume, RefineOptions options, Execution const& execution) const {
    std::optional<Volume> smallest;
    struct Sizes {
        std::int64_t block, largest;
    };
    constexpr Sizes mixed{2, 16};
    BlockSize const asked = blocks();
    std::vector<Sizes> sizes{asked.mixed ? mixed : Sizes{asked.cells, 0}};
    if (asked.best) sizes = {{4, 0}, {8, 0}, {16, 0}, mixed};
    for (Sizes const& size : sizes) {
        options.block = size.block;
        options.largest = size.largest;
        Volume tree = refine(volume, options, execution);
        if (!smallest || bytes_of(tree) < bytes_of(*smallest)) smallest = std::move(tree);
    }
    return *std::move(smallest);
}

std::optional<Volume> Refine::take_whole(Volume input, Execution const& execution) {
    used_ = tolerance.value;
    if (tolerance.noise) {
        noise_ = noise_level(input) * std::abs(input.header().values.slope);
        used_ = noise_ * noise_extent(input.header().voxels());
    }
    Volume stored = input;
    double left = used_;
    if (finds_type()) {
        ErrorInMetric const error = metric == RefineMetric::transfer   ? error_of_levels(scale_of(function(), {}))
                                    : metric == RefineMetric::gradient ? error_of_gradient(input.header())
                                                                       : error_of_values();
        Convert convert;
        convert.dtype = ResultType::automatic();
        convert.tolerance = error.allowed(used_ / 4);
        Volume given = input;
        given.header().error = VolumeError::given();
        stored = apply(convert, {given}, execution);
        // What storing cost, which the rest of the tolerance is less by.
        VolumeError const& cost = stored.header().error;
        left = std::max(0.0, used_ - (cost.known() ? error.of(cost.at_most) : used_ / 4));
    }
    ValueMap const values = stored.header().values;
    RefineOptions options;
    options.levels = levels;
    options.method = method;
    options.tolerance = left;
    if (metric == RefineMetric::transfer) {
        options.scale = scale_of(function(), values);
    } else {
        options.tolerance /= std::abs(values.slope);
    }
    if (metric == RefineMetric::gradient) options.gradient_spacing = input.header().geometry.spacing;
    if (background) {
        require_background(*background, stored.header());
        options.background = values.stored(*background);
    }
    Volume output = best(stored, options, execution);
    error_ = used_;
    double const before = static_cast<double>(input.header().bytes()), now = static_cast<double>(bytes_of(output));
    if (tolerance.noise || finds_type() || blocks().best || blocks().mixed)
        found_ = text(tolerance.noise ? text("noise ", noise_, " (robust estimate), tolerance ", used_, ": ")
                                      : std::string(),
                      output.header().dtype, " in ", static_cast<std::uint64_t>(output.bricks().size()), " bricks, ",
                      bytes_text(now), " with their places instead of ", bytes_text(before), ", ",
                      std::round(10 * before / now) / 10, " times as small");
    if (now > before) {
        std::string remedies = "a larger --tolerance";
        if (!blocks().mixed && !blocks().best) remedies += ", --block-size mixed";
        if (!finds_type() && used_ > 0) remedies += ", --dtype auto";
        grown_ = text("the result takes ", bytes_text(now), ", more than the volume's ", bytes_text(before),
                      ": nearly all of it stays fine; ", remedies, " may help, or keep the grid");
    }
    return output;
}

void Refine::after_scan(Plan& plan) const {
    if (tolerance.noise) {
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.absolute = error_;
    }
    if (metric != RefineMetric::value) return;
    plan.passing = ErrorPassing::averaged(1, values_of(input_));
    plan.error.absolute = error_;
}

std::vector<Remark> Refine::remarks() const {
    std::vector<Remark> result;
    if (!found_.empty()) result.push_back({found_, false});
    if (!grown_.empty()) result.push_back({grown_, false});
    return result;
}

void Refine::run(std::span<ConstView const>, AnyView, Execution const&) {
    throw Error(ErrorKind::failure, "refine makes no slabs");
}

} // namespace vkt
