// Rows of voxels as rows of bits: who is an object, and where values change.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <optional>

namespace vkt {

/// Which voxels get a bit. `zero` is the stored value of what is physically 0; without one, no voxel is.
enum class BitRule : std::uint8_t {
    object,  ///< neither zero nor NaN
    hole,    ///< zero
    changed, ///< differs from the voxel to the left of it; the first of a row always does
    number,  ///< not NaN
};

/// Words of 64 bits that a row of n voxels takes.
constexpr std::int64_t bit_words(std::int64_t n) { return (n + 63) / 64; }

/// Rows of `in`, one after the other, each from a new word on; voxel i of a row is bit i % 64 of its word i / 64. Bits
/// beyond the row are 0.
VKT_CPU_KERNEL(pack_bits,
               (ConstView in, BitRule rule, std::optional<double> zero, std::uint64_t* bits,
                Execution const& execution),
               (in, rule, zero, bits, execution))

} // namespace vkt
