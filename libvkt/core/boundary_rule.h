// The value of --boundary: how a volume continues outside its box, with the value of a constant border.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"

#include <cmath>
#include <cstdio>

namespace vkt {

/// "mirror", "clamp", "wrap", "border" or "border:VALUE" (0 by default; a physical value).
struct BoundaryRule {
    Boundary boundary = Boundary::clamp;
    double value = 0;

    friend bool operator==(BoundaryRule const&, BoundaryRule const&) = default;
};

template <> struct ValueText<BoundaryRule> : OneWord {
    static std::vector<std::string> choices() { return ValueText<Boundary>::choices(); }
    static BoundaryRule read(std::vector<std::string> const& w, std::string_view name) {
        std::string_view const word = w.front();
        std::size_t const colon = word.find(':');
        BoundaryRule rule;
        rule.boundary = parse_enum<Boundary>(word.substr(0, colon), name);
        if (colon == std::string_view::npos) return rule;
        if (rule.boundary != Boundary::border)
            throw Error(ErrorKind::usage, text(name, ": only 'border' takes a value, as in border:0"));
        rule.value = parse_double(word.substr(colon + 1));
        refuse_rounded(word.substr(colon + 1), rule.value, name);
        return rule;
    }
    /// A border value is a float64: a whole number that it does not hold would be another one.
    static void refuse_rounded(std::string_view digits, double value, std::string_view name) {
        if (!(std::abs(value) >= 0x1p53) || digits.find_first_not_of("+-0123456789") != std::string_view::npos) return;
        std::string nearest(400, '\0');
        nearest.resize(
            static_cast<std::size_t>(std::snprintf(nearest.data(), nearest.size(), "%.0f", std::abs(value))));
        std::string_view const given = digits.substr(std::min(digits.find_first_not_of("+-0"), digits.size()));
        if (given != nearest)
            throw Error(ErrorKind::usage, text(name, ": float64, which border values are, does not hold ", digits),
                        text("the nearest that it holds is ", value < 0 ? "-" : "", nearest));
    }
    static std::vector<std::string> write(BoundaryRule const& v) {
        std::string word = enum_name(v.boundary);
        if (v.boundary == Boundary::border) word.append(":").append(to_text(v.value));
        return {word};
    }
};

} // namespace vkt
