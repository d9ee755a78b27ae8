// Otsu's threshold of a volume, from an exact histogram.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/common/number.h"
#include "libvkt/operations/statistics/kernels/bins.h"

#include <vector>

namespace vkt {

/// Otsu's method ("A threshold selection method from gray-level histograms", 1979): of all ways to cut the histogram in
/// two, the first with the largest variance between the classes, as scikit-image's threshold_otsu has it. The histogram
/// has a bin for every value of integers that span at most 65536 values (types of 16 bits take one pass, others a first
/// one for the extremes), and 256 bins between the extremes for all others, of which the threshold is the centre of the
/// last in the lower class. Counts are exact, so that neither slabs nor threads matter. NaN and infinities are left
/// out; of a constant volume the threshold is its value.
class Otsu {
public:
    /// `falling`: physical values fall where stored ones rise, which decides between equally good cuts.
    Otsu(DataType type, bool falling);

    void add(ConstView slab, Execution const& execution);
    /// After every voxel was added once: true if all must be added once more. Throws Error{data} if no voxel is finite,
    /// or if the extremes are further apart than float64 can say.
    bool end_pass();
    /// The stored value at the cut, after the last pass; what lies beyond it (below it if falling) is foreground.
    Number threshold() const;

    static constexpr std::size_t state_bytes = std::size_t{65536} * 8;

private:
    DataType type_;
    bool falling_, counts_ = false;
    bool any_ = false; ///< finite voxel
    double low_ = 0, high_ = 0;
    Int128 whole_low_ = 0, whole_high_ = 0;
    BinRule bins_;
    std::vector<std::int64_t> counters_;
};

} // namespace vkt
