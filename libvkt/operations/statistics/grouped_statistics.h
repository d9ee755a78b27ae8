// Statistics of the voxels of a mask, of each label, or of each slice along an axis; partial results that add up.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/operations/statistics/grouped_quantiles.h"
#include "libvkt/operations/statistics/kernels/grouped_slab.h"
#include "libvkt/operations/statistics/statistics.h"

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Statistics of groups of voxels of one type, by their key: the label, the index, 0.
struct GroupedResult {
    GroupedBy by = GroupedBy::volume;
    DataType type = DataType::uint8;
    ValueMap values;
    bool unsigned_keys = false; ///< labels are uint64
    std::map<std::int64_t, PartialStatistics> groups;
    std::map<std::int64_t, std::vector<Percentile>> percentiles; ///< as asked for; they do not add up

    std::string key_text(std::int64_t key) const;
    /// Groups of the same key are joined. Throws Error{data} if type, value map or kind differ.
    void add(GroupedResult const& other);
};

/// JSON that grouped_from_json() reads: every number exactly as it is kept.
std::string to_json(GroupedResult const& result);
/// What to_json() wrote, a list of such added up. Throws Error{data} naming `name` for anything else.
GroupedResult grouped_from_json(std::string_view json, std::string const& name);

/// A reduction of one volume, with a mask and labels read beside it. Integers of up to 32 bits are summed exactly, the
/// others in extended precision relative to their group's first value; each group is summed by blocks of some rows in
/// x-fastest order, and blocks are merged in order: the same bits for every slab height, thread count and device.
/// O(groups) memory, refused with Error{resources} beyond half of the budget. Percentiles are those of
/// GroupedQuantiles, from further passes: mask and labels are read again, too.
class GroupedStatistics : public Operation {
public:
    Roi roi; ///< part to look at; empty: all
    GroupedBy by = GroupedBy::volume;
    PercentList percents;
    Source* mask = nullptr;   ///< its current volume: voxels count where it is not 0; null: all do
    Source* labels = nullptr; ///< its current volume, of integers

    std::string_view name() const override { return "stats"; }
    Shape shape() const override { return Shape::reduction; }
    /// Throws Error{usage} for hierarchical volumes, a mask or labels on another grid, and labels that are no integers.
    Plan plan(std::span<Header const> inputs) const override;
    void begin(std::span<Header const> inputs, Plan const& plan) override;
    Box scanned(Box const& whole) const override { return intersect(whole, region_); }
    std::int64_t scan_step(Index3 part) const override { return block_rows(part); }
    void scan(ConstView slab, Execution const& execution) override;
    void scan_end() override;
    bool runs_on_gpu() const override { return true; }
    bool scans_again() const override { return quantiles_ && quantiles_->unfinished(); }
    void run(std::span<ConstView const>, AnyView, Execution const&) override {}

    GroupedResult const& result() const { return result_; }

private:
    class Numbers;

    static std::int64_t block_rows(Index3 dims) { return std::max<std::int64_t>(1, 16384 / dims.x); }
    void sum(GroupedSlab const& slab, Execution const& execution);
    void select(GroupedSlab const& slab, Execution const& execution);
    std::int64_t bytes_of_group() const;
    std::int64_t room(Execution const& execution) const;

    Header input_;
    Box region_;
    Buffer mask_buffer_, label_buffer_;
    std::optional<GroupedQuantiles> quantiles_; ///< after the first pass, if percentiles are wanted
    std::shared_ptr<Numbers const> numbers_;    ///< … of its groups
    GroupedResult result_;
};

} // namespace vkt
