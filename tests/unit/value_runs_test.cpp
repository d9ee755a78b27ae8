// Runs of equal voxels, 32 at a time as on GPUs, against all pairs of voxels looked at one by one.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/value_runs.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <random>
#include <set>
#include <utility>
#include <vector>

namespace vkt {
namespace {

using Row = std::vector<int>; ///< 0: of no run

bool starts_run(Row const& row, std::size_t x) { return row[x] != 0 && (x == 0 || row[x - 1] != row[x]); }

ValueRuns word_of(Row const& row, std::size_t w) {
    ValueRuns word;
    std::size_t const begin = 32 * w, end = begin + 32;
    for (std::size_t x = begin; x < end && x < row.size(); ++x) {
        word.bits |= std::uint32_t{row[x] != 0} << (x - begin);
        word.starts |= std::uint32_t{starts_run(row, x)} << (x - begin);
    }
    word.before = begin > 0 && row[begin - 1] != 0;
    bool const next = end < row.size() && row[end] != 0;
    word.next_starts = next && starts_run(row, end);
    word.next_goes_on = next && !word.next_starts;
    return word;
}

/// The number of the run that each voxel is of.
std::vector<std::uint32_t> runs_of(Row const& row) {
    std::vector<std::uint32_t> runs;
    std::uint32_t count = 0;
    for (std::size_t x = 0; x < row.size(); ++x) runs.push_back((count += starts_run(row, x) ? 1 : 0) - 1);
    return runs;
}

using Pairs = std::set<std::pair<std::uint32_t, std::uint32_t>>;

Pairs found(Row const& own, Row const& other, bool diagonally) {
    Pairs pairs;
    std::uint32_t own_before = 0, other_before = 0;
    auto const count = [](std::uint32_t bits) { return std::popcount(bits); };
    for (std::size_t w = 0; w * 32 < own.size(); ++w) {
        ValueRuns const a = word_of(own, w), b = word_of(other, w);
        auto const each = [&](std::uint32_t bits, auto const& run_of) {
            for (; bits != 0; bits &= bits - 1) {
                int const bit = std::countr_zero(bits);
                pairs.emplace(a.run_at(own_before, bit, count), run_of(bit));
            }
        };
        each(a.facing(b), [&](int bit) { return b.run_at(other_before, bit, count); });
        if (diagonally) {
            each(a.touching_left(b), [&](int bit) { return b.run_left_of(other_before, bit, count); });
            each(a.touching_right(b), [&](int bit) { return b.run_right_of(other_before, bit, count); });
        }
        own_before += static_cast<std::uint32_t>(count(a.starts));
        other_before += static_cast<std::uint32_t>(count(b.starts));
    }
    return pairs;
}

TEST(ValueRuns, TouchWhereTheirVoxelsDo) {
    std::mt19937 random(5);
    for (int round = 0; round < 4000; ++round) {
        std::size_t const n = 1 + random() % 140;
        auto const stay = random() % 10, values = 1 + random() % 3;
        auto const row = [&] {
            Row made(n);
            for (std::size_t x = 0; x < n; ++x)
                made[x] = x > 0 && random() % 10 < stay ? made[x - 1] : static_cast<int>(random() % (values + 1));
            return made;
        };
        Row const own = row(), other = row();
        auto const own_runs = runs_of(own), other_runs = runs_of(other);
        for (int const reach : {0, 1}) {
            Pairs expected;
            for (std::size_t x = 0; x < n; ++x)
                for (std::size_t near = x < 1 || reach == 0 ? x : x - 1;
                     near <= x + static_cast<std::size_t>(reach) && near < n; ++near)
                    if (own[x] != 0 && other[near] != 0) expected.emplace(own_runs[x], other_runs[near]);
            ASSERT_EQ(found(own, other, reach == 1), expected) << n << " voxels, round " << round;
        }
    }
}

} // namespace
} // namespace vkt
