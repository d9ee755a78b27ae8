// Compression of chunks.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/blosc_module.h"
#include "libvkt/formats/zarr_array.h"

#include <cstring>

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

namespace vkt::zarr {
namespace {

constexpr int zstd_level = 3, zlib_level = 4;

BloscFunctions const& blosc(std::string const& what) {
    static auto const* const functions = static_cast<BloscFunctions const*>(module_functions("blosc", what));
    return *functions;
}

[[noreturn, maybe_unused]] void without(char const* library, std::string const& file) {
    throw Error(ErrorKind::failure, text(file, ": this build is without ", library),
                text("build vkt with lib", library, ", or compress with zlib"));
}

std::array<std::uint32_t, 256> crc_table() {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < 256; ++i) {
        std::uint32_t c = i;
        for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? c >> 1 ^ 0x82f63b78U : c >> 1;
        table[i] = c;
    }
    return table;
}

std::uint32_t crc32c(std::span<std::byte const> bytes) {
    static std::array<std::uint32_t, 256> const table = crc_table();
    std::uint32_t c = ~0U;
    for (std::byte const b : bytes) c = table[(c ^ std::to_integer<std::uint32_t>(b)) & 255] ^ c >> 8;
    return ~c;
}

bool inflate_all(std::span<std::byte const> from, std::span<std::byte> to) {
    z_stream state{};
    if (from.size() > UINT32_MAX || to.size() > UINT32_MAX || inflateInit2(&state, 15 + 32) != Z_OK) return false;
    state.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(from.data()));
    state.avail_in = static_cast<uInt>(from.size());
    state.next_out = reinterpret_cast<Bytef*>(to.data());
    state.avail_out = static_cast<uInt>(to.size());
    int const result = inflate(&state, Z_FINISH);
    bool const whole = result == Z_STREAM_END && state.avail_out == 0;
    inflateEnd(&state);
    return whole;
}

/// With gzip's header; 0 on failure.
std::size_t deflate_gzip(std::span<std::byte const> from, std::vector<std::byte>& to) {
    z_stream state{};
    if (from.size() > UINT32_MAX ||
        deflateInit2(&state, zlib_level, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return 0;
    to.resize(deflateBound(&state, static_cast<uLong>(from.size())));
    state.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(from.data()));
    state.avail_in = static_cast<uInt>(from.size());
    state.next_out = reinterpret_cast<Bytef*>(to.data());
    state.avail_out = static_cast<uInt>(to.size());
    std::size_t const size = deflate(&state, Z_FINISH) == Z_STREAM_END ? to.size() - state.avail_out : 0;
    deflateEnd(&state);
    return size;
}

bool decoded(Codec codec, std::span<std::byte const> from, std::span<std::byte> to, std::string const& file) {
    switch (codec) {
    case Codec::zlib:
    case Codec::gzip:
        return inflate_all(from, to);
    case Codec::zstd:
#ifdef VKT_HAVE_ZSTD
        return ZSTD_decompress(to.data(), to.size(), from.data(), from.size()) == to.size();
#else
        without("zstd", file);
#endif
    case Codec::blosc:
        return blosc(file).decompress(from.data(), from.size(), to.data(), to.size());
    case Codec::lz4: { // numcodecs puts the size first
#ifdef VKT_HAVE_LZ4
        if (from.size() < 4 || from.size() > INT32_MAX || to.size() > INT32_MAX) return false;
        std::uint32_t size = 0;
        std::memcpy(&size, from.data(), 4);
        return size == to.size() &&
               LZ4_decompress_safe(reinterpret_cast<char const*>(from.data()) + 4, reinterpret_cast<char*>(to.data()),
                                   static_cast<int>(from.size() - 4),
                                   static_cast<int>(to.size())) == static_cast<int>(to.size());
#else
        without("lz4", file);
#endif
    }
    case Codec::bzip2: {
#ifdef VKT_HAVE_BZIP2
        if (from.size() > UINT32_MAX || to.size() > UINT32_MAX) return false;
        auto size = static_cast<unsigned>(to.size());
        auto* const in = reinterpret_cast<char*>(const_cast<std::byte*>(from.data()));
        return BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(to.data()), &size, in,
                                          static_cast<unsigned>(from.size()), 0, 0) == BZ_OK &&
               size == to.size();
#else
        without("bz2", file);
#endif
    }
    case Codec::lzma: {
#ifdef VKT_HAVE_LZMA
        lzma_stream state = LZMA_STREAM_INIT;
        if (lzma_auto_decoder(&state, std::uint64_t{1} << 30, 0) != LZMA_OK) return false;
        state.next_in = reinterpret_cast<std::uint8_t const*>(from.data());
        state.avail_in = from.size();
        state.next_out = reinterpret_cast<std::uint8_t*>(to.data());
        state.avail_out = to.size();
        bool const whole = lzma_code(&state, LZMA_FINISH) == LZMA_STREAM_END && state.avail_out == 0;
        lzma_end(&state);
        return whole;
#else
        without("lzma", file);
#endif
    }
    case Codec::crc32c:
        break;
    }
    if (from.size() != to.size() + 4) return false;
    std::uint32_t said = 0;
    std::memcpy(&said, from.data() + to.size(), 4);
    std::memcpy(to.data(), from.data(), to.size());
    return said == crc32c(to);
}

} // namespace

