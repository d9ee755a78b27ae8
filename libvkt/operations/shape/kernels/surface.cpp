// Surfaces: rows of bits tell which edges are crossed; a vertex is known by its rank among the bits of its row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/surface.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

using Word = std::uint64_t;
template <class T> using Comparable = std::conditional_t<std::is_same_v<T, Half>, float, T>;

template <Inside::Rule rule, class C> struct Test {
    C at;
    bool operator()(C v) const {
        if constexpr (rule == Inside::Rule::from) return v >= at;
        if constexpr (rule == Inside::Rule::to) return v <= at;
        return v == at;
    }
};

/// Bits of a row, the first of which is bit `shift` of word 0; the others are 0.
template <class T, class F>
void pack_row(T const* row, std::int64_t n, std::int64_t shift, F const f, Word* bits, std::int64_t words) {
    Word carried = 0;
    for (std::int64_t w = 0; w < words; ++w) {
        std::int64_t const x = 64 * w;
        Word word = 0;
        if (x + 64 <= n) {
            alignas(64) std::uint8_t flags[64];
#pragma omp simd
            for (int i = 0; i < 64; ++i) flags[i] = f(static_cast<Comparable<T>>(row[x + i])) ? 1 : 0;
            word = gathered_bits(flags);
        } else {
            for (std::int64_t i = x; i < n; ++i)
                word |= static_cast<Word>(f(static_cast<Comparable<T>>(row[i])) ? 1 : 0) << (i - x);
        }
        bits[w] = shift != 0 ? word << 1 | carried : word;
        carried = word >> 63;
    }
}

template <class T, class F> void pack_rows(SurfaceSlab const& slab, F const f, Execution const& execution) {
    View<T const> const view = slab.voxels.as<T>();
    Index3 const n = slab.voxels.dims();
    for_each_item(execution, threads_for(execution, slab.voxels.box.voxels()), n.y * n.z,
                  [&](std::int64_t begin, std::int64_t end) {
                      for (std::int64_t r = begin; r < end; ++r) {
                          std::int64_t const y = r % n.y, z = r / n.y;
                          std::int64_t const to = (slab.voxels_from + z) * slab.lattice.y + y + slab.border;
                          pack_row(view.data + y * view.row + z * view.slice, n.x, slab.border, f,
                                   slab.bits + to * slab.words, slab.words);
                      }
                  });
}

/// Words of a row, and the same one point further along x.
struct Row {
    Word const* bits;
    std::int64_t words;
    Word here(std::int64_t w) const { return bits[w]; }
    Word right(std::int64_t w) const { return bits[w] >> 1 | (w + 1 < words ? bits[w + 1] << 63 : 0); }
};

/// Bits of a word that stand for edges along x: there is one fewer of them than points.
Word edges_along(SurfaceSlab const& slab, std::int64_t w) {
    std::int64_t const n = slab.lattice.x - 1 - 64 * w;
    return n >= 64 ? ~Word{0} : n <= 0 ? Word{0} : (Word{1} << n) - 1;
}

/// The four rows of points around a row of cells: (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1).
struct Cells {
    Row row[4];

    /// Those that the surface goes through.
    Word active(SurfaceSlab const& slab, std::int64_t w) const {
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

    Corners(Cells const& cells, std::int64_t w) {
        for (int r = 0; r < 4; ++r) {
            here[r] = cells.row[r].here(w);
            right[r] = cells.row[r].right(w);
        }
    }
    unsigned case_of(int i) const {
        unsigned result = 0;
        for (int r = 0; r < 4; ++r)
            result |= static_cast<unsigned>(here[r] >> i & 1) << (2 * r) | static_cast<unsigned>(right[r] >> i & 1)
                                                                               << (2 * r + 1);
        return result;
    }
};

Row row_of(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return {slab.bits + (s * slab.lattice.y + y) * slab.words, slab.words};
}
Cells cells_of(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return {{row_of(slab, y, s - 1), row_of(slab, y + 1, s - 1), row_of(slab, y, s), row_of(slab, y + 1, s)}};
}
bool has_cells(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    return y + 1 < slab.lattice.y && !(slab.first && s == 1);
}

int ones(Word word) { return __builtin_popcountll(word); }

/// Ranks of the crossed edges of a row, word by word.
struct Ranks {
    Word bits = 0;
    std::uint32_t before = 0;

