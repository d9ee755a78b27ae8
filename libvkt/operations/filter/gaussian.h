// Gaussian: smoothing by direct convolution or by way of a coarser lattice, chosen from the error allowed and the cost.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/boundary_rule.h"
#include "libvkt/core/buffer.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/share_of_range.h"
#include "libvkt/operations/filter/kernels/gaussian_cascade.h"

#include <array>

namespace vkt {

/// Units of lengths that a user gives.
enum class LengthUnit : std::uint8_t { voxel, world };

template <> struct EnumNames<LengthUnit> {
    static std::vector<std::pair<LengthUnit, char const*>> all() {
        return {{LengthUnit::voxel, "voxel"}, {LengthUnit::world, "world"}};
    }
};

/// Standard deviations in cells of this lattice, which are so many finest cells wide (1 in structured volumes), from
/// finest cells or world units. Coarser cells, of which they may be fractions, get that of the sampled Gaussian whose
/// variance is meant.
Vec3 sigma_in_cells(Vec3 const& sigma, LengthUnit unit, Header const& lattice, Index3 cell_width);

enum class GaussianMethod : std::uint8_t { automatic, fir, cascade };

template <> struct EnumNames<GaussianMethod> {
    static std::vector<std::pair<GaussianMethod, char const*>> all() {
        return {
            {GaussianMethod::automatic, "auto"}, {GaussianMethod::fir, "fir"}, {GaussianMethod::cascade, "cascade"}};
    }
};

/// Convolves with the sampled Gaussian exp(-k^2 / 2 sigma^2), cut off and renormalised, along each axis.
///
/// sigma: standard deviation per axis, finite and >= 0, in voxels (hierarchical volumes: finest cells) or world units;
/// 0 leaves the axis alone, a single voxel is left alone by all boundary rules but `border`. On coarse levels, where
/// sigma may be less than a cell, the kernel is the one whose variance is that of sigma; what this and the passing from
/// level to level cost is not bounded. tolerance: allowed error against the infinite kernel as a share of the value
/// range; by default a quarter of the last bit for integers and 1e-4 for floats. The error is bounded a priori: half
/// the L1 distance of the kernels, summed over the axes, as a share of the value range, plus rounding (see
/// GaussianTaps), some of it as a share of the largest magnitude. A constant border is one of the values.
///
/// Two methods share this contract, the cheaper one is taken. Direct: 2 (rx + ry + rz) + 3 multiply-adds per voxel,
/// radius r about 3.5 to 5 sigma. Cascade (see CascadeAxis): 10 to 30 whatever sigma is, as long as it is small beside
/// the volume; its lattice begins at voxel 0, so that results depend, within the bound, on where the volume begins.
///
/// The type is kept, integers round half to even. Intermediates are float32, float64 for 32- and 64-bit integers,
/// float64, and tolerances that float32 cannot meet. Constants are reproduced bit for bit and results stay within the
/// range of the input, 64-bit integers in the 53 bits of float64; a NaN or infinity spreads over the kernel's box
/// around it and no further. Only a border value outside the type makes results clip. One read and one write of
/// memory.
class Gaussian : public Operation, public Tunable {
public:
    Gaussian() = default;
    explicit Gaussian(Vec3 sigma, Boundary boundary = Boundary::mirror) : sigma_(sigma), boundary_{boundary, 0} {}

    std::string_view name() const override { return "filter gaussian"; }
    Shape shape() const override { return Shape::neighbourhood; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    std::vector<Knob> knobs() const override;
    std::optional<double> by_definition(ConstView input, Index3 voxel) const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Plan plan_level(Header const& level, Index3 cell_width) const override;
    void begin_level(Header const& level, Index3 cell_width, Plan const& plan) override;
    /// Grown by what the kernel sees and cut to the volume, because the kernel knows the boundary rule; by the cascade,
    /// of a region that follows the last one, only the slices that run() has not seen yet, unless what lies outside of
    /// --roi is copied.
    Box footprint(Box const& output, int input) const override;
    /// What threads hold of the tiles they work on; or the rings of the cascade.
    std::size_t fit(Index3 largest, Execution const& execution) override;
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override;

    void set_tolerance(double share) { tolerance_ = ShareOfRange{100 * share}; }
    void set_method(GaussianMethod method) { method_ = method; }

private:
    /// How a volume, or a level of a tree, is convolved.
    struct Choice {
        Vec3 sigma; ///< in its voxels
        double tolerance = 0;
        GaussianPasses passes;
        GaussianRounding rounding;              ///< of the passes
        double direct = 0;                      ///< multiply-adds of theirs; 0: no taps beside the middle ones
        std::optional<GaussianCascade> cascade; ///< if that is cheaper
        GaussianRounding cascade_rounding;
        std::string why; ///< there is none
    };
    Choice choose(Header const& in, Vec3 const& sigma) const;
    void choose_taps(Header const& in, double unit, Choice& choice) const;
    void choose_cascade(Header const& in, Choice& choice) const;
    Plan plan_by(Choice const& choice, Header const& in) const;
    void begin_by(Choice choice, Plan const& plan);
    void convolve(ConstView in, AnyView out, Losses& losses, Execution const& execution);
    /// In the type of the computation, and rounded and counted afterwards: kernels of GPUs count nothing.
    void convolve_unclipped(ConstView in, AnyView out, Losses& losses, Execution const& execution);
    Box region_in(Index3 dims) const { return region_.empty() ? box_of(dims) : region_.resolve(dims); }
    CascadePasses cascade() const { return {&choice_.passes, &*choice_.cascade}; }

    Vec3 sigma_{1, 1, 1};
    LengthUnit unit_ = LengthUnit::voxel;
    BoundaryRule boundary_{Boundary::mirror, 0};
    std::optional<ShareOfRange> tolerance_;
    GaussianMethod method_ = GaussianMethod::automatic;
    Roi region_;

    Choice choice_;
    bool copies_ = false;       ///< no taps beside the middle ones
    std::int64_t together_ = 4; ///< slices of the output at once, where there is memory for it
    GaussianPlanes planes_;
    CascadePlanes nodes_;
    std::array<Buffer, 2> unclipped_; ///< what goes into the passes and what comes out of them
    Box box_;                         ///< the region
    Losses counts_;
    Header planned_; ///< output
};

} // namespace vkt
