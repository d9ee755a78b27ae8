// Fuzzes Zarr: metadata of both versions, and chunks as they say. A byte 0 parts the metadata from a chunk.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/formats/zarr_array.h"

#include <algorithm>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    using namespace vkt::zarr;
    std::uint8_t const* const end = std::find(data, data + size, 0);
    std::string const json(data, end);
    std::span<std::byte const> chunk;
    if (end != data + size) chunk = std::as_bytes(std::span(end + 1, data + size));
    for (int const version : {2, 3}) {
        try {
            Array const array = parse_array(json, version, "/nonexistent");
            if (array.shape.size() != array.inner.size() || array.order.size() != array.shape.size()) std::abort();
            if (array.inner_bytes() > std::size_t{1} << 20) continue;
            std::vector<std::byte> to(array.inner_bytes());
            for (Codec const codec : array.codecs)
                if (codec != Codec::blosc) decode(codec, chunk, to, "input");
            std::vector<std::byte> held(to.size());
            Scratch scratch;
            Chunks(directories(), array).read(Position(array.shape.size(), 0), held, scratch);
        } catch (vkt::Error const&) {
        } // the only thing that may come out of a reader
    }
    return 0;
}
