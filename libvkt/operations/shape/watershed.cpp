// Watershed: a volume flooded from markers, or from its minima, until the floods meet.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/operation.h"
#include "libvkt/formats/labels.h"
#include "libvkt/kernel/cpu_drivers.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/common/same_grid.h"
#include "libvkt/operations/common/zero.h"
#include "libvkt/operations/shape/connectivity.h"
#include "libvkt/operations/shape/distance.h"
#include "libvkt/operations/shape/flooding.h"
#include "libvkt/operations/voxels/kernels/fill.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace vkt {

/// What is flooded.
enum class Relief : std::uint8_t {
    value,    ///< the volume itself
    gradient, ///< the length of its gradient, by central differences in world units, in float32
    distance, ///< minus the distance of its non-zero voxels to the nearest zero one; zero voxels take no part
};

template <> struct EnumNames<Relief> {
    static std::vector<std::pair<Relief, char const*>> all() {
        return {{Relief::value, "value"}, {Relief::gradient, "gradient"}, {Relief::distance, "distance"}};
    }
};

namespace {

/// Calls f(index, value) for all voxels, x fastest.
template <class F> void for_each_voxel(ConstView in, F const& f) {
    with_type(in.type, [&]<class T>(T) {
        View<T const> const view = in.as<T>();
        std::size_t i = 0;
        for (std::int64_t z = in.box.lower.z; z < in.box.upper.z; ++z)
            for (std::int64_t y = in.box.lower.y; y < in.box.upper.y; ++y)
                for (std::int64_t x = in.box.lower.x; x < in.box.upper.x; ++x) f(i++, view(x, y, z));
    });
}

/// |gradient| of physical values by central differences; the outermost voxels count as their own neighbours.
void gradient_into(ConstView in, Header const& header, float* to, Execution const& execution) {
    Vec3 const h = header.geometry.spacing;
    double const slope = header.values.slope;
    Box const box = in.box;
    with_type(in.type, [&]<class T>(T) {
        View<T const> const view = in.as<T>();
        auto const value = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
            return static_cast<double>(view(std::clamp(x, box.lower.x, box.upper.x - 1),
                                            std::clamp(y, box.lower.y, box.upper.y - 1),
                                            std::clamp(z, box.lower.z, box.upper.z - 1)));
        };
        Index3 const n = box.dims();
        VKT_BACKEND::for_each_segment(
            execution, box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t length) {
                for (std::int64_t x = x0; x < x0 + length; ++x) {
                    double const gx = (value(x + 1, y, z) - value(x - 1, y, z)) * slope / (2 * h.x),
                                 gy = (value(x, y + 1, z) - value(x, y - 1, z)) * slope / (2 * h.y),
                                 gz = (value(x, y, z + 1) - value(x, y, z - 1)) * slope / (2 * h.z);
                    to[((z - box.lower.z) * n.y + y - box.lower.y) * n.x + x - box.lower.x] =
                        static_cast<float>(std::sqrt(gx * gx + gy * gy + gz * gz));
                }
            });
    });
}

/// Labels in uint32, 0 where no flood came. Exact: see Flooding for the order, which depends on values alone. Without
/// markers the regional minima that are at least `depth` deep are numbered by their first voxel. NaN is above all
/// numbers. Whole volumes, in one thread.
class Watershed : public Operation {
public:
    std::string in = "-";
    std::optional<std::string> markers, mask;
    Relief on = Relief::value;
    double depth = 0; ///< physical values; of distances world units
    int connectivity = 6;
    bool line = false;
    Roi roi; ///< all else takes no part, and is 0

