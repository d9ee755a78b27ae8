// Scan: prefix sums in three dimensions, the summed-volume table.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/scan.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/label_marks.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/beside.h"
#include "libvkt/operations/common/kernels/convert.h"
#include "libvkt/operations/common/remarks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vkt {

namespace {

/// Every voxel becomes the sum of the box from the first voxel to itself; `exclusive`: of all voxels that lie before it
/// along each of the axes, 0 in the first row, column and slice. Sums of unsigned integers are uint64, of signed ones
/// int64, exact; where 64 bits may not hold them they are taken in 128, saturated and counted. A slope is kept. Floats,
/// and integers whose value map has an intercept, are summed as physical values in float64: float64, and whatever was
/// mapped, with what each addition loses. One pass, with a slice of sums as state; the order of additions, on CPUs
/// along z, then x, then y, on GPUs along x, then y, then z, depends on nothing else.
class Scan : public Operation {
public:
    bool exclusive = false;
    Roi roi; ///< as if it were the volume; all else keeps its values

    std::string_view name() const override { return "scan"; }
    Texts texts() const override {
        return {"Sum up everything before each voxel (summed-volume table).",
                "Each voxel becomes the sum of the box from the first voxel to itself: of integers exact, in 64 bits, "
                "of floats in float64. With it the sum of any box takes eight voxels, whatever its size."
                "\n\n"
                "Accuracy: Sums of integers are exact, or the end of the type and counted; of floats with X, Y, Z "
                "voxels along the axes within (X + Y + Z) 2^-53 of the sum of the magnitudes.",
                {{"A table of sums", "vkt scan volume.nrrd -o table.nrrd"},
                 {"Of what lies strictly before, along each axis", "vkt scan volume.nrrd --exclusive | vkt stats"}}};
    }

    Shape shape() const override { return Shape::geometric; }
    void parameters(Parameters& parameters) override {
        parameters.flag("exclusive", exclusive,
                        "sum what lies before the voxel along each axis: 0 in the first row, column and slice");
        parameters.option("roi", roi, "REGION",
                          "sum only within this region, as if it were the volume; keep the other values");
    }

    Plan plan(std::span<Header const> inputs) const override {
        Header const& in = inputs[0];
        ScanState const state = state_for(in);
        Plan plan;
        plan.output = in;
        plan.output.attributes.erase("background");
        forget_labels(plan.output); // whole numbers, but sums
        plan.carries = true;
        plan.cost = 25;
        plan.slab_hint = 16; // threads follow one another a slice behind
        Index3 const n = state.dims;
        double const voxels = volume_of(n);
        if (state.sums == ScanSums::whole || state.sums == ScanSums::wide) {
            plan.output.dtype = is_signed(in.dtype) ? DataType::int64 : DataType::uint64;
            plan.method = state.sums == ScanSums::whole ? "sums in 64 bits" : "sums in 128 bits, saturated to 64";
        } else {
            bool const pairs = state.sums == ScanSums::pairs;
            plan.output.dtype = DataType::float64;
            plan.output.values = {};
            plan.method = pairs ? "sums in float64, compensated" : "sums in float64";
            auto const steps = static_cast<double>(n.x + n.y + n.z);
            // Each of so many additions is off by 2^-53 of a sum that is at most that of all magnitudes; what
            // compensated ones lose is known to as much of itself, and the result rounds once. Mapping a value rounds
            // twice.
            double const mapping = in.values == ValueMap{} ? 0 : 0x1p-52, each = steps * 0x1.01p-53;
            plan.error.kind = ErrorBound::Kind::bound;
            plan.error.magnitude = voxels * (pairs ? 0x1p-53 + each * each + mapping : each);
            plan.error.absolute = voxels * mapping * std::abs(in.values.intercept);
            plan.error.limit(in.dtype, in.values.slope, std::nullopt);
        }
        plan.passing = ErrorPassing::summed(voxels, values_of(in)); // of more than one, or of one alone outside
        if (is_integer(plan.output.dtype)) plan.passing.storing = ErrorPassing::Storing::whole;
        plan.state_bytes = static_cast<std::size_t>(n.x * (n.y + 1)) * state.bytes_each();
        return plan;
    }

