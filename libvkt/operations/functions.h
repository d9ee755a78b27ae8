// Operations as functions of C++, one line each: vkt::gaussian(volume, {.sigma = 2}).
// What they leave out is told to apply() in words, as on the command line.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/volume.h"
#include "libvkt/engine/registry.h"
#include "libvkt/operations/statistics/statistics.h"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// One number for all axes, or three: `{.sigma = 2}`, `{.sigma = {2, 2, 0.5}}`.
struct PerAxis {
    Vec3 value{0, 0, 0};
    PerAxis(double all) : value{all, all, all} {}
    PerAxis(double x, double y, double z) : value{x, y, z} {}
    PerAxis(Vec3 each) : value(each) {}
};

/// A region of voxels, "X0:X1,Y0:Y1,Z0:Z1" as --roi takes it, or a box; empty: everything.
struct Region {
    std::string text;
    Region() = default;
    Region(char const* words) : text(words) {}
    Region(std::string words) : text(std::move(words)) {}
    Region(Box const& box);
};

/// How a volume continues outside.
struct Outside {
    Boundary rule = Boundary::mirror;
    double value = 0; ///< physical, of Boundary::border
    Outside(Boundary boundary, double border = 0) : rule(boundary), value(border) {}
};

// Every function takes a volume and returns another, throws what apply() throws, and keeps type, value map and place in
// the world as the command of its name does; `how` says where it runs, who watches, and takes remarks. Complexity and
// errors are those of the operation; see vkt-accuracy(7).

/// Gaussian smoothing; lengths in voxels, or in world units.
struct GaussianOptions {
    PerAxis sigma = 1;
    bool world = false;
    Outside boundary = Boundary::mirror;
    std::optional<double> tolerance{}; ///< allowed error, in per cent of the range of values
    Region roi{};                      ///< smooth only there
};
Volume gaussian(Volume const& volume, GaussianOptions const& options = {}, CallOptions const& how = {});

