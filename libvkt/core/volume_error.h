// How far the voxels of a volume may be from exact arithmetic: what every stage adds to, and headers carry along.
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace vkt {

/// How much a number that limits an error is worth, the best first. What is made of several is as good as the worst.
enum class Certainty : std::uint8_t { exact, bound, estimate, unknown };

/// Physical values from low to high, both finite.
struct ValueInterval {
    double low = 0, high = 0;

    double width() const { return high - low; }
    /// Largest distance from a value.
    double reach(double from = 0) const { return std::max(std::abs(low - from), std::abs(high - from)); }
    bool finite() const { return std::isfinite(low) && std::isfinite(high); }
    ValueInterval with(double value) const { return {std::min(low, value), std::max(high, value)}; }
    ValueInterval with(ValueInterval const& o) const { return {std::min(low, o.low), std::max(high, o.high)}; }
    ValueInterval within(ValueInterval const& o) const {
        return {std::clamp(low, o.low, o.high), std::clamp(high, o.low, o.high)};
    }
    ValueInterval grown(double by) const { return {low - by, high + by}; }
    friend bool operator==(ValueInterval const&, ValueInterval const&) = default;
};

/// |physical value of a voxel - what exact arithmetic makes of the same files| is at most `at_most`, for every voxel
/// for which both are finite. Exact arithmetic follows the definitions of the operations, types included: it saturates
/// where they do, and rounds nowhere. Voxels of a file that nothing is known about are what they are: exact. A header
/// that says nothing is of unknown error.
struct VolumeError {
    Certainty kind = Certainty::unknown;
    double at_most = 0;                  ///< physical value, >= 0, finite; 0 if exact or unknown
    std::optional<ValueInterval> values; ///< between which all finite voxels lie, where that is more than the type says
    std::string because;                 ///< if unknown: what lost it; empty if nobody said anything

    /// Of voxels that are given, not computed.
    static VolumeError given() {
        VolumeError error;
        error.kind = Certainty::exact;
        return error;
    }
    static VolumeError lost(std::string because) {
        VolumeError error;
        error.because = std::move(because);
        return error;
    }
    bool exact() const { return kind == Certainty::exact; }
    bool known() const { return kind != Certainty::unknown; }
    /// True for what no one has said anything about.
    bool silent() const { return !known() && because.empty() && !values; }
    friend bool operator==(VolumeError const&, VolumeError const&) = default;
};

} // namespace vkt
