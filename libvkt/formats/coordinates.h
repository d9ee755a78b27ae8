// Coordinates of samples along a dimension, as files of NetCDF's conventions have them in arrays of their own.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt {

/// Coordinates at equal distances.
struct EvenSteps {
    double first = 0, step = 1; ///< the step may be negative, but is not 0
};

/// None where the distances differ by more than a thousandth.
std::optional<EvenSteps> even_steps(std::span<double const> coordinates);

/// Puts the samples of an axis where their coordinates say, or says that these are uneven.
void place_axis(Header& header, int axis, std::span<double const> coordinates);

/// What is said of each volume of a sequence whose places these are: "sequence position", and of even ones the step and
/// the unit.
std::vector<std::map<std::string, std::string>> sequence_places(std::span<double const> coordinates,
                                                                std::string const& units);

/// True for names of dimensions that enumerate volumes and are no direction in space: time and channels.
bool enumerates(std::string const& dimension);

} // namespace vkt