    void begin(std::span<Header const> inputs, Plan const&) override {
        losses_ = {};
        odd_ = false;
        state_ = state_for(inputs[0]);
        region_ = roi.resolve(inputs[0].dims);
    }

    std::size_t fit(Index3 largest, Execution const& execution) override {
        // Of few slices all sums along x; of more, a few rows for each thread and what it hands to the next one.
        std::int64_t const threads = std::max(1, execution.threads);
        std::int64_t const rows = std::min(largest.z, 2 * threads) * largest.y + threads * (largest.z + 8);
        return static_cast<std::size_t>(largest.x * rows) * state_.bytes_each();
    }

    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override {
        Box const inside = intersect(out.box, region_);
        for_each_beside(out.box, inside, [&](Box const& box) { keep(inputs[0].part(box), out.part(box), execution); });
        if (inside.empty()) return;
        Index3 const move = inside.lower - region_.lower;
        ConstView const voxels = inputs[0].part(inside).moved_to(move);
        Losses losses;
        scan_slab(state_, voxels, out.part(inside).moved_to(move), losses, execution);
        losses_ += losses;
        if (losses.undefined == 0 || exclusive || odd_) return;
        TypeFit found;
        find_fit(voxels, found, execution);
        odd_ = found.nan || found.infinite;
    }

    bool runs_on_gpu() const override { return true; }
    std::vector<std::int64_t*> counters() override { return losses_.counters(); }
    std::vector<Remark> remarks() const override {
        std::vector<Remark> result;
        std::int64_t const voxels = state_.dims.x * state_.dims.y * state_.dims.z;
        if (losses_.clipped > 0)
            result.push_back(
                {text(share_text(losses_.clipped, voxels), ": sums beyond 64 bits, stored as their nearest end"),
                 true});
        if (losses_.undefined > 0) {
            // Where the last voxels have no part in sums it is not known.
            bool const overflow = !exclusive && !odd_;
            result.push_back({text(share_text(losses_.undefined, voxels), ": sums that are not finite, ",
                                   exclusive  ? "of values that are not, or beyond float64"
                                   : overflow ? "from the first on that is beyond float64"
                                              : "from the first value on that is not"),
                              overflow});
        }
        return result;
    }

private:
    /// Nothing is summed yet.
    ScanState state_for(Header const& in) const {
        ScanState state;
        state.exclusive = exclusive;
        state.dims = roi.resolve(in.dims).dims();
        if (is_integer(in.dtype) && in.values.intercept == 0) {
            double const voxels = volume_of(state.dims), largest = std::max(highest_of(in.dtype), -lowest_of(in.dtype));
            bool const all_fit = size_of(in.dtype) < 8 && voxels * largest < (is_signed(in.dtype) ? 0x1p63 : 0x1p64);
            state.sums = all_fit ? ScanSums::whole : ScanSums::wide;
        } else {
            bool const pairs = in.dtype == DataType::float64 || !(in.values == ValueMap{});
            state.sums = pairs ? ScanSums::pairs : ScanSums::real;
            state.map = in.values;
        }
        return state;
    }

    /// What lies outside of the region, in the type of the result.
    void keep(ConstView in, AnyView out, Execution const& execution) {
        if (state_.map == ValueMap{}) return convert_values(in, out, losses_, execution);
        LinearMap physical;
        physical.factor = state_.map.slope;
        physical.to_low = state_.map.intercept;
        physical.least = -std::numeric_limits<double>::infinity();
        physical.most = -physical.least;
        convert_range(in, out, physical, losses_, execution);
    }

    ScanState state_;
    Box region_;
    Losses losses_;
    bool odd_ = false; ///< voxels that are not finite were seen: without them sums that are not are beyond float64
};

} // namespace

VKT_OPERATION(Scan, "scan")

} // namespace vkt
