// Grouped statistics: keys of rows, sums of slices.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/grouped_statistics.h"

#include "libvkt/kernel/border.h"
#include "libvkt/kernel/cpu_drivers.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/common/same_grid.h"
#include "libvkt/operations/common/zero.h"
#include "libvkt/operations/statistics/host_sums.h"
#include "libvkt/operations/statistics/kernels/grouped_sums.h"

#include <algorithm>
#include <exception>
#include <limits>
#include <omp.h>
#include <unordered_map>

namespace vkt {
namespace {

/// The groups of one block.
template <class T> class BlockGroups {
public:
    using Sums = RunningSums<T, HostNumbers>;

    Sums& at(std::int64_t key) {
        if (last_ == nullptr || key != last_key_) {
            last_ = &groups_[key];
            last_key_ = key;
        }
        return *last_;
    }
    std::map<std::int64_t, PartialStatistics> partial(DataType type, Box const& box) const {
        std::map<std::int64_t, PartialStatistics> result;
        for (auto const& [key, sums] : groups_)
            result.emplace(key, partial_of(sums.sums(), type, box.lower, box.dims().x));
        return result;
    }

private:
    std::unordered_map<std::int64_t, Sums> groups_; // its elements stay where they are
    Sums* last_ = nullptr;
    std::int64_t last_key_ = 0;
};

/// Which groups the voxels of rows belong to, and which of them count.
class RowKeys {
public:
    /// Voxels count where the mask is not `zero`.
    RowKeys(ConstView const* mask, double zero, ConstView const* labels, GroupedBy by, Box const& box)
        : mask_(mask), labels_(labels), zero_(zero), by_(by), lower_(box.lower.x),
          keys_(static_cast<std::size_t>(box.dims().x)), counts_(keys_.size(), 1) {
        for (std::size_t i = 0; i < keys_.size() && by == GroupedBy::x; ++i)
            keys_[i] = lower_ + static_cast<std::int64_t>(i);
    }
    void read(std::int64_t y, std::int64_t z) {
        std::size_t const n = keys_.size();
        if (by_ == GroupedBy::y || by_ == GroupedBy::z)
            std::fill(keys_.begin(), keys_.end(), by_ == GroupedBy::y ? y : z);
        if (mask_ != nullptr)
            with_type(mask_->type, [&]<class M>(M) {
                M const* const row = reinterpret_cast<M const*>(mask_->at(lower_, y, z));
                for (std::size_t i = 0; i < n; ++i) counts_[i] = static_cast<double>(row[i]) != zero_ ? 1 : 0;
            });
        if (labels_ != nullptr)
            with_type(labels_->type, [&]<class L>(L) {
                L const* const row = reinterpret_cast<L const*>(labels_->at(lower_, y, z));
                if constexpr (std::is_integral_v<L>)
                    for (std::size_t i = 0; i < n; ++i) keys_[i] = static_cast<std::int64_t>(row[i]);
            });
    }
    std::int64_t key(std::size_t i) const { return keys_[i]; }
    bool counts(std::size_t i) const { return counts_[i] != 0; }

private:
    ConstView const *mask_, *labels_;
    double zero_;
    GroupedBy by_;
    std::int64_t lower_;
    std::vector<std::int64_t> keys_;
    std::vector<std::uint8_t> counts_;
};

template <class T>
std::map<std::int64_t, PartialStatistics> block_groups(View<T const> const& voxels, DataType type, RowKeys rows,
                                                       Box const& box, ValueMap const& map) {
    std::int64_t const z = box.lower.z;
    auto const n = static_cast<std::size_t>(box.dims().x);
    bool const mapped = !(map == ValueMap{});
    BlockGroups<T> groups;
    std::int64_t at = 0; // in the block
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
        rows.read(y, z);
        T const* const row = &voxels(box.lower.x, y, z);
        for (std::size_t i = 0; i < n; ++i, ++at)
            if (rows.counts(i)) groups.at(rows.key(i)).add(row[i], at, map, mapped);
    }
    return groups.partial(type, box);
}

/// A source's voxels of a box where they are wanted, in place or copied.
ConstView voxels_of(Source& source, Box const& box, Buffer& buffer, Execution const& execution) {
    auto const lent = source.borrow(box);
    if (lent && lent->space == execution.space()) return *lent;
    DataType const type = source.header().dtype;
    buffer.reserve(static_cast<std::size_t>(box.voxels()) * size_of(type));
    if (execution.device == Device::gpu && lent) {
        AnyView const there = dense_view(buffer.write(Space::device), type, box, Space::device);
        copy_region(*lent, there, execution);
        return there;
    }
    source.read(dense_view(buffer.write(source.space()), type, box, source.space()));
    return dense_view(buffer.read(execution.space()), type, box, execution.space());
}

RowKeys keys_of(GroupedSlab const& slab) {
    return {slab.mask ? &*slab.mask : nullptr, slab.zero, slab.labels ? &*slab.labels : nullptr, slab.by,
            slab.voxels.box};
}

constexpr std::int64_t bytes_of_sums = sizeof(PartialStatistics) + 64;

} // namespace

