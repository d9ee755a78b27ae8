// What an operation is besides, if there is a second way to find its result.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstdint>
#include <optional>

namespace vkt {

/// A voxel that is not what it should be, both as stored values.
struct WrongVoxel {
    std::int64_t index = 0; ///< in x-fastest order
    double found = 0, expected = 0;
    double allowed = 0; ///< stored value that it may be off by
};

/// `vkt stress` knows none of these operations by name.
class Verifiable {
public:
    virtual ~Verifiable() = default;
    /// Works the result out once more, as it is defined and as plainly as can be, with no code in common with run(),
    /// and tells a voxel of the output that is further away than the plan allows. Of the volume last begun, which is
    /// structured, and both lie in host memory. None is told where options or values leave more than one answer.
    virtual std::optional<WrongVoxel> wrong_voxel(ConstView input, ConstView output) const = 0;
};

} // namespace vkt
