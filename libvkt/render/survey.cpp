// Histograms of physical values from what was counted.
// SPDX-License-Identifier: MIT
#include "libvkt/render/survey.h"

namespace vkt::render {

Histogram histogram_of(Range const& range, Bins const& bins, ValueMap const& values) {
    Histogram h;
    h.least = values.physical(range.least), h.greatest = values.physical(range.greatest);
    h.bins = bins.counts();
    h.missing = range.missing, h.infinite = range.infinite;
    h.total = h.missing + h.infinite; // percentiles are of the finite rest
    for (std::int64_t const n : h.bins) h.total += n;
    if (values.slope < 0) {
        std::swap(h.least, h.greatest);
        std::reverse(h.bins.begin(), h.bins.end());
    }
    return h;
}

} // namespace vkt::render
