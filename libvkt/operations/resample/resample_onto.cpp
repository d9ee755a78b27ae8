// Resampling onto another volume's grid.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/resample_onto.h"

#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/resample/kernels/affine.h"
#include "libvkt/operations/resample/kernels/resample.h"
#include "libvkt/operations/voxels/kernels/permute.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace {

constexpr double same_position = 1e-9; ///< … where they are interpolated

Vec3& column(Affine& map, int axis) { return map.column[static_cast<std::size_t>(axis)]; }

/// Entries that move no voxel of n by more than the tolerance from what whole numbers would, become these.
void round_entries(Affine& map, Index3 n, double tolerance) {
    auto const rounded = [&](double& v, double reach) {
        if (double const r = std::nearbyint(v); std::abs(v - r) * reach < tolerance) v = r + 0.0;
    };
    for (int b = 0; b < 3; ++b) {
        for (int a = 0; a < 3; ++a) rounded(column(map, a)[b], static_cast<double>(n[a]));
        rounded(map.offset[b], 1);
    }
}

/// True if every entry is whole and the columns are the axes of the input in some order, either way along them.
bool is_signed_permutation(Affine const& map) {
    int used = 0;
    for (auto const& c : map.column) {
        int here = 0;
        for (int b = 0; b < 3; ++b) {
            if (c[b] == 0) continue;
            if (std::abs(c[b]) != 1) return false;
            here += 1 << b;
        }
        if (here != 1 && here != 2 && here != 4) return false;
        used |= here;
    }
    Vec3 const& o = map.offset;
    return used == 7 && o.x == std::nearbyint(o.x) && o.y == std::nearbyint(o.y) && o.z == std::nearbyint(o.z);
}

std::string_view name_of(Interpolant interpolant) {
    for (InterpolantOf const& entry : interpolants)
        if (entry.interpolant == interpolant) return name_of(entry.kernel);
    return {};
}

/// How many times as long a sample takes where neighbours of a row lie in other rows or slices of the input.
double scatter(Affine const& map) {
    auto const keeps = [&](int axis) {
        for (int other = 0; other < 3; ++other)
            if (other != axis && (map.column[static_cast<std::size_t>(axis)][other] != 0 ||
                                  map.column[static_cast<std::size_t>(other)][axis] != 0))
                return false;
        return true;
    };
    return keeps(2) ? 1 : keeps(0) || keeps(1) ? 1.5 : 3;
}

/// Multiply-adds of a sample, and what finding its voxels takes.
double cost_of(Interpolant interpolant) {
    switch (interpolant) {
    case Interpolant::nearest:
        return 50;
    case Interpolant::linear:
        return 80;
    case Interpolant::cubic:
    case Interpolant::bspline3:
        return 250;
    case Interpolant::bspline5:
    case Interpolant::lanczos3:
        return 650;
    }
    return 0;
}

/// By how much the weights of an interpolant at the worst position, all of them, exceed the voxels' sum: Keys 1.25,
/// Lanczos 3 1.544 (half-way) an axis; those of splines are positive, of their coefficients.
double gain_of(Interpolant interpolant) {
    double const axis = interpolant == Interpolant::cubic ? 1.25 : interpolant == Interpolant::lanczos3 ? 1.544 : 1;
    return axis * axis * axis;
}

} // namespace

std::array<bool, 3> Placement::between() const {
    auto const is_whole = [](double v) { return v == std::nearbyint(v); };
    std::array<bool, 3> result{};
    for (int b = 0; b < 3; ++b) {
        bool whole = is_whole(map.offset[b]);
        for (auto const& c : map.column) whole = whole && is_whole(c[b]);
        result[static_cast<std::size_t>(b)] = !whole;
    }
    return result;
}

bool Placement::coarser() const {
    return std::ranges::any_of(map.column, [](Vec3 const& c) { return length(c) > 1 + 1e-6; });
}

bool Placement::whole() const { return aligned && is_signed_permutation(map); }

bool Placement::keeps_extent(Index3 from, Index3 to) const {
    if (!upright()) return false;
    for (int a = 0; a < 3; ++a) {
        double const n = static_cast<double>(from[a]), m = static_cast<double>(to[a]);
        if (std::abs(scale[a] * m - n) > same_voxel || std::abs(offset[a] - (0.5 * n / m - 0.5)) > same_voxel)
            return false;
    }
    return true;
}

Placement place(Geometry const& grid, Index3 dims, Geometry const& input) {
    return place(index_to_index(grid, input), dims);
}

