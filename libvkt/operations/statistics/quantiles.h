// Percentiles of a volume, exact, from a few passes in bounded memory.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/view.h"
#include "libvkt/core/wide.h"
#include "libvkt/operations/statistics/voxel_counts.h"

#include <cstdint>
#include <vector>

namespace vkt {

/// A stored value: whole + rest, where whole is 0 unless voxels are 64-bit integers, which double does not hold.
struct StoredValue {
    Int128 whole = 0;
    double rest = 0;

    double value() const { return static_cast<double>(whole) + rest; }
    /// a - b, without the digits that both have in common being lost.
    friend double operator-(StoredValue const& a, StoredValue const& b) {
        return static_cast<double>(a.whole - b.whole) + (a.rest - b.rest);
    }
};

/// The value whose ordered_bits() these are.
StoredValue stored_value(DataType type, std::uint64_t bits);

/// Between which ranks of so many values a percentile lies, and how far from the lower one (numpy's "linear").
struct RankedPosition {
    std::int64_t below = 0, above = 0;
    double share = 0;
};
RankedPosition position_in(std::int64_t count, double percent);
StoredValue between(DataType type, StoredValue const& below, StoredValue const& above, double share);

struct OrderedClasses;

/// Finds percentiles of the finite voxels by their order alone: patterns of every type can be arranged to ascend with
/// the value, and pass by pass 16 more bits of those at the wanted ranks become known. Exact for every distribution,
/// and independent of the order of the voxels, slabs and threads. One pass for types of 16 bits and for up to 2^21
/// voxels; else two, and up to four for 64-bit types where more than 2^22 voxels share the patterns' first bits.
class Quantiles {
public:
    /// `percents` in [0,100]; `voxels`: how many will be added in a pass.
    Quantiles(DataType type, std::vector<double> percents, std::int64_t voxels);

    /// Voxels lie in the memory of `execution`. The counters of its threads take no more than an eighth of its budget.
    void add(ConstView slab, Execution const& execution);
    /// After every voxel was added once: true if all must be added once more.
    bool end_pass();

    std::int64_t count() const { return count_; } ///< finite voxels
    /// The value below which percents[i] of the voxels lie, interpolated between neighbours in rank (numpy's "linear").
    /// After the last pass, if there is a finite voxel.
    StoredValue percentile(std::size_t i) const;
    static std::size_t state_bytes(DataType type, int threads);

private:
    struct Target {
        std::int64_t rank = 0;    ///< among the voxels of its class
        std::uint64_t prefix = 0; ///< the bits that are known
        std::int64_t voxels = 0;  ///< of its class
    };
    /// What one thread sees, class after class: voxels whose patterns begin with the same known bits.
    struct Share {
        VoxelCounts counters;                         ///< of each class, by the next 16 bits
        std::vector<std::vector<std::uint64_t>> keys; ///< all of each class, if they are few
    };

    OrderedClasses classes() const;
    Share empty_share() const;
    void add_counts(ConstView slab, int threads, Execution const& execution);
    void add_keys(ConstView slab, int threads);
    template <class T> void add_keys_of(T const* row, std::int64_t n, Share& share) const;
    void begin_pass();
    void place_targets(std::int64_t count);
    std::vector<std::uint64_t> counters_of(std::size_t c);
    std::vector<std::uint64_t> keys_of(std::size_t c) const;

    DataType type_;
    int width_; ///< bits of a pattern
    int known_ = 0;
    bool collects_ = false;
    std::vector<double> percents_;
    std::vector<Target> targets_;         ///< two for every percentile
    std::vector<std::uint64_t> prefixes_; ///< of the classes
    std::vector<Share> shares_;
    bool on_device_ = false; ///< voxels were; they stay there, and none are kept
    std::int64_t count_ = 0;
};

} // namespace vkt
