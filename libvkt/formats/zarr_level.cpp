// Chunks, shards and metadata.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_level.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/layers.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/temporaries.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt::zarr {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr std::int64_t usual_edge = 64;
constexpr std::size_t most_history = std::size_t{256} << 10;

/// A new file, or more of one.
void write_file(std::string const& path, void const* data, std::size_t n, int how = O_EXCL) {
    int const file = ::open(path.c_str(), O_CREAT | how | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (file < 0) throw system_error(text("cannot write '", lasting_name(path), "'"));
    auto const* next = static_cast<std::byte const*>(data);
    int code = 0;
    while (n > 0 && code == 0) {
        ssize_t const done = ::write(file, next, n);
        if (done < 0 && errno == EINTR) continue;
        if (done < 0) {
            code = errno;
        } else {
            next += done;
            n -= static_cast<std::size_t>(done);
        }
    }
    if (::close(file) != 0 && code == 0) code = errno;
    if (code != 0) throw system_error(text("cannot write '", lasting_name(path), "'"), code);
}

std::string type_name_v2(DataType type) {
    bool const real = !is_integer(type);
    return text(size_of(type) == 1 ? "|" : "<",
                real              ? "f"
                : is_signed(type) ? "i"
                                  : "u",
                static_cast<std::int64_t>(size_of(type)));
}

Codec codec_for(ChunkCodec asked) {
    switch (asked) {
    case ChunkCodec::blosc:
        return Codec::blosc;
    case ChunkCodec::zstd:
        return Codec::zstd;
    case ChunkCodec::gzip:
        break;
    }
    return Codec::gzip;
}

Index3 at_least_one(Index3 v) {
    return {std::max<std::int64_t>(v.x, 1), std::max<std::int64_t>(v.y, 1), std::max<std::int64_t>(v.z, 1)};
}

std::int64_t parts_of(std::int64_t all, std::int64_t one) { return (all - 1) / one + 1; }

std::array<std::int64_t, 3> as_key(Index3 v) { return {v.z, v.y, v.x}; }

/// How version 2 and version 3 name a codec and its settings.
OrderedJson compressor_v2(Codec codec, std::size_t element) {
    if (codec == Codec::blosc)
        return {{"id", "blosc"}, {"cname", "zstd"}, {"clevel", 2}, {"shuffle", element > 1 ? 1 : 0}, {"blocksize", 0}};
    if (codec == Codec::zstd) return {{"id", "zstd"}, {"level", 3}};
    return {{"id", codec == Codec::gzip ? "gzip" : "zlib"}, {"level", 4}};
}

OrderedJson codecs_v3(std::optional<Codec> codec, std::size_t element) {
    OrderedJson bytes{{"name", "bytes"}};
    if (element > 1) bytes["configuration"] = {{"endian", "little"}};
    OrderedJson list = OrderedJson::array({bytes});
    if (codec == Codec::blosc)
        list.push_back({{"name", "blosc"},
                        {"configuration",
                         {{"cname", "zstd"},
                          {"clevel", 2},
                          {"shuffle", element > 1 ? "shuffle" : "noshuffle"},
                          {"typesize", element},
                          {"blocksize", 0}}}});
    else if (codec == Codec::zstd)
        list.push_back({{"name", "zstd"}, {"configuration", {{"level", 3}, {"checksum", false}}}});
    else if (codec)
        list.push_back({{"name", "gzip"}, {"configuration", {{"level", 4}}}});
    return list;
}

OrderedJson extents(Index3 v, std::vector<std::int64_t> const& before = {}) {
    OrderedJson result = before;
    for (int a = 2; a >= 0; --a) result.push_back(v[a]);
    return result;
}

void move(std::string const& from, std::string const& to) {
    if (::rename(from.c_str(), to.c_str()) != 0) throw system_error(text("cannot write '", lasting_name(to), "'"));
}

} // namespace

void write_json(std::string const& path, OrderedJson const& json) {
    std::string const lines = json.dump(1) + "\n";
    write_file(path, lines.data(), lines.size());
}

