// Transfer functions: control points from value to colour and opacity, and the tables that integrators look up.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/render/colormap.h"
#include "libvkt/render/inner/optics.h"
#include "libvkt/render/inner/scene.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace vkt::render {

/// Opacity is that of a layer as thick as the unit distance: alpha in [0,1]. Colours are sRGB unless said otherwise.
struct ControlPoint {
    double value = 0; ///< physical
    Color color;
    double alpha = 0;
    friend bool operator==(ControlPoint const&, ControlPoint const&) = default;
};

/// Linear in extinction and colour between control points (never in alpha), constant beyond the ends. Two points at one
/// value make a step.
struct TransferFunction {
    std::vector<ControlPoint> points;
    bool linear_colors = false; ///< colours are linear light, not sRGB
    double unit = 0;            ///< world length for which alpha holds; 0: not said

    /// Throws Error{usage}: no points, values not finite, alpha or colour outside [0,1]. Sorts by value.
    void check_and_sort();
    friend bool operator==(TransferFunction const&, TransferFunction const&) = default;
};

/// Largest extinction times unit distance: alpha = 1 transmits 1e-7 of the light over the unit distance.
inline constexpr double most_extinction = 16;

/// Extinction per unit distance of an opacity in [0,1]: -ln(1 - alpha), at most 16.
double extinction_of(double alpha);

/// The 4n numbers r g b a … as n equidistant points over [lower, upper] (one entry: constant). Colours are sRGB.
/// Throws Error{usage} unless the count is a positive multiple of 4 and all lie in [0,1].
TransferFunction transfer_from_lut(std::vector<double> const& rgba, double lower, double upper);

/// {"points": [[value, r, g, b, a], …], "unit": u, "colors": "srgb" | "linear", "domain": [lo, hi]}. With a domain,
/// values of the points run from 0 to 1 over it. Also a list of presets as ParaView exports them, of which the first
/// counts: colours from "RGBPoints", opacities from "Points" (without: rising from 0 to 1). Throws Error{data}.
TransferFunction transfer_from_json(std::string const& json);
std::string transfer_to_json(TransferFunction const& transfer);
/// What ParaView imports as a preset of this name. Its opacities run in straight lines where ours bend, so that there
/// are points between.
std::string transfer_to_paraview(TransferFunction const& transfer, std::string const& name);
/// alpha between two others as it runs there, in a straight line of extinctions: share 0 gives a, 1 gives b.
double alpha_between(double a, double b, double share);

/// How stored values become those that rays sample, which are floats: (stored - offset) * scale. The scale is a power
/// of two, so that it rounds nothing; it keeps values of any size where floats are precise.
struct Rescaling {
    double offset = 0, scale = 1;
    /// Limited, so that differences are floats: what lies further out differs from nothing there.
    static constexpr double limit = 0x1p100;
    double of(double stored) const;
};

/// Knots in sampled values, ascending. Extinctions are per world
/// length (unit in world units), multiplied by `scale` and then limited; colours are linear.
std::vector<Knot> knots_of(TransferFunction const& transfer, ValueMap const& values, Rescaling const& rescaling,
                           double unit, double scale);

/// Those of them between which the extinction is linear but for rounding, the first and the last included.
std::vector<Knot> bends_of(std::vector<Knot> const& knots);

/// The knots sampled at equidistant nodes with running integrals, and maxima over ranges for majorants.
class TransferTable {
public:
    /// `nodes` equidistant nodes from the first to the last knot. Features narrower than a node's distance keep their
    /// integral.
    explicit TransferTable(std::vector<Knot> const& knots, int nodes = 1024);

    TableView view() const { return {nodes_.data(), count_, origin_, scale_, hidden_}; }
    /// An upper bound of the extinction for stored values in [lowest, highest] and what rounding makes of
    /// them; 0 only if nothing can be seen there.
    float greatest_extinction(float lowest, float highest) const;

    /// Nodes that values in [lowest, highest] may touch; `slack` is a distance in nodes.
    struct Nodes {
        std::int32_t first, last;
    };
    Nodes nodes_of(float lowest, float highest, float slack) const;
    int count() const { return count_; }
    /// For every node, and the end, how many nodes before it have some extinction.
    std::vector<std::uint32_t> visible_before() const;

private:
    std::vector<Quad> nodes_;
    std::vector<std::vector<float>> greatest_; ///< level l: maxima over 2^l nodes
    int count_ = 0;
    float origin_ = 0, scale_ = 1;
    float hidden_ = 0; ///< see TableView
};

/// Counts of stored values as physical ones, in equal bins from the least to the greatest.
struct Histogram {
    double least = 0, greatest = 0; ///< finite physical values
    std::vector<std::int64_t> bins;
    std::int64_t total = 0, missing = 0, infinite = 0;

    /// The value after so many bins.
    double value_at(double bin) const { return std::lerp(least, greatest, bin / static_cast<double>(bins.size())); }
    double center(std::size_t i) const { return value_at(static_cast<double>(i) + 0.5); }
    /// The value below which the share p of the finite voxels lies.
    double percentile(double p) const;
};

/// "lo:hi" with lo below hi, "minmax", "pA:pB" (percentiles) or "auto". Throws Error{usage}.
struct Domain {
    std::string text = "auto";
    double lower = 0, upper = 1;
};
Domain resolve_domain(std::string const& text, Histogram const& histogram);

} // namespace vkt::render
