// Fuzzes VTK's images: the XML's structure, arrays inline and appended, compressed or not, legacy files, lists of them.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    for (char const* const format : {"vti", "vtk", "pvd"}) {
        vkt::ReadOptions options;
        options.format = format;
        try {
            auto bytes = std::make_unique<vkt::ByteSource>(vkt::fuzz::descriptor_with(data, size, false),
                                                           "/nonexistent/input.vti");
            auto source = vkt::open_volume(std::move(bytes), options);
            vkt::fuzz::consume(*source);
        } catch (vkt::Error const&) {
        } // the only thing that may come out of a reader
    }
    return 0;
}
