// Fuzzes Radiance pictures: their header, both kinds of runs, and sizes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/radiance.h"
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    for (bool const pipe_like : {false, true}) {
        try {
            vkt::ByteSource bytes(vkt::fuzz::descriptor_with(data, size, pipe_like), "input.hdr");
            auto const picture = vkt::read_radiance(bytes);
            auto const pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
            if (picture.values.size() != 3 * pixels) std::abort();
        } catch (vkt::Error const&) {
        }
    }
    return 0;
}
