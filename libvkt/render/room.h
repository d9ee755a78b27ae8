// Memory that is touched a piece at a time, so that somebody who waits can end it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/goal.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <sys/mman.h>
#include <vector>

namespace vkt::render {

/// So many zeros, in huge pages where there are many; `finish(first, last)` is called for every piece while it is in
/// cache. The largest pictures take gigabytes, which are touched for seconds: asked to stop in between, it returns
/// false, and the vector is empty.
template <class T, class Finish>
bool make_room(std::vector<T>& numbers, std::size_t count, Watch const& watch, Finish const& finish) {
    numbers.clear();
    numbers.reserve(count);
    constexpr std::uintptr_t page = std::uintptr_t{2} << 20;
    auto const begin = reinterpret_cast<std::uintptr_t>(numbers.data()), end = begin + count * sizeof(T);
    std::uintptr_t const first = (begin + page - 1) / page * page;
    if (end > first + page) ::madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE); // advice only
    constexpr std::size_t piece = (std::size_t{1} << 20) / sizeof(T);
    for (std::size_t from = 0; from < count; from += piece) {
        std::size_t const to = std::min(count, from + piece);
        numbers.resize(to);
        finish(from, to);
        // Small pictures are made whole.
        constexpr std::size_t pieces = 64;
        if (to < count && to / piece % pieces == 0 && watch.stop && watch.stop()) {
            std::vector<T>().swap(numbers);
            return false;
        }
    }
    return true;
}
template <class T> bool make_room(std::vector<T>& numbers, std::size_t count, Watch const& watch) {
    return make_room(numbers, count, watch, [](std::size_t, std::size_t) {});
}

} // namespace vkt::render
