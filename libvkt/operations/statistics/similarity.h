// How alike two volumes are: structural similarity and mutual information.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/engine/source.h"

namespace vkt {

/// The mean structural similarity index (Wang, Bovik, Sheikh and Simoncelli, 2004) of physical values: Gaussian window
/// of standard deviation 1.5 cut at 5 voxels, K1 0.01, K2 0.03, population covariances; what lies within 5 voxels of a
/// face is left out. `range` is that of the data. Axes of fewer than 11 voxels are mirrored at their ends and left
/// whole, axes of 1 have no window. NaN if a voxel is not finite. The same bits for every thread count and budget.
///
/// Both sources can be read anywhere and have the same dims; neither is finished. Holds blocks of some MiB.
double structural_similarity(Source& a, Source& b, double range, Execution const& execution);

/// From the joint histogram of physical values, each volume's own range in so many equal bins (as numpy.histogram2d).
struct MutualInformation {
    double information = 0; ///< in nats
    double normalised = 0;  ///< (Ha + Hb) / Hab (Studholme, 1999), from 1 to 2; 2 if both entropies are 0
};

/// Pairs of which one is not finite do not count. As above.
MutualInformation mutual_information(Source& a, Source& b, int bins, Execution const& execution);

} // namespace vkt
