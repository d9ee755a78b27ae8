// What the fuzz targets share: bytes as an input file or a pipe, and a reader that takes some of every volume in it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

namespace vkt::fuzz {

/// A descriptor from which `size` bytes can be read: of a file, or of a pipe (up to its 64 KiB).
inline int descriptor_with(std::uint8_t const* data, std::size_t size, bool pipe_like) {
    if (pipe_like && size <= 65536) {
        int ends[2];
        if (pipe(ends) != 0) std::abort();
        if (write(ends[1], data, size) != static_cast<ssize_t>(size)) std::abort();
        close(ends[1]);
        return ends[0];
    }
    int const file = memfd_create("input", MFD_CLOEXEC);
    if (file < 0 || write(file, data, size) != static_cast<ssize_t>(size)) std::abort();
    lseek(file, 0, SEEK_SET);
    return file;
}

/// Reads the first slices of up to four volumes, and finishes each.
inline void consume(Source& source) {
    std::vector<std::byte> memory;
    for (int i = 0; i < 4 && source.next_volume(); ++i) {
        Header const& header = source.header();
        check(header); // whatever a reader lets through must be sound
        if (header.kind == Kind::structured) {
            Box part = box_of(header.dims);
            part.upper = {std::min<std::int64_t>(part.upper.x, 64), std::min<std::int64_t>(part.upper.y, 64),
                          std::min<std::int64_t>(part.upper.z, 16)};
            memory.resize(static_cast<std::size_t>(part.voxels()) * size_of(header.dtype));
            source.read(dense_view(memory.data(), header.dtype, part));
        }
        source.finish();
    }
}

/// Reads bytes as a file of a format, and once more as a pipe of it.
inline void read_as(char const* format, char const* name, std::uint8_t const* data, std::size_t size) {
    ReadOptions options;
    options.format = format;
    for (bool const pipe_like : {false, true}) {
        try {
            auto source =
                open_volume(std::make_unique<ByteSource>(descriptor_with(data, size, pipe_like), name), options);
            consume(*source);
        } catch (Error const&) {
        } // the only thing that may come out of a reader
    }
}

} // namespace vkt::fuzz
