// Statistics of bands of rows.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics.h"

namespace vkt {

/// One band of rows after the other, as BandStatistics cuts them; products only with the map to physical values.
VKT_KERNEL(band_statistics,
           (ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
            Execution const& execution),
           (slab, origin, product_map, bands, execution))

} // namespace vkt