Placement place(Affine const& map, Index3 dims) {
    Placement p;
    p.map = map;
    for (Vec3 const v : {p.map.column[0], p.map.column[1], p.map.column[2], p.map.offset})
        if (!(std::abs(v.x) < 1e30 && std::abs(v.y) < 1e30 && std::abs(v.z) < 1e30))
            throw Error(ErrorKind::data, "the grids' positions and spacings have no common scale");
    Affine lattice = p.map;
    round_entries(lattice, dims, same_voxel / 4);
    if (is_signed_permutation(lattice))
        p.map = lattice;
    else
        round_entries(p.map, dims, same_position / 4);
    int used = 0;
    for (int a = 0; a < 3; ++a) {
        Vec3 const c = column(p.map, a);
        for (int b = 0; b < 3; ++b) {
            if (c[b] == 0) continue;
            p.axis[static_cast<std::size_t>(a)] = b;
            p.scale[a] = c[b];
            p.offset[a] = p.map.offset[b];
            used += 1 << (4 * b);
        }
    }
    p.aligned = used == 0x111; // nine entries, of which one of each row and column is not zero
    for (auto const& c : p.map.column) p.aligned = p.aligned && (c.x != 0) + (c.y != 0) + (c.z != 0) == 1;
    return p;
}

Onto::Onto(Placement placement, Index3 from, Index3 to, ResampleMethod method, std::optional<BoundaryRule> boundary,
           OntoValues const& values)
    : placement_(placement), from_(from), to_(to), method_(method), boundary_(boundary), values_(values) {
    if (placement_.aligned)
        plan_aligned();
    else
        plan_turned();
}

Background background_in(Header const& output, std::optional<double> given, Header const& input) {
    double physical = given.value_or(0);
    if (auto const known = input.attributes.find("background"); !given && known != input.attributes.end())
        if (is_number(known->second)) physical = parse_double(known->second);
    double const stored = output.values.stored(physical);
    if (!is_integer(output.dtype)) return {stored};
    bool const held = stored >= lowest_of(output.dtype) && stored <= highest_of(output.dtype);
    if (!given && stored == stored) {
        double const nearest = std::clamp(std::nearbyint(stored), lowest_of(output.dtype), highest_of(output.dtype));
        return {nearest, std::abs(nearest - stored) > 1e-9 * std::max(1.0, std::abs(stored))};
    }
    if (!held)
        throw Error(ErrorKind::usage, text("the background ", physical, " cannot be stored in ", output.dtype),
                    "choose another --background, or another type: vkt convert --dtype");
    return {stored};
}

void Onto::plan_aligned() {
    bool all_single = true;
    for (int a = 0; a < 3; ++a) {
        LinePlacement const line{from_[placement_.axis[static_cast<std::size_t>(a)]], to_[a], placement_.scale[a],
                                 placement_.offset[a]};
        bool const on_lattice = std::abs(line.scale) == 1 && line.offset == std::nearbyint(line.offset);
        ResampleKernel kernel = on_lattice ? ResampleKernel::nearest : kernel_for(method_, std::abs(line.scale));
        all_single = all_single && kernel == ResampleKernel::nearest;
        if (on_lattice && line.scale == 1 && !boundary_) kernel = ResampleKernel::identity;
        tables_[static_cast<std::size_t>(a)] =
            WeightTable(line, kernel, boundary_ ? boundary_->boundary : Boundary::clamp);
        inner_.lower[a] = 0;
        inner_.upper[a] = to_[a];
        // What lies outside altogether is stored without being computed.
        bool const border = boundary_ && boundary_->boundary == Boundary::border;
        if (boundary_ && !border) continue;
        auto const inside = [&](std::int64_t o) {
            if (border) return tables_[static_cast<std::size_t>(a)].reaches(o);
            double const p = line.position(o);
            return p >= first_position() && p < end_position(line.n_in);
        };
        while (inner_.lower[a] < to_[a] && !inside(inner_.lower[a])) ++inner_.lower[a];
        while (inner_.upper[a] > inner_.lower[a] && !inside(inner_.upper[a] - 1)) --inner_.upper[a];
    }
    if (inner_.empty()) inner_ = {};
    bool const same_map = values_.scale == 1 && values_.offset == 0;
    bool const in_place = placement_.whole() && placement_.upright() && !boundary_;
    algorithm_ = in_place && same_map                                  ? Algorithm::convert
                 : all_single && same_map && values_.in == values_.out ? Algorithm::nearest
                                                                       : Algorithm::weighted;
    if (algorithm_ == Algorithm::convert && values_.in == values_.out) algorithm_ = Algorithm::copy;
}

