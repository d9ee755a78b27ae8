// Changing the data type: values kept, or a range of values mapped to the full range of the new type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/operation.h"
#include "libvkt/engine/tunable.h"
#include "libvkt/operations/common/level_region.h"
#include "libvkt/operations/common/remarks.h"
#include "libvkt/operations/statistics/range_option.h"
#include "libvkt/operations/voxels/smallest_type.h"

#include <optional>

namespace vkt {

/// A data type, or the smallest that does.
struct ResultType {
    DataType type = DataType::uint8;
    bool smallest = false;

    ResultType() = default;
    ResultType(DataType of) : type(of) {}
    static ResultType automatic() {
        ResultType result;
        result.smallest = true;
        return result;
    }
};

template <> struct ValueText<ResultType> : OneWord {
    static std::vector<std::string> choices();
    static ResultType read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(ResultType v) { return {v.smallest ? "auto" : to_text(v.type)}; }
};

/// Without a range stored values are kept: rounded half to even, saturated, NaN to 0; both are counted. 64-bit integers
/// convert exactly. With a range, physical values in [low, high] are mapped linearly to `to`, by default the full range
/// of an integer type and [0, 1] of a floating one; what lies outside is clipped and counted; the output's value map is
/// composed so that physical values stay what they were. Percentiles and extremes are those of the finite voxels, of
/// cells whatever their size, and take passes of their own. The map is computed in double precision, of 64-bit integers
/// from their exact distance to the range's first end: before the final rounding it is off by at most 5 * 2^-53 of the
/// new range plus 2^-53 of its larger end. The smallest type is found in a pass before, see smallest_storage(); the
/// plan then has the input's type, which is the largest that may come of it.
class Convert : public Operation, public Tunable {
public:
    std::optional<ResultType> dtype;
    std::optional<double> tolerance; ///< of the smallest type, a physical value; 0 if not given
    std::optional<RangeOption> range;
    std::optional<RangeOption> to; ///< stored values of the output

    std::string_view name() const override { return "convert"; }
    Texts texts() const override;
    Shape shape() const override { return Shape::pointwise; }
    void parameters(Parameters& p) override;
    std::vector<Knob> knobs() const override;
    void check() const override;
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    void enter_level(Index3 cell_width, Index3 first) override { region_.enter_level(cell_width, first); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool scans_again() const override { return scans_again_; }
    void after_scan(Plan& plan) const override;
    /// Ranges are those of what is left of a cropped tree, of which bricks hold what was cut off, too: that is
    /// converted with the rest.
    bool uses_position() const override { return looks_ && cuts_; }
    bool runs_on_gpu() const override { return true; }
    bool scans_on_gpu() const override { return true; }
    void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) override;
    std::vector<std::int64_t*> counters() override { return counts_.counters(); }
    std::vector<Remark> remarks() const override;

private:
    /// From stored values of the input to those of the output.
    struct Map {
        StoredValue low, high;          ///< stored input range, low where to_low comes from
        double to_low = 0, to_high = 1; ///< what it becomes
        double scale = 1, factor = 1;   ///< see LinearMap
        ValueMap values;                ///< of the output
    };
    bool smallest() const { return dtype && dtype->smallest; }
    /// Of the result; with the smallest one the largest that it may be.
    DataType type_for(Header const& in) const { return dtype && !dtype->smallest ? dtype->type : in.dtype; }
    bool copies(Header const& in) const { return !smallest() && !range && type_for(in) == in.dtype; }
    /// The stored values that a range becomes.
    double first_of(DataType type) const;
    double last_of(DataType type) const;
    Map map_for(Header const& in, StoredValue low, StoredValue high) const;
    TypeFit fit_of_background(Header const& in) const;
    void scan_background();
    Plan plan_smallest(Header const& in) const;
    std::string storage_text() const;

    Header input_;
    DataType type_ = DataType::uint8;
    Map map_;
    bool scans_again_ = false;
    std::optional<RangeScan> scan_;
    LevelRegion region_;                ///< of which the range is looked for
    bool looks_ = false, cuts_ = false; ///< for a range; its region is not all of a tree
    std::optional<double> background_;  ///< of a tree whose range is looked for
    std::vector<std::byte> foreground_;
    TypeFit fit_;                    ///< for the smallest type
    std::optional<Storage> storage_; ///< once it is known
    bool maps_ = false;              ///< a range, or what became of the smallest type
    Losses counts_;
    bool copies_ = false;
};

} // namespace vkt
