// Percentiles of a volume from one pass in bounded memory.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstdint>
#include <vector>

namespace vkt {

/// Counts finite voxels. Integers of up to 16 bits are counted value by value and their percentiles are exact. Other
/// types are counted by the first 32 bits of the float64 pattern of their difference to the first finite voxel, in at
/// most 2^21 counters: to 2^-21 of the difference for up to 32 different leading halves of those bits, and coarser by
/// halves as data spread over more of them, down to 2^-12 over all of float32's range and 2^-9 over all of float64's.
/// Within a counter values are taken as evenly spread.
class Quantiles {
public:
    explicit Quantiles(DataType type);

    void add(ConstView slab, int threads);
    std::int64_t count() const { return count_; }
    /// The value below which `percent` of the voxels lie, interpolated between neighbours in rank (numpy's "linear").
    /// NaN if nothing was counted.
    double percentile(double percent) const;

private:
    void add_exactly(ConstView slab, int threads);
    void add_value(double value);
    std::int32_t new_leaf();
    void coarsen();
    double value_at_rank(std::int64_t rank) const;
    double value_in_leaf(std::uint32_t prefix, std::int64_t rank) const;

    DataType type_;
    bool exact_;
    std::int64_t count_ = 0;
    std::vector<std::uint64_t> counters_;
    std::vector<std::int32_t> leaves_; ///< by the upper 16 bits of the pattern: which block of counters, -1 for none
    int leaf_bits_ = 16;               ///< how many of the lower 16 bits are told apart
    std::int32_t leaf_count_ = 0;
    bool shifted_ = false;
    double half_shift_ = 0, low_ = 0, high_ = 0;
};

} // namespace vkt
