// Every operation that a plan can be made of has a rate, or is known to have none.
// SPDX-License-Identifier: MIT
#include "shell/machine/typical_rates.h"

#include "libvkt/engine/registry.h"

#include <gtest/gtest.h>
#include <set>
#include <string>

namespace vkt::shell {
namespace {

TEST(TypicalRates, NameEveryOperation) {
    // Nothing is computed by these, or trees come or go.
    std::set<std::string_view> const without{"set",      "declare-sv", "crop",       "info",       "refine",
                                             "make amr", "reorient",   "fill-range", "flip-range", "dump-range"};
    std::set<std::string_view> known;
    for (auto const& rate : typical_rates()) {
        known.insert(rate.operation);
        bool any = false;
        for (double const each : rate.nanoseconds) {
            EXPECT_GE(each, 0) << rate.operation;
            any = any || each > 0;
        }
        EXPECT_TRUE(any) << rate.operation << ": " << rate.method;
        EXPECT_TRUE(rate.shared >= 0 && rate.shared <= 1) << rate.operation;
    }
    for (auto const& operation : operations())
        EXPECT_NE(known.contains(operation.name), without.contains(operation.name)) << operation.name;
}

TEST(TypicalRates, AreThoseOfACalibration) {
    EXPECT_GE(typical_calibration().size(), 20U);
    for (auto const& rate : typical_calibration()) {
        EXPECT_GT(rate.nanoseconds, 0) << rate.operation;
        EXPECT_TRUE(rate.bytes == 2 || rate.bytes == 4) << rate.operation;
    }
}

} // namespace
} // namespace vkt::shell
