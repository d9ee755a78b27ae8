// One call of each library.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/unpack.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <zlib.h>
#ifdef VKT_HAVE_ZSTD
#include <zstd.h>
#endif
#ifdef VKT_HAVE_LZ4
#include <lz4.h>
#endif
#ifdef VKT_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef VKT_HAVE_LZMA
#include <lzma.h>
#endif

namespace vkt {
namespace {

using Bytes = std::span<std::byte const>;
using Room = std::span<std::byte>;
using Size = std::optional<std::size_t>;
using Unpack = Size (*)(Bytes, Room); ///< null in builds without the library

Size inflated(Bytes from, Room to) {
    z_stream state{};
    if (from.size() > UINT32_MAX || to.size() > UINT32_MAX || inflateInit2(&state, 15 + 32) != Z_OK) return {};
    state.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(from.data()));
    state.avail_in = static_cast<uInt>(from.size());
    state.next_out = reinterpret_cast<Bytef*>(to.data());
    state.avail_out = static_cast<uInt>(to.size());
    bool const whole = inflate(&state, Z_FINISH) == Z_STREAM_END;
    inflateEnd(&state);
    return whole ? Size(to.size() - state.avail_out) : std::nullopt;
}

#ifdef VKT_HAVE_ZSTD
Size zstd_unpacked(Bytes from, Room to) {
    std::size_t const size = ZSTD_decompress(to.data(), to.size(), from.data(), from.size());
    return ZSTD_isError(size) != 0 ? std::nullopt : Size(size);
}
#else
constexpr Unpack zstd_unpacked = nullptr;
#endif

#ifdef VKT_HAVE_LZ4
Size lz4_unpacked(Bytes from, Room to) {
    if (from.size() > INT32_MAX || to.size() > LZ4_MAX_INPUT_SIZE) return {};
    int const size = LZ4_decompress_safe(reinterpret_cast<char const*>(from.data()), reinterpret_cast<char*>(to.data()),
                                         static_cast<int>(from.size()), static_cast<int>(to.size()));
    return size < 0 ? std::nullopt : Size(static_cast<std::size_t>(size));
}
#else
constexpr Unpack lz4_unpacked = nullptr;
#endif

#ifdef VKT_HAVE_BZIP2
Size bzip2_unpacked(Bytes from, Room to) {
    if (from.size() > UINT32_MAX || to.size() > UINT32_MAX) return {};
    auto size = static_cast<unsigned>(to.size());
    auto* const in = reinterpret_cast<char*>(const_cast<std::byte*>(from.data()));
    bool const whole = BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(to.data()), &size, in,
                                                  static_cast<unsigned>(from.size()), 0, 0) == BZ_OK;
    return whole ? Size(size) : std::nullopt;
}
#else
constexpr Unpack bzip2_unpacked = nullptr;
#endif

#ifdef VKT_HAVE_LZMA
Size lzma_unpacked(Bytes from, Room to) {
    constexpr std::uint64_t memory = std::uint64_t{1} << 30;
    lzma_stream state = LZMA_STREAM_INIT;
    if (lzma_auto_decoder(&state, memory, 0) != LZMA_OK) return {};
    state.next_in = reinterpret_cast<std::uint8_t const*>(from.data());
    state.avail_in = from.size();
    state.next_out = reinterpret_cast<std::uint8_t*>(to.data());
    state.avail_out = to.size();
    bool const whole = lzma_code(&state, LZMA_FINISH) == LZMA_STREAM_END;
    std::size_t const size = to.size() - state.avail_out;
    lzma_end(&state);
    return whole ? Size(size) : std::nullopt;
}
#else
constexpr Unpack lzma_unpacked = nullptr;
#endif

/// What does the work, and what it is of.
struct Library {
    Unpack unpacked;
    char const *name, *package;
};

Library library_of(Packing packing) {
    switch (packing) {
    case Packing::zstd:
        return {zstd_unpacked, "Zstandard", "libzstd-dev"};
    case Packing::lz4:
        return {lz4_unpacked, "LZ4", "liblz4-dev"};
    case Packing::bzip2:
        return {bzip2_unpacked, "bzip2", "libbz2-dev"};
    case Packing::lzma:
        return {lzma_unpacked, "LZMA", "liblzma-dev"};
    case Packing::deflate:
        break;
    }
    return {inflated, "zlib", "zlib1g-dev"};
}

} // namespace

bool can_unpack(Packing packing) { return library_of(packing).unpacked != nullptr; }

void require(Packing packing, std::string const& file) {
    Library const library = library_of(packing);
    if (library.unpacked == nullptr)
        throw Error(ErrorKind::failure,
                    text("'", file, "' is compressed with ", library.name, ", which this build lacks"),
                    text("build vkt with ", library.package));
}

bool unpack(Packing packing, std::span<std::byte const> from, std::span<std::byte> to) {
    return unpack_some(packing, from, to) == to.size();
}

std::optional<std::size_t> unpack_some(Packing packing, std::span<std::byte const> from, std::span<std::byte> to) {
    Library const library = library_of(packing);
    return library.unpacked != nullptr ? library.unpacked(from, to) : std::nullopt;
}

} // namespace vkt
