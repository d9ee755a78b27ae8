// Blosc, without its own threads: chunks are what threads share.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/blosc_module.h"

#include <blosc.h>

namespace vkt {
namespace {

constexpr int level = 2; // of Zstandard: 3

bool decompress(std::byte const* from, std::size_t n, std::byte* to, std::size_t m) {
    std::size_t bytes = 0;
    if (blosc_cbuffer_validate(from, n, &bytes) != 0 || bytes != m) return false;
    return blosc_decompress_ctx(from, to, m, 1) == static_cast<int>(m);
}

std::size_t compress(std::byte const* from, std::size_t n, std::size_t element, std::byte* to) {
    int const done = blosc_compress_ctx(level, element > 1 ? BLOSC_SHUFFLE : BLOSC_NOSHUFFLE, element, n, from, to,
                                        n + BLOSC_MAX_OVERHEAD, BLOSC_ZSTD_COMPNAME, 0, 1);
    return done > 0 ? static_cast<std::size_t>(done) : 0;
}

BloscFunctions const functions{decompress, compress};

} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_blosc;
vkt::ModuleExport const vkt_module_blosc{VKT_VERSION, &vkt::functions, nullptr};
}
