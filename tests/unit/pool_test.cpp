// Blocks that are kept: used again, within their number of bytes, given back when asked and when memory is short.
// SPDX-License-Identifier: MIT
#include "libvkt/core/pool.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"

#include <cstring>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace vkt {
namespace {

constexpr std::size_t mib = std::size_t{1} << 20;

class Pool : public testing::Test {
protected:
    void SetUp() override { keep_blocks(0); }
    void TearDown() override {
        keep_blocks(0);
        EXPECT_EQ(kept_block_bytes(), 0u);
    }
};

TEST_F(Pool, KeepsNothingUntilAsked) {
    free_host(allocate_host(8 * mib), 8 * mib);
    EXPECT_EQ(kept_block_bytes(), 0u);
}

TEST_F(Pool, GivesOutWhatItKeptAndCutsOffLittle) {
    keep_blocks(64 * mib);
    std::byte* const first = allocate_host(9 * mib + 5); // in whole pages of 4 KiB
    std::memset(first, 7, 9 * mib + 5);
    free_host(first, 9 * mib + 5);
    EXPECT_EQ(kept_block_bytes(), 9 * mib + 4096);
    std::byte* const again = allocate_host(8 * mib);
    EXPECT_EQ(again, first);
    EXPECT_EQ(kept_block_bytes(), 0u);
    std::memset(again, 8, 8 * mib);
    free_host(again, 8 * mib);
    EXPECT_EQ(kept_block_bytes(), 8 * mib);
    // Of a block much larger than what is asked for nothing is cut.
    std::byte* const small = allocate_host(2 * mib);
    EXPECT_NE(small, first);
    free_host(small, 2 * mib);
    EXPECT_EQ(kept_block_bytes(), 10 * mib);
    EXPECT_EQ(release_blocks(), 10 * mib);
    EXPECT_EQ(kept_block_bytes(), 0u);
}

TEST_F(Pool, WhatIsKeptAndWhatIsAskedForStayWithinTheBudget) {
    keep_blocks(20 * mib);
    std::vector<std::byte*> blocks;
    for (int i = 0; i < 5; ++i) blocks.push_back(allocate_host(6 * mib));
    for (std::byte* block : blocks) free_host(block, 6 * mib);
    EXPECT_EQ(kept_block_bytes(), 18 * mib);
    std::byte* const large = allocate_host(12 * mib);
    EXPECT_EQ(kept_block_bytes(), 6 * mib);
    std::byte* const larger = allocate_host(40 * mib);
    EXPECT_EQ(kept_block_bytes(), 0u);
    free_host(larger, 40 * mib); // more than may be kept
    EXPECT_EQ(kept_block_bytes(), 0u);
    free_host(large, 12 * mib);
    EXPECT_EQ(kept_block_bytes(), 12 * mib);
    keep_blocks(4 * mib);
    EXPECT_EQ(kept_block_bytes(), 0u);
}

TEST_F(Pool, BlocksAreWholeWhateverThreadsDo) {
    keep_blocks(64 * mib);
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([t] {
            for (int i = 0; i < 200; ++i) {
                std::size_t const bytes = (2 + static_cast<std::size_t>((i + t) % 3)) * mib;
                std::byte* const block = allocate_host(bytes);
                block[0] = block[bytes - 1] = static_cast<std::byte>(t);
                std::this_thread::yield();
                ASSERT_EQ(block[0], static_cast<std::byte>(t));
                ASSERT_EQ(block[bytes - 1], static_cast<std::byte>(t));
                free_host(block, bytes);
            }
        });
    for (auto& thread : threads) thread.join();
}

/// In a child, whose address space may be limited: what is kept makes room for what is asked for.
TEST_F(Pool, GivesWayWhenThereIsNoMemory) {
    pid_t const child = ::fork();
    if (child == 0) {
        std::size_t pages = 0;
        if (FILE* file = std::fopen("/proc/self/statm", "r")) {
            if (std::fscanf(file, "%zu", &pages) != 1) pages = 0;
            std::fclose(file);
        }
        keep_blocks(1024 * mib);
        rlimit const limit{pages * 4096 + 300 * mib, RLIM_INFINITY};
        if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(2);
        free_host(allocate_host(200 * mib), 200 * mib);
        if (kept_block_bytes() != 200 * mib) ::_exit(3);
        std::byte* const large = allocate_host(250 * mib);
        if (kept_block_bytes() != 0) ::_exit(4);
        large[0] = std::byte{1};
        try {
            allocate_host(250 * mib);
        } catch (Error const& e) {
            ::_exit(e.kind() == ErrorKind::resources ? 0 : 5);
        }
        ::_exit(6);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
}

} // namespace
} // namespace vkt
