// What is done for one row of a surface's lattice, on CPUs and on GPUs. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/set_bits.h"
#include "libvkt/operations/shape/kernels/surface.h"

#include <type_traits>

namespace vkt::VKT_BACKEND::surface {

using Word = std::uint64_t;
template <class T> using Comparable = std::conditional_t<std::is_same_v<T, Half>, float, T>;

template <Inside::Rule rule, class C> struct Test {
    C at;
    VKT_HD bool operator()(C v) const {
        if constexpr (rule == Inside::Rule::from) return v >= at;
        if constexpr (rule == Inside::Rule::to) return v <= at;
        return v == at;
    }
};

/// Words of a row, and the same one point further along x.
struct Row {
    Word const* bits;
    std::int64_t words;
    VKT_HD Word here(std::int64_t w) const { return bits[w]; }
    VKT_HD Word right(std::int64_t w) const { return bits[w] >> 1 | (w + 1 < words ? bits[w + 1] << 63 : 0); }
};

/// Bits of a word that stand for edges along x: there is one fewer of them than points.
VKT_HD Word edges_along(SurfaceSlab const& slab, std::int64_t w) {
    std::int64_t const n = slab.lattice.x - 1 - 64 * w;
    return n >= 64 ? ~Word{0} : n <= 0 ? Word{0} : (Word{1} << n) - 1;
}

/// The four rows of points around a row of cells: (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
struct Cells {
    Row row[4];

    /// Those that the surface goes through.
    VKT_HD Word active(SurfaceSlab const& slab, std::int64_t w) const {
        Word any = 0, all = ~Word{0};
        for (Row const& r : row) {
            any |= r.here(w) | r.right(w);
            all &= r.here(w) & r.right(w);
        }
        return any & ~all & edges_along(slab, w);
    }
};

/// Corners of the cells of a word; case_of(i) is that of the i-th.
struct Corners {
    Word here[4], right[4];

    VKT_HD Corners(Cells const& cells, std::int64_t w) {
        for (int r = 0; r < 4; ++r) {
            here[r] = cells.row[r].here(w);
            right[r] = cells.row[r].right(w);
        }
    }
    VKT_HD unsigned case_of(int i) const {
        unsigned result = 0;
        for (int r = 0; r < 4; ++r)
            result |= static_cast<unsigned>(here[r] >> i & 1) << (2 * r) | static_cast<unsigned>(right[r] >> i & 1)
                                                                               << (2 * r + 1);
        return result;
    }
};

VKT_HD Row row_of(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return {slab.bits + (s * slab.lattice.y + y) * slab.words, slab.words};
}
VKT_HD Cells cells_of(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return {{row_of(slab, y, s - 1), row_of(slab, y + 1, s - 1), row_of(slab, y, s), row_of(slab, y + 1, s)}};
}
VKT_HD bool has_cells(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return y + 1 < slab.lattice.y && !(slab.first && s == 1);
}

/// Ranks of the crossed edges of a row, word by word.
struct Ranks {
    Word bits = 0;
    std::uint32_t before = 0;

