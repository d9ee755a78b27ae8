// Prefix sums of a volume that comes slab by slab.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

/// What sums are taken in.
enum class ScanSums : std::uint8_t {
    whole, ///< 64-bit integers, which hold all of them
    wide,  ///< 128-bit integers
    real,  ///< float64
    pairs, ///< float64, and what its additions lost
};

/// What is known of the voxels before the next one.
struct ScanState {
    ScanSums sums = ScanSums::whole;
    bool exclusive = false;
    ValueMap map; ///< of real and pairs: what is summed are physical values
    Index3 dims;
    Buffer along_z; ///< of each column, the sum so far
    Buffer above;   ///< of each x, the sum over the rows of this slice so far
    Buffer rows;    ///< sums along x of the slab being worked on

    std::size_t bytes_each() const { return sums == ScanSums::whole || sums == ScanSums::real ? 8 : 16; }
};

/// Sums of the voxels of `in`, which follow the last ones: slices from the first row on, or rows of one slice.
VKT_KERNEL(scan_slab, (ScanState & state, ConstView in, AnyView out, Losses& losses, Execution const& execution),
           (state, in, out, losses, execution))

} // namespace vkt
