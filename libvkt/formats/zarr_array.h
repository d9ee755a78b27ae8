// Zarr arrays, version 2 and 3 (https://zarr-specs.readthedocs.io): what their metadata say, and one chunk at a time.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/large_vector.h"
#include "libvkt/core/types.h"
#include "libvkt/formats/zarr_filters.h"
#include "libvkt/formats/zarr_store.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace vkt::zarr {

/// Begin and length of a chunk that a shard does not have.
inline constexpr std::uint64_t absent = ~std::uint64_t{0};

/// What undoes, or does, one step of compression. Checksums of four bytes stand behind what they are of, or before it.
enum class Codec : std::uint8_t {
    zlib,
    gzip,
    zstd,
    blosc,
    lz4,
    bzip2,
    lzma,
    crc32c,
    crc32c_before,
    crc32,
    crc32_before,
    adler32,
    adler32_before,
    fletcher32,
    lookup3
};

inline bool is_checksum(Codec codec) { return codec >= Codec::crc32c; }

/// What the library has of each codec; loads the module blosc. Throws Error{failure} for what the build is without.
void require(Codec codec, std::string const& file);

/// What compresses best of what the build has: Blosc's Zstandard, Zstandard, else zlib.
Codec best_codec();

/// Exactly `to.size()` bytes. Throws Error{data} naming `file` for anything else.
void decode(Codec codec, std::span<std::byte const> from, std::span<std::byte> to, std::string const& file);
/// The same where nobody says how many bytes they are, at most `to.size()`: their number.
std::size_t decode_some(Codec codec, std::span<std::byte const> from, std::span<std::byte> to, std::string const& file);
/// True for what encode() does: zlib, gzip, zstd, blosc and crc32c.
bool encodes(Codec codec);
/// Throws Error{failure}.
std::vector<std::byte> encode(Codec codec, std::span<std::byte const> from, std::size_t element);

inline constexpr std::size_t most_dimensions = 16;
using Position = std::vector<std::int64_t>; ///< one number for each dimension, as the metadata order them

struct Array {
    std::string folder; ///< where its metadata and chunks lie in their store
    Position shape;
    Position chunk;                 ///< of a file
    Position inner;                 ///< what is encoded by itself: the same, or a part of a shard
    std::vector<std::size_t> order; ///< of dimensions in the bytes of a chunk, slowest first
    DataType dtype = DataType::uint8;
    bool boolean = false; ///< of which uint8 was made
    bool big_endian = false;
    std::array<std::byte, 8> fill{}; ///< of one voxel, in this machine's byte order
    std::vector<Filter> filters;     ///< of what is encoded by itself, before the codecs
    std::vector<Codec> codecs;       ///< of the same, in the order of encoding
    bool sharded = false, index_first = false, index_checksum = false;
    char separator = '.';
    bool prefix = false;            ///< keys begin with "c"
    std::vector<std::string> names; ///< of dimensions; may be empty
    std::string attributes = "{}";  ///< JSON

    std::size_t inner_bytes() const;
    std::size_t filtered_bytes() const; ///< of the same as codecs get it
    std::string key(Position const& file) const;
};

/// True if the directory has metadata of an array or a group.
bool is_zarr(std::string const& folder);
/// The metadata of the array in this folder; none if it is a group or nothing. Throws Error{data} for what is damaged
/// and what volumes are not.
std::optional<Array> read_array(Store const& store, std::string const& folder);
/// How many dimensions the array in this folder has, whatever its elements are; none if it is a group or nothing.
std::optional<std::size_t> rank_of_array(Store const& store, std::string const& folder);
/// Attributes of an array or group as JSON; "{}" if there are none.
std::string read_attributes(Store const& store, std::string const& folder);
/// The same from the text of a file (.zarray: version 2; zarr.json: 3).
Array parse_array(std::string const& json, int version, std::string const& folder);

/// Memory that a thread keeps from chunk to chunk.
struct Scratch {
    LargeVector<std::byte> encoded, decoded, filtered, unfiltered;
};

/// Chunks, read by any number of threads.
class Chunks {
public:
    /// A chunk in a file that is open.
    struct Place {
        std::unique_ptr<StoredFile> file; ///< none if there is no such chunk
        std::string key;
        std::uint64_t begin = 0, size = 0;
    };

    Chunks(std::shared_ptr<Store const> store, Array array);
    Array const& array() const { return array_; }
    /// The chunk at this position among those that are encoded by themselves: decoded, in this machine's byte order,
    /// array().inner_bytes() of it. False if there is none: it holds the fill value. Throws Error{data, io}.
    bool read(Position const& at, std::span<std::byte> to, Scratch& scratch) const;
    /// Chunks lie in their files as they are, but for the order of bytes.
    bool plain() const { return array_.codecs.empty() && array_.filters.empty(); }
    /// Where the bytes of a chunk lie. Throws Error{data, io}.
    Place place(Position const& at) const;
    /// Throws Error{data} for a chunk of more or fewer bytes than it should have.
    void check_size(Place const& place, std::size_t size, std::size_t expected) const;

private:
    std::size_t most_encoded() const;
    std::shared_ptr<std::vector<std::uint64_t> const> index_of(StoredFile const& opened, std::string const& key) const;

    std::shared_ptr<Store const> store_;
    Array array_;
    mutable std::mutex mutex_;
    mutable std::map<std::string, std::shared_ptr<std::vector<std::uint64_t> const>> indices_;
};

} // namespace vkt::zarr
