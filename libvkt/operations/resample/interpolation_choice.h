// The cheapest interpolant whose error, estimated from the voxels themselves, keeps to a tolerance.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume_error.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/value_tolerance.h"
#include "libvkt/operations/resample/resample_method.h"

#include <array>
#include <optional>
#include <vector>

namespace vkt {

/// What a tolerance of interpolation may be: finite and above 0, less than 100 %, and alone, since it chooses the
/// method. Throws Error{usage}.
void check_interpolation_tolerance(ValueTolerance const& tolerance, bool method_given);

/// Half-way between two voxels and a quarter from each, each candidate is compared with the polynomial of degree 7
/// through the eight voxels around (Lagrange), whose own error is two orders smaller for what is sampled finely enough
/// to be interpolated at all. The largest difference along each axis is taken, and those of the axes that are
/// interpolated are summed. Of large volumes every fourth or eighth row is looked at: an estimate, no bound. What is
/// not finite takes no part.
class InterpolationChoice {
public:
    /// What may be varied where a tolerance is given.
    static Knob knob() { return {"tolerance", {"30%", "10%", "3%", "1%", "0.3%", "0.1%"}, "1e-10%", false}; }

    /// The cheapest first; the last looks furthest. Of smooth data cubic is the most accurate of them, of edges
    /// lanczos3. Splines are none of them: they filter all voxels before one is sampled.
    static constexpr std::array<ResampleMethod, 4> candidates{ResampleMethod::nearest, ResampleMethod::linear,
                                                              ResampleMethod::cubic, ResampleMethod::lanczos3};

    /// Of the voxels of a box in a volume with this header; `axes`: those along which positions lie between voxels.
    /// Of a share of the range all of them are looked at for their extremes.
    InterpolationChoice(Header const& volume, Box const& box, std::array<bool, 3> axes,
                        ValueTolerance const& tolerance = {});

    std::size_t state_bytes() const;
    /// Slabs of host memory in z order, whole rows of the box; a slice may come in pieces of rows, in order.
    void scan(ConstView slab);

    /// Estimated largest error of a candidate, as a physical value.
    double error(ResampleMethod candidate) const;
    /// The cheapest candidate that keeps to the tolerance, or the most accurate one if none does. Where voxels of the
    /// result are `wider` than those of the volume nearest is none: it would leave voxels out. Linear is meant with an
    /// average where voxels are wider.
    ResampleMethod choose(bool wider);

    /// What the plan says before the scan: with the tolerance as estimated error.
    void announce(Plan& plan) const;
    /// And after it, of the method chosen, whose plan `chosen` is.
    void settle(Plan const& chosen, Plan& plan) const;
    /// What was chosen, if that is known.
    std::optional<Remark> remark() const;

private:
    static constexpr int taps = 8;
    /// As a physical value.
    double allowed() const;
    using Errors = std::array<double, candidates.size()>;
    /// Of each candidate at one place: by what its weights of the eight voxels differ from the polynomial's. They sum
    /// to 0, so that an offset costs no digits.
    using Place = std::array<std::array<double, taps>, candidates.size()>;
    static Place place_at(double fraction);

    void compare(std::array<double const*, taps> const& tap, std::int64_t n, Errors& errors) const;
    void take_row(double const* row, std::int64_t y, std::int64_t z);

    ResampleMethod chosen_ = candidates.back();
    bool looked_ = false; ///< … after a look at the voxels
    Box box_;
    std::array<bool, 3> axes_{};
    ValueTolerance tolerance_;
    DataType type_ = DataType::uint8;
    double slope_ = 1;
    std::int64_t every_ = 1; ///< row, and slice, is looked at
    std::array<Place, 4> places_{};
    double largest_ = 0;                ///< magnitude of a stored value that was looked at
    std::optional<ValueInterval> seen_; ///< stored values, for a share of their range
    std::array<Errors, 3> errors_{};    ///< of stored values, along each axis
    std::vector<double> padded_;        ///< a row, and what continues it, if it is short
    std::vector<double> rows_, slices_; ///< the last eight rows of a slice, and slices of the rows looked at
};

} // namespace vkt