OrderedJson kept_header(Header header) {
    header.timing = header.dry_run = false;
    if (header.history) header.history = parse_history(history_text(*header.history, most_history));
    return OrderedJson::parse(to_json(header));
}

void make_directory(std::string const& path) {
    if (::mkdir(path.c_str(), 0777) != 0 && errno != EEXIST)
        throw system_error(text("cannot write '", lasting_name(path), "'"));
}

LevelWriter::LevelWriter(std::string folder, Index3 dims, DataType dtype, WriteOptions const& options,
                         std::size_t memory)
    : folder_(std::move(folder)), dims_(dims), dtype_(dtype), version_(options.zarr.version),
      sharded_(options.zarr.shard.has_value()), threads_(std::max(1, options.threads.value_or(default_threads()))),
      row_(static_cast<std::size_t>(dims.x) * size_of(dtype)) {
    if (options.zarr.codec) codec_ = codec_for(*options.zarr.codec);
    if (options.compress && !codec_) codec_ = best_codec();
    if (codec_ == Codec::zlib && version_ == 3) codec_ = Codec::gzip; // version 3 has no other
    if (codec_) require(*codec_, "writing Zarr");
    Index3 const wanted = at_least_one(options.zarr.chunk.value_or(Index3{usual_edge, usual_edge, usual_edge}));
    // A layer of chunks is held; of slices beyond the budget, some rows.
    std::size_t const slice = row_ * static_cast<std::size_t>(dims.y);
    bool const by_rows = slice > memory;
    std::int64_t const depth =
        by_rows ? 1
                : std::clamp<std::int64_t>(static_cast<std::int64_t>(memory / slice), 1, std::min(wanted.z, dims.z));
    std::int64_t const rows =
        std::clamp<std::int64_t>(static_cast<std::int64_t>(memory / row_), 1, std::min(wanted.y, dims.y));
    chunk_ = {std::min(wanted.x, dims.x), by_rows ? rows : std::min(wanted.y, dims.y), depth};
    layer_ = by_rows ? row_ * static_cast<std::size_t>(rows) : slice * static_cast<std::size_t>(depth);
    if (static_cast<double>(chunk_.x) * static_cast<double>(chunk_.y * chunk_.z) *
            static_cast<double>(size_of(dtype)) >=
        2147483648.0)
        throw Error(ErrorKind::usage, text("chunks of ", chunk_, " voxels are 2 GiB or more"),
                    "choose a smaller --chunk");
    shard_ = chunk_;
    if (!sharded_) return;
    Index3 const outer = at_least_one(*options.zarr.shard);
    for (int a = 0; a < 3; ++a) shard_[a] = chunk_[a] * parts_of(std::min(outer[a], dims[a]), chunk_[a]);
}

std::optional<std::size_t> LevelWriter::bytes() const {
    if (codec_) return {};
    return row_ * static_cast<std::size_t>(dims_.y) * static_cast<std::size_t>(dims_.z);
}

void LevelWriter::write(std::byte const* voxels, std::size_t n) {
    std::size_t const slice = row_ * static_cast<std::size_t>(dims_.y), all = slice * static_cast<std::size_t>(dims_.z);
    hold_layers(
        held_, {layer_, slice, all}, voxels, n, [&] { return static_cast<std::size_t>(rows_) * row_; },
        [&] { flush(); });
}

std::string LevelWriter::file_of(Index3 at) const { return text(volume(volume_), "/", at.z, "/", at.y, "/", at.x); }

/// Where the chunks of a volume lie until it is known how many there are.
std::string LevelWriter::volume(std::int64_t number) const { return text(folder_, "/volume.", number); }

