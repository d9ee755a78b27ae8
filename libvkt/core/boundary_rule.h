// The value of --boundary: how a volume continues outside its box, with the value of a constant border.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"

namespace vkt {

/// "mirror", "clamp", "wrap", "border" or "border:VALUE" (0 by default; a physical value).
struct BoundaryRule {
    Boundary boundary = Boundary::clamp;
    double value = 0;

    friend bool operator==(BoundaryRule const&, BoundaryRule const&) = default;
};

template <>
struct ValueText<BoundaryRule> : OneWord {
    static std::vector<std::string> choices() { return ValueText<Boundary>::choices(); }
    static BoundaryRule read(std::vector<std::string> const& w, std::string_view name) {
        std::string_view const word = w.front();
        std::size_t const colon = word.find(':');
        BoundaryRule rule;
        rule.boundary = parse_enum<Boundary>(word.substr(0, colon), name);
        if (colon == std::string_view::npos) return rule;
        if (rule.boundary != Boundary::border)
            throw Error(ErrorKind::usage, text("--", name, ": only 'border' takes a value, as in border:0"));
        rule.value = parse_double(word.substr(colon + 1));
        return rule;
    }
    static std::vector<std::string> write(BoundaryRule const& v) {
        std::string word = enum_name(v.boundary);
        if (v.boundary == Boundary::border) word.append(":").append(to_text(v.value));
        return {word};
    }
};

} // namespace vkt