/// The numbers of keys, of which there are some in ascending order.
class GroupedStatistics::Numbers {
public:
    explicit Numbers(std::vector<std::int64_t> keys) : keys_(std::move(keys)) {
        if (keys_.empty()) return;
        auto const span = static_cast<std::uint64_t>(keys_.back()) - static_cast<std::uint64_t>(keys_.front());
        if (span > 4 * keys_.size() + 65536) return;
        table_.assign(span + 1, GroupedQuantiles::no_group);
        for (std::size_t i = 0; i < keys_.size(); ++i) table_[offset(keys_[i])] = static_cast<std::uint32_t>(i);
    }
    std::vector<std::int64_t> const& keys() const { return keys_; }
    std::uint32_t of(std::int64_t key) const {
        if (keys_.empty()) return GroupedQuantiles::no_group;
        if (!table_.empty()) return offset(key) < table_.size() ? table_[offset(key)] : GroupedQuantiles::no_group;
        auto const found = std::lower_bound(keys_.begin(), keys_.end(), key);
        bool const known = found != keys_.end() && *found == key;
        return known ? static_cast<std::uint32_t>(found - keys_.begin()) : GroupedQuantiles::no_group;
    }

private:
    std::uint64_t offset(std::int64_t key) const {
        return static_cast<std::uint64_t>(key) - static_cast<std::uint64_t>(keys_.front());
    }

    std::vector<std::int64_t> keys_;
    std::vector<std::uint32_t> table_; ///< by their distance from the first, where that is no long way
};

std::string GroupedResult::key_text(std::int64_t key) const {
    return unsigned_keys ? to_text(static_cast<std::uint64_t>(key)) : to_text(key);
}

void GroupedResult::add(GroupedResult const& other) {
    if (other.by != by) throw Error(ErrorKind::data, "partial statistics of different things: labels, slices, volumes");
    if (other.type != type || !(other.values == values))
        throw Error(ErrorKind::data, text("partial statistics of different volumes: ", type, " and ", other.type),
                    "their types and value maps must be the same");
    unsigned_keys = unsigned_keys || other.unsigned_keys;
    for (auto const& [key, part] : other.groups) groups[key].append(part, type);
}

Plan GroupedStatistics::plan(std::span<Header const> inputs) const {
    Header const& in = inputs.front();
    if (in.kind != Kind::structured)
        throw Error(ErrorKind::usage, "hierarchical volumes have neither masks, labels, slices nor partial statistics",
                    "make a grid first: vkt resample --cells 50M");
    static_cast<void>(roi.resolve(in.dims)); // or it is refused
    if (mask != nullptr) require_same_grid(in, mask->header(), "--mask");
    if (labels != nullptr) {
        require_same_grid(in, labels->header(), "--labels");
        if (DataType const type = labels->header().dtype; !is_integer(type))
            throw Error(ErrorKind::usage, text("--labels: labels are integers, these are ", type),
                        "convert them: vkt convert --dtype uint32");
    }
    Plan plan;
    plan.output = in;
    bool const exact = is_integer(in.dtype) && size_of(in.dtype) <= 4;
    plan.method = exact ? "exact integer sums by group" : "shifted sums by group, Chan merge";
    if (!exact) {
        plan.error.kind = ErrorBound::Kind::estimate;
        plan.error.magnitude = 1e-15;
    }
    plan.cost = mask != nullptr && labels == nullptr ? 350 : 600;
    if (!percents.values.empty()) plan.scans = true;
    return plan;
}

