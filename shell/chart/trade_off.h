// What a pipeline of operations costs in time and error under all settings of its knobs, measured on a volume.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/source.h"

#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {

struct TradeOffRequest {
    std::string pipeline;          ///< operations of one volume, as `vkt pipe` takes them
    std::vector<std::string> kept; ///< options that stay as they are given; "threads" and "device", too
    Roi roi;                       ///< where to measure; empty: in the middle, as much as there is time for
    double seconds = 12;           ///< to spend, about
    Execution execution;
};

/// One setting and what was measured. Errors are differences to the reference, in physical values.
struct TradeOffPoint {
    std::vector<std::string> stages; ///< as words for a shell, one text a stage
    std::string label;               ///< what differs from what was given: "--tolerance 1%, 1 thread"
    int threads = 1;
    bool gpu = false;
    double seconds = 0;       ///< median of the repeats
    double whole_seconds = 0; ///< of the whole volume, or of a picture of the size asked for: time grows with these
    int repeats = 0;
    double max_error = 0, rms_error = 0;
    /// Difference to the same definition (interpolant, …) without rounding and truncation: what the bound is about.
    double own_error = 0;
    std::optional<double> bound; ///< as predicted; none where none is known
    /// Seconds: by the calibration of this machine (TradeOff::calibrated), or else the plan's operations at the speed
    /// of the setting that was given.
    std::optional<double> predicted;
    double operations = 0; ///< multiply-adds of the plan, for all voxels
    bool given = false, front = false;
    bool lossy = false; ///< values were clipped or no numbers
    bool exceeded() const { return bound && own_error > *bound; }
};

struct TradeOff {
    Index3 whole;             ///< dims of the volume
    Box part;                 ///< where it was measured
    Index3 picture;           ///< dims of the pictures that were compared; zeros: volumes were
    Index3 whole_picture;     ///< of those asked for
    double low = 0, high = 0; ///< physical values of the result, in the reference
    std::string reference;    ///< how it was computed
    struct Check {
        std::int64_t voxels = 0;
        double error = 0, bound = 0; ///< largest difference, and what is promised of the reference
    };
    std::optional<Check> check; ///< of the reference, against sums by definition
    std::string settings;       ///< "all 14 settings"
    std::string units;
    bool calibrated = false;           ///< what is predicted is so by `vkt doctor --calibrate`
    std::vector<TradeOffPoint> points; ///< the fastest first
    double scale() const;              ///< voxels of the volume per voxel measured, or pixels
    double range() const { return high - low; }
};

/// Measures the source's current volume and finishes it. Throws Error{usage} for pipelines that are not made of
/// operations with one input, or have nothing to vary.
TradeOff measure_trade_off(TradeOffRequest const& request, Source& source);

} // namespace vkt::shell
