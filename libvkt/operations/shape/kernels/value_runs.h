// Runs of equal voxels as words of 32 bits: where two rows of them touch, and which runs do.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

#include <cstdint>

namespace vkt {

/// 32 voxels of a row, some of which are of runs. A run ends where no voxel is, and where the next one starts.
struct ValueRuns {
    std::uint32_t bits = 0;                         ///< voxels of runs
    std::uint32_t starts = 0;                       ///< … with which a run starts
    bool before = false;                            ///< the voxel before these is of a run
    bool next_goes_on = false, next_starts = false; ///< so is the next one: of the same as the last one, or another

    /// Voxels whose runs go on with the next one.
    VKT_HD std::uint32_t going_on() const { return (bits & ~starts) >> 1 | (next_goes_on ? 1u << 31 : 0u); }

    /// Voxels at which a run and one of another row begin to face each other.
    VKT_HD std::uint32_t facing(ValueRuns const& other) const { return bits & other.bits & (starts | other.starts); }
    /// Voxels whose run touches a run of another row that ends with the voxel before them, and faces none of theirs.
    VKT_HD std::uint32_t touching_left(ValueRuns const& other) const {
        return starts & (other.bits << 1 | (other.before ? 1u : 0u)) & ~(other.bits & ~other.starts);
    }
    /// Voxels whose run touches one of another row that starts with the voxel after them, and faces none of theirs.
    VKT_HD std::uint32_t touching_right(ValueRuns const& other) const {
        return bits & ~going_on() & (other.starts >> 1 | (other.next_starts ? 1u << 31 : 0u));
    }

    /// Of so many runs that start before these voxels: the last one that starts up to voxel b, before it, and up to the
    /// one after it.
    template <class Count> VKT_HD std::uint32_t run_at(std::uint32_t runs_before, int b, Count const& count) const {
        return runs_before + static_cast<std::uint32_t>(count(starts & ~0u >> (31 - b))) - 1;
    }
    template <class Count>
    VKT_HD std::uint32_t run_left_of(std::uint32_t runs_before, int b, Count const& count) const {
        return runs_before + static_cast<std::uint32_t>(count(starts & ((1u << b) - 1))) - 1;
    }
    template <class Count>
    VKT_HD std::uint32_t run_right_of(std::uint32_t runs_before, int b, Count const& count) const {
        if (b < 31) return run_at(runs_before, b + 1, count);
        return runs_before + static_cast<std::uint32_t>(count(starts)) - (next_starts ? 0u : 1u);
    }
};

} // namespace vkt
