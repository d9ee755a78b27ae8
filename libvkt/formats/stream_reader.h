// Volume streams stand above libvkt's formats: what reads them is said here, so that a file may be one wherever a
// volume is opened. SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/io/byte_source.h"

#include <memory>
#include <span>

namespace vkt {

struct StreamReader {
    std::size_t magic_bytes = 0;
    bool (*recognise)(std::span<std::byte const> head) = nullptr;
    std::unique_ptr<Source> (*open)(std::unique_ptr<ByteSource> bytes) = nullptr;
};

/// Until it is said, streams are files of no known format. Before main() or from one thread.
void set_stream_reader(StreamReader reader);

/// True of a stream; a file or pipe that holds one compressed as a whole, NAME.vkt.gz, is replaced by the stream.
bool holds_stream(std::unique_ptr<ByteSource>& bytes);

} // namespace vkt
