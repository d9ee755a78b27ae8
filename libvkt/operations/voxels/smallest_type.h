// The smallest type that holds the voxels of a volume within a tolerance, from one look at all of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/statistics/quantiles.h"

namespace vkt {

/// How to store a volume. Without a map stored values are rounded to the type; with one a stored value v becomes
/// round((v - low) / (high - low) * codes), and the value map is another.
struct Storage {
    DataType type = DataType::uint8;
    ValueMap values;
    bool maps = false;
    StoredValue low, high; ///< with a map: these become 0 and `codes`
    double codes = 0;
    double error = 0; ///< |physical value then - now| is at most this
};

/// The storage of fewest bytes a voxel whose error is at most `tolerance`, a physical value: of equal ones integers as
/// they are first (unsigned before signed), then floats, then whole numbers counted in their greatest common step from
/// the smallest on (exact), then the values spread over an unsigned type. NaN and infinities are held by floats only.
/// The input's own type where none is smaller; exact with a tolerance of 0, where physical values stay the same bit for
/// bit.
Storage smallest_storage(TypeFit const& fit, Header const& input, double tolerance);

/// Joins what was found in two parts of a volume.
TypeFit joined(TypeFit const& a, TypeFit const& b);

} // namespace vkt
