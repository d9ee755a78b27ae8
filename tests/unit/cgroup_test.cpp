// Limits of control groups, from folders that look like the kernel's.
// SPDX-License-Identifier: MIT
#include "libvkt/core/cgroup.h"

#include <cstdlib>
#include <fstream>
#include <gtest/gtest.h>
#include <limits>
#include <string>

namespace vkt {
namespace {

class Cgroup : public testing::Test {
protected:
    void SetUp() override {
        std::string name = testing::TempDir() + "vkt-cgroup-XXXXXX";
        ASSERT_NE(mkdtemp(name.data()), nullptr);
        root_ = name;
    }
    void TearDown() override { std::filesystem::remove_all(root_); }

    void write(std::string const& path, std::string const& text) {
        std::filesystem::create_directories((root_ / path).parent_path());
        std::ofstream(root_ / path) << text;
    }
    CgroupLimits limits() const { return cgroup_limits(root_); }

    std::filesystem::path root_;
};

TEST_F(Cgroup, NothingReadableIsNoLimit) {
    EXPECT_EQ(limits(), CgroupLimits{});
    write("proc/self/cgroup", "nonsense\n0::/gone/away\n");
    EXPECT_EQ(limits(), CgroupLimits{});
}

TEST_F(Cgroup, TheTightestOfOwnGroupAndThoseAroundIt) {
    write("proc/self/cgroup", "0::/slurm/job_7/step_0\n");
    write("sys/fs/cgroup/slurm/memory.max", "max\n");
    write("sys/fs/cgroup/slurm/job_7/memory.max", "4000000000\n");
    write("sys/fs/cgroup/slurm/job_7/step_0/memory.max", "8000000000\n");
    write("sys/fs/cgroup/slurm/cpu.max", "1600000 100000\n");
    write("sys/fs/cgroup/slurm/job_7/cpu.max", "max 100000\n");
    write("sys/fs/cgroup/slurm/job_7/step_0/cpu.max", "250000 100000\n");
    write("sys/fs/cgroup/slurm/job_8/memory.max", "1000\n"); // another's
    EXPECT_EQ(limits(), (CgroupLimits{4000000000, 2.5}));
}

TEST_F(Cgroup, TheRootOfAContainer) {
    write("proc/self/cgroup", "0::/\n");
    write("sys/fs/cgroup/memory.max", "1073741824\n");
    write("sys/fs/cgroup/cpu.max", "50000 100000\n");
    EXPECT_EQ(limits(), (CgroupLimits{1073741824, 0.5}));
    write("proc/self/cgroup", "0::/as/seen/outside\n"); // the container's own root is what it mounts
    EXPECT_EQ(limits(), (CgroupLimits{1073741824, 0.5}));
}

TEST_F(Cgroup, VersionOneHasAPathForEachController) {
    write("proc/self/cgroup", "5:memory:/batch/m\n4:cpu,cpuacct:/batch/c\n0::/\n");
    write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
    write("sys/fs/cgroup/memory/batch/memory.limit_in_bytes", "3000000000\n");
    write("sys/fs/cgroup/memory/batch/m/memory.limit_in_bytes", "9223372036854771712\n");
    write("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
    write("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
    write("sys/fs/cgroup/cpu/batch/c/cpu.cfs_quota_us", "300000\n");
    write("sys/fs/cgroup/cpu/batch/c/cpu.cfs_period_us", "100000\n");
    EXPECT_EQ(limits(), (CgroupLimits{3000000000, 3}));
}

TEST_F(Cgroup, WhatIsLeftIsTheLeastOfAllGroupsLessWhatCannotBeDropped) {
    EXPECT_EQ(cgroup_memory_left(root_), std::numeric_limits<std::size_t>::max());
    write("proc/self/cgroup", "0::/job/step\n");
    write("sys/fs/cgroup/job/memory.max", "1000\n");
    write("sys/fs/cgroup/job/memory.current", "900\n");
    write("sys/fs/cgroup/job/memory.stat", "anon 500\ninactive_file 300\nactive_file 100\n");
    write("sys/fs/cgroup/job/step/memory.max", "max\n");
    EXPECT_EQ(cgroup_memory_left(root_), 400u);
    write("sys/fs/cgroup/job/step/memory.max", "700\n");
    write("sys/fs/cgroup/job/step/memory.current", "650\n");
    EXPECT_EQ(cgroup_memory_left(root_), 50u);
    write("sys/fs/cgroup/job/step/memory.current", "800\n");
    EXPECT_EQ(cgroup_memory_left(root_), 0u);
}

} // namespace
} // namespace vkt
