// Words into parameters, as callers inside the process give them.
// SPDX-License-Identifier: MIT
#include "libvkt/core/parameters.h"

#include <gtest/gtest.h>

namespace vkt {
namespace {

using Words = std::vector<std::string>;

struct Options {
    Index3 dims{};
    std::vector<double> numbers;
    std::vector<std::string> names;
    Parameters list;

    Options() {
        list.option("dims", dims, "X Y Z", "");
        list.option("numbers", numbers, "R G B A", "");
        list.option("names", names, "NAME", "");
    }
    Words read(Words const& words) { return read_words(words, {&list}); }
};

TEST(Parameters, ATupleTakesItsWordsAndNoMore) {
    for (Words const& words :
         {Words{"--dims", "1", "2", "3", "v"}, Words{"--dims", "1,2,3", "v"}, Words{"--dims=1,2,3", "v"},
          Words{"--dims=1", "2", "3", "v"}, Words{"v", "--dims=1,2,3"}}) {
        Options options;
        EXPECT_EQ(options.read(words), Words{"v"}) << join(words, " ");
        EXPECT_EQ(options.dims, (Index3{1, 2, 3})) << join(words, " ");
    }
    EXPECT_THROW(Options().read({"--dims", "1", "2"}), Error);
}

TEST(Parameters, AListOfNumbersEndsAtAnotherWord) {
    for (Words const& words : {Words{"--numbers", "1", "-0.5", "2e3", "v"}, Words{"--numbers=1", "-0.5", "2e3", "v"}}) {
        Options options;
        EXPECT_EQ(options.read(words), Words{"v"}) << join(words, " ");
        EXPECT_EQ(options.numbers, (std::vector<double>{1, -0.5, 2000})) << join(words, " ");
    }
    EXPECT_THROW(Options().read({"--numbers", "v"}), Error);
    Options options;
    EXPECT_EQ(options.read({"--names", "a", "1", "v"}), Words{}); // any word may be a name
}

} // namespace
} // namespace vkt