void LevelWriter::flush() {
    std::int64_t const rows = static_cast<std::int64_t>(held_.size() / row_);
    bool const whole = rows % dims_.y == 0;
    std::int64_t const z = rows_ / dims_.y, first = rows_ % dims_.y;
    std::int64_t const slices = whole ? rows / dims_.y : 1, height = whole ? dims_.y : rows;
    Index3 const at{0, first / chunk_.y, z / chunk_.z};
    std::int64_t const across = parts_of(dims_.x, chunk_.x), down = parts_of(height, chunk_.y);
    make_directory(volume(volume_));
    std::int64_t const file_z = z / shard_.z;
    std::string const folder = text(volume(volume_), "/", file_z);
    make_directory(folder);
    for (std::int64_t y = 0; y < down; ++y) make_directory(text(folder, "/", (at.y + y) * chunk_.y / shard_.y));
    if (!open_.empty() && open_.begin()->first[0] != file_z) close_shards();
    // Of shards the chunks are encoded by all threads and appended in their order, so that files are always the same.
    std::vector<std::vector<std::byte>> encoded(sharded_ ? static_cast<std::size_t>(across * down) : 0);
    FirstFailure failure;
#pragma omp parallel for num_threads(threads_) schedule(dynamic)
    for (std::int64_t i = 0; i < across * down; ++i) {
        failure.catch_from([&] {
            Index3 const place{i % across, at.y + i / across, at.z};
            std::vector<std::byte> chunk = chunk_at(place, first, height, slices);
            if (sharded_)
                encoded[static_cast<std::size_t>(i)] = std::move(chunk);
            else if (!chunk.empty())
                write_file(file_of(place), chunk.data(), chunk.size());
        });
    }
    failure.rethrow();
    for (std::int64_t i = 0; i < std::ssize(encoded); ++i)
        append({i % across, at.y + i / across, at.z}, encoded[static_cast<std::size_t>(i)]);
    rows_ += rows;
    held_.clear();
}

/// From what is held: rows from `row` on of some slices, encoded; nothing of a chunk of zeros. Chunks at the end are
/// whole all the same.
std::vector<std::byte> LevelWriter::chunk_at(Index3 at, std::int64_t row, std::int64_t rows,
                                             std::int64_t slices) const {
    std::size_t const size = size_of(dtype_), width = static_cast<std::size_t>(chunk_.x) * size;
    std::vector<std::byte> chunk(width * static_cast<std::size_t>(chunk_.y * chunk_.z));
    std::int64_t const x = at.x * chunk_.x, y = at.y * chunk_.y;
    auto const count = static_cast<std::size_t>(std::min(chunk_.x, dims_.x - x)) * size;
    std::int64_t const end = std::min({y + chunk_.y, dims_.y, row + rows});
    for (std::int64_t s = 0; s < slices; ++s)
        for (std::int64_t r = y; r < end; ++r)
            std::memcpy(chunk.data() + static_cast<std::size_t>(s * chunk_.y + r - y) * width,
                        held_.data() + static_cast<std::size_t>(s * rows + r - row) * row_ +
                            static_cast<std::size_t>(x) * size,
                        count);
    if (std::all_of(chunk.begin(), chunk.end(), [](std::byte b) { return b == std::byte{0}; })) return {};
    if (codec_) chunk = encode(*codec_, chunk, size);
    return chunk;
}

/// To the shard that the chunk at this position belongs to.
void LevelWriter::append(Index3 at, std::vector<std::byte> const& chunk) {
    if (chunk.empty()) return;
    Index3 shard, within, parts;
    for (int a = 0; a < 3; ++a) {
        parts[a] = shard_[a] / chunk_[a];
        shard[a] = at[a] / parts[a];
        within[a] = at[a] % parts[a];
    }
    Index& index = open_[as_key(shard)];
    if (index.empty()) index.assign(static_cast<std::size_t>(2 * parts.x * parts.y * parts.z), absent);
    std::uint64_t& size = sizes_[as_key(shard)];
    auto const entry = static_cast<std::size_t>(2 * ((within.z * parts.y + within.y) * parts.x + within.x));
    index[entry] = size;
    index[entry + 1] = chunk.size();
    write_file(file_of(shard), chunk.data(), chunk.size(), size == 0 ? O_EXCL : O_APPEND);
    size += chunk.size();
}

