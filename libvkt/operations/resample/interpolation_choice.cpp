// Interpolants against a polynomial of higher degree, between voxels.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/interpolation_choice.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/operations/common/row_values.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace vkt {

void check_interpolation_tolerance(ValueTolerance const& tolerance, bool method_given) {
    if (method_given) throw Error(ErrorKind::usage, "--tolerance chooses the method: --method does not apply");
    auto const refuse = [&](char const* what) {
        throw Error(ErrorKind::usage, text("--tolerance ", tolerance.number, tolerance.percent ? "% " : " ", what),
                    "it is in units of values, or with % a share of their range; --method nearest keeps voxels as they "
                    "are");
    };
    if (!(tolerance.number > 0 && std::isfinite(tolerance.number))) refuse("is not a finite number above 0");
    if (tolerance.percent && !(tolerance.number < 100)) refuse("is not below 100%");
}

InterpolationChoice::InterpolationChoice(Header const& volume, Box const& box, std::array<bool, 3> axes,
                                         ValueTolerance const& tolerance)
    : box_(box), axes_(axes), tolerance_(tolerance), type_(volume.dtype), slope_(std::abs(volume.values.slope)) {
    std::int64_t const voxels = box.voxels();
    every_ = voxels > 1 << 24 ? 8 : voxels > 1 << 21 ? 4 : 1;
    // Of the two in the middle the nearest voxel is one or the other.
    places_ = {place_at(0.25), place_at(0.499), place_at(0.501), place_at(0.75)};
    Index3 const n = box.dims();
    auto const row = static_cast<std::size_t>(n.x);
    padded_.resize(row + taps);
    if (axes_[1]) rows_.resize(taps * row);
    if (axes_[2]) slices_.resize(taps * row * static_cast<std::size_t>((n.y + every_ - 1) / every_));
}

std::size_t InterpolationChoice::state_bytes() const {
    return (padded_.size() + rows_.size() + slices_.size()) * sizeof(double);
}

/// Voxel k of eight lies at k - 3, the place between 0 and 1.
InterpolationChoice::Place InterpolationChoice::place_at(double fraction) {
    Place place{};
    for (std::size_t c = 0; c < candidates.size(); ++c) {
        WeightTable const table({taps, 1, 1, 3 + fraction}, interpolant_of(candidates[c])->kernel, Boundary::clamp);
        AxisTable const t = table.taps(Space::host);
        for (std::int64_t i = t.start[0]; i < t.start[1]; ++i)
            place[c][static_cast<std::size_t>(t.first[0] + i - t.start[0])] = t.weight[i];
    }
    for (int k = 0; k < taps; ++k) {
        double product = 1;
        for (int j = 0; j < taps; ++j)
            if (j != k) product *= (fraction - (j - 3)) / (k - j);
        for (auto& weights : place) weights[static_cast<std::size_t>(k)] -= product;
    }
    return place;
}

/// tap[k] is the voxel k - 3 after the one before the place.
void InterpolationChoice::compare(std::array<double const*, taps> const& tap, std::int64_t n, Errors& errors) const {
    for (Place const& place : places_) {
        Errors most = errors;
        for (std::int64_t i = 0; i < n; ++i) {
            double const first = tap[3][i];
            std::array<double, taps> v{};
            for (std::size_t k = 0; k < taps; ++k) v[k] = tap[k][i] - first;
            for (std::size_t c = 0; c < candidates.size(); ++c) {
                double difference = 0;
                for (std::size_t k = 0; k < taps; ++k) difference += place[c][k] * v[k];
                double const error = std::abs(difference);
                if (error > most[c] && error <= std::numeric_limits<double>::max()) most[c] = error;
            }
        }
        errors = most;
    }
}

void InterpolationChoice::scan(ConstView slab) {
    Box const part = intersect(slab.box, box_);
    if (part.empty()) return;
    ConstView const view = slab.part(part);
    std::vector<double> row(static_cast<std::size_t>(box_.dims().x));
    for (std::int64_t z = part.lower.z; z < part.upper.z; ++z)
        for (std::int64_t y = part.lower.y; y < part.upper.y; ++y) {
            bool const across = axes_[1] && (z - box_.lower.z) % every_ == 0;
            bool const interpolated = across || (y - box_.lower.y) % every_ == 0;
            if (!interpolated && !tolerance_.percent) continue;
            read_row(view, y, z, row.data());
            for (double const v : row) {
                if (!(std::abs(v) <= std::numeric_limits<double>::max())) continue;
                if (std::abs(v) > largest_) largest_ = std::abs(v);
                if (tolerance_.percent) seen_ = seen_ ? seen_->with(v) : ValueInterval{v, v};
            }
            if (!interpolated) continue;
            take_row(row.data(), y - box_.lower.y, z - box_.lower.z);
        }
}

