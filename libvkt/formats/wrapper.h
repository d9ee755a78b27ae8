// Files that are compressed as a whole: gzip, bzip2, xz, Zstandard around any format of one file.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/byte_source.h"

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

enum class Wrapper : std::uint8_t { none, gzip, bzip2, xz, zstd };

/// By the first bytes of a file.
Wrapper wrapper_of(std::span<std::byte const> head);
/// By the end of its name: .gz, .bz2, .xz, .zst.
Wrapper wrapper_of_name(std::string_view name);
/// The name without that end.
std::string without_wrapper(std::string const& name);

/// What the beginning of a file stands for: up to n bytes, fewer where it ends or is damaged.
std::vector<std::byte> unwrapped_head(std::span<std::byte const> head, std::size_t n);
/// The content under the same name, to be read in order. Members and frames that follow one another are one content.
/// Reading throws Error{data} on damage and early ends, Error{failure} where the library is not built in.
std::unique_ptr<ByteSource> unwrapped(std::unique_ptr<ByteSource> bytes, Wrapper wrapper);

/// A sink whose file is written by `create` under a temporary name beside `path`, and compressed into that when it is
/// complete. The bytes do not depend on the number of threads. Throws Error{usage} for a pipe as gzip's DeflateWriter
/// does not, Error{io}.
std::unique_ptr<Sink> wrapping_sink(std::string const& path, Wrapper wrapper, WriteOptions const& options,
                                    std::function<std::unique_ptr<Sink>(std::string const&)> const& create);

} // namespace vkt