void GroupedStatistics::begin(std::span<Header const> inputs, Plan const&) {
    input_ = inputs.front();
    region_ = roi.resolve(input_.dims);
    result_ = {};
    result_.by = by;
    result_.type = input_.dtype;
    result_.values = input_.values;
    result_.unsigned_keys = labels != nullptr && labels->header().dtype == DataType::uint64;
    if (by == GroupedBy::volume) result_.groups[0]; // also if nothing is counted
    quantiles_.reset();
    numbers_.reset();
}

/// Sums and a row of the report, and what its percentiles take.
std::int64_t GroupedStatistics::bytes_of_group() const {
    constexpr std::int64_t printed = 2048, printed_percentile = 128;
    std::size_t const n = percents.values.size();
    if (n == 0) return bytes_of_sums + printed;
    return bytes_of_sums + printed + printed_percentile * static_cast<std::int64_t>(n) +
           static_cast<std::int64_t>(GroupedQuantiles::bytes_of_group(n));
}

std::int64_t GroupedStatistics::room(Execution const& execution) const {
    constexpr std::int64_t least = std::int64_t{4} << 20;
    return std::max(static_cast<std::int64_t>(execution.memory), least) / 2;
}

void GroupedStatistics::scan(ConstView slab, Execution const& execution) {
    Box const box = intersect(slab.box, region_);
    if (box.empty()) return;
    GroupedSlab in{slab.part(box), {}, {}, 0, by, input_.values};
    if (mask != nullptr) {
        in.mask = voxels_of(*mask, box, mask_buffer_, execution);
        in.zero = stored_zero(mask->header()).value_or(std::numeric_limits<double>::quiet_NaN());
    }
    if (labels != nullptr) in.labels = voxels_of(*labels, box, label_buffer_, execution);
    if (quantiles_)
        select(in, execution);
    else
        sum(in, execution);
}

void GroupedStatistics::sum(GroupedSlab const& in, Execution const& execution) {
    Box const box = in.voxels.box;
    std::int64_t const rows = block_rows(region_.dims()), per_slice = (box.dims().y - 1) / rows + 1;
    std::int64_t const blocks = per_slice * box.dims().z, threads = std::max(1, execution.threads);
    std::int64_t together = std::min(blocks, 2 * threads);
    // Slices across x: every block has all of them, one that is being summed twice.
    auto const held_by_x = [&] { return region_.dims().x * (together + std::min(threads, together)); };
    auto const has_room = [&](std::int64_t groups, std::int64_t in_blocks) {
        return groups * bytes_of_group() + in_blocks * bytes_of_sums <= room(execution);
    };
    auto const check_room = [&](std::int64_t groups, std::int64_t in_blocks) {
        if (!has_room(groups, in_blocks))
            throw Error(ErrorKind::resources,
                        text(groups, by == GroupedBy::label ? " labels" : " rows of statistics",
                             " are more than --memory has room for"),
                        "raise --memory");
    };
    if (execution.device == Device::gpu) {
        if (by == GroupedBy::x) check_room(region_.dims().x, 0);
        constexpr auto bytes = static_cast<std::int64_t>(sizeof(GroupInBlock));
        std::int64_t const most = std::clamp<std::int64_t>(room(execution) / 4 / bytes, 1, 1 << 18);
        RowBlocks const row_blocks(box.dims(), rows);
        return grouped_sums(
            in, rows, most,
            [&](std::vector<GroupInBlock> const& found) {
                for (GroupInBlock const& group : found) {
                    Index3 const lower =
                        box.lower + Index3{0, row_blocks.first_row(group.block), row_blocks.z(group.block)};
                    result_.groups[group.key].append(partial_of(on_host(group.sums), input_.dtype, lower, box.dims().x),
                                                     input_.dtype);
                }
                check_room(std::ssize(result_.groups), 0);
            },
            execution);
    }
    if (by == GroupedBy::x) {
        while (together > 1 && !has_room(region_.dims().x, held_by_x())) --together;
        check_room(region_.dims().x, held_by_x());
    }
    std::vector<std::map<std::int64_t, PartialStatistics>> found(static_cast<std::size_t>(together));
    for (std::int64_t first = 0, n = 0; first < blocks; first += n) {
        n = std::min(together, blocks - first);
        std::exception_ptr failure;
        with_type(in.voxels.type, [&]<class T>(T) {
#pragma omp parallel for num_threads(execution.threads) schedule(dynamic) if (n > 1)
            for (std::int64_t i = 0; i < n; ++i) {
                Box block = box;
                block.lower.y += (first + i) % per_slice * rows;
                block.lower.z += (first + i) / per_slice;
                block.upper = {box.upper.x, std::min(block.lower.y + rows, box.upper.y), block.lower.z + 1};
                try {
                    found[static_cast<std::size_t>(i)] =
                        block_groups<T>(in.voxels.as<T>(), in.voxels.type, keys_of(in), block, input_.values);
                } catch (...) { // there is no memory left
#pragma omp critical
                    failure = std::current_exception();
                }
            }
        });
        if (failure) std::rethrow_exception(failure);
        std::int64_t held = 0;
        for (auto& block : found) {
            held += std::ssize(block);
            for (auto const& [key, part] : block) result_.groups[key].append(part, input_.dtype);
            block.clear(); // or they were held beside those of the next blocks
        }
        // Fewer blocks at a time where there is no room for those of all threads.
        std::int64_t const groups = std::ssize(result_.groups), in_block = (held + n - 1) / n;
        check_room(groups, in_block);
        while (together > 1 && !has_room(groups, together * in_block)) --together;
    }
}

