// Gaussian, host side: method, radius, bound and cost from the tolerance; footprints.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/gaussian.h"

#include "libvkt/amr/tree.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/filter/local_filter.h"

#include <cmath>

namespace vkt {

namespace {

/// Multiply-adds that the passes of a cascade through memory are worth (measured).
constexpr double cascade_overhead = 15;

/// A quarter of the last bit for integers, 1e-4 of the range for floats. A border value outside an integer type widens
/// the range that the tolerance is a share of.
double default_tolerance(DataType type, double border) {
    if (!is_integer(type)) return 1e-4;
    double const lowest = lowest_of(type), highest = highest_of(type);
    double const wider = (std::max(highest, border) - std::min(lowest, border)) / (highest - lowest);
    double const levels = std::exp2(std::min(32.0, 8.0 * static_cast<double>(size_of(type)))) - 1;
    return std::max(1e-12, 0.25 / (levels * wider));
}

/// Along which something is done, or 1.
int axes_of(Vec3 const& sigma) {
    return std::max(1, (sigma.x > 0 ? 1 : 0) + (sigma.y > 0 ? 1 : 0) + (sigma.z > 0 ? 1 : 0));
}

/// The sigma for which the sampled Gaussian has a variance, in voxels. Sampling takes from it where sigma is small.
double sigma_of_variance(double variance) {
    if (variance >= 1) return std::sqrt(variance); // the sampled one's differs by less than 2e-7
    if (!(variance > 1e-12)) return 0;             // shares of neighbours far below any tolerance
    double low = 0, high = 1.1;
    for (int step = 0; step < 60; ++step) {
        double const sigma = 0.5 * (low + high);
        double sum = 0.5, second = 0; // of one half
        for (int k = 1; k <= 10; ++k) {
            double const tap = std::exp(-0.5 * (k / sigma) * (k / sigma));
            sum += tap;
            second += k * k * tap;
        }
        (second / sum < variance ? low : high) = sigma;
    }
    return 0.5 * (low + high);
}

} // namespace

Vec3 sigma_in_cells(Vec3 const& sigma, LengthUnit unit, Header const& lattice, Index3 cell_width) {
    Vec3 cells;
    for (int axis = 0; axis < 3; ++axis) {
        auto const width = static_cast<double>(cell_width[axis]);
        cells[axis] = sigma[axis] / (unit == LengthUnit::world ? lattice.geometry.spacing[axis] : width);
        if (width > 1) cells[axis] = sigma_of_variance(cells[axis] * cells[axis]);
    }
    return cells;
}

VKT_OPERATION(Gaussian, "filter gaussian")

Texts Gaussian::texts() const {
    return {
        "Smooth with a Gaussian.",
        "A separable convolution whose radius follows from --tolerance: the error against the infinite kernel is "
        "bounded before it runs (--explain prints the bound). Where that is cheaper, and within the tolerance, it is "
        "done on a coarser lattice, at a cost that does not grow with sigma. The data type is kept; integers round "
        "half to even."
        "\n\n"
        "Accuracy: Bound, known before it runs: within the tolerance of the Gaussian of infinite extent; by default a "
        "quarter of the last bit of integers, 1e-4 of the range for floats. --explain prints the bound.",
        {{"A standard deviation of two voxels", "vkt filter gaussian volume.nrrd --sigma 2 -o smooth.nrrd"},
         {"Millimetres instead of voxels, and the plan",
          "vkt filter gaussian volume.nrrd --sigma 1.5 --unit world --explain | vkt stats"}}};
}

void Gaussian::parameters(Parameters& parameters) {
    parameters.option("sigma", sigma_, "S", "standard deviation, one number or X,Y,Z");
    parameters.option("unit", unit_, "UNIT", "unit of --sigma: voxel (of hierarchical volumes: finest cell) or world");
    parameters.option("boundary", boundary_, "RULE",
                      "how the volume continues outside: mirror, clamp, wrap, border[:VALUE]");
    parameters.option("tolerance", tolerance_, "P%",
                      "allowed error in percent of the value range (default: a quarter of the last bit, floats 0.01%)");
    parameters.option("method", method_, "M",
                      "fir: direct convolution; cascade: by way of a coarser lattice; auto: the cheaper one");
    parameters.option("roi", region_, "REGION", "smooth only the voxels of this region");
}

std::vector<Knob> Gaussian::knobs() const {
    return {{"tolerance", {"10%", "1%", "0.1%", "0.01%", "0.001%", "0.0001%"}, "1e-10%"},
            {"method", {"fir", "cascade"}, "fir"}};
}

std::optional<double> Gaussian::by_definition(ConstView input, Index3 voxel) const {
    if (!region_.empty()) return std::nullopt;
    struct Share {
        std::int64_t index;
        long double weight;
    };
    std::array<std::vector<Share>, 3> shares; // of the voxels inside, along each axis
    Index3 const dims = input.box.dims();
    for (int axis = 0; axis < 3; ++axis) {
        auto& list = shares[static_cast<std::size_t>(axis)];
        std::int64_t const n = dims[axis], period = 2 * n;
        auto const sigma = static_cast<long double>(choice_.sigma[axis]);
        if (!(sigma > 0) || (n == 1 && boundary_.boundary != Boundary::border)) {
            list.push_back({voxel[axis], 1});
            continue;
        }
        auto const reach = static_cast<std::int64_t>(std::ceil(10 * sigma)) + 1;
        long double mass = 0;
        for (std::int64_t k = -reach; k <= reach; ++k) {
            auto const distance = static_cast<long double>(k) / sigma;
            long double const weight = std::exp(-0.5L * distance * distance);
            mass += weight;
            std::int64_t i = voxel[axis] + k;
            if (boundary_.boundary == Boundary::clamp) i = std::clamp<std::int64_t>(i, 0, n - 1);
            if (boundary_.boundary == Boundary::wrap) i = (i % n + n) % n;
            if (boundary_.boundary == Boundary::mirror) {
                i = (i % period + period) % period;
                if (i >= n) i = period - 1 - i;
            }
            if (i >= 0 && i < n) list.push_back({i, weight});
        }
        for (auto& share : list) share.weight /= mass;
    }
    auto const values = input.as<double>();
    Index3 const lower = input.box.lower;
    long double sum = 0, inside = 0;
    for (auto const& z : shares[2])
        for (auto const& y : shares[1])
            for (auto const& x : shares[0]) {
                long double const weight = x.weight * y.weight * z.weight;
                sum +=
                    weight * static_cast<long double>(values(lower.x + x.index, lower.y + y.index, lower.z + z.index));
                inside += weight;
            }
    if (boundary_.boundary == Boundary::border)
        sum += (1 - inside) * static_cast<long double>(choice_.passes.border_value);
    return static_cast<double>(sum);
}

void Gaussian::check() const {
    for (int axis = 0; axis < 3; ++axis)
        if (!std::isfinite(sigma_[axis]) || sigma_[axis] < 0)
            throw Error(ErrorKind::usage, text("--sigma ", sigma_[axis], " is not a finite number >= 0"));
    if (tolerance_) check_tolerance(*tolerance_);
    if (!std::isfinite(boundary_.value))
        throw Error(ErrorKind::usage, "--boundary border: the value is not a finite number");
}

Plan Gaussian::plan(std::span<Header const> inputs) const {
    check();
    static_cast<void>(region_in(inputs[0].dims)); // or it is refused
    return plan_by(choose(inputs[0], sigma_in_cells(sigma_, unit_, inputs[0], {1, 1, 1})), inputs[0]);
}

Plan Gaussian::plan_level(Header const& level, Index3 cell_width) const {
    check();
    if (!region_.empty())
        throw Error(ErrorKind::usage, text(name(), " --roi works on structured volumes only"),
                    "crop the hierarchical volume first: vkt crop --roi");
    return plan_by(choose(level, sigma_in_cells(sigma_, unit_, level, cell_width)), level);
}

void Gaussian::begin(std::span<Header const> inputs, Plan const& plan) {
    box_ = region_in(inputs[0].dims);
    begin_by(choose(inputs[0], sigma_in_cells(sigma_, unit_, inputs[0], {1, 1, 1})), plan);
}

void Gaussian::begin_level(Header const& level, Index3 cell_width, Plan const& plan) {
    box_ = box_of(level.dims);
    begin_by(choose(level, sigma_in_cells(sigma_, unit_, level, cell_width)), plan);
}

void Gaussian::begin_by(Choice choice, Plan const& plan) {
    choice_ = std::move(choice);
    copies_ = choice_.direct == 0;
    together_ = choice_.passes.run_height = std::max<std::int64_t>(4, plan.slab_hint);
    planes_.forget();
    nodes_.held = false;
    counts_ = {};
    planned_ = plan.output;
}

Gaussian::Choice Gaussian::choose(Header const& in, Vec3 const& sigma) const {
    Choice choice;
    choice.sigma = sigma;
    GaussianPasses& passes = choice.passes;
    passes.dims = in.dims;
    passes.boundary = boundary_.boundary;
    double const border = passes.border_value =
        boundary_.boundary == Boundary::border ? in.values.stored(boundary_.value) : 0;
    if (!std::isfinite(border))
        throw Error(ErrorKind::usage,
                    text("--boundary border:", boundary_.value, " is beyond float64 as it is stored"));
    passes.clips = border < lowest_of(in.dtype) || border > highest_of(in.dtype);
    passes.wide = in.dtype == DataType::float64 || (is_integer(in.dtype) && size_of(in.dtype) >= 4) ||
                  std::abs(border) > highest_of(DataType::float32);
    choice.tolerance = tolerance_ ? tolerance_->share() : default_tolerance(in.dtype, border);

    // Rounding takes its share of the tolerance first; if that is most of it, intermediates become wide.
    choose_taps(in, passes.wide ? 0x1p-53 : 0x1p-24, choice);
    if (!passes.wide && choice.rounding.sum() > choice.tolerance / 2) {
        passes.wide = true;
        choose_taps(in, 0x1p-53, choice);
    }
    for (auto const& taps : passes.taps)
        choice.direct += taps.radius > 0 ? static_cast<double>(2 * taps.radius + 1) : 0;
    choose_cascade(in, choice);
    return choice;
}

void Gaussian::choose_taps(Header const& in, double unit, Choice& choice) const {
    double left = choice.tolerance;
    for (int attempt = 0; attempt < 2; ++attempt) {
        choice.rounding = {};
        for (int axis = 0; axis < 3; ++axis) {
            auto& taps = choice.passes.taps[static_cast<std::size_t>(axis)];
            taps = gaussian_taps(choice.sigma[axis], in.dims[axis], boundary_.boundary, left / axes_of(choice.sigma));
            choice.rounding += taps.rounding(unit);
        }
        left = std::max(choice.tolerance - choice.rounding.sum(), choice.tolerance / 2);
    }
}

/// In the same precision, if it is cheaper.
void Gaussian::choose_cascade(Header const& in, Choice& choice) const {
    Vec3 const& sigma = choice.sigma;
    double const tolerance = choice.tolerance, direct = choice.direct;
    auto& cascade = choice.cascade;
    if (method_ != GaussianMethod::fir && direct > cascade_overhead) {
        double const unit = choice.passes.wide ? 0x1p-53 : 0x1p-24;
        double left = tolerance;
        for (int attempt = 0; attempt < 2; ++attempt) {
            cascade = gaussian_cascade(sigma, in.dims, boundary_.boundary, left / axes_of(sigma), choice.passes.taps);
            if (!cascade) break;
            choice.cascade_rounding = {};
            for (auto const& axis : cascade->axes) choice.cascade_rounding += axis.rounding(unit);
            left = std::max(tolerance - choice.cascade_rounding.sum(), tolerance / 2);
        }
        if (cascade && choice.cascade_rounding.sum() > tolerance / 2) cascade.reset();
    }
    if (method_ == GaussianMethod::automatic && direct > 2 * cascade_overhead && !cascade)
        choice.why = "; no cascade keeps to the tolerance";
    if (method_ == GaussianMethod::automatic && cascade && cascade->cost + cascade_overhead >= direct) {
        choice.why = text("; a cascade costs ", std::round(cascade->cost));
        cascade.reset();
    }
    if (method_ == GaussianMethod::cascade && direct > 0 && !cascade)
        throw Error(ErrorKind::usage,
                    text("--method cascade: no cascade for a sigma of ", sigma[0], ",", sigma[1], ",", sigma[2],
                         " voxels keeps to a tolerance of ", 100 * tolerance, "%",
                         boundary_.boundary == Boundary::wrap ? " and reaches no further than the slices" : ""),
                    "leave the choice to vkt (--method auto), or allow a larger --tolerance");
}

Plan Gaussian::plan_by(Choice const& choice, Header const& in) const {
    GaussianPasses const& passes = choice.passes;
    auto const& cascade = choice.cascade;
    double const direct = choice.direct, border = passes.border_value;
    bool const constant = boundary_.boundary == Boundary::border;
    Plan plan;
    plan.output = in;
    plan.boundary = boundary_.boundary;
    plan.border_value = passes.border_value;
    plan.cost = cascade ? cascade->cost : direct;
    double truncation = 0, reduced = 0, steps = 0;
    std::string radii, lattice;
    for (std::size_t i = 0; i < 3; ++i) {
        auto const& taps = passes.taps[i];
        truncation += taps.truncation;
        steps += taps.radius > 0 ? static_cast<double>(taps.radius + 3) : 0;
        radii = text(radii, radii.empty() ? "" : ",", taps.radius);
        if (!cascade) continue;
        CascadeAxis const& axis = cascade->axes[i];
        reduced += axis.truncation;
        steps += static_cast<double>(axis.before.radius + axis.coarse.radius + axis.taps + 9);
        lattice = text(lattice, lattice.empty() ? "" : ",", axis.step);
    }
    bool const copies = direct == 0;
    if (!copies || truncation > 0) {
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.range = truncation + choice.rounding.range;
    }
    if (cascade) {
        plan.error.range = reduced + choice.cascade_rounding.range;
    }
    if (!copies) {
        double const magnitude = cascade ? choice.cascade_rounding.magnitude : choice.rounding.magnitude;
        // What goes in is rounded if the compute type does not hold it, and what comes out if the output is narrower.
        DataType const computes = passes.wide ? DataType::float64 : DataType::float32;
        bool const rounds_in =
            (is_integer(in.dtype) && size_of(in.dtype) == 8) || (!passes.wide && border != static_cast<float>(border));
        bool const rounds_out = !is_integer(in.dtype) && in.dtype != computes;
        plan.error.magnitude =
            magnitude + (rounds_in ? storing_error(computes) : 0) + (rounds_out ? storing_error(in.dtype) : 0);
        double const floor = steps * 8 * storing_floor(computes) + (rounds_out ? storing_floor(in.dtype) : 0);
        plan.error.absolute = std::abs(in.values.slope) * floor;
    }
    if (!plan.error.exact() && !is_uniform(in)) plan.error = ErrorBound::none_known();
    plan.error.limit(in.dtype, in.values.slope, constant ? std::optional(border) : std::nullopt);
    plan.passing = ErrorPassing::averaged(1, values_read(in, plan)); // the weights are positive
    if (copies) {
        plan.passing.storing = ErrorPassing::Storing::moves;
        plan.shift = Index3{};
        plan.method = "copy";
        return plan;
    }
    char const* const precision = passes.wide ? ", float64" : ", float32";
    plan.method = cascade ? text("B-spline cascade, nodes every ", lattice, " voxels", precision)
                          : text("direct FIR, radius ", radii, precision, choice.why);
    // Slabs that are low beside the kernel load much for little, and threads meet after each; of higher ones the
    // cascade would only hold more.
    std::int64_t const slice = in.dims.x * in.dims.y * static_cast<std::int64_t>(size_of(in.dtype));
    auto const within = [&](std::int64_t mebibytes) { return (mebibytes << 20) / slice; };
    std::int64_t const high =
        cascade ? std::min<std::int64_t>(within(16), 16)
                : std::max(std::min<std::int64_t>(within(32), 32), std::min<std::int64_t>(within(8), 64));
    plan.slab_hint = passes.taps[2].radius == 0 ? 0 : std::max<std::int64_t>(high, 4);
    return plan;
}

std::size_t Gaussian::fit(Index3 largest, Execution const& execution) {
    if (copies_) return 0;
    planes_.forget();
    choice_.passes.run_height = std::max<std::int64_t>(4, std::min(largest.z, together_));
    if (choice_.cascade) {
        nodes_.held = false;
        CascadeLayout const layout(cascade(), largest);
        std::int64_t const threads = VKT_BACKEND::threads_for(execution, box_of(largest).voxels());
        return static_cast<std::size_t>(layout.ring_values() + threads * layout.scratch) *
               (choice_.passes.wide ? 8 : 4);
    }
    GaussianLayout const layout(choice_.passes, largest);
    std::int64_t const threads = VKT_BACKEND::threads_for(execution, box_of(largest).voxels());
    return static_cast<std::size_t>(threads * layout.values) * (choice_.passes.wide ? 8 : 4);
}

GaussianLayout::GaussianLayout(GaussianPasses const& passes, Index3 region) {
    std::int64_t const size = passes.wide ? 8 : 4, line = 64 / size, block = 256 / size;
    Index3 const r{passes.taps[0].radius, passes.taps[1].radius, passes.taps[2].radius};
    auto const rounded = [](std::int64_t n, std::int64_t unit) { return (n + unit - 1) / unit * unit; };
    // Whole registers reach beyond rows. One odd cache line more per row: no two that meet in a sum share a cache set.
    auto const pitch_of = [&](std::int64_t n) { return rounded(n + 2 * line, 2 * line) + line; };
    auto const in_bytes = [&](std::int64_t bytes, std::int64_t lines) {
        return std::clamp(bytes / (lines * size) / block * block, block, 4 * block);
    };
    // What lies outside of the volume is held only if it wraps around.
    auto const held = [&](std::int64_t n, std::int64_t most) {
        return passes.boundary == Boundary::wrap ? n : std::min(n, most);
    };
    rows = held(2 * r.y + group, passes.dims.y);
    // Each slice of a tile spares others the loading of those around it, and narrow tiles read memory in short pieces:
    // so the rings are rather in the third cache than small.
    constexpr std::int64_t most_ring_bytes = std::int64_t{2} << 20;
    tile = {std::min<std::int64_t>(region.x, 8 * block), region.y, std::min<std::int64_t>(region.z, 16)};
    auto const ring_bytes = [&] { return tile.z * rows * pitch_of(tile.x + 2 * r.x) * size; };
    if (ring_bytes() > most_ring_bytes) tile.x = std::min(tile.x, 4 * block);
    while (ring_bytes() > most_ring_bytes && tile.z > 4) tile.z /= 2;
    slices = held(2 * r.z + tile.z, passes.dims.z);
    pitch = pitch_of(tile.x + 2 * r.x);
    slice = rows * pitch + 5 * line;
    // Pieces of rows that are summed together stay in the first cache.
    strip_z = in_bytes(24 << 10, slices);
    strip_y = in_bytes(24 << 10, rows);
    values = rounded(2 * slices * pitch + tile.z * slice + (group + 2) * pitch, 64);
}

Box gaussian_input(GaussianPasses const& passes, Box const& output) {
    return inside_volume(grow(output, {passes.taps[0].radius, passes.taps[1].radius, passes.taps[2].radius}),
                         passes.dims, passes.boundary);
}

Box Gaussian::footprint(Box const& output, int) const {
    Box box = choice_.cascade ? cascade_input(cascade(), output) : gaussian_input(choice_.passes, output);
    if (!region_.empty()) return box;
    // What the ring holds need not come again.
    if (choice_.cascade && nodes_.continues(output))
        box.lower.z = std::clamp(nodes_.thin_end, box.lower.z, box.upper.z);
    return box;
}

void Gaussian::run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) {
    Box const inside = copies_ ? Box{} : intersect(out.box, box_);
    if (inside != out.box) copy_region(inputs[0].part(out.box), out, execution);
    if (inside.empty()) return;
    Losses losses;
    if (choice_.passes.clips && execution.device == Device::gpu)
        convolve_unclipped(inputs[0], out.part(inside), losses, execution);
    else
        convolve(inputs[0], out.part(inside), losses, execution);
    counts_.clipped += losses.clipped;
}

void Gaussian::convolve(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    if (choice_.cascade)
        gaussian_cascade_run(cascade(), nodes_, in, out, losses, execution);
    else
        gaussian_run(choice_.passes, planes_, in, out, losses, execution);
}

void Gaussian::convolve_unclipped(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    DataType const type = choice_.passes.wide ? DataType::float64 : DataType::float32;
    auto const room = [&](Buffer& buffer, Box const& box) {
        buffer.reserve(static_cast<std::size_t>(box.voxels()) * size_of(type));
        return dense_view(buffer.write(out.space), type, box, out.space);
    };
    AnyView const from = room(unclipped_[0], in.box), to = room(unclipped_[1], out.box);
    Losses none;
    convert_values(in, from, none, execution);
    convolve(from, to, none, execution);
    convert_values(to, out, losses, execution);
}

std::vector<Remark> Gaussian::remarks() const { return store_remarks(counts_, planned_.voxels(), planned_.dtype); }

} // namespace vkt
