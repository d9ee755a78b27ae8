// Non-local means: voxels with like surroundings, averaged.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/tunable.h"
#include "libvkt/operations/filter/kernels/nlmeans.h"
#include "libvkt/operations/filter/local_filter.h"

#include <optional>

namespace vkt {

/// The standard deviation of the noise: a number, or what the volume seems to have.
struct NoiseOption {
    bool automatic = false;
    double deviation = 0; ///< physical values
};

template <> struct ValueText<NoiseOption> : OneWord {
    static NoiseOption read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(NoiseOption const& noise);
};

/// Every voxel becomes a mean of those of a search box around it, weighted by how much the patches around both are
/// alike (Buades, Coll and Morel 2005), all of them, patches by sums along the axes (Darbon et al. 2008), in float32;
/// of 32- and 64-bit types in float64, to which 64-bit integers are rounded. The type is kept.
class NlMeans : public LocalFilter, public Tunable {
public:
    std::string_view name() const override { return "filter nlmeans"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;
    /// Smaller boxes and patches than those that are asked for.
    std::vector<Knob> knobs() const override;
    /// Differences across slices are not looked at, nor those across the rows of two pieces.
    void scan(ConstView slab, Execution const& execution) override { count_noise(slab, counts_, execution); }
    std::int64_t scan_step(Index3) const override { return 2; }
    void scan_end() override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    std::vector<Remark> remarks() const override;
    bool reports() const override { return true; }
    bool runs_on_gpu() const override;
    /// Noise and strength, in physical values.
    Report report() const override;

protected:
    void describe(Header const& in, Index3 cell_width, Plan& plan) const override;
    void prepare(Header const& in, Index3 cell_width) override;
    void filter(ConstView in, AnyView out, Execution const& execution) override;

private:
    bool estimates() const { return noise_ && noise_->automatic; }
    void set_noise(double stored);

    Radius patch_{{1, 1, 1}}, search_{{5, 5, 5}};
    std::optional<double> strength_;
    std::optional<NoiseOption> noise_;
    Header input_;
    NlMeansRule rule_;
    NoiseCounts counts_;
    bool copies_ = false;
};

} // namespace vkt
