// Ranges of numbers as options give them: "LO:HI", both ends taken.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/common/number.h"

#include <cmath>

namespace vkt {

/// All v with low <= v <= high; an end that is left out is infinite.
struct NumberRange {
    Number low, high;
    friend bool operator==(NumberRange const&, NumberRange const&) = default;
};

template <> struct ValueText<NumberRange> : OneWord {
    static NumberRange read(std::vector<std::string> const& w, std::string_view name) {
        std::string const& word = w.front();
        std::size_t const colon = word.find(':');
        if (colon == std::string::npos || word.find(':', colon + 1) != std::string::npos || word == ":")
            throw Error(ErrorKind::usage, text(name, ": '", word, "' is not a range LO:HI"),
                        "for example 100:200, 100: or :200");
        auto const end = [&](std::string const& digits, double open) {
            return digits.empty() ? Number(open) : ValueText<Number>::read({digits}, name);
        };
        NumberRange const range{end(word.substr(0, colon), -HUGE_VAL), end(word.substr(colon + 1), HUGE_VAL)};
        bool const whole = range.low.whole && range.high.whole;
        if (!(whole ? *range.low.whole <= *range.high.whole : range.low.value <= range.high.value))
            throw Error(ErrorKind::usage,
                        text(name, ": '", word, "' is empty: the first end must not be above the second"));
        return range;
    }
    static std::vector<std::string> write(NumberRange const& v) {
        auto const end = [](Number const& n) { return std::isinf(n.value) ? std::string() : to_text(n); };
        return {text(end(v.low), ":", end(v.high))};
    }
};

} // namespace vkt