    std::string_view name() const override { return "watershed"; }
    Texts texts() const override {
        return {
            "Split a volume into the basins that water would fill.",
            "Floods rise from markers, or from the minima of the volume, and each voxel gets the label of the flood "
            "that reaches it first: always the lowest voxel next to a flood, of equal ones the one that was reached "
            "first. --on gradient puts borders where the values change, --on distance splits objects that touch."
            "\n\n"
            "Accuracy: Exact: labels depend on the values alone; gradients and distances are rounded to float32 first.",
            {{"Every basin of a smoothed volume",
              "vkt filter gaussian volume.nrrd --sigma 2 | vkt watershed --depth 5 -o basins.nrrd"},
             {"Objects that touch, apart", "vkt threshold volume.nrrd --otsu | vkt watershed --on distance --depth 1 "
                                           "--report sizes.json -o objects.nrrd"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    int inputs() const override { return 1 + (markers ? 1 : 0) + (mask ? 1 : 0); }
    std::vector<std::string> input_names() const override {
        std::vector<std::string> names{in};
        if (markers) names.push_back(*markers);
        if (mask) names.push_back(*mask);
        return names;
    }

    void parameters(Parameters& parameters) override {
        parameters.positional("in", in, "the volume: a file, or '-' for standard input").optional();
        parameters.option("markers", markers, "FILE",
                          "flood from the non-zero voxels of this volume, which are labels");
        parameters.option("depth", depth, "H", "without markers: flood from the minima that are at least so deep");
        parameters.option(
            "on", on, "WHAT",
            "flood the values, the length of their gradient, or minus the distance of objects to zero voxels");
        connectivity_option(parameters, connectivity);
        parameters.option("mask", mask, "FILE", "flood only where this volume is not zero");
        parameters.option("roi", roi, "REGION", "flood only this region, as if there were no other voxels");
        parameters.flag("line", line, "leave voxels where different floods meet at 0");
    }

    void check() const override {
        check_connectivity(connectivity);
        if (!(depth >= 0) || !std::isfinite(depth))
            throw Error(ErrorKind::usage, text("--depth ", depth, " is not a depth: 0 or more"));
        if (markers && depth > 0)
            throw Error(ErrorKind::usage, "--depth chooses minima, and --markers says where to flood from",
                        "leave one of them out");
    }

    /// Throws Error{usage} if the volumes do not lie on one another or the markers are no integers.
    Plan plan(std::span<Header const> inputs) const override {
        Header const& first = inputs.front();
        Plan plan;
        plan.output = first;
        plan.output.dtype = DataType::uint32;
        plan.output.values = {};
        plan.output.units.clear();
        plan.output.attributes.erase("background");
        mark_as_labels(plan.output);
        plan.whole = true;
        plan.passing = ErrorPassing::jumps();
        plan.cost = on == Relief::distance ? 5000 : 10000;
        plan.method = text("flooding from ",
                           markers     ? "markers"
                           : depth > 0 ? "deep minima"
                                       : "all minima",
                           ", ", connectivity, "-connected, one thread");
        for (std::size_t i = 1; i < inputs.size(); ++i)
            require_same_grid(first, inputs[i], i == 1 && markers ? "--markers" : "--mask");
        if (first.kind == Kind::hierarchical) return plan; // refused by the engine
        if (markers && !is_integer(inputs[1].dtype))
            throw Error(ErrorKind::usage, text("markers are labels, and cannot be ", inputs[1].dtype),
                        "vkt label numbers the components of a mask; vkt convert --dtype uint32 changes the type");
        Header within = first;
        within.dims = roi.resolve(first.dims).dims();
        if (!Flooding::can(within.dims))
            throw Error(ErrorKind::resources, text("a volume of ", within.dims, " voxels has too many for 32 bits"),
                        "make it smaller with 'vkt crop' or 'vkt resample'");
        DataType const relief = on == Relief::value ? first.dtype : DataType::float32;
        double bytes = Flooding::bytes(within.dims, relief, !markers);
        if (on != Relief::value) bytes += 4 * static_cast<double>(within.voxels());
        if (mask || on == Relief::distance) bytes += static_cast<double>(within.voxels());
        plan.state_bytes = static_cast<std::size_t>(bytes);
        if (on == Relief::distance) plan.state_bytes += Distance().plan({&within, 1}).state_bytes; // or it is refused
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const&) override {
        headers_.assign(inputs.begin(), inputs.end());
        result_ = {};
        sizes_.clear();
        if (inputs.front().kind == Kind::hierarchical) return;
        region_ = roi.resolve(inputs.front().dims);
        for (Header& header : headers_) header.dims = region_.dims();
    }

    Box footprint(Box const&, int) const override { return region_; }
    /// Throws Error{data} if there is no marker.
    void run(std::span<ConstView const> wholes, AnyView whole, Execution const& execution) override {
        if (region_ != whole.box) fill_box(whole, VoxelBytes{}, execution);
        AnyView const out = whole.part(region_).moved_to({});
        std::vector<ConstView> parts;
        for (ConstView const& input : wholes) parts.push_back(input.part(region_).moved_to({}));
        std::span<ConstView const> const inputs = parts;
        Header const& header = headers_.front();
        std::vector<std::uint8_t> const part = taking_part(inputs);
        ConstView values = inputs[0];
        Buffer relief;
        if (on != Relief::value) {
            relief.reserve(static_cast<std::size_t>(header.voxels()) * 4);
            AnyView const to = dense_view(relief.write(Space::host), DataType::float32, values.box);
            if (on == Relief::gradient) {
                gradient_into(inputs[0], header, reinterpret_cast<float*>(to.data), execution);
            } else {
                Distance distance;
                begun(distance, {&header, 1});
                distance.run(inputs.first(1), to, execution);
            }
            values = to;
        }
        bool const descending = on == Relief::distance || (on == Relief::value && header.values.slope < 0);
        std::optional<ProgressPart> share(std::in_place, execution.monitor, 0.0, 0.3);
        Flooding flooding(values, descending, part.empty() ? nullptr : part.data(), connectivity, !markers,
                          execution.monitor);
        relief = {};
        share.emplace(execution.monitor, 0.3, 0.3);
        if (markers)
            mark(flooding, inputs[1]);
        else
            flooding.mark_minima(on == Relief::value ? depth / std::abs(header.values.slope) : depth);
        share.emplace(execution.monitor, 0.6, 0.35);
        result_ = flooding.flood(line);
        share.reset();
        View<std::uint32_t> const labels = out.as<std::uint32_t>();
        Index3 const n = out.dims();
        std::uint32_t const highest = flooding.highest_label();
        bool const few = highest <= static_cast<std::uint64_t>(header.voxels()); // as many counters as voxels at most
        std::vector<std::int64_t> counts(few ? highest + 1 : 0);
        std::map<std::uint32_t, std::int64_t> others;
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) {
                    std::uint32_t const label = flooding.label({x, y, z});
                    labels(x, y, z) = label;
                    if (label != 0) ++(few ? counts[label] : others[label]);
                }
        sizes_.assign(others.begin(), others.end());
        for (std::uint32_t label = 1; label < counts.size(); ++label)
            if (counts[label] > 0) sizes_.emplace_back(label, counts[label]);
    }

    std::vector<Remark> remarks() const override {
        if (result_.left == 0) return {};
        return {
            {text(share_text(result_.left, headers_.front().voxels()), " reached from no marker: they stay 0"), false}};
    }

    bool reports() const override { return true; }
    /// Labels and their sizes.
    Report report() const override {
        Report result;
        result.add("labels", static_cast<std::int64_t>(sizes_.size()));
        result.add("line", result_.line);
        result.add("unreached", result_.left);
        std::vector<Report> rows;
        for (auto const& [label, size] : sizes_) {
            Report row;
            row.add("label", static_cast<std::int64_t>(label));
            row.add("size", size);
            rows.push_back(std::move(row));
        }
        result.add("sizes", std::move(rows));
        return result;
    }

private:
    /// A byte a voxel: 0 where it takes no part. Empty if all do.
    std::vector<std::uint8_t> taking_part(std::span<ConstView const> inputs) const {
        std::vector<std::uint8_t> result;
        auto const keep = [&](std::size_t input) {
            if (result.empty()) result.assign(static_cast<std::size_t>(headers_.front().voxels()), 1);
            std::optional<double> const zero = stored_zero(headers_[input]);
            for_each_voxel(inputs[input], [&](std::size_t i, auto v) {
                auto const value = static_cast<double>(v);
                if (value != value || (zero && value == *zero)) result[i] = 0;
            });
        };
        if (on == Relief::distance) keep(0);
        if (mask) keep(inputs.size() - 1);
        return result;
    }

    void mark(Flooding& flooding, ConstView volume) const {
        Index3 const n = volume.dims();
        std::int64_t outside = 0, marked = 0;
        for_each_voxel(volume, [&](std::size_t i, auto v) {
            if constexpr (std::is_integral_v<decltype(v)>) {
                if (v == 0) return;
                if (v < 0 || static_cast<std::uint64_t>(v) >= Flooding::outside)
                    throw Error(ErrorKind::data,
                                text("the marker ", to_text(static_cast<Int128>(v)), " is no label: they are 1 to ",
                                     std::int64_t{Flooding::outside} - 1));
                auto const at = static_cast<std::int64_t>(i);
                bool const taken =
                    flooding.mark({at % n.x, at / n.x % n.y, at / n.x / n.y}, static_cast<std::uint32_t>(v));
                (taken ? marked : outside) += 1;
            }
        });
        if (marked == 0)
            throw Error(ErrorKind::data, outside == 0 ? "there is no marker: all voxels are zero"
                                                      : "there is no marker where the volume is to be flooded");
    }

    std::vector<Header> headers_; ///< of the region
    Box region_;
    Flooding::Result result_;
    std::vector<std::pair<std::uint32_t, std::int64_t>> sizes_; ///< labels in ascending order, and their voxels
};

} // namespace

VKT_OPERATION(Watershed, "watershed")

} // namespace vkt
