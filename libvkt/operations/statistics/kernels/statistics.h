// Statistics of bands of rows.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/statistics.h"

namespace vkt {

/// One band of rows after the other, as BandStatistics cuts them; products only with the map to physical values.
VKT_KERNEL(band_statistics,
           (ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
            Execution const& execution),
           (slab, origin, product_map, bands, execution))

/// Appends the bands of each slice to slices[z], of which only the first may have had some before; bands are numbered
/// from 0 in their slice. On GPUs, where has_slice_sums().
VKT_KERNEL(slice_statistics,
           (ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, SliceStatistics* slices,
            Execution const& execution),
           (slab, origin, product_map, slices, execution))
/// Sums of these voxels need neither long double nor a fixed order of more than doubles.
inline bool has_slice_sums(DataType type) { return size_of(type) <= 4; }

} // namespace vkt