void require(Codec codec, std::string const& file) {
    if (codec == Codec::blosc) blosc(file);
#ifndef VKT_HAVE_ZSTD
    if (codec == Codec::zstd) without("zstd", file);
#endif
#ifndef VKT_HAVE_LZ4
    if (codec == Codec::lz4) without("lz4", file);
#endif
#ifndef VKT_HAVE_BZIP2
    if (codec == Codec::bzip2) without("bz2", file);
#endif
#ifndef VKT_HAVE_LZMA
    if (codec == Codec::lzma) without("lzma", file);
#endif
}

Codec best_codec() {
    if (module_built("blosc")) return Codec::blosc;
#ifdef VKT_HAVE_ZSTD
    return Codec::zstd;
#else
    return Codec::zlib;
#endif
}

void decode(Codec codec, std::span<std::byte const> from, std::span<std::byte> to, std::string const& file) {
    if (!decoded(codec, from, to, file))
        throw Error(ErrorKind::data,
                    text("'", file, "': damaged: the chunk does not decompress to what it should hold"));
}

std::vector<std::byte> encode(Codec codec, std::span<std::byte const> from, std::size_t element) {
    std::vector<std::byte> to;
    std::size_t size = 0;
    if (codec == Codec::crc32c) {
        std::uint32_t const sum = crc32c(from);
        to.resize(from.size() + sizeof sum);
        std::memcpy(to.data(), from.data(), from.size());
        std::memcpy(to.data() + from.size(), &sum, sizeof sum);
        return to;
    }
    if (codec == Codec::gzip) {
        size = deflate_gzip(from, to);
    } else if (codec == Codec::blosc) {
        to.resize(from.size() + 16);
        size = blosc("writing Zarr").compress(from.data(), from.size(), element, to.data());
#ifdef VKT_HAVE_ZSTD
    } else if (codec == Codec::zstd) {
        to.resize(ZSTD_compressBound(from.size()));
        std::size_t const done = ZSTD_compress(to.data(), to.size(), from.data(), from.size(), zstd_level);
        size = ZSTD_isError(done) != 0 ? 0 : done;
#endif
    } else {
        uLongf length = compressBound(static_cast<uLong>(from.size()));
        to.resize(length);
        bool const done =
            compress2(reinterpret_cast<Bytef*>(to.data()), &length, reinterpret_cast<Bytef const*>(from.data()),
                      static_cast<uLong>(from.size()), zlib_level) == Z_OK;
        size = done ? length : 0;
    }
    if (size == 0) throw Error(ErrorKind::failure, "a chunk cannot be compressed");
    to.resize(size);
    return to;
}

} // namespace vkt::zarr
