// Correlation with a kernel that a file holds.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/read_once.h"
#include "libvkt/operations/common/share_of_range.h"
#include "libvkt/operations/filter/fft_correlation.h"
#include "libvkt/operations/filter/linear_filter.h"

namespace vkt {

/// A kernel of odd extents, x fastest; its middle lies over the voxel that is computed.
struct Kernel {
    Index3 dims{1, 1, 1};
    std::vector<double> weights{1};
};

/// Reads "NX NY NZ" and as many numbers from text ('#' begins a comment), or the physical values of a volume. Throws
/// Error{data} if it is neither, an extent is even, above 129, or a weight is not finite.
Kernel read_kernel(std::string const& path);

/// A sum of products, and what it lacks of the kernel: a share of the sum of its weights' magnitudes, at most.
struct KernelProducts {
    SeparableSum sum;
    double left = 0;
};

/// A kernel as a sum of products of three factors, from crosses through the largest elements of what is left: one
/// product if it is one, and as few sets of x factors as its unfolding has rank. Nothing if what remains is more than
/// this share of the sum of its magnitudes, summed over all weights, if the sum costs more multiply-adds than this, or
/// if the products cancel, so that their rounding would be more than four times that of the weights.
std::optional<KernelProducts> products_of(Kernel const& kernel, double tolerance, double most);

enum class KernelMethod : std::uint8_t { automatic, direct, separable, fft };

template <> struct EnumNames<KernelMethod> {
    static std::vector<std::pair<KernelMethod, char const*>> all() {
        return {{KernelMethod::automatic, "auto"},
                {KernelMethod::direct, "direct"},
                {KernelMethod::separable, "separable"},
                {KernelMethod::fft, "fft"}};
    }
};

/// out(p) = sum over k of kernel(k) v(p + k), in physical values; with --convolve v(p - k). A kernel that is a product
/// of three, or a sum of a few such products, is applied along one axis after the other, where that is less work.
/// Integer weights on integers take no sums of products, which round where the sums themselves may be exact.
class KernelFilter : public LinearFilter {
public:
    std::string_view name() const override { return "filter kernel"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    std::string_view volume_file() const override { return "file"; }
    void take_volume(Source& opened) override;
    void check() const override;
    Box footprint(Box const& output, int input) const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    std::vector<Knob> knobs() const override;

protected:
    void prepare(Header const& in, Index3 cell_width) override;
    Weights weights(Header const& in, Index3 cell_width) const override;
    void filter(ConstView in, AnyView out, Execution const& execution) override;

private:
    std::string file_;
    bool convolve_ = false;
    KernelMethod method_ = KernelMethod::automatic;
    std::optional<ShareOfRange> tolerance_; ///< of the largest magnitude times the sum of the weights' magnitudes
    Index3 dims_;
    std::optional<FftCorrelation> fft_; ///< made when it is needed first
    ReadOnce<Kernel> kernel_;
};

} // namespace vkt