void Onto::plan_turned() {
    sampling_.map = placement_.map;
    auto const* const known = interpolant_of(method_);
    sampling_.interpolant = known != nullptr ? known->interpolant : Interpolant::linear;
    sampling_.dims = from_;
    if (method_ != ResampleMethod::nearest && method_ != ResampleMethod::linear)
        for (int a = 0; a < 3; ++a) {
            double const width = length(column(sampling_.map, a));
            sampling_.samples[a] = static_cast<std::int64_t>(std::ceil(std::min(width, 1e6) - 1e-6));
            sampling_.samples[a] = std::max<std::int64_t>(sampling_.samples[a], 1);
        }
    if (boundary_) sampling_.boundary = boundary_->boundary;
    sampling_.border = values_.border;
    sampling_.background = values_.background;
    sampling_.scale = values_.scale;
    sampling_.offset = values_.offset;
    bool const same_values = values_.scale == 1 && values_.offset == 0 && values_.in == values_.out;
    algorithm_ = same_values && method_ == ResampleMethod::nearest ? Algorithm::turned_nearest : Algorithm::turned;
    bool const narrow = size_of(values_.in) <= 2 || values_.in == DataType::float32;
    bool const as_it_is = values_.scale == 1 && values_.offset == 0 && sampling_.samples == Index3{1, 1, 1};
    bool const fits = std::abs(values_.border) <= highest_of(DataType::float32) &&
                      std::abs(values_.background) <= highest_of(DataType::float32);
    sampling_.single =
        narrow && as_it_is && values_.in == values_.out && fits && sampling_.interpolant == Interpolant::linear;
    int const degree = spline_degree(sampling_.interpolant);
    if (degree == 0) return;
    bool const wide = values_.in == DataType::float64 || (is_integer(values_.in) && size_of(values_.in) >= 4) ||
                      std::abs(values_.border) > highest_of(DataType::float32) / 1000;
    spline_.type = wide ? DataType::float64 : DataType::float32;
    spline_.prefilter = SplinePrefilter(degree, wide ? 1e-14 : 1e-8);
    filter_weights_.assign(spline_.prefilter.weight.begin(), spline_.prefilter.weight.end());
    spline_.boundary = sampling_.boundary.value_or(Boundary::clamp);
    spline_.border = values_.border;
    // Coefficients are up to gain^3 times as large as voxels, which may be the largest numbers that there are.
    if (values_.in == DataType::float64) {
        spline_.scale = std::exp2(-std::ceil(3 * std::log2(spline_.prefilter.gain)));
        sampling_.scale /= spline_.scale;
    }
    // From there on all voxels that a coefficient is made of are the same along the axis.
    sampling_.beyond = spline_.prefilter.radius + 1;
    bool const folds = spline_.boundary == Boundary::wrap || spline_.boundary == Boundary::mirror;
    spline_.margin = folds ? 0 : sampling_.beyond;
}

/// Positions are good to 1e-9 voxels, and a voxel's width changes a value by no more than a few ranges; the rest is the
/// rounding of so many steps in double, of which weights that overshoot make more, and of storing, for splines the
/// coefficients too. What their filters leave out is a share of the range.
ErrorBound Onto::error_of(Header const& output, double steps) const {
    ErrorBound error;
    error.kind = ErrorBound::Kind::bound;
    error.range = 1e-8;
    double gain = 1;
    if (placement_.aligned)
        for (WeightTable const& table : tables_) gain *= table.gain();
    else
        gain = gain_of(sampling_.interpolant);
    error.magnitude = 2 * gain * (steps * 0x1p-53 + storing_error(output.dtype));
    if (!placement_.aligned && spline_.prefilter.radius > 0) {
        double const g = spline_.prefilter.gain;
        error.range += 1.5 * spline_.prefilter.cut * g * g; // weights that sum to 0, of which each axis has some
        error.magnitude +=
            3 * g * g * g * (storing_error(spline_.type) + static_cast<double>(spline_.prefilter.radius + 2) * 0x1p-52);
        error.absolute += std::abs(output.values.slope) * 3 * g * g * g * storing_floor(spline_.type) / spline_.scale;
    } else if (!placement_.aligned && sampling_.single) { // three roundings a step, and those of the fractions
        error.range += 3 * 0x1p-24;
        error.magnitude += 9 * 0x1p-24;
        // Among the denormals the differences and sums are exact, and each of three products is rounded.
        error.absolute += std::abs(output.values.slope) * 3 * storing_floor(DataType::float32);
    } else if (placement_.aligned && has_lobes(method_)) {
        error.range += 1e-11;
    }
    error.absolute +=
        std::abs(output.values.slope) *
        (storing_floor(output.dtype) + std::abs(values_.offset) * (4 * 0x1p-53 + storing_error(output.dtype)));
    return error;
}

