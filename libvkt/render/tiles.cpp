// Which of the compiled inner loops draw.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tiles.h"

namespace vkt::render {

TileFunction tile_function([[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::tile_function();
    if (instructions == InstructionSet::avx2) return avx2::tile_function();
#endif
    return baseline::tile_function();
}

TreeTileFunction tree_tile_function([[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::tree_tile_function();
    if (instructions == InstructionSet::avx2) return avx2::tree_tile_function();
#endif
    return baseline::tree_tile_function();
}

} // namespace vkt::render
