// The formats are those of the registered filters, https://github.com/HDFGroup/hdf5_plugins.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/filters.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/blosc_module.h"
#include "libvkt/formats/unpack.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#ifdef VKT_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef VKT_HAVE_ZSTD
#include <zstd.h>
#endif

namespace vkt::hdf5 {
namespace {

using Bytes = std::span<std::byte const>;
using Settings = std::span<unsigned const>;
using Decoded = std::optional<std::vector<std::byte>>; ///< none for what is damaged

constexpr std::size_t most_chunk = std::size_t{1} << 32; ///< bytes of a chunk in HDF5

std::size_t setting(Settings settings, std::size_t i) { return i < settings.size() ? settings[i] : 0; }

std::uint64_t big_endian(Bytes from, std::size_t at, std::size_t n) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < n; ++i) value = value << 8 | std::to_integer<std::uint64_t>(from[at + i]);
    return value;
}

/// For formats that do not say how long they become: `decode` fills memory, or says that it is too little by returning
/// none. The filter's settings mostly have the size.
template <class F> Decoded with_growing(std::size_t guess, F const& decode) {
    for (std::size_t n = std::max<std::size_t>(guess, 1024); n <= most_chunk; n *= 2) {
        std::vector<std::byte> to(n);
        bool damaged = false;
        if (auto const size = decode(std::span(to), damaged)) {
            to.resize(*size);
            return to;
        }
        if (damaged) break;
    }
    return std::nullopt;
}

/// LibLZF: runs of literals, and repetitions of 3 bytes or more from up to 8 KiB before.
Decoded lzf(Bytes from, Settings settings) {
    return with_growing(setting(settings, 2),
                        [&](std::span<std::byte> to, bool& damaged) -> std::optional<std::size_t> {
                            std::size_t in = 0, out = 0;
                            damaged = true;
                            auto const next = [&] { return std::to_integer<std::size_t>(from[in++]); };
                            while (in < from.size()) {
                                std::size_t const control = next();
                                if (control < 32) {
                                    std::size_t const n = control + 1;
                                    if (n > from.size() - in) return std::nullopt;
                                    if (n > to.size() - out) {
                                        damaged = false;
                                        return std::nullopt;
                                    }
                                    std::memcpy(to.data() + out, from.data() + in, n);
                                    in += n;
                                    out += n;
                                    continue;
                                }
                                std::size_t n = control >> 5;
                                if (from.size() - in < (n == 7 ? 2U : 1U)) return std::nullopt;
                                if (n == 7) n += next();
                                n += 2;
                                std::size_t const back = ((control & 31) << 8) + next() + 1;
                                if (back > out) return std::nullopt;
                                if (n > to.size() - out) {
                                    damaged = false;
                                    return std::nullopt;
                                }
                                for (; n > 0; --n, ++out) to[out] = to[out - back]; // may overlap
                            }
                            return out;
                        });
}

#ifdef VKT_HAVE_ZSTD
Decoded zstd(Bytes from, Settings) {
    unsigned long long const size = ZSTD_getFrameContentSize(from.data(), from.size());
    if (size > most_chunk) return std::nullopt; // unknown ones, too: filters encode whole chunks, which have a size
    std::vector<std::byte> to(static_cast<std::size_t>(size));
    if (!unpack(Packing::zstd, from, to)) return std::nullopt;
    return to;
}
#endif

#ifdef VKT_HAVE_BZIP2
Decoded bzip2(Bytes from, Settings) {
    return with_growing(4 * from.size(), [&](std::span<std::byte> to, bool& damaged) -> std::optional<std::size_t> {
        auto size = static_cast<unsigned>(std::min<std::size_t>(to.size(), UINT32_MAX));
        auto* const in = reinterpret_cast<char*>(const_cast<std::byte*>(from.data()));
        int const result = BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(to.data()), &size, in,
                                                      static_cast<unsigned>(from.size()), 0, 0);
        damaged = result != BZ_OUTBUFF_FULL;
        return result == BZ_OK ? std::optional<std::size_t>(size) : std::nullopt;
    });
}
#endif

