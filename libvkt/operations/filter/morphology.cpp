// Morphology: least and greatest values of boxes and balls, and what is made of them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/buffer.h"
#include "libvkt/engine/travelled.h"
#include "libvkt/operations/filter/box.h"
#include "libvkt/operations/filter/kernels/box_window.h"
#include "libvkt/operations/filter/local_filter.h"

#include <cmath>
#include <numbers>
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

Index3 ball_tile(Index3 radius) {
    return {std::clamp<std::int64_t>(1024 / (radius.x + 1), 64, 512), std::clamp<std::int64_t>(2 * radius.y, 8, 32),
            std::max<std::int64_t>(16, 4 * radius.z)};
}

std::size_t ball_window_bytes(Index3 radius, std::size_t value_bytes, int threads) {
    Index3 const tile = ball_tile(radius);
    std::int64_t const rows = (radius.x + 1) * (2 * radius.z + 1) * (tile.y + 2 * radius.y);
    return static_cast<std::size_t>(rows * (tile.x + 2 * radius.x) * std::max(1, threads)) * value_bytes;
}

namespace {

constexpr std::int64_t most_ball_radius = 32;

/// Erosion takes the least value of a window around each voxel, dilation the greatest; opening dilates what is eroded,
/// closing erodes what is dilated; the gradient is dilation minus erosion, the top hat the volume minus its opening.
/// All are of physical values (with a negative slope the least stored value is the greatest), and of the volume
/// continued without end by the boundary rule: with `mirror` what lies outside never counts, and closing keeps what
/// touches a face. Exact for all types; only differences may clip in signed integer types. NaN counts as larger than
/// all numbers. Boxes cost the same for all radii, balls about pi r^2 comparisons a voxel.
class Morphology : public LocalFilter {
public:
    std::string_view name() const override { return "morphology"; }
    Texts texts() const override {
        return {"Erode, dilate, open, close: least and greatest values around each voxel.",
                "erode takes the least value of a ball or box around each voxel, dilate the greatest; open erodes and "
                "then dilates, close the reverse; gradient is dilate minus erode, tophat the volume minus open. Exact "
                "for every data type. Boxes cost the same whatever their size."
                "\n\n"
                "Accuracy: Exact: voxels are chosen.",
                {{"Close gaps of up to four voxels", "vkt morphology close volume.nrrd --radius 2 -o closed.nrrd"},
                 {"The outline of what is bright", "vkt morphology gradient volume.nrrd --shape box -o outline.nrrd"}}};
    }

    void parameters(Parameters& parameters) override {
        parameters.positional("what", op_, "which of them");
        parameters.option("radius", radius_, "R", "the window reaches R voxels to either side: one number or X,Y,Z");
        parameters.option("shape", shape_, "SHAPE", "of the window");
        LocalFilter::parameters(parameters);
    }

    void check() const override {
        LocalFilter::check();
        if (shape_ == WindowShape::ball)
            for (int axis = 0; axis < 3; ++axis)
                if (radius_.voxels[axis] > most_ball_radius)
                    throw Error(ErrorKind::usage,
                                text("--radius ", radius_.voxels[axis], ": balls have at most ", most_ball_radius),
                                "use --shape box, or resample the volume first");
        radius_.check(most_window_radius);
    }

    std::size_t fit(Index3 largest, Execution const& execution) override {
        Index3 const r = window_, most = twice() ? grow(box_of(largest), r).dims() : largest;
        std::size_t const size = size_of(type_), between = static_cast<std::size_t>(most.x * most.y * most.z) * size;
        std::size_t const windows = shape_ == WindowShape::box ? box_window_bytes(most, r, size, execution)
                                                               : ball_window_bytes(r, size, execution.threads);
        return windows + (twice() || subtracts() ? 2 * between : 0) + outside_bytes(largest, type_, execution);
    }

