// Touching runs of two rows against all pairs looked at one by one.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/touching_runs.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <set>
#include <utility>
#include <vector>

namespace vkt {
namespace {

using Row = std::vector<bool>;

std::vector<std::pair<int, int>> runs_of(Row const& row) {
    std::vector<std::pair<int, int>> runs; // first and last
    for (int i = 0; i < static_cast<int>(row.size()); ++i) {
        if (!row[static_cast<std::size_t>(i)]) continue;
        if (!runs.empty() && runs.back().second == i - 1)
            runs.back().second = i;
        else
            runs.emplace_back(i, i);
    }
    return runs;
}

std::vector<std::uint64_t> words_of(Row const& row) {
    std::vector<std::uint64_t> words((row.size() + 63) / 64);
    for (std::size_t i = 0; i < row.size(); ++i) words[i / 64] |= std::uint64_t{row[i]} << i % 64;
    return words;
}

TEST(TouchingRuns, AreAllPairsOnce) {
    std::mt19937 random(11);
    for (int round = 0; round < 3000; ++round) {
        std::size_t const n = 1 + random() % 200;
        double const share = 0.05 + 0.09 * (round % 11);
        Row a(n), b(n);
        for (std::size_t i = 0; i < n; ++i) {
            a[i] = static_cast<double>(random() % 1000) < 1000 * share;
            b[i] = static_cast<double>(random() % 1000) < 1000 * share;
        }
        auto const a_runs = runs_of(a), b_runs = runs_of(b);
        auto const a_words = words_of(a), b_words = words_of(b);
        for (bool const diagonal : {false, true}) {
            std::set<std::pair<std::uint32_t, std::uint32_t>> expected;
            int const reach = diagonal ? 1 : 0;
            for (std::size_t i = 0; i < a_runs.size(); ++i)
                for (std::size_t j = 0; j < b_runs.size(); ++j)
                    if (a_runs[i].first <= b_runs[j].second + reach && b_runs[j].first <= a_runs[i].second + reach)
                        expected.emplace(i, j);
            std::vector<RunPair> pairs(n + 2);
            std::int64_t count = 0;
            touching_runs(a_words.data(), b_words.data(), std::ssize(a_words), diagonal, pairs.data(), count, {});
            ASSERT_EQ(static_cast<std::size_t>(count), expected.size());
            for (std::int64_t k = 0; k < count; ++k) {
                auto const& pair = pairs[static_cast<std::size_t>(k)];
                ASSERT_EQ(expected.count({pair.a, pair.b}), 1U) << n << " positions, pair " << k;
                expected.erase({pair.a, pair.b});
            }
        }
    }
}

} // namespace
} // namespace vkt