    VKT_HD void next(Word word) {
        before += static_cast<std::uint32_t>(set_bits(bits));
        bits = word;
    }
    VKT_HD std::uint32_t of(int i) const {
        return before + static_cast<std::uint32_t>(set_bits(bits & ((Word{1} << i) - 1)));
    }
};

/// Rows of voxels of one type; none if there is no first one.
template <class T> struct VoxelRows {
    T const* data = nullptr;
    std::int64_t row = 0, slice = 0;
    Index3 dims;

    explicit VoxelRows(ConstView const& view)
        : data(reinterpret_cast<T const*>(view.data)), row(view.row), slice(view.slice), dims(view.dims()) {}
};

struct Point {
    double at[3];
};

/// What turns lattice points into world coordinates, and voxels into places on edges.
template <class T> struct Places {
    SurfaceSlab slab;
    VoxelRows<T> last_voxels, new_voxels;
    double level;
    bool half;             ///< vertices lie half way
    Point origin, step[3]; ///< steps along the axes

    Places(SurfaceSlab const& of, Inside const& inside)
        : slab(of), last_voxels(of.last), new_voxels(of.voxels), level(inside.level),
          half(inside.rule == Inside::Rule::equal) {
        for (int i = 0; i < 3; ++i) {
            origin.at[i] = slab.geometry.origin[i];
            for (int axis = 0; axis < 3; ++axis)
                step[axis].at[i] =
                    slab.geometry.direction[static_cast<std::size_t>(axis)][i] * slab.geometry.spacing[axis];
        }
    }
    VKT_HD Point row_start(std::int64_t y, std::int64_t s) const {
        auto const fy = static_cast<double>(slab.origin.y + y), fz = static_cast<double>(slab.origin_z + s);
        auto const fx = static_cast<double>(slab.origin.x);
        Point start{};
        for (int i = 0; i < 3; ++i)
            start.at[i] = origin.at[i] + step[0].at[i] * fx + step[1].at[i] * fy + step[2].at[i] * fz;
        return start;
    }
    /// Voxels of a lattice row, the first at lattice point `border`; null in the border.
    VKT_HD T const* voxels(std::int64_t y, std::int64_t s) const {
        std::int64_t const row = y - slab.border;
        VoxelRows<T> const& rows = s < slab.voxels_from ? last_voxels : new_voxels;
        std::int64_t const slice = s < slab.voxels_from ? 0 : s - slab.voxels_from;
        if (rows.data == nullptr || row < 0 || row >= rows.dims.y || slice >= rows.dims.z) return nullptr;
        return rows.data + row * rows.row + slice * rows.slice;
    }
    VKT_HD double part(T a, T b) const {
        auto const from = static_cast<double>(static_cast<Comparable<T>>(a));
        auto const to = static_cast<double>(static_cast<Comparable<T>>(b));
        double const t = (level - from) / (to - from);
        if (!(t == t)) return 0.5; // beside an infinity or what is not a number
        return t < surface_margin ? surface_margin : t > 1 - surface_margin ? 1 - surface_margin : t;
    }
    VKT_HD void put(std::uint32_t vertex, Point const& start, double x, Point const& along, double t) const {
        double* const to = slab.vertices + 3 * static_cast<std::int64_t>(vertex);
        for (int i = 0; i < 3; ++i) to[i] = start.at[i] + step[0].at[i] * x + along.at[i] * t;
    }
};

/// Calls f(i, bit position in the row) for each bit of the words, i counting from `first`.
template <class Words, class F> VKT_HD void for_each_bit(std::int64_t words, Words const& word_at, F const& f) {
    for (std::int64_t w = 0; w < words; ++w)
        for (Word word = word_at(w); word != 0; word &= word - 1) f(64 * w + lowest_bit(word));
}

template <class T> VKT_HD void emit_vertices(Places<T> const& places, std::int64_t y, std::int64_t s) {
    SurfaceSlab const& slab = places.slab;
    SurfaceRow const& row = slab.rows[s * slab.lattice.y + y];
    Row const here = row_of(slab, y, s), before = row_of(slab, y, s - 1);
    T const* const voxels = places.voxels(y, s);
    std::int64_t const border = slab.border;
    Point const start = places.row_start(y, s);

    // From the slice before.
    std::uint32_t vertex = row.before;
    T const* other = places.voxels(y, s - 1);
    for_each_bit(
        slab.words, [&](std::int64_t w) { return here.here(w) ^ before.here(w); },
        [&](std::int64_t x) {
            bool const known = voxels != nullptr && other != nullptr && !places.half;
            double const t = known ? places.part(other[x - border], voxels[x - border]) : 0.5;
            places.put(vertex++, start, static_cast<double>(x), places.step[2], t - 1);
        });
    vertex = row.along;
    std::int64_t const n = slab.lattice.x - 2 * border;
    for_each_bit(
        slab.words, [&](std::int64_t w) { return (here.here(w) ^ here.right(w)) & edges_along(slab, w); },
        [&](std::int64_t x) {
            std::int64_t const i = x - border;
            bool const known = i >= 0 && i + 1 < n && !places.half;
            double const t = known ? places.part(voxels[i], voxels[i + 1]) : 0.5;
            places.put(vertex++, start, static_cast<double>(x), places.step[0], t);
        });
    if (y + 1 == slab.lattice.y) return;
    Row const below = row_of(slab, y + 1, s);
    vertex = row.next;
    other = places.voxels(y + 1, s);
    for_each_bit(
        slab.words, [&](std::int64_t w) { return here.here(w) ^ below.here(w); },
        [&](std::int64_t x) {
            bool const known = voxels != nullptr && other != nullptr && !places.half;
            double const t = known ? places.part(voxels[x - border], other[x - border]) : 0.5;
            places.put(vertex++, start, static_cast<double>(x), places.step[1], t);
        });
}

VKT_HD void emit_triangles(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    Cells const cells = cells_of(slab, y, s);
    std::int64_t const ny = slab.lattice.y;
    SurfaceRow const *const behind = slab.rows + (s - 1) * ny + y, *const here = slab.rows + s * ny + y;
    std::uint32_t* to = slab.triangles + 3 * static_cast<std::int64_t>(here->triangles);
    Ranks along[4], next[2], before[2]; // of edges along x, y and z
    std::uint32_t const along_from[4] = {behind[0].along, behind[1].along, here[0].along, here[1].along};
    for (int r = 0; r < 4; ++r) along[r].before = along_from[r];
    next[0].before = behind[0].next;
    next[1].before = here[0].next;
    before[0].before = here[0].before;
    before[1].before = here[1].before;
    int const second = slab.mirrored ? 2 : 1, third = 3 - second;
    for (std::int64_t w = 0; w < slab.words; ++w) {
        Corners const corners(cells, w);
        Word const edges = edges_along(slab, w);
        for (int r = 0; r < 4; ++r) along[r].next((corners.here[r] ^ corners.right[r]) & edges);
        next[0].next(corners.here[0] ^ corners.here[1]);
        next[1].next(corners.here[2] ^ corners.here[3]);
        before[0].next(corners.here[0] ^ corners.here[2]);
        before[1].next(corners.here[1] ^ corners.here[3]);
        for (Word active = cells.active(slab, w); active != 0; active &= active - 1) {
            int const i = lowest_bit(active);
            unsigned const which = corners.case_of(i);
            std::uint32_t vertex[12];
            for (int r = 0; r < 4; ++r) vertex[r] = along[r].of(i);
            for (int k = 0; k < 2; ++k) {
                vertex[4 + 2 * k] = next[k].of(i);
                vertex[5 + 2 * k] = vertex[4 + 2 * k] + static_cast<std::uint32_t>(next[k].bits >> i & 1);
                vertex[8 + 2 * k] = before[k].of(i);
                vertex[9 + 2 * k] = vertex[8 + 2 * k] + static_cast<std::uint32_t>(before[k].bits >> i & 1);
            }
            std::uint8_t const* edge = slab.cases->edges[which].data();
            for (int t = slab.cases->count[which]; t > 0; --t, edge += 3, to += 3) {
                to[0] = vertex[edge[0]];
                to[1] = vertex[edge[second]];
                to[2] = vertex[edge[third]];
            }
        }
    }
}

VKT_HD void count_row(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    std::int64_t const ny = slab.lattice.y;
    Row const here = row_of(slab, y, s), before = row_of(slab, y, s - 1);
    SurfaceRow& row = slab.rows[s * ny + y];
    row = {};
    for (std::int64_t w = 0; w < slab.words; ++w) {
        row.before += static_cast<std::uint32_t>(set_bits(here.here(w) ^ before.here(w)));
        row.along += static_cast<std::uint32_t>(set_bits((here.here(w) ^ here.right(w)) & edges_along(slab, w)));
    }
    if (y + 1 < ny) {
        Row const below = row_of(slab, y + 1, s);
        for (std::int64_t w = 0; w < slab.words; ++w)
            row.next += static_cast<std::uint32_t>(set_bits(here.here(w) ^ below.here(w)));
    }
    if (!has_cells(slab, y, s)) return;
    Cells const cells = cells_of(slab, y, s);
    for (std::int64_t w = 0; w < slab.words; ++w) {
        Word active = cells.active(slab, w);
        if (active == 0) continue;
        Corners const corners(cells, w);
        for (; active != 0; active &= active - 1)
            row.triangles += slab.cases->count[corners.case_of(lowest_bit(active))];
    }
}

} // namespace vkt::VKT_BACKEND::surface
