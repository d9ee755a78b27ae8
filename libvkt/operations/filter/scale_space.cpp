// Filters made of Gaussians: Laplacian of Gaussian, difference of Gaussians, and sharpening.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/filter/linear_filter.h"

#include <cmath>

namespace vkt {

namespace {

constexpr double most_scale = 100, cut = 5;

/// exp(-k^2 / 2 sigma^2) for k from 0 to 5 sigma.
std::vector<double> sampled_gaussian(double sigma) {
    std::vector<double> taps{1};
    auto const radius = static_cast<int>(std::ceil(cut * sigma));
    for (int k = 1; k <= radius; ++k) taps.push_back(std::exp(-0.5 * (k / sigma) * (k / sigma)));
    return taps;
}

/// Sampled Gaussian of a standard deviation in voxels, cut off beyond 5 sigma and normalised; exact for constants.
AxisTaps gaussian_average(double sigma) {
    std::vector<double> taps = sampled_gaussian(sigma);
    double sum = taps[0];
    for (std::size_t k = 1; k < taps.size(); ++k) sum += 2 * taps[k];
    for (double& tap : taps) tap /= sum;
    return {AxisTaps::Kind::average, taps};
}

/// Its sampled second derivative, with middle and scale such that constants and ramps give exactly 0 and x^2 gives 2,
/// for voxels of size h; second differences where sigma is 0.
AxisTaps gaussian_second_derivative(double sigma, double h) {
    std::vector<double> taps = sampled_gaussian(sigma);
    double moment = 0;
    for (std::size_t k = 1; k < taps.size(); ++k) {
        double const share = static_cast<double>(k) / sigma;
        taps[k] *= share * share - 1;
        moment += taps[k] * static_cast<double>(k * k);
    }
    // Narrow ones vanish, or change sign, between the samples.
    if (taps.size() < 2 || sigma < 0.6) return second_difference(h);
    for (double& tap : taps) tap /= moment * h * h;
    return {AxisTaps::Kind::zero_sum, taps};
}

/// Base of the three: --sigma in voxels (of trees: finest cells) or world units, 0 to 100 voxels.
class ScaleFilter : public LinearFilter {
public:
    using LinearFilter::LinearFilter;
    void parameters(Parameters& parameters) override {
        parameters.option("sigma", sigma_, "S", "standard deviation, one number or X,Y,Z");
        parameters.option("unit", unit_, "UNIT",
                          "unit of --sigma: voxel (of hierarchical volumes: finest cell) or world");
        LinearFilter::parameters(parameters);
    }

    void check() const override {
        LinearFilter::check();
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite(sigma_[axis]) || sigma_[axis] < 0)
                throw Error(ErrorKind::usage, text("--sigma ", sigma_[axis], " is not a finite number >= 0"));
    }

protected:
    /// In voxels. Throws Error{usage} above 100.
    Vec3 sigma_in_voxels(Header const& in, Index3 cell_width, double factor = 1) const {
        Vec3 const sigma = sigma_in_cells(sigma_ * factor, unit_, in, cell_width);
        for (int axis = 0; axis < 3; ++axis)
            if (sigma[axis] > most_scale)
                throw Error(ErrorKind::usage,
                            text(name(), ": a sigma of ", sigma[axis], " voxels is more than ", most_scale),
                            "resample the volume first: vkt resample --scale 0.25");
        return sigma;
    }

    /// Adds a Gaussian and returns its plane along x and y and its taps along z, which have one index.
    static int add_gaussian(Vec3 const& sigma, SeparableSum& sum) {
        auto const index = static_cast<int>(sum.x.size());
        sum.x.push_back(gaussian_average(sigma[0]));
        sum.y.push_back(gaussian_average(sigma[1]));
        sum.z.push_back(gaussian_average(sigma[2]));
        return index;
    }

private:
    Vec3 sigma_{1, 1, 1};
    LengthUnit unit_ = LengthUnit::voxel;
};

/// The Laplacian of the smoothed volume, per world unit squared.
class LaplacianOfGaussian : public ScaleFilter {
public:
    std::string_view name() const override { return "filter log"; }
    Texts texts() const override {
        return {"The Laplacian of the smoothed volume, in world units.",
                "x^2 gives 2, a constant or a ramp exactly 0, and a bright blob a negative value in its middle, most "
                "so where sigma is its radius divided by the square root of 3. Kernels end at 5 sigma."
                "\n\n"
                "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
                "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
                {{"Blobs of about four voxels", "vkt filter log volume.nrrd --sigma 2 -o blobs.nrrd"}}};
    }

protected:
    Weights weights(Header const& in, Index3 cell_width) const override {
        Weights result;
        SeparableSum& sum = result.sum;
        Vec3 const sigma = sigma_in_voxels(in, cell_width), h = in.geometry.spacing;
        int const g = add_gaussian(sigma, sum), second = g + 1;
        sum.x.push_back(gaussian_second_derivative(sigma[0], h[0]));
        sum.y.push_back(gaussian_second_derivative(sigma[1], h[1]));
        sum.z.push_back(gaussian_second_derivative(sigma[2], h[2]));
        sum.planes = {{second, g}, {g, second}, {g, g}};
        sum.terms = {{0, g}, {1, g}, {2, second}};
        result.method = text("Laplacian of Gaussian, sigma ", sigma[0], ",", sigma[1], ",", sigma[2], " voxels");
        return result;
    }
};

/// The volume smoothed by sigma minus that smoothed by ratio times sigma.
class DifferenceOfGaussians : public ScaleFilter {
public:
    std::string_view name() const override { return "filter dog"; }
    Texts texts() const override {
        return {"The volume smoothed little minus the volume smoothed more.",
                "A Gaussian of --sigma minus one of --ratio times as much: what is about as large as sigma stays. A "
                "constant gives exactly 0. Kernels end at 5 sigma."
                "\n\n"
                "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
                "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
                {{"What is about two voxels wide", "vkt filter dog volume.nrrd --sigma 2 -o band.nrrd"}}};
    }

