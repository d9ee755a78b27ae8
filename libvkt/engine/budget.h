// One budget for several knobs: which settings keep a whole within it at the least cost.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace vkt {

/// What a choice of settings, one for each knob, leads to. An error that is not known is infinite.
struct Outcome {
    double error = 0;
    double cost = 0;
};
using Settings = std::vector<std::size_t>;

/// The cheapest settings with an error of at most `limit`; none if no choice that was tried has one. Settings of a knob
/// are numbered from 0, the loosest and cheapest, to counts[k] - 1. Up to `exhaustive` choices all are tried, and the
/// result is the cheapest there is. Beyond that it is a greedy walk: from the loosest settings, each step tightens the
/// knob that takes most error away for its cost, and what turns out tighter than needed is loosened at the end; that
/// ends within a few per cent of the cheapest where errors add up and costs grow slowly, as those of a pipeline do.
/// Calls `evaluate` at most O(K^2 S^2) times for K knobs of S settings.
std::optional<Settings> cheapest_within(double limit, std::vector<std::size_t> const& counts,
                                        std::function<Outcome(Settings const&)> const& evaluate,
                                        std::size_t exhaustive = 256);

} // namespace vkt