/// The size, that of blocks, and blocks behind their own sizes; those of full size are not compressed.
Decoded lz4(Bytes from, Settings) {
    if (from.size() < 12) return std::nullopt;
    std::uint64_t const size = big_endian(from, 0, 8), block = big_endian(from, 8, 4);
    if (size > most_chunk || block == 0) return std::nullopt;
    std::vector<std::byte> to(static_cast<std::size_t>(size));
    std::size_t in = 12;
    for (std::size_t out = 0; out < to.size();) {
        std::size_t const n = std::min<std::size_t>(block, to.size() - out);
        if (from.size() - in < 4) return std::nullopt;
        std::size_t const packed = big_endian(from, in, 4);
        in += 4;
        if (packed > from.size() - in) return std::nullopt;
        if (packed == n)
            std::memcpy(to.data() + out, from.data() + in, n);
        else if (!unpack(Packing::lz4, from.subspan(in, packed), std::span(to).subspan(out, n)))
            return std::nullopt;
        in += packed;
        out += n;
    }
    return to;
}

Decoded blosc(Bytes from, Settings) {
    if (from.size() < 16) return std::nullopt;
    std::uint32_t size = 0;
    std::memcpy(&size, from.data() + 4, 4); // little-endian, as all machines that this is built for
    auto const* const functions = static_cast<BloscFunctions const*>(module_functions("blosc", "reading HDF5"));
    std::vector<std::byte> to(size);
    if (!functions->decompress(from.data(), from.size(), to.data(), to.size())) return std::nullopt;
    return to;
}

/// Eight bytes whose bits k stand in byte k, back in their order (Warren, Hacker's Delight, 7-3).
std::uint64_t transposed(std::uint64_t x) {
    std::uint64_t t = (x ^ x >> 7) & 0x00aa00aa00aa00aaULL;
    x ^= t ^ t << 7;
    t = (x ^ x >> 14) & 0x0000cccc0000ccccULL;
    x ^= t ^ t << 14;
    t = (x ^ x >> 28) & 0x00000000f0f0f0f0ULL;
    return x ^ t ^ t << 28;
}

/// n elements, a multiple of 8, of which the lowest bits of the first bytes come first, then the next ones.
void unshuffle_bits(std::byte const* from, std::byte* to, std::size_t n, std::size_t element) {
    std::size_t const row = n / 8;
    for (std::size_t byte = 0; byte < element; ++byte)
        for (std::size_t group = 0; group < row; ++group) {
            std::uint64_t bits = 0;
            for (std::size_t k = 0; k < 8; ++k)
                bits |= std::to_integer<std::uint64_t>(from[(byte * 8 + k) * row + group]) << 8 * k;
            bits = transposed(bits);
            for (std::size_t i = 0; i < 8; ++i)
                to[(group * 8 + i) * element + byte] = static_cast<std::byte>(bits >> 8 * i);
        }
}

/// Blocks of elements whose bits are transposed, and which may be compressed behind that, each by itself; what is less
/// than eight elements at the end is as it was.
Decoded bitshuffle(Bytes from, Settings settings) {
    std::size_t const element = setting(settings, 2), compressor = setting(settings, 4);
    if (element == 0 || element > 65536) return std::nullopt;
    std::size_t size = from.size(), block = setting(settings, 3), in = 0;
    if (compressor != 0) {
        if (from.size() < 12) return std::nullopt;
        size = static_cast<std::size_t>(std::min<std::uint64_t>(big_endian(from, 0, 8), most_chunk + 1));
        block = big_endian(from, 8, 4) / element;
        in = 12;
    }
    if (block == 0) block = std::max<std::size_t>(8192 / element / 8 * 8, 128); // the filter's own choice
    if (size > most_chunk || size % element != 0 || block % 8 != 0) return std::nullopt;
    std::vector<std::byte> to(size), plain(block * element);
    std::size_t const n = size / element;
    for (std::size_t done = 0; done < n;) {
        std::size_t const here = std::min(block, (n - done) / 8 * 8), bytes = here * element;
        std::byte* const out = to.data() + done * element;
        if (here == 0) {
            std::size_t const rest = (n - done) * element;
            if (rest > from.size() - in) return std::nullopt;
            std::memcpy(out, from.data() + in, rest);
            break;
        }
        Bytes packed;
        if (compressor == 0) {
            if (bytes > from.size() - in) return std::nullopt;
            packed = from.subspan(in, bytes);
            in += bytes;
        } else {
            if (from.size() - in < 4) return std::nullopt;
            std::size_t const stored = big_endian(from, in, 4);
            in += 4;
            if (stored > from.size() - in) return std::nullopt;
            if (compressor != 2 && compressor != 3) return std::nullopt;
            Packing const packing = compressor == 2 ? Packing::lz4 : Packing::zstd;
            if (!unpack(packing, from.subspan(in, stored), std::span(plain).first(bytes))) return std::nullopt;
            packed = Bytes(plain).first(bytes);
            in += stored;
        }
        unshuffle_bits(packed.data(), out, here, element);
        done += here;
    }
    return to;
}

