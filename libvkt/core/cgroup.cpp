// Reading limits from the files of the kernel.
// SPDX-License-Identifier: MIT
#include "libvkt/core/cgroup.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace vkt {
namespace {

namespace fs = std::filesystem;

/// Where this process stands in the hierarchies; containers may show paths that do not exist in what they mount.
struct Groups {
    fs::path unified = "/", memory = "/", cpu = "/";
};

Groups own_groups(fs::path const& list) {
    Groups groups;
    std::ifstream file(list);
    for (std::string line; std::getline(file, line);) { // "4:cpu,cpuacct:/user.slice"
        std::size_t const first = line.find(':'), second = line.find(':', first + 1);
        if (first == std::string::npos || second == std::string::npos) continue;
        fs::path const group = fs::path(line.substr(second + 1)).lexically_normal();
        if (second == first + 1) groups.unified = group;
        for (std::string const& controller : split(line.substr(first + 1, second - first - 1), ',')) {
            if (controller == "memory") groups.memory = group;
            if (controller == "cpu") groups.cpu = group;
        }
    }
    return groups;
}

/// Calls f with the folder of a group and of all around it, up to the root of the hierarchy.
template <class F> void for_each_group(fs::path const& hierarchy, fs::path const& group, F const& f) {
    fs::path folder = hierarchy;
    f(folder);
    for (fs::path const& part : group.relative_path()) f(folder /= part);
}

template <class T> void tighten(T& limit, T other) {
    if (other > 0 && (limit == 0 || other < limit)) limit = other;
}

void limit_memory(fs::path const& path, CgroupLimits& limits) {
    std::ifstream file(path);
    std::size_t bytes = 0; // "max", or in version 1 nearly 2^63, is no limit
    if (file >> bytes && bytes < (std::size_t{1} << 60)) tighten(limits.memory, bytes);
}

/// The quota and its period; "max", or in version 1 -1, is no limit.
void limit_cpus(std::istream& quota_file, std::istream& period_file, CgroupLimits& limits) {
    double quota = 0, period = 0;
    if (quota_file >> quota && period_file >> period && quota > 0 && period > 0) tighten(limits.cpus, quota / period);
}

} // namespace

namespace {

/// A number that stands after a word of a file such as memory.stat.
std::size_t number_after(fs::path const& path, std::string const& word) {
    std::ifstream file(path);
    std::string key;
    std::size_t value = 0;
    while (file >> key >> value)
        if (key == word) return value;
    return 0;
}

/// What a group has left, if it has a limit. Pages of files that were not used lately are dropped when need be.
void reckon(fs::path const& folder, char const* limit_file, char const* use_file, char const* files,
            std::size_t& left) {
    CgroupLimits limits;
    limit_memory(folder / limit_file, limits);
    if (limits.memory == 0) return;
    std::ifstream file(folder / use_file);
    std::size_t use = 0;
    if (!(file >> use)) return;
    std::size_t const dropped = number_after(folder / "memory.stat", files);
    use -= std::min(use, dropped);
    left = std::min(left, limits.memory - std::min(limits.memory, use));
}

} // namespace

std::size_t cgroup_memory_left(fs::path const& root) {
    std::size_t left = std::numeric_limits<std::size_t>::max();
    Groups const groups = own_groups(root / "proc/self/cgroup");
    fs::path const mount = root / "sys/fs/cgroup";
    for_each_group(mount, groups.unified, [&](fs::path const& folder) {
        reckon(folder, "memory.max", "memory.current", "inactive_file", left);
    });
    for_each_group(mount / "memory", groups.memory, [&](fs::path const& folder) {
        reckon(folder, "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file", left);
    });
    return left;
}

CgroupLimits cgroup_limits(fs::path const& root) {
    CgroupLimits limits;
    Groups const groups = own_groups(root / "proc/self/cgroup");
    fs::path const mount = root / "sys/fs/cgroup";
    for_each_group(mount, groups.unified, [&](fs::path const& folder) {
        limit_memory(folder / "memory.max", limits);
        std::ifstream file(folder / "cpu.max"); // "200000 100000"
        limit_cpus(file, file, limits);
    });
    for_each_group(mount / "memory", groups.memory,
                   [&](fs::path const& folder) { limit_memory(folder / "memory.limit_in_bytes", limits); });
    for_each_group(mount / "cpu", groups.cpu, [&](fs::path const& folder) {
        std::ifstream quota_file(folder / "cpu.cfs_quota_us"), period_file(folder / "cpu.cfs_period_us");
        limit_cpus(quota_file, period_file, limits);
    });
    return limits;
}

} // namespace vkt
