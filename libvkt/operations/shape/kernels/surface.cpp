// Surfaces: rows of bits tell which edges are crossed; a vertex is known by its rank among the bits of its row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/surface.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/shape/kernels/surface_rows.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

using namespace surface;

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

/// Apart: of all types of voxels it is the same.
[[gnu::noinline]] void emit_triangles_of_row(SurfaceSlab const& slab, std::int64_t y, std::int64_t s) {
    emit_triangles(slab, y, s);
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
    for_each_item(execution, threads_for(execution, count * slab.lattice.x), count,
                  [&](std::int64_t begin, std::int64_t end) {
                      for (std::int64_t r = begin; r < end; ++r) {
                          std::int64_t const y = r % ny, s = r / ny + 1;
                          count_row(slab, y, s);
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
                              if (has_cells(slab, y, s)) emit_triangles_of_row(slab, y, s);
                          }
                      });
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
