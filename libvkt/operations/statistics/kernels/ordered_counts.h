// Counting voxels by the next bits of their patterns, arranged to ascend with the values: a step of finding
// percentiles.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

namespace vkt {

/// Voxels whose ordered_bits() begin with the `known` bits of a prefix, a class for each.
struct OrderedClasses {
    DataType type;
    int known = 0;
    int count = 0;
    std::uint64_t const* prefixes = nullptr; ///< on the host

    /// Bits that are looked at next, and those that are left after them.
    VKT_HD int next() const { return rest() < 16 ? rest() : 16; }
    VKT_HD int left() const { return rest() - next(); }
    /// Counters of a class: the last counts voxels that are none of it on GPUs, and nothing on CPUs.
    VKT_HD std::size_t counters() const { return (std::size_t{1} << next()) + 1; }

private:
    VKT_HD int rest() const { return static_cast<int>(8 * size_of(type)) - known; }
};

/// Adds the finite voxels of every class to its counters, by their next bits. `sets`: so many lists of counters, class
/// after class, one of which each thread has for itself; a GPU needs one, in its memory.
VKT_KERNEL(count_ordered,
           (ConstView in, OrderedClasses const& classes, std::uint64_t* const* sets, int threads,
            Execution const& execution),
           (in, classes, sets, threads, execution))

} // namespace vkt
