// map() for functors that also know rows of voxels as they are stored. For kernel sources.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

#include <algorithm>

namespace vkt::VKT_BACKEND {

#ifndef __CUDACC__

namespace driver {

template <class F, class... In>
void map_stored(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
    std::int64_t const piece = piece_for(out, in...);
    bool const stream = is_large(out), one_row = dense(out.box, out, in...) && !out.box.empty();
    for_each_segment(execution, one_row ? as_one_row(out.box) : out.box,
                     [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
                         alignas(64) std::byte stored[row_piece * 8];
                         Losses mine;
                         for (std::int64_t begin = x; begin < x + n; begin += piece) {
                             std::int64_t const m = std::min(piece, x + n - begin);
                             std::byte* const to = out.at(begin, y, z);
                             mine += f.stored_row(m, stream ? stored : to, in.at(begin, y, z)...);
                             if (stream) stream_bytes(to, stored, static_cast<std::size_t>(m) * size_of(out.type));
                         }
                         add(losses, mine);
                     });
}

} // namespace driver

#endif

/// map<C>() of a functor that on CPUs makes voxels of voxels in one loop, without widening them for its own sake:
/// takes_stored(types of out and in...) says whether it does, stored_row(n, out, in...) does a piece and says what was
/// lost.
template <class C, class F, class... In>
void map_stored(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
#ifndef __CUDACC__
    if (f.takes_stored(out.type, in.type...)) return driver::map_stored(execution, out, losses, f, in...);
#endif
    map<C>(execution, out, losses, f, in...);
}

} // namespace vkt::VKT_BACKEND
