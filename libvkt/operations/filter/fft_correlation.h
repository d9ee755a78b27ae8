// Correlation with large kernels by Fourier transforms of slices (overlap-save).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/kernels/correlate.h"

#include <vector>

namespace vkt {

/// The squares that slices of a volume are cut into for a kernel of this radius: those that take the least time.
struct FftSquares {
    FftSquares(Index3 radius, Index3 dims);

    std::int64_t edge = 0;
    double cost = 0; ///< multiply-adds a voxel that take as long
    /// A share of the largest magnitude times the sum of the magnitudes of the weights.
    double error(Index3 radius) const;
    /// What a thread needs.
    std::size_t bytes(Index3 radius) const;
};

/// A kernel, transformed slice by slice. Slices are cut into squares that begin at multiples of their step from voxel 0
/// and are transformed two at a time; along z the transforms are added up directly. So a result depends on nothing but
/// the voxels in the square around it in the slices that the kernel reaches, whatever is computed together.
/// Squares with voxels that are not finite, or beyond 1e280, are computed by definition.
class FftCorrelation {
public:
    /// dims: of the volume. Throws Error{failure} without the module.
    FftCorrelation(DenseKernel const& kernel, Index3 dims);

    /// `in` covers the volume grown by the radius in x and y, and the slices of out.box grown by it; out is float64.
    void run(ConstView in, AnyView out, Execution const& execution) const;

private:
    DenseKernel const kernel_;
    Index3 dims_;
    std::int64_t edge_;
    std::vector<double> spectra_; ///< of the kernel's slices, see SpectraLayout
};

} // namespace vkt
