// Fuzzes PNG: libpng and what is made of its rows.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::fuzz::read_as("png", "/nonexistent/input.png", data, size);
    return 0;
}
