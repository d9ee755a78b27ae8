// Vectors made of what a function gives for each element of a range.
// SPDX-License-Identifier: MIT
#pragma once

#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

namespace vkt {

/// {function(element), …}
template <class Range, class Function> auto collect(Range const& range, Function&& function) {
    std::vector<std::decay_t<decltype(function(*std::begin(range)))>> result;
    result.reserve(static_cast<std::size_t>(std::size(range)));
    for (auto const& element : range) result.push_back(function(element));
    return result;
}

} // namespace vkt
