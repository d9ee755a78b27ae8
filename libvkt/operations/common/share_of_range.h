// A tolerance as a share, as options take it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/core/text.h"

namespace vkt {

/// A share of the value range, written in percent: "0.0001%". A tolerance without the sign is one in values, as diff
/// and refine take it.
struct ShareOfRange {
    double percent = 0;
    double share() const { return percent / 100; }
};
template <> struct ValueText<ShareOfRange> : OneWord {
    static ShareOfRange read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(ShareOfRange v) { return {text(v.percent, "%")}; }
};

/// Throws Error{usage} for a tolerance of less than 1e-10 %, or of 100 % or more.
void check_tolerance(ShareOfRange tolerance);

} // namespace vkt
