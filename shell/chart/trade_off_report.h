// What a measured trade-off of time and error looks like: a table, CSV, JSON, a chart, and the command of a setting.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/common/value_tolerance.h"
#include "shell/chart/trade_off.h"
#include "shell/picture/plot.h"

#include <cstdint>
#include <optional>
#include <string>

namespace vkt::shell {

/// What is asked of a setting; of nothing, that it keeps what the given one promises.
struct TradeOffGoal {
    std::optional<ValueTolerance> within; ///< the largest error
    std::optional<double> seconds;        ///< for all of the volume
    /// Throws Error{usage}.
    void check() const;
    /// The fastest setting that is as exact, or the most exact one that is as fast; null if there is none.
    TradeOffPoint const* choose(TradeOff const& found) const;
    /// What the choice is: "fastest within 0.5".
    std::string purpose(TradeOff const& found) const;
};

/// What was charted, and the setting that its user is advised to take.
struct TradeOffReport {
    TradeOff const& found;
    std::string const& pipeline;
    std::string const& volume;             ///< the input as it was given, "-" for standard input
    TradeOffPoint const* choice = nullptr; ///< by a goal
    std::string purpose{};

    /// Settings, and the check of the reference, whose error is larger than was predicted.
    std::int64_t exceeded() const;
    std::string predicted_by() const; ///< "calibration" or "given setting"
    /// For a terminal that draws, the chart too.
    std::string table(bool with_chart) const;
    std::string csv() const;
    std::string json() const;
    Plot plot() const;
};

} // namespace vkt::shell
