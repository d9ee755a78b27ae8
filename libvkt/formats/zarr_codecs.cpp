// Compression of chunks.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/blosc_module.h"
#include "libvkt/formats/unpack.h"
#include "libvkt/formats/zarr_array.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>

#include <zlib.h>
#ifdef VKT_HAVE_ZSTD
#include <zstd.h>
#endif

namespace vkt::zarr {
namespace {

constexpr int zstd_level = 3, zlib_level = 4;

BloscFunctions const& blosc(std::string const& what) {
    static auto const* const functions = static_cast<BloscFunctions const*>(module_functions("blosc", what));
    return *functions;
}

/// None of what is no compression, or Blosc's.
std::optional<Packing> packing_of(Codec codec) {
    switch (codec) {
    case Codec::zlib:
    case Codec::gzip:
        return Packing::deflate;
    case Codec::zstd:
        return Packing::zstd;
    case Codec::lz4:
        return Packing::lz4;
    case Codec::bzip2:
        return Packing::bzip2;
    case Codec::lzma:
        return Packing::lzma;
    default:
        return {};
    }
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

/// Of words of two bytes, the first the higher one, and of a last byte the higher one alone (Fletcher, 1982, as HDF5
/// has it: sums of anything but zeros are never 0, since carries are added).
std::uint32_t fletcher32(std::span<std::byte const> bytes) {
    constexpr std::uint64_t base = 65535;
    std::uint64_t first = 0, second = 0;
    for (std::size_t i = 0; i < bytes.size(); i += 2) {
        first += std::to_integer<std::uint64_t>(bytes[i]) << 8;
        if (i + 1 < bytes.size()) first += std::to_integer<std::uint64_t>(bytes[i + 1]);
        if (first > base) first -= base;
        second += first;
        if (second > base) second -= base;
    }
    return static_cast<std::uint32_t>(second << 16 | first);
}

/// Bob Jenkins' lookup3 (public domain, 2006), of bytes as little-endian words, as HDF5 has it.
std::uint32_t lookup3(std::span<std::byte const> bytes) {
    std::uint32_t a = 0xdeadbeefU + static_cast<std::uint32_t>(bytes.size()), b = a, c = a;
    auto const part = [](std::uint32_t& x, std::uint32_t y, int turn) { x = (x ^ y) - std::rotl(y, turn); };
    while (!bytes.empty()) {
        std::array<std::uint32_t, 3> words{}; // of the last block what is missing is 0
        for (std::size_t i = 0; i < std::min<std::size_t>(bytes.size(), 12); ++i)
            words[i / 4] |= std::to_integer<std::uint32_t>(bytes[i]) << i % 4 * 8;
        a += words[0], b += words[1], c += words[2];
        if (bytes.size() <= 12) {
            part(c, b, 14), part(a, c, 11), part(b, a, 25), part(c, b, 16), part(a, c, 4), part(b, a, 14);
            part(c, b, 24);
            break;
        }
        auto const turn = [](std::uint32_t& x, std::uint32_t& y, std::uint32_t z, int bits) {
            x = (x - y) ^ std::rotl(y, bits);
            y += z;
        };
        turn(a, c, b, 4), turn(b, a, c, 6), turn(c, b, a, 8), turn(a, c, b, 16), turn(b, a, c, 19), turn(c, b, a, 4);
        bytes = bytes.subspan(12);
    }
    return c;
}

std::uint32_t checksum(Codec codec, std::span<std::byte const> bytes) {
    auto const* const data = reinterpret_cast<Bytef const*>(bytes.data());
    switch (codec) {
    case Codec::crc32:
    case Codec::crc32_before:
        return static_cast<std::uint32_t>(crc32_z(0, data, bytes.size()));
    case Codec::adler32:
    case Codec::adler32_before:
        return static_cast<std::uint32_t>(adler32_z(1, data, bytes.size()));
    case Codec::fletcher32:
        return fletcher32(bytes);
    case Codec::lookup3:
        return lookup3(bytes);
    default:
        return crc32c(bytes);
    }
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
    if (codec == Codec::blosc) return blosc(file).decompress(from.data(), from.size(), to.data(), to.size());
    if (codec == Codec::lz4) { // numcodecs puts the size first
        std::uint32_t size = 0;
        if (from.size() < sizeof size) return false;
        std::memcpy(&size, from.data(), sizeof size);
        if (size != to.size()) return false;
        from = from.subspan(sizeof size);
    }
    if (auto const packing = packing_of(codec)) {
        vkt::require(*packing, file);
        return unpack(*packing, from, to);
    }
    if (from.size() != to.size() + 4) return false;
    bool const before = codec == Codec::crc32c_before || codec == Codec::crc32_before || codec == Codec::adler32_before;
    std::uint32_t said = 0;
    std::memcpy(&said, from.data() + (before ? 0 : to.size()), 4);
    std::memcpy(to.data(), from.data() + (before ? 4 : 0), to.size());
    return said == checksum(codec, to);
}

} // namespace

void require(Codec codec, std::string const& file) {
    if (codec == Codec::blosc) blosc(file);
    if (auto const packing = packing_of(codec)) vkt::require(*packing, file);
}

Codec best_codec() {
    if (module_built("blosc")) return Codec::blosc;
#ifdef VKT_HAVE_ZSTD
    return Codec::zstd;
#else
    return Codec::zlib;
#endif
}

std::size_t decode_some(Codec codec, std::span<std::byte const> from, std::span<std::byte> to,
                        std::string const& file) {
    std::optional<std::size_t> size;
    if (codec == Codec::blosc || codec == Codec::lz4) { // they say it
        std::uint32_t said = 0;
        std::size_t const at = codec == Codec::blosc ? 4 : 0;
        if (from.size() >= at + sizeof said) std::memcpy(&said, from.data() + at, sizeof said);
        if (said <= to.size() && decoded(codec, from, to.first(said), file)) size = said;
    } else if (auto const packing = packing_of(codec)) {
        vkt::require(*packing, file);
        size = unpack_some(*packing, from, to);
    }
    if (!size) throw Error(ErrorKind::data, text("'", file, "': damaged: the chunk does not decompress"));
    return *size;
}

void decode(Codec codec, std::span<std::byte const> from, std::span<std::byte> to, std::string const& file) {
    if (!decoded(codec, from, to, file))
        throw Error(ErrorKind::data,
                    text("'", file, "': damaged: the chunk does not decompress to what it should hold"));
}

bool encodes(Codec codec) {
    return codec == Codec::zlib || codec == Codec::gzip || codec == Codec::zstd || codec == Codec::blosc ||
           codec == Codec::crc32c;
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
