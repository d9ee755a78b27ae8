// Fuzzes MRC and CCP4 maps: header, extended header, whole and compressed.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::fuzz::read_as("mrc", "/nonexistent/input.mrc", data, size);
    return 0;
}
