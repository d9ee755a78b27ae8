// Hashing in pieces gives what hashing at once gives, whatever lay in memory before.
// SPDX-License-Identifier: MIT
#include "ipc/frame.h"

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
