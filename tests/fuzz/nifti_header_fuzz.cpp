// Fuzzes NIfTI: both versions and byte orders, extensions, geometry, whole and compressed.
// SPDX-License-Identifier: MIT
#include "tests/fuzz/volume_input.h"

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    // The voxels of a pair are looked for in a folder that does not exist.
    vkt::fuzz::read_as("nifti", "/nonexistent/input.hdr", data, size);
    return 0;
}