void GroupedStatistics::select(GroupedSlab const& in, Execution const& execution) {
    if (!quantiles_->in_pass()) {
        std::int64_t const left = room(execution) - std::ssize(numbers_->keys()) * bytes_of_group();
        quantiles_->begin_pass(static_cast<std::size_t>(std::max<std::int64_t>(0, left)),
                               execution.device == Device::gpu ? 1 : execution.threads);
    }
    if (execution.device == Device::gpu) return quantiles_->add(in, numbers_->keys(), execution);
    Box const box = in.voxels.box;
    Index3 const n = box.dims();
    int const threads = static_cast<int>(std::clamp<std::int64_t>(box.voxels() / 32768, 1, quantiles_->threads()));
    VKT_BACKEND::for_each_item(threads, n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
        RowKeys rows = keys_of(in);
        std::vector<std::uint32_t> groups(static_cast<std::size_t>(n.x));
        for (std::int64_t i = begin; i < end; ++i) {
            VKT_BACKEND::tell_progress(execution, begin, i, end);
            std::int64_t const y = box.lower.y + i % n.y, z = box.lower.z + i / n.y;
            rows.read(y, z);
            for (std::size_t x = 0; x < groups.size(); ++x)
                groups[x] = rows.counts(x) ? numbers_->of(rows.key(x)) : GroupedQuantiles::no_group;
            quantiles_->add(in.voxels.at(box.lower.x, y, z), groups.data(), n.x, omp_get_thread_num());
        }
    });
}

void GroupedStatistics::scan_end() {
    if (percents.values.empty()) return;
    if (!quantiles_) {
        std::vector<std::int64_t> keys, finite;
        for (auto const& [key, group] : result_.groups) {
            keys.push_back(key);
            finite.push_back(group.moments.finite);
        }
        numbers_ = std::make_shared<Numbers const>(std::move(keys));
        quantiles_.emplace(input_.dtype, percents.of_stored(input_.values), std::move(finite));
    } else if (quantiles_->in_pass()) {
        quantiles_->end_pass();
    }
    if (quantiles_->unfinished()) return;
    std::vector<std::int64_t> const& keys = numbers_->keys();
    for (std::size_t group = 0; group < keys.size(); ++group)
        for (std::size_t i = 0; i < percents.values.size(); ++i)
            result_.percentiles[keys[group]].push_back(
                quantiles_->count(group) > 0
                    ? percentile_of(percents.values[i], quantiles_->percentile(group, i), input_.values)
                    : Percentile{percents.values[i], "nan"});
}

} // namespace vkt