/// What HDF5 calls: its memory comes from the library and goes back there.
template <Decoded (*decode)(Bytes, Settings)>
std::size_t filter(unsigned flags, std::size_t count, unsigned const* settings, std::size_t n, std::size_t* capacity,
                   void** buffer) {
    if ((flags & H5Z_FLAG_REVERSE) == 0) return 0;
    try {
        Decoded const result = decode({static_cast<std::byte const*>(*buffer), n}, {settings, count});
        if (!result || result->empty()) return 0;
        void* const memory = H5allocate_memory(result->size(), false);
        if (memory == nullptr) return 0;
        std::memcpy(memory, result->data(), result->size());
        H5free_memory(*buffer);
        *buffer = memory;
        *capacity = result->size();
        return result->size();
    } catch (...) { // C code lies between
        return 0;
    }
}

struct Known {
    H5Z_filter_t id;
    char const* name;
    H5Z_func_t decode; ///< null: only named
};
constexpr Known known[] = {
    {32000, "lzf", filter<lzf>},   {32001, "blosc", filter<blosc>}, {32008, "bitshuffle", filter<bitshuffle>},
#ifdef VKT_HAVE_BZIP2
    {307, "bzip2", filter<bzip2>},
#else
    {307, "bzip2", nullptr},
#endif
    {32004, "lz4", filter<lz4>},
#ifdef VKT_HAVE_ZSTD
    {32015, "zstd", filter<zstd>},
#else
    {32015, "zstd", nullptr},
#endif
    {305, "lzo", nullptr},         {32013, "zfp", nullptr},         {32017, "sz", nullptr},
    {32019, "fcidecomp", nullptr}, {32024, "sz3", nullptr},         {32026, "blosc2", nullptr},
};

} // namespace

void register_filters() {
    for (Known const& one : known) {
        if (one.decode == nullptr || (one.decode == filter<lz4> && !can_unpack(Packing::lz4))) continue;
        H5Z_class2_t const description{H5Z_CLASS_T_VERS, one.id, 0, 1, one.name, nullptr, nullptr, one.decode};
        H5Zregister(&description);
    }
}

namespace {

bool encodes(H5Z_filter_t id) {
    unsigned flags = 0;
    return H5Zfilter_avail(id) > 0 && H5Zget_filter_info(id, &flags) >= 0 &&
           (flags & H5Z_FILTER_CONFIG_ENCODE_ENABLED) != 0;
}

/// The first filter that is not `there`.
template <class There> std::string other_filter(std::int64_t creation, There const& there) {
    for (int i = 0; i < H5Pget_nfilters(creation); ++i) {
        unsigned flags = 0, config = 0;
        std::size_t values = 0;
        std::array<char, 64> name{};
        H5Z_filter_t const id = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr,
                                               name.size() - 1, name.data(), &config);
        if (id < 0 || there(id)) continue;
        auto const found = std::find_if(std::begin(known), std::end(known), [&](Known const& k) { return k.id == id; });
        std::string const own = found != std::end(known) ? found->name : name.data();
        return text("filter ", static_cast<std::int64_t>(id), own.empty() ? "" : text(" (", printable(own), ")"));
    }
    return {};
}

} // namespace

std::string absent_filter(std::int64_t creation) {
    return other_filter(creation, [](H5Z_filter_t id) { return H5Zfilter_avail(id) > 0; });
}

std::string absent_encoder(std::int64_t creation) { return other_filter(creation, encodes); }

} // namespace vkt::hdf5