namespace {

/// Calls f(taps) for every pair of neighbours whose eight voxels have all come with line i of n: taps[k] is the line
/// k - 3 after the first of the pair. What continues a volume beyond its faces is no part of it: there none is looked
/// at, unless there are fewer than eight lines in all.
template <class F> void for_each_middle(std::int64_t i, std::int64_t n, F const& f) {
    bool const few = n < 8;
    std::int64_t const last = few ? (i == n - 1 ? n - 2 : -1) : i - 4;
    for (std::int64_t middle = few ? 0 : std::max<std::int64_t>(last, 3); middle <= last; ++middle) {
        std::array<std::int64_t, 8> taps{};
        for (std::int64_t k = 0; k < 8; ++k)
            taps[static_cast<std::size_t>(k)] = std::clamp<std::int64_t>(middle + k - 3, 0, n - 1);
        f(taps);
    }
}

} // namespace

void InterpolationChoice::take_row(double const* row, std::int64_t y, std::int64_t z) {
    Index3 const n = box_.dims();
    bool const looked_at = y % every_ == 0;
    if (axes_[0] && looked_at && n.x > 1) {
        bool const few = n.x < taps;
        for (std::int64_t k = 0; few && k < n.x + taps - 1; ++k)
            padded_[static_cast<std::size_t>(k)] = row[std::clamp<std::int64_t>(k - 3, 0, n.x - 1)];
        std::array<double const*, taps> tap{};
        for (std::size_t k = 0; k < taps; ++k) tap[k] = (few ? padded_.data() : row) + k;
        compare(tap, few ? n.x - 1 : n.x - taps + 1, errors_[0]);
    }
    // Rings of lines; line i lies in place i % 8.
    auto const along = [&](std::vector<double>& ring, std::size_t pitch, std::size_t at, std::int64_t i,
                           std::int64_t lines, Errors& errors) {
        std::copy_n(row, n.x, ring.data() + static_cast<std::size_t>(i % taps) * pitch + at);
        for_each_middle(i, lines, [&](std::array<std::int64_t, 8> const& line) {
            std::array<double const*, taps> tap{};
            for (std::size_t k = 0; k < taps; ++k)
                tap[k] = ring.data() + static_cast<std::size_t>(line[k] % taps) * pitch + at;
            compare(tap, n.x, errors);
        });
    };
    auto const width = static_cast<std::size_t>(n.x);
    if (axes_[1] && z % every_ == 0 && n.y > 1) along(rows_, width, 0, y, n.y, errors_[1]);
    if (axes_[2] && looked_at && n.z > 1)
        along(slices_, slices_.size() / taps, static_cast<std::size_t>(y / every_) * width, z, n.z, errors_[2]);
}

double InterpolationChoice::error(ResampleMethod candidate) const {
    auto const at = static_cast<std::size_t>(std::ranges::find(candidates, candidate) - candidates.begin());
    double sum = 0;
    for (Errors const& errors : errors_) sum += errors.at(at);
    return sum * slope_;
}

double InterpolationChoice::allowed() const { return tolerance_.within(seen_ ? slope_ * seen_->width() : 0); }

ResampleMethod InterpolationChoice::choose(bool wider) {
    double const tolerance = allowed();
    std::optional<ResampleMethod> best; // if none keeps to it
    for (ResampleMethod const candidate : candidates) {
        if (wider && candidate == ResampleMethod::nearest) continue;
        if (!best || error(candidate) < error(*best)) best = candidate;
        if (error(candidate) <= tolerance) break;
    }
    chosen_ = *best;
    looked_ = true;
    return chosen_ == ResampleMethod::linear ? ResampleMethod::automatic : chosen_;
}

void InterpolationChoice::announce(Plan& plan) const {
    plan.scans = true;
    plan.state_bytes += state_bytes();
    plan.method = text("the cheapest of nearest, linear, cubic and lanczos3 within ", tolerance_.number,
                       tolerance_.percent ? "% of the value range" : "", ", chosen after a look at the voxels");
    plan.error.kind = Certainty::estimate;
    double const most = slope_ * (highest_of(type_) - lowest_of(type_)); // of the range of integers
    if (tolerance_.percent)
        plan.error.range += tolerance_.within(1);
    else
        plan.error.absolute += tolerance_.number;
    if (plan.error.in_values) *plan.error.in_values += tolerance_.within(most);
}

void InterpolationChoice::settle(Plan const& chosen, Plan& plan) const {
    double const own = error(chosen_);
    plan.error = chosen.error;
    plan.error.kind = Certainty::estimate;
    // Rounding, of values as large as those that were looked at.
    double const rounding = slope_ * (2 * plan.error.range + plan.error.magnitude) * largest_;
    plan.error.range = plan.error.magnitude = 0;
    plan.error.absolute += own + rounding;
    if (plan.error.in_values) *plan.error.in_values += own;
    plan.passing = chosen.passing;
    if (plan.passing.storing == ErrorPassing::Storing::moves) plan.passing.own = own;
}

std::optional<Remark> InterpolationChoice::remark() const {
    if (!looked_) return std::nullopt;
    double const own = error(chosen_);
    std::string const asked = text(tolerance_.number, tolerance_.percent ? "%" : ""),
                      meant = tolerance_.percent ? text(", ", two_digits(allowed()), " in values") : std::string();
    std::string const estimate = text(enum_name(chosen_), ": estimated error ", two_digits(own));
    if (own <= allowed()) return Remark{text(estimate, ", within ", asked, meant), false};
    return Remark{
        text("not as good as asked for: ", estimate, ", the least there is, is beyond --tolerance ", asked, meant),
        true};
}

} // namespace vkt
