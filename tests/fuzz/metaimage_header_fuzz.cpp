// Fuzzes MetaImage: header, geometry, encodings; voxels in the file itself, so that no other file is opened.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

#include <string_view>

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::ReadOptions options;
    options.format = "metaimage";
    // Named data files are looked for in a folder that does not exist; names that lead elsewhere are not tried.
    if (std::string_view(reinterpret_cast<char const*>(data), size).find('/') != std::string_view::npos) return 0;
    for (bool const pipe_like : {false, true}) {
        try {
            auto bytes = std::make_unique<vkt::ByteSource>(vkt::fuzz::descriptor_with(data, size, pipe_like),
                                                           "/nonexistent/input.mha");
            auto source = vkt::open_volume(std::move(bytes), options);
            vkt::fuzz::consume(*source);
        } catch (vkt::Error const&) {
        } // the only thing that may come out of a reader
    }
    return 0;
}
