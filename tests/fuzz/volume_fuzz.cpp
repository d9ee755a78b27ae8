// Fuzzes every file format that vkt parses itself behind one door: the content decides which reader gets the bytes.
// SPDX-License-Identifier: MIT
#include <cstring>

#include "tests/fuzz/volume_input.h"

// The first byte says how the rest arrives: as a file or through a pipe, and whether dims are given as for raw files.
extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    if (size == 0) return 0;
    // What follows is up to libhdf5, whose crashes are not ours to find.
    if (size > 4 && std::memcmp(data + 1, "\x89HDF", 4) == 0) return 0;
    vkt::ReadOptions options;
    if (data[0] & 2) {
        options.dims = vkt::Index3{3 + (data[0] >> 4), 5, 7};
        options.dtype = vkt::DataType::int16;
        options.big_endian = (data[0] & 4) != 0;
    }
    try {
        int const descriptor = vkt::fuzz::descriptor_with(data + 1, size - 1, (data[0] & 1) != 0);
        auto source = vkt::open_volume(std::make_unique<vkt::ByteSource>(descriptor, "input"), options);
        vkt::fuzz::consume(*source);
    } catch (vkt::Error const&) {
    } // the only thing that may come out of a reader
    return 0;
}