    void parameters(Parameters& parameters) override {
        ScaleFilter::parameters(parameters);
        parameters.option("ratio", ratio_, "K", "the second sigma, divided by the first");
    }

    void check() const override {
        ScaleFilter::check();
        if (!(std::isfinite(ratio_) && ratio_ > 0))
            throw Error(ErrorKind::usage, text("--ratio ", ratio_, " is not a finite number above 0"));
    }

protected:
    Weights weights(Header const& in, Index3 cell_width) const override {
        Weights result;
        SeparableSum& sum = result.sum;
        Vec3 const little = sigma_in_voxels(in, cell_width), more = sigma_in_voxels(in, cell_width, ratio_);
        int const first = add_gaussian(little, sum), second = add_gaussian(more, sum);
        sum.planes = {{first, first}, {second, second}};
        sum.terms = {{0, first}, {1, second, 0, -1}};
        result.method = text("difference of Gaussians, sigma ", little[0], ",", little[1], ",", little[2], " and ",
                             more[0], ",", more[1], ",", more[2], " voxels");
        return result;
    }

private:
    double ratio_ = 1.6;
};

/// v + amount (v - smoothed v), in the volume's type: integers round half to even and saturate. Constants stay as they
/// are, bit for bit.
class Sharpen : public ScaleFilter {
public:
    Sharpen() : ScaleFilter(true) {}
    std::string_view name() const override { return "filter sharpen"; }
    Texts texts() const override {
        return {
            "Raise what smoothing takes away.",
            "v + amount (v - smoothed v), known as an unsharp mask. The data type is kept: integers round half to "
            "even, and what leaves the type is clipped and counted. Constants stay as they are. Kernels end at 5 sigma."
            "\n\n"
            "Accuracy: Bound, known before it runs (--explain prints it): a share of the largest magnitude for the "
            "rounding of sums; integers are rounded once more, to the nearest, ties to even.",
            {{"A little sharper", "vkt filter sharpen volume.nrrd --sigma 1 --amount 0.5 -o sharp.nrrd"}}};
    }

    void parameters(Parameters& parameters) override {
        ScaleFilter::parameters(parameters);
        parameters.option("amount", amount_, "A", "share of what smoothing takes away that is added");
    }

    void check() const override {
        ScaleFilter::check();
        if (!std::isfinite(amount_)) throw Error(ErrorKind::usage, "--amount is not a finite number");
    }

protected:
    Weights weights(Header const& in, Index3 cell_width) const override {
        Weights result;
        SeparableSum& sum = result.sum;
        Vec3 const sigma = sigma_in_voxels(in, cell_width);
        // Smoothed v - v = Dx v + Dy Gx v + Dz Gy Gx v with D = G - 1, whose taps are those of G without the middle
        // one: each is exactly 0 for a constant.
        int const g = add_gaussian(sigma, sum), same = g + 1, difference = g + 2;
        for (auto* const axis : {&sum.x, &sum.y, &sum.z}) {
            AxisTaps taps = axis->front();
            taps.kind = AxisTaps::Kind::zero_sum;
            axis->push_back({});
            axis->push_back(taps);
        }
        sum.planes = {{same, same}, {difference, same}, {g, difference}, {g, g}};
        sum.terms = {{0, same}, {1, same, 0, -amount_}, {2, same, 0, -amount_}, {3, difference, 0, -amount_}};
        result.method = text("unsharp mask, sigma ", sigma[0], ",", sigma[1], ",", sigma[2], " voxels");
        return result;
    }

private:
    double amount_ = 1;
};

} // namespace

VKT_OPERATION(LaplacianOfGaussian, "filter log")
VKT_OPERATION(DifferenceOfGaussians, "filter dog")
VKT_OPERATION(Sharpen, "filter sharpen")

} // namespace vkt
