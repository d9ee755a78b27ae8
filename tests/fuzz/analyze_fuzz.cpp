// Fuzzes Analyze headers, whose voxels are looked for in a folder that does not exist.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::ReadOptions options;
    options.format = "analyze";
    for (bool const pipe_like : {false, true}) {
        try {
            auto bytes = std::make_unique<vkt::ByteSource>(vkt::fuzz::descriptor_with(data, size, pipe_like),
                                                           "/nonexistent/input.hdr");
            auto source = vkt::open_volume(std::move(bytes), options);
            vkt::fuzz::consume(*source);
        } catch (vkt::Error const&) {
        } // the only thing that may come out of a reader
    }
    return 0;
}
