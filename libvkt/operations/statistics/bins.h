// Equal bins over a range of values: where their edges are, exactly, and in which of them a value lies.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/wide.h"
#include "libvkt/operations/common/number.h"

#include <cstdint>
#include <string>
#include <vector>

namespace vkt {

/// Bins are half-open, the last one holds its upper edge as well. Values are physical, slope * stored + intercept in
/// double precision; those of integers without a value map are whole numbers, and nothing is rounded. Edge k is the
/// rational number low + k (high - low) / count for these, if the ends are whole, and low + k * ((high - low) / count)
/// in double precision otherwise (low (1 - k / count) + high k / count where the
/// difference is beyond it); the last edge is `high`. What lies outside, infinities too, and what is not a number
/// has a slot of its own after the bins.
class Bins {
public:
    static constexpr int most = 65536; ///< bins

    Bins() = default;
    /// Of stored voxels of this type under this map; low < high, both finite.
    Bins(DataType type, ValueMap const& map, Number const& low, Number const& high, int count);

    /// Of a type of at most 16 bits: a bin for every pattern of bits, by pattern; it has no edges.
    static Bins of_patterns(DataType type);
    /// The stored value of such a pattern.
    static double value_of_pattern(DataType type, std::size_t bits);

    int count() const { return count_; }
    int under() const { return count_; }
    int over() const { return count_ + 1; }
    int missing() const { return count_ + 2; } ///< NaN
    std::size_t slots() const { return static_cast<std::size_t>(count_) + 3; }

    double edge(int k) const; ///< rounded to double, if it is none
    /// The edge as a number that reads back as itself; whole edges with all digits.
    std::string edge_text(int k) const;

    /// The slot of a stored value, or of a 64-bit integer without a value map (see wide()).
    int slot_of(double stored) const;
    int slot_of(Int128 stored) const;

    // For kernels, which guess a bin from (value * scale - scaled_low) * per_unit and look at the edges beside it.
    bool wide() const { return wide_; } ///< compares whole numbers of 64 bits
    /// Of every voxel of a type of at most 16 bits, by its bits; empty for others.
    std::vector<std::int32_t> const& table() const { return table_; }
    double const* edges() const { return edges_.data(); }
    Int128 const* whole_edges() const { return whole_edges_.data(); }
    Int128 highest() const { return highest_; }
    double scale() const { return scale_; }
    double scaled_low() const { return scaled_low_; }
    double per_unit() const { return per_unit_; }
    /// True if edges lie so near to each other for their distance from 0 that their rounding is felt.
    bool far() const { return far_; }
    ValueMap const& map() const { return map_; }

private:
    DataType type_ = DataType::uint8;
    ValueMap map_;
    Number low_, high_;
    int count_ = 1;
    bool exact_ = false, wide_ = false, far_ = false;
    std::vector<double> edges_; ///< what values are compared with: for whole ones the least that lies above
    std::vector<Int128> whole_edges_;
    Int128 highest_ = 0; ///< largest whole number in the range
    double scale_ = 1, scaled_low_ = 0, per_unit_ = 1;
    std::vector<std::int32_t> table_;
};

} // namespace vkt
