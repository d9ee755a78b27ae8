// Runs joined on a GPU by union-find: a thread a word of 32 voxels, the smaller root wins.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/shape/kernels/device_runs.h"

namespace vkt::VKT_BACKEND::components {

__device__ inline unsigned root_of(unsigned* parent, unsigned i) {
    auto* const now = static_cast<unsigned volatile*>(parent);
    for (unsigned above = now[i]; above != i; above = now[i]) {
        unsigned const next = now[above];
        if (next != above) now[i] = next; // it stays an ancestor whatever others do
        i = next;
    }
    return i;
}

__device__ inline void unite(unsigned* parent, unsigned a, unsigned b) {
    auto* const now = static_cast<unsigned volatile*>(parent);
    if (now[a] == now[b]) return;
    for (;;) {
        a = root_of(parent, a);
        b = root_of(parent, b);
        if (a == b) return;
        unsigned const high = a > b ? a : b, low = a > b ? b : a;
        unsigned const was = atomicMin(parent + high, low);
        if (was == high) return;
        a = was;
        b = low;
    }
}

static __global__ void __launch_bounds__(block) singles_kernel(unsigned* parent, std::int64_t n) {
    std::int64_t const i = this_thread();
    if (i < n) parent[i] = static_cast<unsigned>(i);
}

/// A word of bits and the bits beside it.
struct Word {
    unsigned bits;
    bool left, right; ///< the neighbours of its first and last bit

    /// Of each bit the one to its left, or right.
    __device__ unsigned lefts() const { return bits << 1 | (left ? 1u : 0u); }
    __device__ unsigned rights() const { return bits >> 1 | (right ? 1u << 31 : 0u); }
};

/// The bits below, or up to, bit b.
__device__ __forceinline__ unsigned below(int b) { return (1u << b) - 1; }
__device__ __forceinline__ unsigned up_to(int b) { return ~0u >> (31 - b); }

struct Joiner {
    Rows rows;
    unsigned const* before;
    unsigned* parent;
    Place place;
    unsigned starts;

    __device__ unsigned mine(int b) const {
        return before[rows.word(place.y, place.z, place.w)] + static_cast<unsigned>(__popc(starts & up_to(b))) - 1;
    }

    /// Joins runs through `own` and `other`, rows of bits that face each other; that of the other belongs to the row of
    /// runs y, z. They may touch diagonally. What `joined` has a bit for is joined already, and so are bits of their
    /// own with those to the left, or right, of them in the other where `aside` has a bit there.
    __device__ void join(Word own, Word other, std::int64_t y, std::int64_t z, bool diagonally, unsigned joined,
                         Word aside = {}) const {
        if (own.bits == 0) return;
        if (other.bits == 0 && !(diagonally && (other.left || other.right))) return;
        unsigned const both = own.bits & other.bits;
        std::int64_t const word = rows.word(y, z, place.w);
        unsigned const others = rows.starts(y, z, place.w), runs = before[word];
        for (unsigned e = both & ~(both << 1 | (own.left && other.left ? 1u : 0u)); e != 0; e &= e - 1) {
            unsigned const first = e & -e;
            if ((both & ~(both + first) & joined) != 0) continue;
            int const b = __ffs(static_cast<int>(e)) - 1;
            unite(parent, mine(b), runs + static_cast<unsigned>(__popc(others & up_to(b))) - 1);
        }
        if (!diagonally) return;
        // Where nothing overlaps: a run that begins where the other has ended, and the other way round.
        unsigned const free = own.bits & ~other.bits;
        for (unsigned e = free & ~own.lefts() & other.lefts() & ~aside.lefts(); e != 0; e &= e - 1) {
            int const b = __ffs(static_cast<int>(e)) - 1;
            unite(parent, mine(b), runs + static_cast<unsigned>(__popc(others & below(b))) - 1);
        }
        for (unsigned e = free & ~own.rights() & other.rights() & ~aside.rights(); e != 0; e &= e - 1) {
            int const b = __ffs(static_cast<int>(e)) - 1;
            unsigned run = runs + static_cast<unsigned>(__popc(others & up_to(b < 31 ? b + 1 : b))) - 1;
            if (b == 31) run += rows.starts(y, z, place.w + 1) & 1u;
            unite(parent, mine(b), run);
        }
    }
};

/// Which neighbours are joined: of the slice, of the slice before, and those across.
enum class Links { above, before, across };

static __global__ void __launch_bounds__(block)
    join_kernel(Rows rows, int connectivity, Links links, unsigned const* before, unsigned* parent) {
    std::int64_t const i = this_thread();
    if (i >= rows.words * rows.run_ny * rows.run_nz) return;
    Place const p = place_of(rows, i);
    if (rows.all(p.y, p.z, p.w) == 0) return;
    Joiner const joiner{rows, before, parent, p, rows.starts(p.y, p.z, p.w)};
    // Up to two rows together.
    auto const word = [&](std::int64_t y, std::int64_t z, std::int64_t y2, std::int64_t z2) {
        auto const at = [&](std::int64_t w) { return rows.row(y, z, w) | rows.row(y2, z2, w); };
        return Word{at(p.w), at(p.w - 1) >> 31 != 0, (at(p.w + 1) & 1) != 0};
    };
    if (rows.group == 1) {
        auto const one = [&](std::int64_t y, std::int64_t z) { return word(y, z, y, z); };
        bool const edges = connectivity >= 18;
        Word const own = one(p.y, p.z), above = one(p.y - 1, p.z), below = one(p.y, p.z - 1);
        if (links == Links::above) joiner.join(own, above, p.y - 1, p.z, edges, 0);
        // Around four rows that all have a voxel there is a way without this one. To a voxel beside that below there is
        // one by way of the voxel beside that above: they are joined with each other across. So there is one to the
        // voxel across from here, by way of the same.
        if (links == Links::before)
            joiner.join(own, below, p.y, p.z - 1, edges, above.bits & rows.row(p.y - 1, p.z - 1, p.w), above);
        if (links != Links::across) return;
        joiner.join(own, one(p.y - 1, p.z - 1), p.y - 1, p.z - 1, false,
                    above.bits | below.bits | above.lefts() | above.rights());
        joiner.join(own, one(p.y + 1, p.z - 1), p.y + 1, p.z - 1, false, below.bits | rows.row(p.y + 1, p.z, p.w));
        return;
    }
    std::int64_t const y = 2 * p.y, z = 2 * p.z;
    if (links == Links::above && p.y > 0)
        joiner.join(word(y, z, y, z + 1), word(y - 1, z, y - 1, z + 1), p.y - 1, p.z, true, 0);
    if (p.z == 0) return;
    if (links == Links::before) joiner.join(word(y, z, y + 1, z), word(y, z - 1, y + 1, z - 1), p.y, p.z - 1, true, 0);
    if (links != Links::across) return;
    if (p.y > 0) joiner.join(word(y, z, y, z), word(y - 1, z - 1, y - 1, z - 1), p.y - 1, p.z - 1, true, 0);
    joiner.join(word(y + 1, z, y + 1, z), word(y + 2, z - 1, y + 2, z - 1), p.y + 1, p.z - 1, true, 0);
}

/// Runs point to their roots, so that those that are joined already are seen to be at once.
static __global__ void __launch_bounds__(block) flatten_kernel(unsigned* parent, std::int64_t n) {
    std::int64_t const i = this_thread();
    if (i >= n) return;
    unsigned const root = root_of(parent, static_cast<unsigned>(i));
    if (parent[i] != root) parent[i] = root;
}

} // namespace vkt::VKT_BACKEND::components
