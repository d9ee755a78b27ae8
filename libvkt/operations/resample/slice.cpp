// Slice: a plane of a volume, as a volume of one slice or as a picture.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/prepared.h"
#include "libvkt/kernel/border.h"
#include "libvkt/operations/resample/oblique_slice.h"
#include "libvkt/operations/voxels/axis_order.h"
#include "libvkt/operations/voxels/convert.h"
#include "libvkt/operations/voxels/kernels/permute.h"

#include <array>
#include <cmath>
#include <optional>

namespace vkt {

namespace {

/// The voxels with one index along an axis. The axes that are left keep their order and become x and y; origin, spacing
/// and directions move along, so that voxels keep their world positions. Bytes are moved. With a range, values in it
/// are mapped to 0 … 255 as Convert does (uint8), percentiles being those of the slice. With a normal the plane lies at
/// any angle, and is sampled, see ObliqueSlice.
class Slice : public Operation, public Prepared {
public:
    std::optional<Axis> axis;
    std::array<std::optional<std::int64_t>, 3> index; ///< negative: from the end
    std::optional<RangeOption> range;
    ObliquePlane oblique;

    std::string_view name() const override { return "slice"; }
    Texts texts() const override {
        return {
            "Take a slice of a volume, as a volume or as a picture.",
            "The result has one slice; it keeps its place in the world. As .png or .pgm it is a grey picture, a pixel "
            "a voxel, the first row on top: of uint8 and uint16 as they are, of all types with --range. As .exr or "
            ".pfm it holds the values as floats. With --normal the plane lies at any angle in the world and is "
            "sampled; with --thickness it is the mean, maximum or minimum of a slab."
            "\n\n"
            "Accuracy: Exact along the axes, and where all pixels of a plane fall on voxels: bytes are moved, world "
            "positions survive. Other planes are sampled as vkt affine does, within the bound that --explain prints.",
            {{"A picture of a slice of a CT", "vkt slice volume.nrrd --z 12 --range 0:200 -o slice.png"},
             {"The middle, as values", "vkt slice volume.nrrd --axis x | vkt stats"},
             {"An oblique slice, a slab of ten units averaged",
              "vkt slice volume.nrrd --normal 1,1,0 --up 0,0,1 --spacing 1 --thickness 10 --range 0:200 -o "
              "oblique.png"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override {
        parameters.option("axis", axis, "AXIS", "axis to cut across (z); without an index its middle");
        parameters.option("x", index[0], "N", "the slice with this x; negative numbers count from the end");
        parameters.option("y", index[1], "N", "the slice with this y");
        parameters.option("z", index[2], "N", "the slice with this z");
        parameters.option("range", range, "LO:HI|minmax|pA:pB", "map these values to 0 … 255, as uint8");
        parameters.option("normal", oblique.normal, "X,Y,Z",
                          "a plane at any angle: the direction across it, in world coordinates");
        parameters.option("at", oblique.at, "X,Y,Z",
                          "a point of that plane, in world coordinates (the volume's middle)");
        parameters.option("up", oblique.up, "X,Y,Z",
                          "the direction of the world that points upwards in a picture, seen along the normal (rows "
                          "and columns as across the nearest axis)");
        parameters.option("spacing", oblique.spacing, "S",
                          "size of its pixels in world units (as the voxels are there)");
        parameters.option("thickness", oblique.thickness, "T", "a slab so thick around the plane, in world units");
        parameters.option("project", oblique.project, "KIND", "what becomes of the slab: mean (default), max or min");
        parameters.option(
            "method", oblique.method, "METHOD",
            "how planes are sampled: auto (default), nearest, linear, cubic, bspline3, bspline5 or lanczos3");
        parameters.option("background", oblique.background, "VALUE",
                          "value where the plane lies outside the volume (0)");
    }

    void check() const override {
        oblique.check();
        if (oblique.normal && (axis || index[0] || index[1] || index[2]))
            throw Error(ErrorKind::usage, "--normal says where the slice lies: --axis, --x, --y and --z do not apply",
                        "a point of the plane is given by --at X,Y,Z");
        int const given = (index[0] ? 1 : 0) + (index[1] ? 1 : 0) + (index[2] ? 1 : 0);
        if (given > 1) throw Error(ErrorKind::usage, "a slice has one index: give one of --x, --y and --z");
        if (axis && given == 1 && sliced_axis() != static_cast<int>(*axis))
            throw Error(ErrorKind::usage, text("--axis ", enum_name(*axis), " and the index are about different axes"));
    }

    /// Throws Error{usage} if the index, or the plane, lies outside of the volume.
    Plan plan(std::span<Header const> inputs) const override {
        if (oblique.normal) return plan_oblique(inputs);
        Header const& in = inputs[0];
        Header const slice = cut_out(in);
        Plan plan;
        if (range) {
            plan = conversion().plan({&slice, 1});
            plan.method = "copy, " + plan.method;
            return plan;
        }
        plan.output = slice;
        plan.method = "copy";
        plan.cost = 0;
        plan.passing = ErrorPassing::moved(values_of(in));
        if (sliced_axis() == 2) plan.shift = plane_in(in.dims).lower;
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const& plan) override {
        Header const& in = inputs[0];
        type_ = in.dtype;
        sampled_plane_.reset();
        if (oblique.normal) {
            sampled_plane_.emplace(oblique);
            Header const sampled = sampled_plane_->plan(inputs).output;
            plane_ = box_of(sampled.dims);
            axes_ = {0, 1, 2};
            if (!range) return;
            convert_ = conversion();
            convert_.begin({&sampled, 1}, plan);
            return;
        }
        axes_ = axes_without(sliced_axis());
        plane_ = plane_in(in.dims);
        if (!range) return;
        Header const slice = cut_out(in);
        convert_ = conversion();
        convert_.begin({&slice, 1}, plan);
    }

    /// The sampled plane.
    Operation* preparation() override { return sampled_plane_ ? &*sampled_plane_ : nullptr; }
    Box footprint(Box const& output, int) const override {
        if (sampled_plane_) return output;
        Box box = plane_;
        for (std::size_t k = 0; k < 2; ++k) {
            box.lower[axes_[k]] = output.lower[static_cast<int>(k)];
            box.upper[axes_[k]] = output.upper[static_cast<int>(k)];
        }
        return box;
    }

    Box scanned(Box const& whole) const override { return sampled_plane_ ? whole : plane_; }
    void scan(ConstView slab, Execution const& execution) override { convert_.scan(slab, execution); }
    void scan_end() override { convert_.scan_end(); }
    bool scans_again() const override { return convert_.scans_again(); }
    void after_scan(Plan& plan) const override { convert_.after_scan(plan); }
    std::size_t fit(Index3 largest, Execution const&) override {
        return range && !sampled_plane_ ? static_cast<std::size_t>(box_of(largest).voxels()) * size_of(type_) : 0;
    }

    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        ConstView const in = inputs[0].part(footprint(out.box, 0));
        if (sampled_plane_) return range ? convert_.run({&in, 1}, out, execution) : copy_region(in, out, execution);
        if (!range) return permute_box(in, out, axes_, {}, execution);
        staging_.reserve(static_cast<std::size_t>(out.box.voxels()) * size_of(type_));
        AnyView const staged = dense_view(staging_.write(out.space), type_, out.box, out.space);
        permute_box(in, staged, axes_, {}, execution);
        ConstView const slice = staged;
        convert_.run({&slice, 1}, out, execution);
    }

    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return convert_.counters(); }
    std::vector<Remark> remarks() const override {
        std::vector<Remark> result;
        if (range) result = convert_.remarks();
        for (Remark& remark : result) remark.lossy = false; // to cut off is what a range is for
        if (!sampled_plane_) return result;
        auto const sampled = sampled_plane_->remarks();
        result.insert(result.begin(), sampled.begin(), sampled.end());
        return result;
    }

private:
    int sliced_axis() const {
        for (std::size_t a = 0; a < 3; ++a)
            if (index[a]) return static_cast<int>(a);
        return axis ? static_cast<int>(*axis) : 2;
    }

    Box plane_in(Index3 dims) const {
        int const across = sliced_axis();
        std::int64_t const n = dims[across], asked = index[static_cast<std::size_t>(across)].value_or(n / 2);
        std::int64_t const at = asked < 0 ? asked + n : asked;
        if (at < 0 || at >= n)
            throw Error(ErrorKind::usage,
                        text("--", enum_name(static_cast<Axis>(across)), " ", asked,
                             " is outside of the volume, which has ", n, " slices across it"),
                        text("the first is 0, the last ", n - 1));
        Box plane = box_of(dims);
        plane.lower[across] = at;
        plane.upper[across] = at + 1;
        return plane;
    }

    /// The plane as a volume, with the values of the input.
    Header cut_out(Header const& in) const {
        Box const plane = plane_in(in.dims);
        Header cut = in;
        cut.dims = plane.dims();
        cut.geometry = cropped(in.geometry, plane.lower);
        if (cut.part) cut.part = {cut.part->global_dims, cut.part->offset + plane.lower, {}};
        return with_axes(cut, axes_without(sliced_axis()));
    }

    /// Of what is cut out, with a range.
    Convert conversion() const {
        Convert convert;
        convert.range = range;
        convert.dtype = DataType::uint8;
        return convert;
    }

    /// What runs is about the plane once it is sampled; what is said beforehand is about the volume.
    Plan plan_oblique(std::span<Header const> inputs) const {
        Plan const sampled = ObliqueSlice(oblique).plan(inputs);
        Plan plan = sampled;
        if (range) {
            plan = conversion().plan({&sampled.output, 1});
            plan.access = sampled.access;
            plan.slab_hint = sampled.slab_hint;
            plan.cost += sampled.cost;
            plan.state_bytes += sampled.state_bytes;
            plan.method = text(sampled.method, ", ", plan.method);
            // A range keeps physical values: what sampling costs comes on top.
            plan.error.kind = std::max(plan.error.kind, sampled.error.kind);
            plan.error.range += sampled.error.range;
            plan.error.magnitude += sampled.error.magnitude;
            plan.error.absolute += sampled.error.absolute;
            plan.passing.gain = sampled.passing.gain;
        }
        plan.shift.reset();
        return plan;
    }

    std::array<int, 3> axes_{0, 1, 2}; ///< axis k of the result is axis axes_[k] of the input; the last is sliced
    Box plane_;                        ///< of the input
    DataType type_ = DataType::uint8;  ///< of the input
    std::optional<ObliqueSlice> sampled_plane_;
    Convert convert_;
    Buffer staging_;
};

} // namespace

VKT_OPERATION(Slice, "slice")

} // namespace vkt
