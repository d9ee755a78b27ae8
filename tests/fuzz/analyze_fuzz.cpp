// Fuzzes Analyze headers, whose voxels are looked for in a folder that does not exist.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::fuzz::read_as("analyze", "/nonexistent/input.hdr", data, size);
    return 0;
}
