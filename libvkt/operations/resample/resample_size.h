// How large a resampled volume is to be, as users say it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/parameters.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// A number of cells: "50000000", "50M" (k, M, G: thousands, millions, thousands of millions).
struct CellCount {
    std::int64_t value = 0;
};
template <> struct ValueText<CellCount> : OneWord {
    static CellCount read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(CellCount v) { return {to_text(v.value)}; }
};

/// Numbers of voxels along x, y and z; 0 stands for "auto", in proportion to the others.
struct WantedDims {
    WantedDims(Index3 v) : value(v) {}
    Index3 value;
};
/// Three words or one with commas, any but not all of them "auto".
template <> struct ValueText<WantedDims> {
    static constexpr int min_words = 3, max_words = 3;
    static std::vector<std::string> choices() { return {}; }
    static WantedDims read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(WantedDims v);
};

/// The nearest whole number of voxels, at least one. Throws Error{usage} beyond the largest extent.
std::int64_t rounded_extent(double voxels);
/// The numbers given, and for the axes without one the scale of those that have one.
Index3 filled_in(Index3 wanted, Index3 dims);
/// Throws Error{usage} if such a volume is too large: that was asked for, and is not the data's fault.
void check_wanted(Header const& output);

} // namespace vkt
