// What operations take on the machine where they were all measured: a calibration says how much faster another one is.
// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <span>
#include <string_view>

namespace vkt::shell {

/// One setting of an operation, on one thread.
struct TypicalRate {
    std::string_view operation;
    std::string_view method; ///< of its plan, without what follows the first digit
    double cost = 0;         ///< of its plan
    /// A voxel of the output, of the input for reductions, for voxels of 1, 2, 4 and 8 bytes; 0: not measured.
    std::array<double, 4> nanoseconds{};
    double shared = 1; ///< the share of it that threads divide among them
};

/// Every registered operation that makes grids of grids, or reports on them.
std::span<TypicalRate const> typical_rates();

/// What the calibration of that machine was.
struct TypicalCalibration {
    std::string_view operation;
    std::string_view method;
    int bytes = 4;
    double cost = 0;
    double nanoseconds = 0; ///< on one thread
};
std::span<TypicalCalibration const> typical_calibration();

} // namespace vkt::shell
