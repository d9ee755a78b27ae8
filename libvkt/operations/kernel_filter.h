// Correlation with a kernel that a file holds.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/linear_filter.h"

namespace vkt {

/// A kernel of odd extents, x fastest; its middle lies over the voxel that is computed.
struct Kernel {
    Index3 dims{1, 1, 1};
    std::vector<double> weights{1};
};

/// Reads "NX NY NZ" and as many numbers from text ('#' begins a comment), or the physical values of a volume. Throws
/// Error{data} if it is neither, an extent is even, above 129, or a weight is not finite.
Kernel read_kernel(std::string const& path);

/// The factors of a kernel along x, y and z, or nothing if it is no product of three up to this share of the sum of
/// its magnitudes, summed over all weights.
std::optional<std::array<std::vector<double>, 3>> factors_of(Kernel const& kernel, double tolerance);

/// out(p) = sum over k of kernel(k) v(p + k), in physical values; with --convolve v(p - k). A kernel that is a product
/// of three is applied along one axis after the other, where that is less work.
class KernelFilter : public LinearFilter {
public:
    std::string_view name() const override { return "filter kernel"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;

protected:
    void describe(Header const& in, Plan& plan) override;

private:
    std::string file_;
    bool convolve_ = false;
    std::optional<Kernel> kernel_; ///< read once: the file may be a pipe
};

} // namespace vkt
