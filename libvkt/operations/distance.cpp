// Distance: rows from their runs, columns and lines along z by the kernel.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/distance.h"

#include "libvkt/core/text.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/kernels/bits.h"
#include "libvkt/operations/kernels/distance.h"
#include "libvkt/operations/kernels/fill.h"
#include "libvkt/operations/remarks.h"
#include "libvkt/operations/zero.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

namespace vkt {
namespace {

/// Whole numbers of a common unit that spacings are to 12 digits, so that squared distances stay below no_site.
struct WholeSpacing {
    std::array<std::int64_t, 3> steps;
    double unit;
};

std::optional<WholeSpacing> whole_spacing(Vec3 spacing, Index3 dims) {
    double const least = std::min({spacing.x, spacing.y, spacing.z});
    constexpr std::int64_t largest = 1 << 12;
    for (std::int64_t divisor = 1; divisor <= largest; ++divisor) {
        WholeSpacing result{{}, least / static_cast<double>(divisor)};
        double farthest = 0, error = 0;
        for (int axis = 0; axis < 3; ++axis) {
            double const exact = spacing[axis] / least * static_cast<double>(divisor), nearest = std::nearbyint(exact);
            if (nearest > largest) return std::nullopt; // and all larger divisors
            error = std::max(error, std::abs(exact - nearest) / exact);
            result.steps[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(nearest);
            farthest += std::pow(nearest * static_cast<double>(dims[axis]), 2);
        }
        if (farthest >= no_site) return std::nullopt;
        if (error < 1e-12) return result;
    }
    return std::nullopt;
}

double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// The first voxel from x on whose bit differs from those of `same`, which is all 0 or all 1; n if there is none.
std::int64_t next(std::vector<std::uint64_t> const& bits, std::int64_t x, std::int64_t n, std::uint64_t same) {
    while (x < n) {
        std::uint64_t const rest = (bits[static_cast<std::size_t>(x / 64)] ^ same) >> (x % 64);
        if (rest != 0) return std::min(n, x + std::countr_zero(rest));
        x = (x / 64 + 1) * 64;
    }
    return n;
}

/// Distances in steps for the voxels [begin, end) of a row of n, all of one side; those beyond are of the other.
template <class S, class F>
void fill_run(S* row, std::int64_t begin, std::int64_t end, std::int64_t n, S none, F const& value) {
    std::int64_t const far = std::int64_t{1} << 40;
    std::int64_t const left = begin > 0 ? begin - 1 : -far, right = end < n ? end : far;
    if (begin == 0 && end == n) {
        std::fill(row, row + n, none);
        return;
    }
    std::int64_t const middle = std::clamp((left + right) / 2 + 1, begin, end);
    for (std::int64_t x = begin; x < middle; ++x) row[x] = value(x - left);
    for (std::int64_t x = middle; x < end; ++x) row[x] = value(right - x);
}

} // namespace

VKT_OPERATION(Distance, "distance")

Texts Distance::texts() const {
    return {"Measure the distance to the nearest zero voxel.",
            "Exact Euclidean distances, in world units, from the centre of every non-zero voxel to the centre of the "
            "nearest one that is zero or NaN; float32. Outside of the volume there is nothing to measure to."
            "\n\n"
            "Accuracy: Within 2^-23 of the value; correctly rounded where squared distances are whole numbers of a "
            "common unit, as with equal spacings.",
            {{"How deep voxels lie inside of the object", "vkt distance volume.nrrd -o depth.nrrd"},
             {"Inside positive, outside negative, in voxels",
              "vkt distance volume.nrrd --signed --unit voxel | vkt stats"}}};
}

void Distance::parameters(Parameters& parameters) {
    parameters.flag("signed", both, "zero voxels get minus the distance to the nearest non-zero one");
    parameters.option("unit", unit, "UNIT", "unit of the distances: world or voxel, whatever its shape");
    parameters.option("roi", roi, "REGION", "measure only within this region, as if there were no other voxels");
}

Plan Distance::plan(std::span<Header const> inputs) {
    input_ = inputs[0];
    nan_ = 0;
    none_ = false;
    zero_ = stored_zero(input_);
    Plan plan;
    plan.output = input_;
    plan.output.dtype = DataType::float32;
    plan.output.values = {};
    plan.output.units.clear();
    plan.output.attributes.erase("background");
    plan.whole = true;
    plan.cost = 30;
    if (input_.kind == Kind::hierarchical) return plan; // refused by the engine
    region_ = roi.resolve(input_.dims);
    Index3 const dims = region_.dims();
    bool const world = unit == LengthUnit::world;
    auto const& direction = input_.geometry.direction;
    for (int a = 0; a < 3 && world; ++a)
        if (std::abs(dot(direction[static_cast<std::size_t>(a)], direction[static_cast<std::size_t>((a + 1) % 3)])) >
            1e-6)
            throw Error(ErrorKind::usage, "distances in the world need axes that are perpendicular",
                        "measure with --unit voxel, or resample the volume first: vkt resample --like");
    Vec3 const spacing = world ? input_.geometry.spacing : Vec3{1, 1, 1};
    Vec3 size;
    if (auto const whole = whole_spacing(spacing, dims)) {
        whole_ = true;
        unit_length_ = whole->unit;
        for (std::size_t a = 0; a < 3; ++a) weights_[a] = static_cast<double>(whole->steps[a] * whole->steps[a]);
    } else {
        whole_ = false;
        // Relative to the first, so that squares neither overflow nor vanish.
        unit_length_ = std::max({spacing.x, spacing.y, spacing.z});
        for (int a = 0; a < 3; ++a) weights_[static_cast<std::size_t>(a)] = std::pow(spacing[a] / unit_length_, 2);
    }
    for (int a = 0; a < 3; ++a) size[a] = spacing[a] * static_cast<double>(dims[a] - 1);
    plan.method = text("outward search to 20 voxels, then envelopes; squares ", whole_ ? "exact" : "in float64");
    if (!whole_ || unit_length_ != 1) {
        plan.error.kind = ErrorBound::Kind::bound;
        plan.error.absolute = std::sqrt(dot(size, size)) * (whole_ ? 0x1.0001p-24 : 0x1p-23);
    }
    plan.passing = ErrorPassing::jumps(ValueInterval{0, std::sqrt(dot(size, size))});
    plan.passing.storing = ErrorPassing::Storing::computes;
    std::int64_t const longest = std::max(dims.y, dims.z);
    plan.state_bytes = static_cast<std::size_t>(longest + 40) * 16 * (whole_ ? 4 : 8) * 4 + 65536;
    return plan;
}

Box Distance::footprint(Box const&, int) const { return region_; }

void Distance::run_rows(ConstView in, AnyView out, Execution const& execution) {
    Index3 const n = in.dims();
    Execution alone = execution;
    alone.threads = 1;
    std::atomic<std::int64_t> objects = 0, nan = 0;
    VKT_BACKEND::for_each_item(
        VKT_BACKEND::threads_for(execution, in.box.voxels()), n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
            std::vector<std::uint64_t> bits(static_cast<std::size_t>(bit_words(n.x)));
            std::int64_t my_objects = 0, my_nan = 0;
            for (std::int64_t r = begin; r < end; ++r) {
                VKT_BACKEND::tell_progress(execution, begin, r, end);
                std::int64_t const y = in.box.lower.y + r % n.y, z = in.box.lower.z + r / n.y;
                ConstView const row = in.part({{in.box.lower.x, y, z}, {in.box.upper.x, y + 1, z + 1}});
                if (!is_integer(in.type)) {
                    pack_bits(row, BitRule::number, {}, bits.data(), alone);
                    my_nan += n.x;
                    for (std::uint64_t const word : bits) my_nan -= std::popcount(word);
                }
                pack_bits(row, BitRule::object, zero_, bits.data(), alone);
                auto const fill_row = [&]<class S>(S* to, S none, auto const& value) {
                    auto const outside = [&](std::int64_t first, std::int64_t last) {
                        if (first == last) return;
                        if (both)
                            fill_run(to, first, last, n.x, static_cast<S>(-none),
                                     [&](std::int64_t d) { return static_cast<S>(-value(d)); });
                        else
                            std::fill(to + first, to + last, S(0));
                    };
                    std::int64_t x = 0;
                    while (x < n.x) {
                        // The next voxel of an object, and the next beyond it.
                        std::int64_t const first = next(bits, x, n.x, 0),
                                           last = next(bits, first, n.x, ~std::uint64_t{0});
                        outside(x, first);
                        if (first < last) fill_run(to, first, last, n.x, none, value);
                        my_objects += last - first;
                        x = last;
                    }
                };
                std::byte* const to = out.at(out.box.lower.x, y, z);
                if (whole_) {
                    auto const weight = static_cast<std::int32_t>(weights_[0]);
                    fill_row(reinterpret_cast<std::int32_t*>(to), no_site,
                             [&](std::int64_t d) { return static_cast<std::int32_t>(d * d) * weight; });
                } else {
                    fill_row(reinterpret_cast<float*>(to), std::numeric_limits<float>::infinity(),
                             [](std::int64_t d) { return static_cast<float>(d); });
                }
            }
            objects += my_objects;
            nan += my_nan;
        });
    nan_ = nan;
    none_ = objects == in.box.voxels() || (both && objects == 0);
}

void Distance::run(std::span<ConstView const> inputs, AnyView whole, Execution const& execution) {
    if (region_ != whole.box) fill_box(whole, VoxelBytes{}, execution);
    AnyView const out = whole.part(region_).moved_to({});
    run_rows(inputs[0].part(region_).moved_to({}), out, execution);
    DistancePass pass;
    pass.whole = whole_;
    pass.both_sides = both;
    pass.weight = weights_[1];
    pass.weight_before = whole_ ? 0 : weights_[0];
    distance_pass(out, pass, execution);
    pass.axis = Axis::z;
    pass.weight = weights_[2];
    pass.weight_before = 0;
    pass.unit = unit_length_;
    distance_pass(out, pass, execution);
}

std::vector<Remark> Distance::remarks() const {
    std::vector<Remark> result;
    if (nan_ > 0) result.push_back({text(share_text(nan_, region_.voxels()), " not a number: taken for zero"), false});
    if (none_) result.push_back({"all voxels are of one kind: distances are infinite", false});
    return result;
}

} // namespace vkt
