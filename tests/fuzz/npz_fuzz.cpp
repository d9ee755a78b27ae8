// Fuzzes NumPy archives: the directory of the ZIP file, stored and deflated members.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    vkt::fuzz::read_as("npz", "/nonexistent/input.npz", data, size);
    return 0;
}