/// Sum of the magnitudes of all weights that a voxel of the result is made with.
double Onto::gain() const {
    if (!placement_.aligned) {
        double const g = spline_.prefilter.radius > 0 ? spline_.prefilter.gain : 1;
        return gain_of(sampling_.interpolant) * g * g * g;
    }
    double gain = 1;
    for (WeightTable const& table : tables_) gain *= table.gain();
    return gain;
}

void Onto::pass(Header const& input, Plan& plan) const {
    bool const moves = algorithm_ != Algorithm::weighted && algorithm_ != Algorithm::turned;
    auto values = values_read(input, plan);
    if (values) values = values->with(plan.output.values.physical(values_.background));
    plan.passing = ErrorPassing::averaged(moves ? 1 : gain(), values);
    if (!moves) return;
    plan.passing.storing =
        algorithm_ == Algorithm::convert ? ErrorPassing::Storing::converts : ErrorPassing::Storing::moves;
}

void Onto::describe(Plan& plan) const {
    bool const exact = algorithm_ != Algorithm::weighted && algorithm_ != Algorithm::turned;
    if (!placement_.aligned) {
        Index3 const k = sampling_.samples;
        double const count = static_cast<double>(k.x) * static_cast<double>(k.y) * static_cast<double>(k.z);
        plan.access = Access::random;
        plan.slab_hint = affine_tile.z;
        if (boundary_) plan.boundary = boundary_->boundary;
        plan.method = text("onto a turned grid: ", name_of(sampling_.interpolant),
                           count > 1 ? text(", mean of ", k.x, "x", k.y, "x", k.z, " samples a voxel") : "");
        if (!exact) plan.error = error_of(plan.output, 64 + 2 * count);
        plan.cost = count * cost_of(sampling_.interpolant) * scatter(placement_.map);
        if (spline_.prefilter.radius > 0) {
            plan.method += text(", prefilter of radius ", spline_.prefilter.radius);
            plan.cost += 3 * static_cast<double>(spline_.prefilter.radius);
            plan.slab_hint = 4 * spline_.prefilter.radius;
        }
        return;
    }
    double taps = 1;
    plan.method = "onto another grid: ";
    for (std::size_t a = 0; a < 3; ++a) {
        plan.method += text(a == 0 ? "" : ", ", name_of(tables_[a].kernel()));
        plan.state_bytes += tables_[a].bytes();
        taps *= static_cast<double>(tables_[a].most_taps());
    }
    if (algorithm_ == Algorithm::copy) plan.method = "copy";
    if (algorithm_ == Algorithm::convert) plan.method = "rounded half to even, saturated";
    if (!exact) plan.error = error_of(plan.output, 12 + 2 * taps);
    plan.cost = exact || inner_.empty() ? 0 : multiply_adds(tables_);
    bool const forward = placement_.axis[2] == 2 && tables_[2].ascends();
    plan.access = forward ? Access::forward : Access::random;
    if (boundary_) plan.boundary = boundary_->boundary;
    if (algorithm_ == Algorithm::copy && inner_ == box_of(to_)) {
        auto const whole = [](double v) { return static_cast<std::int64_t>(v); };
        plan.shift = Index3{whole(placement_.offset.x), whole(placement_.offset.y), whole(placement_.offset.z)};
    }
}

Box Onto::footprint(Box const& output) const {
    if (!placement_.aligned) return turned_footprint(output);
    Box const part = intersect(output, inner_);
    if (part.empty()) return {};
    Box result;
    for (int a = 0; a < 3; ++a) {
        int const b = placement_.axis[static_cast<std::size_t>(a)];
        WeightTable const& table = tables_[static_cast<std::size_t>(a)];
        bool const forward = b == 2 && a == 2 && table.ascends();
        auto const range = forward ? table.footprint_forward(part.lower[a], part.upper[a])
                                   : table.footprint(part.lower[a], part.upper[a]);
        result.lower[b] = range.first;
        result.upper[b] = range.second;
    }
    return result;
}

