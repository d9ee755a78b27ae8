// Writing one array of a Zarr store: chunks or shards of it, slice by slice, and its metadata.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/zarr_array.h"

#include <nlohmann/json_fwd.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vkt::zarr {

/// Files of a directory that has no name yet, and goes if anything fails. Throw Error{io}.
void write_json(std::string const& path, nlohmann::ordered_json const& json);
void make_directory(std::string const& path);

/// All of a header, as the attribute "vkt" of an array keeps it.
nlohmann::ordered_json kept_header(Header header);

/// Dimensions before z that enumerate volumes, slowest first.
struct Leading {
    std::vector<std::string> names;
    std::vector<std::int64_t> extents;
    bool turned = false; ///< of two: volumes came with the second one slowest
};

/// Slices of one array as they come, in whole rows. Of chunks a layer is held, as deep as `memory` has room for, of
/// slices beyond it some rows; of shards, which hold several layers, only their indices.
class LevelWriter {
public:
    LevelWriter(std::string folder, Index3 dims, DataType dtype, WriteOptions const& options, std::size_t memory);

    void write(std::byte const* voxels, std::size_t n);
    /// After the last voxel of a volume that another one follows.
    void next_volume();
    /// After the last voxel of all: what is left of shards, and the metadata with these attributes.
    void finish(Leading const& leading, nlohmann::ordered_json const& attributes);
    Index3 dims() const { return dims_; }
    /// Bytes of all chunks of a volume together; not known if they are compressed.
    std::optional<std::size_t> bytes() const;

private:
    using Index = std::vector<std::uint64_t>; ///< of a shard: where each chunk begins, and its bytes

    void flush();
    std::vector<std::byte> chunk_at(Index3 at, std::int64_t row, std::int64_t rows, std::int64_t slices) const;
    void append(Index3 at, std::vector<std::byte> const& chunk);
    void close_shards();
    std::string file_of(Index3 at) const;
    std::string volume(std::int64_t number) const;
    void place_volumes(Leading const& leading) const;
    nlohmann::ordered_json metadata(Leading const& leading, nlohmann::ordered_json const& attributes) const;

    std::string folder_;
    Index3 dims_, chunk_, shard_; ///< shard_: a multiple of chunk_, or the same
    DataType dtype_;
    int version_;
    bool sharded_ = false;
    std::optional<Codec> codec_;
    int threads_;
    std::size_t row_, layer_; ///< bytes
    std::int64_t rows_ = 0;   ///< of this volume that were written
    std::int64_t volume_ = 0;
    std::vector<std::byte> held_;
    std::map<std::array<std::int64_t, 3>, Index> open_; ///< shards of this layer of shards that have a file
    std::map<std::array<std::int64_t, 3>, std::uint64_t> sizes_;
};

} // namespace vkt::zarr
