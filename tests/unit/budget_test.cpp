// Dividing an error budget: the greedy walk against all choices.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/budget.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace {

using namespace vkt;

/// A chain of filters: each setting of a stage has ten times less error than the one before, passed on by what follows,
/// and a radius that grows with its logarithm.
struct Stages {
    std::vector<std::size_t> counts;
    std::vector<double> gain, scale, radius, voxels;

    Outcome operator()(Settings const& at) const {
        Outcome outcome;
        for (std::size_t k = 0; k < at.size(); ++k) {
            auto const setting = static_cast<double>(at[k]);
            outcome.error += gain[k] * scale[k] * std::pow(10, -setting);
            outcome.cost += voxels[k] * std::ceil(radius[k] * std::sqrt(2 * std::log(10) * (setting + 1)));
        }
        return outcome;
    }
};

Stages random_stages(std::mt19937& random, std::size_t stages) {
    std::uniform_real_distribution<double> unit(0, 1);
    Stages chain;
    for (std::size_t k = 0; k < stages; ++k) {
        chain.counts.push_back(2 + random() % 4);
        chain.gain.push_back(std::exp(2 * unit(random)));
        chain.scale.push_back(std::exp(4 * unit(random) - 2));
        chain.radius.push_back(1 + 9 * unit(random));
        chain.voxels.push_back(std::exp(3 * unit(random)));
    }
    return chain;
}

TEST(Budget, TheGreedyWalkIsNearlyTheBestOfAll) {
    std::mt19937 random(7);
    double worst = 1, sum = 0;
    int cases = 0;
    for (int i = 0; i < 60; ++i) {
        Stages const chain = random_stages(random, 2 + random() % 5);
        Settings tightest, loosest(chain.counts.size(), 0);
        for (std::size_t const count : chain.counts) tightest.push_back(count - 1);
        double const least = chain(tightest).error, most = chain(loosest).error;
        double const limit = least * std::pow(most / least, 0.1 + 0.8 * static_cast<double>(i % 9) / 8);
        auto const best = cheapest_within(limit, chain.counts, chain, std::size_t{1} << 20);
        auto const greedy = cheapest_within(limit, chain.counts, chain, 0);
        ASSERT_TRUE(best && greedy);
        EXPECT_LE(chain(*best).error, limit);
        EXPECT_LE(chain(*greedy).error, limit);
        double const ratio = chain(*greedy).cost / chain(*best).cost;
        EXPECT_GE(ratio, 1 - 1e-12);
        worst = std::max(worst, ratio);
        sum += ratio;
        ++cases;
    }
    EXPECT_LE(worst, 1.25);
    EXPECT_LE(sum / cases, 1.03);
    RecordProperty("worst", std::to_string(worst));
}

TEST(Budget, WhatCannotBeReachedIsNone) {
    std::mt19937 random(8);
    Stages const chain = random_stages(random, 4);
    EXPECT_FALSE(cheapest_within(0, chain.counts, chain, 0));
    EXPECT_FALSE(cheapest_within(0, chain.counts, chain));
    EXPECT_EQ(cheapest_within(1e9, chain.counts, chain), Settings(4, 0));
    EXPECT_EQ(cheapest_within(1, {}, [](Settings const&) { return Outcome{0.5, 1}; }), Settings{});
    EXPECT_FALSE(cheapest_within(0.1, {}, [](Settings const&) { return Outcome{0.5, 1}; }));
}

} // namespace