std::size_t Onto::fit(Index3 largest, Execution const& execution) const {
    if (!placement_.aligned) return held(largest);
    Box const part = intersect({inner_.lower, inner_.lower + largest}, inner_), in = footprint(part);
    std::int64_t const threads = VKT_BACKEND::threads_for(execution, std::max(in.voxels(), part.voxels()));
    std::int64_t bytes = 0;
    if (algorithm_ == Algorithm::weighted) bytes += threads * SumTile(tables_).bytes();
    if (placement_.axis != std::array<int, 3>{0, 1, 2})
        bytes += in.voxels() * static_cast<std::int64_t>(size_of(values_.in));
    return static_cast<std::size_t>(bytes);
}

/// What the samples of an output region look at: around the corners' images, cut to the volume and with what stands for
/// the rest. Only with Boundary::wrap, and for splines, it may reach outside, where affine_sample() then expects it.
Box Onto::sampled(Box const& output) const {
    Reach const reach = reach_of(sampling_.interpolant);
    Box result;
    for (int b = 0; b < 3; ++b) {
        auto const beyond = static_cast<double>(beyond_along(from_[b], sampling_.beyond, spline_.boundary));
        double low = placement_.map.offset[b], high = low;
        for (int a = 0; a < 3; ++a) {
            double const step = placement_.map.column[static_cast<std::size_t>(a)][b];
            double const first = static_cast<double>(output.lower[a]), last = static_cast<double>(output.upper[a] - 1);
            auto const k = static_cast<double>(sampling_.samples[a]);
            double const aside = 0.5 * (1 - 1 / k); // of the samples in a voxel's cell
            low += std::min(step * (first - aside), step * (last + aside));
            high += std::max(step * (first - aside), step * (last + aside));
        }
        double const n = static_cast<double>(from_[b]);
        low = std::floor(low - face_slack) - static_cast<double>(reach.before);
        high = std::floor(high + face_slack) + static_cast<double>(reach.after) + 1;
        bool const leaves = low < 0 || high > n;
        if (spline_.prefilter.radius > 0) {
            bool const folds =
                boundary_ && (boundary_->boundary == Boundary::wrap || boundary_->boundary == Boundary::mirror);
            if (!boundary_ && (high <= -beyond || low >= n + beyond)) return {};
            result.lower[b] = leaves && folds ? 0 : static_cast<std::int64_t>(std::clamp(low, -beyond, n - 1 + beyond));
            result.upper[b] =
                leaves && folds ? from_[b] : static_cast<std::int64_t>(std::clamp(high, 1 - beyond, n + beyond));
            continue;
        }
        if (!boundary_ && (high <= 0 || low >= n)) return {};
        bool const wraps = leaves && boundary_ && boundary_->boundary == Boundary::wrap;
        if (leaves && boundary_ && boundary_->boundary == Boundary::mirror) {
            double const back = low < 0 ? std::max(-low, high) : n, front = high > n ? std::min(low, 2 * n - high) : 0;
            bool const one_end = (low < 0) != (high > n);
            low = one_end ? front : 0;
            high = one_end ? back : n;
        }
        // Of rows and slices those that are looked at, which the engine wraps around; at a distance all there are.
        bool const as_they_are = wraps && b > 0 && low >= -n && high <= 2 * n && high - low < n;
        if (wraps && !as_they_are) {
            low = 0;
            high = n;
        }
        result.lower[b] = static_cast<std::int64_t>(as_they_are ? low : std::clamp(low, 0.0, n - 1));
        result.upper[b] = static_cast<std::int64_t>(as_they_are ? high : std::clamp(high, 1.0, n));
    }
    return result;
}

Box Onto::turned_footprint(Box const& output) const {
    Box const looked_at = sampled(output);
    if (spline_.prefilter.radius == 0 || looked_at.empty()) return looked_at;
    if (!preparation_) return spline_.source(looked_at, from_);
    Index3 const margin = spline_.margins(from_);
    return {looked_at.lower + margin, looked_at.upper + margin};
}

Operation* Onto::take_coefficients() {
    if (placement_.aligned || spline_.prefilter.radius == 0) return nullptr;
    preparation_ = std::make_unique<SplineCoefficients>(spline_);
    return preparation_.get();
}