    bool runs_on_gpu() const override { return true; }

protected:
    void describe(Header const& in, Index3 /*cell_width*/, Plan& plan) const override {
        Index3 const r = without_copies(in, radius_.voxels);
        if (subtracts()) plan.output.values = {std::abs(in.values.slope), 0};
        if (subtracts() && has_region() && !(plan.output.values == in.values))
            throw Error(
                ErrorKind::usage,
                text("morphology ", enum_name(op_),
                     " --roi: differences need a value map without intercept, which would change what is outside"),
                "crop the region instead, or do without --roi");
        auto const n = [](std::int64_t a) { return static_cast<double>(2 * a + 1); };
        double const once = shape_ == WindowShape::box
                                ? std::log2(n(r.x)) + 6
                                : std::numbers::pi / 4 * n(r.y) * n(r.z) + 2 * static_cast<double>(r.x);
        plan.cost = once * (twice() || op_ == MorphologyOp::gradient ? 2 : 1);
        plan.slab_hint = std::max<std::int64_t>(8, (shape_ == WindowShape::box ? 8 : 4) * (twice() ? 2 * r.z : r.z));
        plan.method = shape_ == WindowShape::box ? text("windows, ", 2 * r.x + 1, "x", 2 * r.y + 1, "x", 2 * r.z + 1)
                                                 : text("chords of a ball, radius ", r.x, ",", r.y, ",", r.z);
        auto values = values_read(in, plan);
        plan.passing = ErrorPassing::moved(values);
        if (subtracts()) { // the greater and the less may be off in opposite directions
            if (values) values = ValueInterval{0, values->width()};
            plan.passing = ErrorPassing::computed(2, values);
            plan.passing.storing = ErrorPassing::Storing::whole;
            if (has_region()) plan.passing = {};
        }
        if (subtracts() && !is_integer(in.dtype)) {
            plan.error.kind = ErrorBound::Kind::bound;
            plan.error.range = storing_error(in.dtype);
            plan.error.absolute = std::abs(in.values.slope) * storing_floor(in.dtype);
        }
    }

    void prepare(Header const& in, Index3 /*cell_width*/) override {
        type_ = in.dtype;
        reversed_ = in.values.slope < 0;
        window_ = without_copies(in, radius_.voxels);
        reach_ = twice() ? window_ + window_ : window_;
        // What comes second looks at results outside the volume, which are no folds of those inside.
        folds_ = shape_ == WindowShape::box && !twice();
    }

    void filter(ConstView voxels, AnyView out, Execution const& execution) override {
        Index3 const r = window_;
        ConstView const in = folds_ ? with_outside(voxels, out.box, around_, execution) : voxels;
        auto const take = [&](ConstView from, AnyView to, bool least) {
            WindowExtreme const extreme = least != reversed_ ? WindowExtreme::least : WindowExtreme::greatest;
            if (shape_ == WindowShape::box)
                extreme_of_boxes(from, to, r, beyond_, extreme, execution);
            else
                extreme_of_balls(from, to, r, extreme, execution);
        };
        auto const between = [&](Buffer& bytes, Box const& box) {
            bytes.reserve(static_cast<std::size_t>(box.voxels()) * size_of(type_));
            return dense_view(bytes.write(execution.space()), type_, box, execution.space());
        };
        // The greater minus the less, whichever is which in stored values.
        auto const subtract = [&](ConstView greater, ConstView less) {
            if (reversed_) std::swap(greater, less);
            difference_of(greater, less, out, losses_, execution);
        };
        if (op_ == MorphologyOp::erode || op_ == MorphologyOp::dilate) return take(in, out, op_ == MorphologyOp::erode);
        if (op_ == MorphologyOp::gradient) {
            AnyView const greatest = between(first_, out.box), least = between(second_, out.box);
            take(in, greatest, false);
            take(in, least, true);
            return subtract(greatest, least);
        }
        bool const erodes = op_ != MorphologyOp::close;
        AnyView const first = between(first_, grow(out.box, r));
        take(in, first, erodes);
        if (op_ != MorphologyOp::tophat) return take(first, out, !erodes);
        AnyView const opened = between(second_, out.box);
        take(first, opened, false);
        subtract(in.part(out.box), opened);
    }

private:
    bool twice() const {
        return op_ == MorphologyOp::open || op_ == MorphologyOp::close || op_ == MorphologyOp::tophat;
    }

    bool subtracts() const { return op_ == MorphologyOp::gradient || op_ == MorphologyOp::tophat; }

    MorphologyOp op_ = MorphologyOp::erode;
    Radius radius_;
    WindowShape shape_ = WindowShape::ball;
    Index3 window_; ///< the radius of the volume that was begun
    DataType type_ = DataType::uint8;
    bool reversed_ = false; ///< a negative slope
    Buffer around_, first_, second_;
};

} // namespace

VKT_OPERATION(Morphology, "morphology")

} // namespace vkt
