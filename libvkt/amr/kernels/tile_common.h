// Helpers of the tile kernels. Included once per kernel source, inside the back end's own translation unit.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/kernels/tile.h"
#include "libvkt/core/type_dispatch.h"

// Nothing here may have external linkage: the same function compiled for another instruction set must not replace it.
namespace {

using vkt::DataType;
using vkt::with_type;
namespace tile = vkt::tile;

inline float madd(float a, float b, float c) {
#ifdef __FMA__
    return __builtin_fmaf(a, b, c);
#else
    return a * b + c;
#endif
}
inline double madd(double a, double b, double c) {
#ifdef __FMA__
    return __builtin_fma(a, b, c);
#else
    return a * b + c;
#endif
}

template <class T, class C> inline void load_cells(std::byte const* cells, std::int64_t first, int n, C* to) {
    T const* const from = reinterpret_cast<T const*>(cells) + first;
    for (int i = 0; i < n; ++i) to[i] = static_cast<C>(from[i]);
}

/// Converts n consecutive cells of a brick, from cell `first` on.
template <class C> inline void load_cells(DataType type, std::byte const* cells, std::int64_t first, int n, C* to) {
    with_type(type, [&]<class T>(T) { load_cells<T>(cells, first, n, to); });
}

/// The same as the job asks for it.
template <class C>
inline void load_part(tile::Job const& job, tile::Source const& brick, std::int64_t first, int n, C* to) {
    if (job.load == tile::Load::values) return load_cells(job.type, brick.cells, first, n, to);
    auto const* const from = reinterpret_cast<std::uint64_t const*>(brick.cells) + first;
    int const shift = job.load == tile::Load::high_halves ? 32 : 0;
    std::uint64_t const mask = job.load == tile::Load::low_halves ? 0xffffffffu : ~std::uint64_t{0};
    for (int i = 0; i < n; ++i) to[i] = static_cast<C>((from[i] - brick.base) >> shift & mask);
}

template <class C> inline void clear_tile(tile::Job const& job, tile::Scratch<C>& scratch) {
    int const n = job.count[0] * job.count[1] * job.count[2];
    for (int i = 0; i < n; ++i) scratch.sum[i] = scratch.weight[i] = C(0);
}

} // namespace