std::size_t Onto::held(Index3 largest) const {
    if (placement_.aligned || spline_.prefilter.radius == 0 || preparation_) return 0;
    double bytes = static_cast<double>(size_of(spline_.type));
    for (int b = 0; b < 3; ++b) {
        double extent = 4 + 2 * static_cast<double>(reach_of(sampling_.interpolant).after);
        for (int a = 0; a < 3; ++a)
            extent += std::abs(placement_.map.column[static_cast<std::size_t>(a)][b]) * static_cast<double>(largest[a]);
        if (b < 2) extent += 2 * static_cast<double>(spline_.prefilter.radius);
        bytes *= std::min(
            extent, static_cast<double>(from_[b] + 2 * beyond_along(from_[b], sampling_.beyond, spline_.boundary)));
    }
    return static_cast<std::size_t>(bytes);
}

void Onto::run_spline(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    Box const box = sampled(out.box);
    if (box.empty()) { // nothing but background
        AffineSampling anything = sampling_;
        anything.interpolant = Interpolant::nearest;
        return affine_sample(in, out, anything, losses, outside_, execution);
    }
    if (preparation_) {
        Index3 const margin = spline_.margins(from_);
        return affine_sample(in.moved_to(in.box.lower - margin), out, sampling_, losses, outside_, execution);
    }
    coefficients_.reserve(static_cast<std::size_t>(box.voxels()) * size_of(spline_.type));
    AnyView const coefficients =
        dense_view(coefficients_.write(execution.space()), spline_.type, box, execution.space());
    spline_coefficients(spline_, filter_weights_, from_, in, coefficients, wider_, execution);
    affine_sample(coefficients, out, sampling_, losses, outside_, execution);
}

void Onto::run(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    if (out.box.empty()) return;
    if (placement_.aligned) return run_aligned(in, out, losses, execution);
    if (algorithm_ == Algorithm::turned_nearest) return affine_nearest(in, out, sampling_, outside_, execution);
    if (spline_.prefilter.radius > 0) return run_spline(in, out, losses, execution);
    affine_sample(in, out, sampling_, losses, outside_, execution);
}

ConstView Onto::with_axes_in_order(ConstView in, Execution const& execution) {
    if (placement_.axis == std::array<int, 3>{0, 1, 2}) return in;
    Box box;
    for (int a = 0; a < 3; ++a) {
        box.lower[a] = in.box.lower[placement_.axis[static_cast<std::size_t>(a)]];
        box.upper[a] = in.box.upper[placement_.axis[static_cast<std::size_t>(a)]];
    }
    ordered_.reserve(in.bytes());
    AnyView const ordered = dense_view(ordered_.write(execution.space()), in.type, box, execution.space());
    permute_box(in, ordered, placement_.axis, {}, execution);
    return ordered;
}

void Onto::run_aligned(ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    Box part = intersect(out.box, inner_);
    if (part.empty()) part = {};
    if (!(part == out.box)) {
        // As a window around the part: outside of it lies the border.
        double const beyond = boundary_ ? values_.border * values_.scale + values_.offset : values_.background;
        fill_border(out.moved_to(out.box.lower - part.lower), box_of(part.dims()), part.dims(), Boundary::border,
                    beyond, execution);
        std::int64_t const voxels = out.box.voxels() - part.voxels();
        bool const fits = !is_integer(out.type) || (beyond >= lowest_of(out.type) && beyond <= highest_of(out.type));
        if (!fits) losses.clipped += voxels;
        if (!boundary_) outside_ += voxels;
    }
    if (part.empty()) return;
    AnyView const to = out.part(part);
    ConstView const from = with_axes_in_order(in, execution);
    if (algorithm_ == Algorithm::copy || algorithm_ == Algorithm::convert) {
        ConstView const same = from.moved_to(part.lower); // its footprint is the part, elsewhere
        if (algorithm_ == Algorithm::copy) return copy_region(same, to, execution);
        return convert_values(same, to, losses, execution);
    }
    WeightedSum sum = weighted_sum(tables_, in.type, execution.space());
    if (algorithm_ == Algorithm::nearest) return resample_nearest(from, to, sum, execution);
    sum.border = values_.border;
    sum.scale = values_.scale;
    sum.offset = values_.offset;
    resample_weighted(from, to, sum, scratch_, losses, execution);
}

Remark outside_remark(std::int64_t outside, std::int64_t voxels, std::string const& what,
                      std::optional<double> const& other_background) {
    return {text(share_text(outside, voxels), " outside ", what, ": background",
                 other_background ? text(" ", *other_background, ", the nearest to what was meant that can be stored")
                                  : ""),
            false};
}

} // namespace vkt