/// Indices stand at the end, with their checksum.
void LevelWriter::close_shards() {
    for (auto const& [key, index] : open_) {
        std::vector<std::byte> const bytes = encode(Codec::crc32c, std::as_bytes(std::span(index)), 1);
        write_file(file_of({key[2], key[1], key[0]}), bytes.data(), bytes.size(), O_APPEND);
    }
    open_.clear();
    sizes_.clear();
}

OrderedJson LevelWriter::metadata(Leading const& leading, OrderedJson const& attributes) const {
    std::size_t const element = size_of(dtype_);
    std::vector<std::int64_t> const ones(leading.extents.size(), 1); // chunks are of one volume
    OrderedJson names = leading.names;
    for (char const* const axis : {"z", "y", "x"}) names.push_back(axis);
    if (version_ == 2) {
        return {{"zarr_format", 2},
                {"shape", extents(dims_, leading.extents)},
                {"chunks", extents(chunk_, ones)},
                {"dtype", type_name_v2(dtype_)},
                {"compressor", codec_ ? compressor_v2(*codec_, element) : OrderedJson(nullptr)},
                {"fill_value", 0},
                {"order", "C"},
                {"filters", nullptr},
                {"dimension_separator", "/"}};
    }
    OrderedJson codecs = codecs_v3(codec_, element);
    if (sharded_)
        codecs = OrderedJson::array(
            {{{"name", "sharding_indexed"},
              {"configuration",
               {{"chunk_shape", extents(chunk_, ones)},
                {"codecs", codecs},
                {"index_codecs", OrderedJson::array({{{"name", "bytes"}, {"configuration", {{"endian", "little"}}}},
                                                     {{"name", "crc32c"}}})},
                {"index_location", "end"}}}}});
    return {{"zarr_format", 3},
            {"node_type", "array"},
            {"shape", extents(dims_, leading.extents)},
            {"data_type", std::string(name_of(dtype_))},
            {"chunk_grid", {{"name", "regular"}, {"configuration", {{"chunk_shape", extents(shard_, ones)}}}}},
            {"chunk_key_encoding", {{"name", "default"}, {"configuration", {{"separator", "/"}}}}},
            {"fill_value", is_integer(dtype_) ? OrderedJson(0) : OrderedJson(0.0)},
            {"codecs", codecs},
            {"dimension_names", names},
            {"attributes", attributes}};
}

void LevelWriter::next_volume() {
    close_shards();
    rows_ = 0;
    ++volume_;
}

/// Below the root, in folders of their numbers along the dimensions; of a single one, the chunks themselves.
void LevelWriter::place_volumes(Leading const& leading) const {
    std::string const root = version_ == 3 ? folder_ + "/c" : folder_;
    if (leading.extents.empty()) {
        if (version_ == 3) return move(volume(0), root);
        for (std::int64_t z = 0; z < parts_of(dims_.z, shard_.z); ++z)
            move(text(volume(0), "/", z), text(root, "/", z));
        if (::rmdir(volume(0).c_str()) != 0) throw system_error(text("cannot write '", lasting_name(volume(0)), "'"));
        return;
    }
    make_directory(root);
    std::int64_t const row = leading.extents[leading.turned ? 0 : leading.extents.size() - 1];
    for (std::int64_t i = 0; i <= volume_; ++i) {
        if (leading.extents.size() == 1) {
            move(volume(i), text(root, "/", i));
            continue;
        }
        std::int64_t const first = leading.turned ? i % row : i / row, second = leading.turned ? i / row : i % row;
        make_directory(text(root, "/", first));
        move(volume(i), text(root, "/", first, "/", second));
    }
}

void LevelWriter::finish(Leading const& leading, OrderedJson const& attributes) {
    close_shards();
    place_volumes(leading);
    OrderedJson const about = metadata(leading, attributes);
    if (version_ == 3) return write_json(folder_ + "/zarr.json", about);
    write_json(folder_ + "/.zarray", about);
    write_json(folder_ + "/.zattrs", attributes);
}

} // namespace vkt::zarr
