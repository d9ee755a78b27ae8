// Work in tiles on a CPU: kernels that blocking decides the speed of get theirs here.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cpu_drivers.h"

namespace vkt::VKT_BACKEND {

/// Cuts a box into tiles of at most this extent. Calls f(each) once per thread, of at most so many, and each(g) calls
/// g(tile) for those that are the thread's, in order: what f has made before is its own.
template <class F>
void for_each_tile(Execution const& execution, int threads, Box const& box, Index3 extent, F const& f) {
    if (box.empty()) return;
    Index3 tiles;
    for (int axis = 0; axis < 3; ++axis) tiles[axis] = (box.dims()[axis] + extent[axis] - 1) / extent[axis];
    std::int64_t const count = tiles.x * tiles.y * tiles.z;
    for_each_item(static_cast<int>(std::clamp<std::int64_t>(threads, 1, count)), count,
                  [&](std::int64_t begin, std::int64_t end) {
                      f([&](auto const& g) {
                          for (std::int64_t item = begin; item < end; ++item) {
                              tell_progress(execution, begin, item, end);
                              Index3 const at{item % tiles.x, item / tiles.x % tiles.y, item / tiles.x / tiles.y};
                              Box tile;
                              for (int axis = 0; axis < 3; ++axis) {
                                  tile.lower[axis] = box.lower[axis] + at[axis] * extent[axis];
                                  tile.upper[axis] = std::min(tile.lower[axis] + extent[axis], box.upper[axis]);
                              }
                              g(tile);
                          }
                      });
                  });
}

} // namespace vkt::VKT_BACKEND
