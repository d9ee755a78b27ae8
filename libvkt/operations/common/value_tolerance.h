// A tolerance in values, or as a share of their range.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/core/text.h"

namespace vkt {

/// An error that is allowed: a physical value, or with the sign % a share of the value range, as ShareOfRange.
struct ValueTolerance {
    double number = 0;
    bool percent = false;

    /// As a physical value, for values in a range so wide.
    double within(double range) const { return percent ? number / 100 * range : number; }
};
template <> struct ValueText<ValueTolerance> : OneWord {
    static ValueTolerance read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(ValueTolerance v) { return {text(v.number, v.percent ? "%" : "")}; }
};

} // namespace vkt
