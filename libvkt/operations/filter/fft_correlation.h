// Correlation with large kernels by Fourier transforms of slices (overlap-save).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/kernels/correlate.h"

#include <complex>

namespace vkt {

/// A kernel, transformed slice by slice. Slices are cut into squares that begin at multiples of their step from voxel 0
/// and are transformed two at a time; along z the transforms are added up directly. So a result depends on nothing but
/// the voxels in the square around it in the slices that the kernel reaches, whatever is computed together.
/// Squares with voxels that are not finite, or beyond 1e280, are computed by definition.
class FftCorrelation {
public:
    /// dims: of the volume. Throws Error{failure} without the module.
    FftCorrelation(DenseKernel const& kernel, Index3 dims);

    /// The edge of the squares for a kernel of this radius, and multiply-adds a voxel that they take as long as.
    static std::int64_t edge_for(Index3 radius);
    static double cost(Index3 radius);
    /// A share of the largest magnitude times the sum of the magnitudes of the weights.
    static double error(Index3 radius);
    /// What a thread needs.
    static std::size_t bytes(Index3 radius);

    /// `in` covers the volume grown by the radius in x and y, and the slices of out.box grown by it; out is float64.
    void run(ConstView in, AnyView out, Execution const& execution) const;

private:
    DenseKernel const kernel_;
    Index3 dims_;
    std::int64_t edge_;
    std::vector<std::complex<double>> spectra_; ///< of one slice of the kernel after the other
};

} // namespace vkt
