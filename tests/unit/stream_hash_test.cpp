// Hashing in pieces gives what hashing at once gives, whatever lay in memory before.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"

#include "libvkt/core/execution.h"
#include "libvkt/kernel/hash.h"

#include <gtest/gtest.h>
#include <vector>

namespace {

using namespace vkt;

TEST(StreamHash, PiecesGiveWhatTheWholeGives) {
    std::vector<std::byte> data(5000);
    for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::byte>(i * 7);
    for (std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{240}, std::size_t{420}, data.size()})
        for (std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{77}}) {
            ipc::StreamHash hasher(seed);
            for (std::size_t at = 0; at < n; at += 17)
                hasher.add({data.data() + at, std::min<std::size_t>(17, n - at)});
            EXPECT_EQ(hasher.value(), ipc::hash({data.data(), n}, seed)) << n;
        }
}

TEST(StreamHash, AllInstructionSetsGiveTheSame) {
    std::vector<std::byte> data(70000);
    for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::byte>(i * i >> 3);
    for (std::size_t n : {std::size_t{0}, std::size_t{16}, std::size_t{200}, std::size_t{1024}, data.size()}) {
        Execution execution;
        std::uint64_t expected = 0;
        hash_bytes({data.data(), n}, 5, expected, execution);
        for (auto set : {InstructionSet::avx2, InstructionSet::avx512}) {
            if (set > best_instruction_set()) continue;
            execution.instructions = set;
            std::uint64_t got = 0;
            hash_bytes({data.data(), n}, 5, got, execution);
            EXPECT_EQ(got, expected) << n << ' ' << name_of(set);
        }
        EXPECT_EQ(ipc::hash({data.data(), n}, 5), expected) << n;
    }
    // As xxhsum and other programs have it, so that streams of other builds are read.
    EXPECT_EQ(ipc::hash({}, 0), 0x2d06800538d394c2u);
}

TEST(StreamHash, MemoryThatWasUsedBeforeDoesNotMatter) {
    // The allocator hands the same block out again, in which only the old seed may have survived.
    std::vector<std::byte> const data(420, std::byte{3});
    std::uint64_t const expected = ipc::hash(data, 77);
    for (int i = 0; i < 100; ++i) {
        {
            ipc::StreamHash hasher(77);
            hasher.add(data);
            EXPECT_EQ(hasher.value(), expected);
        }
        std::vector<std::byte*> blocks;
        for (std::size_t size = 64; size < 1024; size += 64) {
            blocks.push_back(new std::byte[size]);
            std::fill_n(blocks.back(), size, static_cast<std::byte>(i));
        }
        for (auto* block : blocks) delete[] block;
    }
}

} // namespace
