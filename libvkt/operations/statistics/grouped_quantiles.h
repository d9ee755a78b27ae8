// Percentiles of many groups of voxels at once, exact, from a few passes in bounded memory.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/large_vector.h"
#include "libvkt/core/view.h"
#include "libvkt/operations/statistics/kernels/grouped_counts.h"
#include "libvkt/operations/statistics/quantiles.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace vkt {

/// Selects like Quantiles, by the bits of voxels at the wanted ranks, from groups whose finite voxels were counted
/// before. Of each class of voxels (those of a group that begin with the same known bits) a pass counts the next bits,
/// or keeps the voxels where these are fewer. How many bits are next, 4 to 16, is what memory has room for; so tables
/// of thousands of groups are small, and take more passes. The result depends on none of that.
class GroupedQuantiles {
public:
    static constexpr std::uint32_t no_group = 0xffffffff;

    /// `percents` in [0,100]; `finite`: voxels of each group that are neither infinite nor NaN.
    GroupedQuantiles(DataType type, std::vector<double> percents, std::vector<std::int64_t> finite);

    /// Bytes that are held of a group whatever its voxels are.
    static std::size_t bytes_of_group(std::size_t percents);

    /// True if there is something left to find out: all voxels must be added, between begin_pass() and end_pass().
    bool unfinished() const { return unfinished_; }
    bool in_pass() const { return in_pass_; }
    /// Tables take up to `room` bytes, with fewer threads where there is no room for those of all. Throws
    /// Error{resources} where even the smallest have none.
    void begin_pass(std::size_t room, int threads);
    /// Threads of a pass are numbered from 0 to this less 1.
    int threads() const { return threads_; }
    /// Voxels of the type and the groups that they belong to, from any number of threads at once.
    void add(std::byte const* voxels, std::uint32_t const* groups, std::int64_t n, int thread);
    /// Or the voxels of a slab that lies on a GPU, in a pass that began with one thread; `keys`: of the groups,
    /// ascending.
    void add(GroupedSlab const& slab, std::vector<std::int64_t> const& keys, Execution const& execution);
    /// Throws Error{data} if other voxels came than were counted before.
    void end_pass();

    std::int64_t count(std::size_t group) const { return finite_[group]; }
    /// After the last pass, of a group that has a finite voxel.
    StoredValue percentile(std::size_t group, std::size_t i) const;

private:
    struct Target {
        std::int64_t rank = 0;    ///< among the voxels of its class
        std::uint64_t prefix = 0; ///< the bits that are known
        std::int64_t voxels = 0;  ///< of its class
        bool found = false;       ///< all bits are
    };
    using Class = QuantileClass;
    struct Tables {
        std::int64_t counters = 0, kept = 0;
        double bytes(int threads) const {
            return 8 * (static_cast<double>(counters) * threads + static_cast<double>(kept));
        }
    };

    void make_classes();
    Tables tables(int step) const;
    QuantileClasses sought() const { return {classes_.data(), first_class_.data(), width_, known_, step_}; }
    void begin_on_device(std::vector<std::int64_t> const& keys);
    void end_on_device();
    template <class T> void add_row(T const* row, std::uint32_t const* groups, std::int64_t n, std::int64_t* counters);
    void resolve(Class const& of, Target* targets, std::int64_t* counters);

    DataType type_;
    int width_;                ///< bits of a voxel
    int known_ = 0, step_ = 0; ///< bits that are known, and those that a pass adds
    int threads_ = 1;
    bool unfinished_ = false, in_pass_ = false;
    std::vector<double> percents_;
    std::vector<std::int64_t> finite_;
    std::vector<Target> targets_;            ///< two for every percentile of every group
    std::vector<std::uint32_t> first_class_; ///< of every group, and the end
    std::vector<Class> classes_;
    LargeVector<std::int64_t> counters_; ///< of one thread after the other
    LargeVector<std::uint64_t> kept_;
    std::vector<std::int64_t> arrived_;       ///< of every class that keeps its voxels
    std::shared_ptr<DeviceQuantiles> device_; ///< in a pass on a GPU, until it ends
};

} // namespace vkt
