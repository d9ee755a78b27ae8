// Filters made of Gaussians: Laplacian of Gaussian, difference of Gaussians, and sharpening.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/filter/linear_filter.h"

namespace vkt {

/// Sampled Gaussian of a standard deviation in voxels, cut off beyond 5 sigma and normalised; exact for constants.
AxisTaps gaussian_average(double sigma);
/// Its sampled second derivative, with middle and scale such that constants and ramps give exactly 0 and x^2 gives 2,
/// for voxels of size h; second differences where sigma is 0.
AxisTaps gaussian_second_derivative(double sigma, double h);

/// Base of the three: --sigma in voxels (of trees: finest cells) or world units, 0 to 100 voxels.
class ScaleFilter : public LinearFilter {
public:
    using LinearFilter::LinearFilter;
    void parameters(Parameters& parameters) override;
    void check() const override;

protected:
    /// In voxels. Throws Error{usage} above 100.
    Vec3 sigma_in_voxels(Header const& in, Index3 cell_width, double factor = 1) const;
    /// Adds a Gaussian and returns its plane along x and y and its taps along z, which have one index.
    static int add_gaussian(Vec3 const& sigma, SeparableSum& sum);

private:
    Vec3 sigma_{1, 1, 1};
    LengthUnit unit_ = LengthUnit::voxel;
};

/// The Laplacian of the smoothed volume, per world unit squared.
class LaplacianOfGaussian : public ScaleFilter {
public:
    std::string_view name() const override { return "filter log"; }
    Texts texts() const override;

protected:
    Weights weights(Header const& in, Index3 cell_width) const override;
};

/// The volume smoothed by sigma minus that smoothed by ratio times sigma.
class DifferenceOfGaussians : public ScaleFilter {
public:
    std::string_view name() const override { return "filter dog"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;

protected:
    Weights weights(Header const& in, Index3 cell_width) const override;

private:
    double ratio_ = 1.6;
};

/// v + amount (v - smoothed v), in the volume's type: integers round half to even and saturate. Constants stay as they
/// are, bit for bit.
class Sharpen : public ScaleFilter {
public:
    Sharpen() : ScaleFilter(true) {}
    std::string_view name() const override { return "filter sharpen"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;

protected:
    Weights weights(Header const& in, Index3 cell_width) const override;

private:
    double amount_ = 1;
};

} // namespace vkt
