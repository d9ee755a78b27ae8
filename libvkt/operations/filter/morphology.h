// Morphology: least and greatest values of boxes and balls, and what is made of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/operations/filter/local_filter.h"

#include <vector>

namespace vkt {

enum class MorphologyOp : std::uint8_t { erode, dilate, open, close, gradient, tophat };
template <> struct EnumNames<MorphologyOp> {
    static std::vector<std::pair<MorphologyOp, char const*>> all() {
        return {{MorphologyOp::erode, "erode"}, {MorphologyOp::dilate, "dilate"},     {MorphologyOp::open, "open"},
                {MorphologyOp::close, "close"}, {MorphologyOp::gradient, "gradient"}, {MorphologyOp::tophat, "tophat"}};
    }
};

enum class WindowShape : std::uint8_t { ball, box };
template <> struct EnumNames<WindowShape> {
    static std::vector<std::pair<WindowShape, char const*>> all() {
        return {{WindowShape::ball, "ball"}, {WindowShape::box, "box"}};
    }
};

/// Erosion takes the least value of a window around each voxel, dilation the greatest; opening dilates what is eroded,
/// closing erodes what is dilated; the gradient is dilation minus erosion, the top hat the volume minus its opening.
/// All are of physical values (with a negative slope the least stored value is the greatest), and of the volume
/// continued without end by the boundary rule: with `mirror` what lies outside never counts, and closing keeps what
/// touches a face. Exact for all types; only differences may clip in signed integer types. NaN counts as larger than
/// all numbers. Boxes cost the same for all radii, balls about pi r^2 comparisons a voxel.
class Morphology : public LocalFilter {
public:
    std::string_view name() const override { return "morphology"; }
    Texts texts() const override;
    void parameters(Parameters& parameters) override;
    void check() const override;
    std::size_t fit(Index3 largest, Execution const& execution) override;
    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 cell_width, Plan& plan) const override;
    void prepare(Header const& in, Index3 cell_width) override;
    void filter(ConstView voxels, AnyView out, Execution const& execution) override;

private:
    bool twice() const;
    bool subtracts() const;

    MorphologyOp op_ = MorphologyOp::erode;
    Radius radius_;
    WindowShape shape_ = WindowShape::ball;
    Index3 window_; ///< the radius of the volume that was begun
    DataType type_ = DataType::uint8;
    bool reversed_ = false; ///< a negative slope
    Buffer around_, first_, second_;
};

} // namespace vkt