/// Median of the box of (2 radius + 1)^3 voxels; 0 to 64 along each axis.
struct MedianOptions {
    PerAxis radius = 1;
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume median(Volume const& volume, MedianOptions const& options = {}, CallOptions const& how = {});

/// Smoothing that keeps edges. Throws Error{usage} without a deviation of values.
struct BilateralOptions {
    PerAxis sigma = 1;
    double range_sigma = 0; ///< deviation of values, above 0
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume bilateral(Volume const& volume, BilateralOptions const& options, CallOptions const& how = {});

/// Mean of the box of (2 radius + 1)^3 voxels; the cost hardly depends on it.
struct BoxOptions {
    PerAxis radius = 1;
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume box_mean(Volume const& volume, BoxOptions const& options = {}, CallOptions const& how = {});

/// First derivatives in world units: their length, or that along one axis of the volume.
struct DerivativeOptions {
    std::string component = "magnitude"; ///< or x, y, z
    Outside boundary = Boundary::mirror;
    Region roi{};
    std::optional<DataType> dtype{}; ///< float32, or float64 of what that does not hold
};
Volume gradient(Volume const& volume, DerivativeOptions const& options = {}, CallOptions const& how = {});
/// The same with Sobel's smoothing across.
Volume sobel(Volume const& volume, DerivativeOptions const& options = {}, CallOptions const& how = {});

/// Sum of the second derivatives, of the volume or (`sigma` above 0) of its Gaussian.
struct LaplacianOptions {
    std::optional<PerAxis> sigma{}; ///< voxels
    Outside boundary = Boundary::mirror;
    Region roi{};
    std::optional<DataType> dtype{};
};
Volume laplacian(Volume const& volume, LaplacianOptions const& options = {}, CallOptions const& how = {});

/// What a Gaussian takes away is added `amount` times.
struct SharpenOptions {
    PerAxis sigma = 1;
    double amount = 1;
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume sharpen(Volume const& volume, SharpenOptions const& options = {}, CallOptions const& how = {});

/// Means over voxels whose surroundings are alike.
struct NlmeansOptions {
    std::optional<double> noise{};    ///< its deviation; without one it is estimated
    std::optional<double> strength{}; ///< differences that are averaged; without one 0.8 of the noise
    PerAxis patch = 1, search = 5;
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume nlmeans(Volume const& volume, NlmeansOptions const& options = {}, CallOptions const& how = {});

/// "erode", "dilate", "open", "close", "gradient" or "tophat", of grey values too.
struct MorphologyOptions {
    PerAxis radius = 1;
    std::string shape = "ball"; ///< or box
    Outside boundary = Boundary::mirror;
    Region roi{};
};
Volume morphology(std::string const& what, Volume const& volume, MorphologyOptions const& options = {},
                  CallOptions const& how = {});

/// Contrast-limited adaptive histogram equalisation.
struct ClaheOptions {
    double clip = 2; ///< as OpenCV defines it
    Index3 bricks{8, 8, 8};
    int bins = 256;
};
Volume clahe(Volume const& volume, ClaheOptions const& options = {}, CallOptions const& how = {});

/// Another grid for the same content: say one of dims, scale and spacing.
struct ResampleOptions {
    std::optional<Index3> dims{};
    std::optional<PerAxis> scale{};   ///< factor for the numbers of voxels
    std::optional<PerAxis> spacing{}; ///< world units
    std::string method = "auto";      ///< nearest, linear, cubic, bspline3, bspline5, lanczos3, average
    std::optional<DataType> dtype{};
};
Volume resample(Volume const& volume, ResampleOptions const& options, CallOptions const& how = {});

/// Turned by degrees, counter-clockwise seen from the tip of the axis, which is a direction along the volume's axes.
struct RotateOptions {
    double angle = 0;
    Vec3 axis{0, 0, 1};
    std::optional<Vec3> about{}; ///< in voxels; the middle
    bool expand = false;         ///< make the grid as large as it takes
    std::string method = "auto";
    std::optional<double> background{};
    Region roi{}; ///< turn only what is there, within it
};
Volume rotate(Volume const& volume, RotateOptions const& options, CallOptions const& how = {});

/// So many times as large.
struct ScaleOptions {
    PerAxis factor = 1;
    std::optional<Vec3> about{}; ///< in voxels; the middle
    bool expand = false;
    std::string method = "auto";
    std::optional<double> background{};
    Region roi{};
};
Volume scale(Volume const& volume, ScaleOptions const& options, CallOptions const& how = {});

/// Moved by a map of three rows of four numbers, which says where in the input a place of the result lies.
struct AffineOptions {
    std::array<double, 12> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    bool voxels = false;  ///< what the numbers are about; else the world
    bool inverse = false; ///< the map says where content goes
    bool expand = false;
    std::string method = "auto";
    std::optional<double> background{};
    Region roi{};
};
Volume affine(Volume const& volume, AffineOptions const& options, CallOptions const& how = {});

/// The content mirrored; voxels keep their places in the world.
Volume flip(Volume const& volume, Axis axis, CallOptions const& how = {});
/// The voxels of a region.
Volume crop(Volume const& volume, Region const& roi, CallOptions const& how = {});

/// A volume in the place of another's voxels from `at` on.
Volume paste(Volume const& part, Volume const& into, Index3 at, CallOptions const& how = {});
/// Axes in another order ("zyx"), or towards those of the body ("RAS"); voxels keep their places in the world.
Volume permute(Volume const& volume, std::string const& order, CallOptions const& how = {});
/// One slice, one voxel thick; negative numbers count from the end.
Volume slice(Volume const& volume, Axis axis, std::int64_t at, CallOptions const& how = {});
/// "max", "min", "mean", "sum", "std" or "median" along an axis, one voxel thick.
struct ProjectOptions {
    Axis axis = Axis::z;
    Region roi{};
};
Volume project(std::string const& what, Volume const& volume, ProjectOptions const& options = {},
               CallOptions const& how = {});

/// So many more voxels below and above each axis.
struct PadOptions {
    Index3 below{0, 0, 0}, above{0, 0, 0};
    Outside boundary = Boundary::border;
};
Volume pad(Volume const& volume, PadOptions const& options, CallOptions const& how = {});

/// One value everywhere, or in a region.
struct FillOptions {
    double value = 0; ///< physical
    Region roi{};
};
Volume fill(Volume const& volume, FillOptions const& options = {}, CallOptions const& how = {});

/// 1 where values are strictly between `above` and `below`, 0 elsewhere, in uint8. Without both, above the threshold of
/// Otsu.
struct ThresholdOptions {
    std::optional<double> above{}, below{}; ///< physical
    Region roi{};
};
Volume threshold(Volume const& volume, ThresholdOptions const& options = {}, CallOptions const& how = {});

/// Connected components of what is not 0, numbered from 1.
struct LabelOptions {
    int connectivity = 6; ///< 6, 18 or 26
    std::optional<std::int64_t> keep_largest{};
    std::int64_t min_size = 1; ///< voxels
    DataType dtype = DataType::uint32;
};
Volume label(Volume const& volume, LabelOptions const& options = {}, CallOptions const& how = {});

/// Euclidean distance of voxels that are not 0 to the nearest that is, in world units or in voxels.
struct DistanceOptions {
    bool both_sides = false; ///< zero voxels get minus the distance to the nearest other one
    bool voxels = false;
};
Volume distance(Volume const& volume, DistanceOptions const& options = {}, CallOptions const& how = {});

/// Zero voxels that something encloses get its value.
Volume fill_holes(Volume const& volume, int connectivity = 6, CallOptions const& how = {});

/// Floods from the minima, or from markers, each voxel getting the number of what reached it first.
struct WatershedOptions {
    std::optional<Volume> markers{}; ///< labels from 1; 0: none
    double depth = 0;                ///< without markers: of the minima that count
    std::string on = "value";        ///< value, gradient or distance
    int connectivity = 6;
    bool line = false; ///< voxels between two floods stay 0
};
Volume watershed(Volume const& volume, WatershedOptions const& options = {}, CallOptions const& how = {});

/// Sums of all voxels below along each axis, with the voxel's own (or without it).
Volume scan(Volume const& volume, bool exclusive = false, CallOptions const& how = {});

/// What an expression makes of each voxel: "v * 2 + x", "v[1,0,0] - v", with `a`, `b` … for the volumes behind the
/// first.
struct TransformOptions {
    std::vector<Volume> others{};      ///< of the same grid
    std::optional<Outside> boundary{}; ///< of expressions that look at neighbours; mirror
    Region roi{};
    std::optional<DataType> dtype{};
};
Volume transform(std::string const& expression, Volume const& volume, TransformOptions const& options = {},
                 CallOptions const& how = {});

/// Another type, values kept, rounded half to even and limited to what it holds.
Volume convert(Volume const& volume, DataType type, CallOptions const& how = {});

/// arith NAME: "add", "sub", "mul", "div", "min", "max", "absdiff", … of two volumes of one grid, or with a number.
Volume arith(std::string const& name, Volume const& a, Volume const& b, CallOptions const& how = {});
Volume arith(std::string const& name, Volume const& a, double b, CallOptions const& how = {});

/// Counts, extremes and where they are, sum, mean, variance, product.
struct StatsOptions {
    Region roi{};
};
StatisticsResult stats(Volume const& volume, StatsOptions const& options = {}, CallOptions const& how = {});

} // namespace vkt