    void next(Word word) {
        before += static_cast<std::uint32_t>(ones(bits));
        bits = word;
    }
    std::uint32_t of(int i) const { return before + static_cast<std::uint32_t>(ones(bits & ((Word{1} << i) - 1))); }
};

/// What turns lattice points into world coordinates, and voxels into places on edges.
template <class T> struct Places {
    SurfaceSlab const& slab;
    double level;
    bool half; ///< vertices lie half way
    Vec3 step[3];

    Places(SurfaceSlab const& of, Inside const& inside)
        : slab(of), level(inside.level), half(inside.rule == Inside::Rule::equal) {
        for (int axis = 0; axis < 3; ++axis)
            step[axis] = slab.geometry.direction[static_cast<std::size_t>(axis)] * slab.geometry.spacing[axis];
    }
    Vec3 row_start(std::int64_t y, std::int64_t s) const {
        auto const fy = static_cast<double>(slab.origin.y + y), fz = static_cast<double>(slab.origin_z + s);
        return slab.geometry.origin + step[0] * static_cast<double>(slab.origin.x) + step[1] * fy + step[2] * fz;
    }
    /// Voxels of a lattice row, the first at lattice point `border`; null in the border.
    T const* voxels(std::int64_t y, std::int64_t s) const {
        std::int64_t const row = y - slab.border;
        ConstView const& view = s < slab.voxels_from ? slab.last : slab.voxels;
        std::int64_t const slice = s < slab.voxels_from ? 0 : s - slab.voxels_from;
        if (view.data == nullptr || row < 0 || row >= view.dims().y || slice >= view.dims().z) return nullptr;
        return view.as<T>().data + row * view.row + slice * view.slice;
    }
    double part(T a, T b) const {
        auto const from = static_cast<double>(static_cast<Comparable<T>>(a));
        auto const to = static_cast<double>(static_cast<Comparable<T>>(b));
        double const t = (level - from) / (to - from);
        if (!(t == t)) return 0.5; // beside an infinity or what is not a number
        return t < surface_margin ? surface_margin : t > 1 - surface_margin ? 1 - surface_margin : t;
    }
    void put(std::uint32_t vertex, Vec3 const& start, double x, Vec3 const& along, double t) const {
        double* const to = slab.vertices + 3 * static_cast<std::int64_t>(vertex);
        for (int i = 0; i < 3; ++i) to[i] = start[i] + step[0][i] * x + along[i] * t;
    }
};

/// Calls f(i, bit position in the row) for each bit of the words, i counting from `first`.
template <class Words, class F> void for_each_bit(std::int64_t words, Words const& word_at, F const& f) {
    for (std::int64_t w = 0; w < words; ++w)
        for (Word word = word_at(w); word != 0; word &= word - 1) f(64 * w + __builtin_ctzll(word));
}

template <class T> void emit_vertices(Places<T> const& places, std::int64_t y, std::int64_t s) {
    SurfaceSlab const& slab = places.slab;
    SurfaceRow const& row = slab.rows[s * slab.lattice.y + y];
    Row const here = row_of(slab, y, s), before = row_of(slab, y, s - 1);
    T const* const voxels = places.voxels(y, s);
    std::int64_t const border = slab.border;
    Vec3 const start = places.row_start(y, s);

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

void emit_triangles(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
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
            int const i = __builtin_ctzll(active);
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

} // namespace

void surface_bits(SurfaceSlab const& slab, Inside const& inside, Execution const& execution) {
    if (slab.voxels.box.empty()) return;
    with_type(slab.voxels.type, [&]<class T>(T) {
        using C = Comparable<T>;
        C at;
        std::memcpy(&at, inside.at.data(), sizeof at);
        switch (inside.rule) {
        case Inside::Rule::nobody:
            return pack_rows<T>(
                slab, [](C) { return false; }, execution);
        case Inside::Rule::everybody:
            return pack_rows<T>(
                slab, [](C) { return true; }, execution);
        case Inside::Rule::from:
            return pack_rows<T>(slab, Test<Inside::Rule::from, C>{at}, execution);
        case Inside::Rule::to:
            return pack_rows<T>(slab, Test<Inside::Rule::to, C>{at}, execution);
        case Inside::Rule::equal:
            return pack_rows<T>(slab, Test<Inside::Rule::equal, C>{at}, execution);
        }
    });
}

void surface_count(SurfaceSlab const& slab, Execution const& execution) {
    std::int64_t const ny = slab.lattice.y, count = ny * (slab.lattice.z - 1);
    for_each_item(
        execution, threads_for(execution, count * slab.lattice.x), count, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t r = begin; r < end; ++r) {
                std::int64_t const y = r % ny, s = r / ny + 1;
                Row const here = row_of(slab, y, s), before = row_of(slab, y, s - 1);
                SurfaceRow& row = slab.rows[s * ny + y];
                row = {};
                for (std::int64_t w = 0; w < slab.words; ++w) {
                    row.before += static_cast<std::uint32_t>(ones(here.here(w) ^ before.here(w)));
                    row.along +=
                        static_cast<std::uint32_t>(ones((here.here(w) ^ here.right(w)) & edges_along(slab, w)));
                }
                if (y + 1 < ny) {
                    Row const below = row_of(slab, y + 1, s);
                    for (std::int64_t w = 0; w < slab.words; ++w)
                        row.next += static_cast<std::uint32_t>(ones(here.here(w) ^ below.here(w)));
                }
                if (!has_cells(slab, y, s)) continue;
                Cells const cells = cells_of(slab, y, s);
                for (std::int64_t w = 0; w < slab.words; ++w) {
                    Word active = cells.active(slab, w);
                    if (active == 0) continue;
                    Corners const corners(cells, w);
                    for (; active != 0; active &= active - 1)
                        row.triangles += slab.cases->count[corners.case_of(__builtin_ctzll(active))];
                }
            }
        });
}

void surface_emit(SurfaceSlab const& slab, Inside const& inside, Execution const& execution) {
    ConstView const& any = slab.voxels.data != nullptr ? slab.voxels : slab.last;
    std::int64_t const ny = slab.lattice.y, count = ny * (slab.lattice.z - 1);
    with_type(any.type, [&]<class T>(T) {
        Places<T> const places(slab, inside);
        for_each_item(execution, threads_for(execution, count * slab.lattice.x), count,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (std::int64_t r = begin; r < end; ++r) {
                              std::int64_t const y = r % ny, s = r / ny + 1;
                              emit_vertices(places, y, s);
                              if (has_cells(slab, y, s)) emit_triangles(slab, y, s);
                          }
                      });
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
