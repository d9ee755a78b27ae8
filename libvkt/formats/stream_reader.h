// Volume streams as files: what formats need of them. ipc, which stands above, defines it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/io/byte_source.h"

#include <cstddef>
#include <memory>
#include <span>

namespace vkt {

/// How many bytes tell whether a stream begins with them.
constexpr std::size_t stream_magic_bytes = 8;
bool begins_stream(std::span<std::byte const> head);
std::unique_ptr<Source> open_stream(std::unique_ptr<ByteSource> bytes);

/// True of a stream; a file or pipe that holds one compressed as a whole, NAME.vkt.gz, is replaced by the stream.
bool holds_stream(std::unique_ptr<ByteSource>& bytes);

} // namespace vkt
