// The limits of the control groups this process is in.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>

namespace vkt {

/// Limits, 0 for none.
struct CgroupLimits {
    std::size_t memory = 0; ///< bytes
    double cpus = 0;        ///< CPU time per time
    friend bool operator==(CgroupLimits const&, CgroupLimits const&) = default;
};

/// The tightest limits of this process's groups and of all groups around them, as proc/self/cgroup and sys/fs/cgroup
/// below `root` say, version 1 and 2. What cannot be read sets no limit.
CgroupLimits cgroup_limits(std::filesystem::path const& root = "/");

/// Bytes that the groups still have for this process's memory: limit less what is in use and cannot be dropped, at
/// the tightest; the largest number there is without a limit.
std::size_t cgroup_memory_left(std::filesystem::path const& root = "/");

} // namespace vkt
