// Sorting and selection networks, made by the compiler: what no result depends on is left out.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <algorithm>
#include <array>
#include <utility>

namespace vkt::VKT_BACKEND {

/// Puts the lesser of two values into `low` and the greater into `high`, or only one of the two.
struct Exchange {
    short low = 0, high = 0;
    bool least = true, greatest = true;
};

/// A list of exchanges among values[0…]; results lie where `places` says, in ascending order.
template <int capacity> struct Network {
    std::array<Exchange, static_cast<std::size_t>(capacity)> steps{};
    int count = 0;

    constexpr void add(int low, int high) {
        steps[static_cast<std::size_t>(count++)] = {static_cast<short>(low), static_cast<short>(high)};
    }

    /// Batcher's merge of two sorted lists of places; returns the places of the sorted whole.
    template <std::size_t a, std::size_t b>
    constexpr std::array<int, a + b> merge(std::array<int, a> const& first, std::array<int, b> const& second) {
        constexpr int half = power_from(a > b ? a : b), all = 2 * half;
        std::array<int, static_cast<std::size_t>(all)> wire{}; // -1: above everything, never compared
        for (int i = 0; i < all; ++i) wire[static_cast<std::size_t>(i)] = -1;
        for (std::size_t i = 0; i < a; ++i) wire[i] = first[i];
        for (std::size_t i = 0; i < b; ++i) wire[static_cast<std::size_t>(half) + i] = second[i];
        for (int k = half; k >= 1; k /= 2)
            for (int j = k % half; j + k < all; j += 2 * k)
                for (int i = 0; i < k; ++i) {
                    int& low = wire[static_cast<std::size_t>(i + j)];
                    int& high = wire[static_cast<std::size_t>(i + j + k)];
                    if (high < 0) continue;
                    if (low < 0)
                        std::swap(low, high);
                    else
                        add(low, high);
                }
        std::array<int, a + b> places{};
        for (std::size_t i = 0; i < a + b; ++i) places[i] = wire[i];
        return places;
    }

    /// Batcher's sort of the first n values, in place.
    constexpr void sort(int n) {
        int const all = power_from(static_cast<std::size_t>(n));
        for (int p = 1; p < all; p *= 2)
            for (int k = p; k >= 1; k /= 2)
                for (int j = k % p; j + k < all; j += 2 * k)
                    for (int i = 0; i < k; ++i)
                        if ((i + j) / (2 * p) == (i + j + k) / (2 * p) && i + j + k < n) add(i + j, i + j + k);
    }

    /// Rank `rank`, counted from 0, of two sorted lists of places; returns its place.
    template <std::size_t a, std::size_t b>
    constexpr int select(std::array<int, a> const& many, std::array<int, b> const& few, int rank) {
        // The least over i of the greater of few[i - 1] and many[rank - i].
        int place = -1;
        for (int i = 0; i <= static_cast<int>(b) && i <= rank; ++i) {
            int const other = rank - i;
            if (other >= static_cast<int>(a)) continue;
            int const here = many[static_cast<std::size_t>(other)];
            if (i > 0) add(few[static_cast<std::size_t>(i - 1)], here);
            if (place >= 0) add(here, place);
            place = here;
        }
        return place;
    }

    /// Leaves out what `wanted` does not depend on.
    constexpr void prune(int wanted) {
        std::array<bool, 4096> live{};
        live[static_cast<std::size_t>(wanted)] = true;
        Network kept;
        for (int i = count - 1; i >= 0; --i) {
            Exchange step = steps[static_cast<std::size_t>(i)];
            auto const low = static_cast<std::size_t>(step.low), high = static_cast<std::size_t>(step.high);
            step.least = live[low];
            step.greatest = live[high];
            if (!step.least && !step.greatest) continue;
            live[low] = live[high] = true;
            kept.steps[static_cast<std::size_t>(kept.count++)] = step;
        }
        count = kept.count;
        for (int i = 0; i < count; ++i)
            steps[static_cast<std::size_t>(i)] = kept.steps[static_cast<std::size_t>(count - 1 - i)];
    }

    static constexpr int power_from(std::size_t n) {
        int power = 1;
        while (static_cast<std::size_t>(power) < n) power *= 2;
        return power;
    }
};

/// Sorts n values.
template <int n> struct SortingNetwork {
    static constexpr auto network = [] {
        Network<n * n> made;
        made.sort(n);
        return made;
    }();
};

/// The middle one of `lists` sorted lists of n values each, list after list; it ends up in values[place].
template <int lists, int n> struct MedianOfSorted {
    static_assert(lists == 3 || lists == 5);

    struct Selection {
        Network<4096> network;
        int place = 0;
    };
    static constexpr std::array<int, static_cast<std::size_t>(n)> list(int which) {
        std::array<int, static_cast<std::size_t>(n)> places{};
        for (int i = 0; i < n; ++i) places[static_cast<std::size_t>(i)] = which * n + i;
        return places;
    }
    static constexpr Selection made = [] {
        Selection result;
        auto& all = result.network;
        auto const first = all.merge(list(0), list(1));
        if constexpr (lists == 3) {
            result.place = all.select(first, list(2), lists * n / 2);
        } else {
            auto const second = all.merge(list(2), list(3));
            result.place = all.select(all.merge(first, second), list(4), lists * n / 2);
        }
        all.prune(result.place);
        return result;
    }();
    static constexpr Network<4096> network = made.network;
    static constexpr int place = made.place;
};

template <Exchange step, class V> VKT_HD void exchange(V* values) {
    V const a = values[step.low], b = values[step.high];
    if constexpr (step.least) values[step.low] = a < b ? a : b;
    if constexpr (step.greatest) values[step.high] = a < b ? b : a;
}
template <class N, std::size_t begin, class V, std::size_t... i>
VKT_HD void apply_steps(V* values, std::index_sequence<i...>) {
    (exchange<N::network.steps[begin + i]>(values), ...);
}

template <class F, int... k> VKT_HD void unrolled(F const& f, std::integer_sequence<int, k...>) { (f(k), ...); }
/// Calls f(0), …, f(n - 1) without a loop, so that arrays become registers.
template <int n, class F> VKT_HD void unrolled(F const& f) { unrolled(f, std::make_integer_sequence<int, n>{}); }

/// Runs a network, from step `begin`, on values in registers: in pieces, since compilers bound how long one expression
/// may become.
template <class N, std::size_t begin = 0, class V> VKT_HD void apply_network(V* values) {
    constexpr std::size_t count = static_cast<std::size_t>(N::network.count), piece = 128;
    if constexpr (begin < count) {
        apply_steps<N, begin>(values, std::make_index_sequence<std::min(piece, count - begin)>{});
        apply_network<N, begin + piece>(values);
    }
}

} // namespace vkt::VKT_BACKEND
