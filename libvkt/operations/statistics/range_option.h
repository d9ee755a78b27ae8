// Ranges of values as options give them, numbers or percentiles of a volume, and how they are found.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/header.h"
#include "libvkt/operations/common/number.h"
#include "libvkt/operations/statistics/quantiles.h"

#include <memory>

namespace vkt {

/// One end of a range: a physical value, or a percentile of the volume (0 and 100 are the extremes).
struct RangeEnd {
    bool percentile = false;
    Number value;
    friend bool operator==(RangeEnd const&, RangeEnd const&) = default;
};

/// "LO:HI", "minmax", "p1:p99", or mixtures such as "0:p99.5".
struct RangeOption {
    RangeEnd low, high;
    /// True if the volume must be looked at to know it.
    bool depends() const { return low.percentile || high.percentile; }
    /// True if it must be more than its extremes.
    bool percentiles() const;
    friend bool operator==(RangeOption const&, RangeOption const&) = default;
};

template <> struct ValueText<RangeOption> : OneWord {
    static RangeOption read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(RangeOption const& v);
};

/// Finds the stored values that are the ends of a range, which are those of the finite voxels where they are
/// percentiles: one pass for extremes, one to four for others (see Quantiles). Exact, and independent of the order of
/// voxels.
class RangeScan {
public:
    RangeScan(RangeOption const& range, Header const& header);

    /// What a pass needs besides a few bytes.
    std::size_t state_bytes() const { return quantiles_ ? Quantiles::state_bytes(header_.dtype, 1) : 0; }
    bool has_percentiles() const { return quantiles_ != nullptr; }
    void scan(ConstView slab, Execution const& execution);
    /// After every voxel was added once: true if all must be added once more.
    bool end_pass();

    /// False if an end depends on the voxels, and none of them is finite.
    bool known() const { return !range_.depends() || any_finite_ || (quantiles_ && quantiles_->count() > 0); }
    /// The ends in the order in which they were given, which is falling for stored values under a negative slope.
    StoredValue low() const { return low_; }
    StoredValue high() const { return high_; }

private:
    StoredValue stored(Number const& physical) const;
    StoredValue end_of(RangeEnd const& end, std::size_t& percentiles) const;
    void set_ends();

    RangeOption range_;
    Header header_;
    bool any_finite_ = false, first_pass_ = true;
    StoredValue least_, most_; ///< extremes
    StoredValue low_, high_;
    std::unique_ptr<Quantiles> quantiles_;
};

} // namespace vkt
