// The example in the comment of kernel.h, compiled as it stands there.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/kernel.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace vkt::baseline {
namespace {

// The example begins here.
template <class C> struct Inside {
    C low, high;
    VKT_HD C operator()(C v) const { return v >= low && v <= high ? C(1) : C(0); }
};
void threshold(ConstView in, AnyView out, double low, double high, Losses& losses, Execution const& execution) {
    with_compute_type(in.type, [&]<class C>(C) { map<C>(execution, out, losses, Inside<C>{C(low), C(high)}, in); });
}
// The example ends here.

/// Words of the lines between two, without what begins comments.
std::string words_between(std::string const& file, std::string const& first, std::string const& last) {
    std::ifstream in(file);
    std::string words;
    bool inside = false;
    for (std::string line; std::getline(in, line);) {
        if (line.find(last) != std::string::npos) inside = false;
        if (inside) {
            std::istringstream text(line);
            for (std::string word; text >> word;)
                if (word != "//") words += word + " ";
        }
        if (line.find(first) != std::string::npos) inside = true;
    }
    return words;
}

TEST(KernelExample, IsTheOneOfTheHeaderAndWorks) {
    std::vector<std::int16_t> voxels{-3, 0, 1, 5, 6, 7};
    std::vector<std::uint8_t> result(voxels.size(), 9);
    Box const box{{}, {3, 2, 1}};
    ConstView const in(dense_view(reinterpret_cast<std::byte*>(voxels.data()), DataType::int16, box));
    AnyView const out = dense_view(reinterpret_cast<std::byte*>(result.data()), DataType::uint8, box);
    Losses losses;
    threshold(in, out, 0, 5, losses, {});
    EXPECT_EQ(result, (std::vector<std::uint8_t>{0, 1, 1, 1, 0, 0}));

    char const* const root = std::getenv("VKT_ROOT");
    if (root == nullptr) GTEST_SKIP() << "VKT_ROOT does not name the sources";
    std::string const shown =
        words_between(std::string(root) + "/libvkt/kernel/kernel.h", "has is_identity", "#include");
    EXPECT_NE(shown, "");
    EXPECT_EQ(shown, words_between(std::string(root) + "/tests/unit/kernel_example_test.cpp",
                                   "// The example begins"
                                   " here.",
                                   "// The example ends"
                                   " here."));
}

} // namespace
} // namespace vkt::baseline
