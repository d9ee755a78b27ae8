// Touching runs, 64 positions at a time: what two runs share begins at one bit, and how many runs begin up to a bit
// says which run it lies in. Merging lists of edges instead takes a guess a run, which noise makes wrong half of the
// time.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/touching_runs.h"

#include <bit>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// A word of a row and what is beside it.
struct Word {
    std::uint64_t bits, left, right, starts; ///< left: whether the position before is set, right: the one after
};
inline __attribute__((always_inline)) Word word_of(std::uint64_t const* row, std::int64_t w, std::int64_t words) {
    std::uint64_t const bits = row[w], before = w > 0 ? row[w - 1] >> 63 : 0,
                        after = w + 1 < words ? row[w + 1] << 63 : 0, left = bits << 1 | before;
    return {bits, left, bits >> 1 | after, bits & ~left};
}
inline __attribute__((always_inline)) std::uint32_t count_of(std::uint64_t bits) {
    return static_cast<std::uint32_t>(std::popcount(bits));
}

} // namespace

void touching_runs(std::uint64_t const* a, std::uint64_t const* b, std::int64_t words, bool diagonal, RunPair* pairs,
                   std::int64_t& count, Execution const&) {
    RunPair* to = pairs;
    std::uint32_t a_before = 0, b_before = 0; // runs that begin in the words before
    for (std::int64_t w = 0; w < words; ++w) {
        Word const p = word_of(a, w, words), q = word_of(b, w, words);
        std::uint64_t hits = p.bits & q.bits & ~(p.left & q.left), next = 0;
        if (diagonal) {
            hits |= p.starts & q.left & ~q.bits;          // one ends right before the other begins
            next = p.bits & ~p.right & q.right & ~q.bits; // the other begins right after the one ends
        }
        for (std::uint64_t t = hits; t != 0; t &= t - 1) {
            std::uint64_t const up_to = t ^ (t - 1);
            *to++ = {a_before + count_of(p.starts & up_to) - 1, b_before + count_of(q.starts & up_to) - 1};
        }
        for (std::uint64_t t = next; t != 0; t &= t - 1) {
            std::uint64_t const up_to = t ^ (t - 1);
            *to++ = {a_before + count_of(p.starts & up_to) - 1, b_before + count_of(q.starts & up_to)};
        }
        a_before += count_of(p.starts);
        b_before += count_of(q.starts);
    }
    count = to - pairs;
}

} // namespace VKT_BACKEND
} // namespace vkt
