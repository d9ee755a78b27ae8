// Chunks and shards that a region meets, each made anew of what was there and what comes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_region.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/region_write.h"
#include "libvkt/formats/zarr_layout.h"
#include "libvkt/formats/zarr_level.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/io/system_error.h"
#include "libvkt/io/whole_text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <omp.h>
#include <unistd.h>

namespace vkt {
namespace {

using OrderedJson = nlohmann::ordered_json;
using zarr::Position;

constexpr std::size_t most_text = std::size_t{16} << 20;

/// A store of which some files were written anew and have not their names yet.
class Rewritten : public zarr::Store {
public:
    explicit Rewritten(std::shared_ptr<zarr::Store const> store) : store_(std::move(store)) {}

    std::unique_ptr<zarr::StoredFile> open(std::string const& key) const override {
        auto const found = names_.find(key);
        return store_->open(found == names_.end() ? key : found->second);
    }
    std::string shown(std::string const& key) const override { return store_->shown(key); }
    /// Files by their keys, and where they lie until they have their names.
    std::map<std::string, std::string>& names() { return names_; }

protected:
    std::optional<std::string> text_of(std::string const&) const override { return std::nullopt; }
    std::vector<std::string> folders_below(std::string const&) const override { return {}; }

private:
    std::shared_ptr<zarr::Store const> store_;
    std::map<std::string, std::string> names_;
};

/// A file that is written part by part; `shown` is how messages name it.
class NewFile {
public:
    NewFile(std::string const& path, std::string shown)
        : shown_(std::move(shown)),
          descriptor_(::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0666)) {
        if (descriptor_ < 0) fail();
    }
    ~NewFile() {
        if (descriptor_ >= 0) ::close(descriptor_);
    }
    NewFile(NewFile const&) = delete;
    NewFile& operator=(NewFile const&) = delete;

    void put(std::uint64_t at, std::span<std::byte const> bytes) const {
        while (!bytes.empty()) {
            ssize_t const done = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(at));
            if (done < 0 && errno == EINTR) continue;
            if (done < 0) fail();
            at += static_cast<std::uint64_t>(done);
            bytes = bytes.subspan(static_cast<std::size_t>(done));
        }
    }
    void close() {
        if (::close(std::exchange(descriptor_, -1)) != 0) fail();
    }

private:
    [[noreturn]] void fail() const { throw system_error(text("cannot write '", shown_, "'")); }

    std::string shown_;
    int descriptor_;
};

class RegionWriter : public VolumeWriter {
public:
    RegionWriter(std::string const& path, WriteOptions const& options);

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override {
        layers_.add(voxels, n, [&](Box const& box, std::byte const* from) { flush(box, from); });
    }
    void close() override;
    void plan(Header const& header) override {
        check(header);
        ++volumes_;
    }

private:
    /// What a thread keeps from chunk to chunk.
    struct Held {
        std::vector<std::byte> chunk, encoded;
        zarr::Scratch scratch;
    };
    [[noreturn]] void refuse(std::string const& what, std::string const& hint) const {
        throw Error(ErrorKind::usage, text("'", name_, "' ", what), hint);
    }
    void open();
    std::int64_t check(Header const& header);
    void check_storage() const;
    void tell_past(Header const& part);
    RegionTarget target() const { return {name_, whole_, layout_->volumes()}; }
    void flush(Box const& box, std::byte const* voxels);
    void rewrite(zarr::Chunks const& chunks, Index3 file, ConstView const& part, NewFile const& to, Held& held) const;
    bool meets(Position const& chunk, Box const& region, Box& box) const;
    std::span<std::byte const> with_region(zarr::Chunks const& chunks, Position const& at, Box const& box,
                                           ConstView const& part, Held& held) const;
    void move_to(std::string const& key, std::string const& from) const;

    WriteOptions options_;
    std::string name_, folder_, inside_; ///< folder_: the store
    std::shared_ptr<zarr::Store const> store_;
    std::shared_ptr<Rewritten> rewritten_;
    std::optional<zarr::Found> found_;
    std::optional<zarr::Layout> layout_;
    zarr::Layout::Place volume_;
    Header whole_;
    std::optional<OutputDirectory> directory_;
    std::optional<std::pair<std::string, std::string>> metadata_; ///< key, and the file that is going to have it
    std::int64_t volumes_ = 0, files_ = 0;
    int threads_ = 1;
    RegionLayers layers_;
    std::vector<Held> held_;
};

RegionWriter::RegionWriter(std::string const& path, WriteOptions const& options) : options_(options), name_(path) {
    FilePart const part = file_part(path);
    folder_ = part.file;
    inside_ = part.part;
    while (folder_.size() > 1 && folder_.ends_with('/')) folder_.pop_back();
    std::error_code failed;
    if (!std::filesystem::exists(folder_, failed))
        throw Error(ErrorKind::io, text("cannot open '", folder_, "': there is no such store to write into"),
                    "without --at it is made");
    if (!std::filesystem::is_directory(folder_, failed))
        refuse("is no directory, and what lies in a file is not changed in its place",
               text("write all of it again: vkt copy PART ", shell_quoted(path), " --at ... -o OUT"));
}

/// Returns which volume of the array it is written into.
std::int64_t RegionWriter::check(Header const& header) {
    refuse_bricks(header, "Zarr arrays");
    if (volumes_ == 0) open();
    return checked_volume(target(), header, options_, volumes_);
}

void RegionWriter::begin(Header const& header) {
    std::int64_t const number = check(header);
    if (volumes_ == 0) {
        directory_.emplace(
            text(zarr::key_of(found_->array.folder, ".region")), false, [](std::string const&) { return false; },
            "chunks");
        if (found_->array.codecs.empty()) directory_->expect(header.bytes());
        tell_past(header);
    }
    volume_ = layout_->place(number);
    ++volumes_;
    // Files are made once where the budget has room for a layer of them.
    layers_.begin(header, *options_.at, layout_->file().z, options_.memory.value_or(default_memory()) / 8);
}

void RegionWriter::open() {
    store_ = zarr::directories();
    if (!store_->is_node(folder_))
        throw Error(ErrorKind::data,
                    text("'", folder_, "' is no Zarr store: it holds neither zarr.json nor .zarray nor .zgroup"));
    found_ = zarr::find_array(*store_, folder_, folder_, inside_);
    if (!found_->choices.names.empty())
        refuse("holds several arrays",
               text("name one: ", shell_quoted(text(folder_, ":/", found_->choices.names.front().first))));
    layout_.emplace(*found_);
    rewritten_ = std::make_shared<Rewritten>(store_);
    // As it is read, which also checks that a chunk fits into memory.
    ReadOptions reading;
    reading.memory = options_.memory;
    auto const source = zarr_format().open(open_bytes(name_), reading);
    source->next_volume();
    whole_ = source->header();
    check_storage();
    std::size_t const memory = options_.memory.value_or(default_memory());
    threads_ = static_cast<int>(
        std::clamp<std::size_t>(memory / 8 / found_->array.inner_bytes(), 1,
                                static_cast<std::size_t>(std::max(1, options_.threads.value_or(default_threads())))));
    held_.resize(static_cast<std::size_t>(threads_));
}

void RegionWriter::check_storage() const {
    zarr::Array const& array = found_->array;
    if (found_->image && found_->image->levels.size() > 1)
        refuse(text("is one of the ", std::ssize(found_->image->levels),
                    " levels of an image, which would not show the same any more"),
               text("make them anew: vkt copy PART ", shell_quoted(name_), " --at ... | vkt write OUT.zarr --pyramid"));
    auto const elsewhere = [&](std::string const& what) {
        refuse(text("is encoded by ", what, ", which is read and not written"),
               text("write it anew: vkt copy PART ", shell_quoted(name_), " --at ... -o OUT.zarr"));
    };
    if (!array.filters.empty()) elsewhere("filters");
    for (zarr::Codec const codec : array.codecs)
        if (!zarr::encodes(codec)) elsewhere("a codec other than zlib, gzip, zstd, blosc and crc32c");
    if (array.boolean) refuse("holds booleans, and voxels are numbers", "write it as another array");
}

/// Of an array that vkt wrote: how it came about now, and how exact it is. That takes its name before any chunk does,
/// so that no voxel is ever less exact than is said.
void RegionWriter::tell_past(Header const& part) {
    std::string const& folder = found_->array.folder;
    std::error_code failed;
    bool const second = std::filesystem::exists(zarr::key_of(folder, ".zarray"), failed);
    std::string const key = zarr::key_of(folder, second ? ".zattrs" : "zarr.json");
    OrderedJson const said = OrderedJson::parse(found_->array.attributes, nullptr, false);
    if (!said.is_object() || !said.contains("vkt")) return;
    if (!std::filesystem::exists(key, failed))
        refuse("has its metadata in those of a group only", "write it as another array");
    OrderedJson json = OrderedJson::parse(whole_text(key, most_text));
    RegionTarget there = target();
    for (char const* const name : {"variable", "levels"}) there.whole.attributes.erase(name);
    mark_as_given(there.whole);
    (second ? json : json["attributes"])["vkt"] = zarr::kept_header(with_part(there, part, *options_.at));
    metadata_ = {key, directory_->file("metadata")};
    zarr::write_json(metadata_->second, json);
}

/// All files that a box meets, by several threads.
void RegionWriter::flush(Box const& box, std::byte const* voxels) {
    Index3 const extent = layout_->file();
    Box files;
    for (int a = 0; a < 3; ++a) {
        files.lower[a] = box.lower[a] / extent[a];
        files.upper[a] = (box.upper[a] - 1) / extent[a] + 1;
    }
    Index3 const count = files.dims();
    ConstView const part = dense_view(voxels, found_->array.dtype, box);
    zarr::Chunks const chunks(rewritten_, found_->array); // whose indices of shards are those of now
    std::vector<std::pair<std::string, std::string>> names(static_cast<std::size_t>(files.voxels()));
    FirstFailure failure;
#pragma omp parallel for num_threads(threads_) schedule(dynamic)
    for (std::int64_t i = 0; i < files.voxels(); ++i) {
        failure.catch_from([&] {
            Index3 const at = files.lower + Index3{i % count.x, i / count.x % count.y, i / count.x / count.y};
            auto& [key, name] = names[static_cast<std::size_t>(i)];
            key = zarr::key_of(found_->array.folder, found_->array.key(layout_->file_position(volume_, at)));
            name = directory_->file(to_text(files_ + i));
            NewFile file(name, key);
            rewrite(chunks, at, part, file, held_[static_cast<std::size_t>(omp_get_thread_num())]);
            file.close();
        });
    }
    failure.rethrow();
    files_ += files.voxels();
    for (auto& [key, name] : names) {
        auto const [entry, added] = rewritten_->names().try_emplace(key, name);
        if (added) continue;
        ::unlink(entry->second.c_str());
        entry->second = name;
    }
}

/// The box of a chunk that has voxels of the current volume in the region; false if it has none.
bool RegionWriter::meets(Position const& chunk, Box const& region, Box& box) const {
    zarr::Array const& array = found_->array;
    for (std::size_t const k : layout_->leading())
        if (chunk[k] != volume_.at[k] / array.inner[k]) return false;
    Index3 const extent = layout_->chunk();
    box = {{0, 0, 0}, extent};
    for (int a = 0; a < 3; ++a)
        if (int const k = layout_->axes()[static_cast<std::size_t>(a)]; k >= 0) {
            box.lower[a] = chunk[static_cast<std::size_t>(k)] * extent[a];
            box.upper[a] = box.lower[a] + extent[a];
        }
    return !intersect(box, region).empty();
}

/// A chunk with the region in it, encoded; stays in `held`.
std::span<std::byte const> RegionWriter::with_region(zarr::Chunks const& chunks, Position const& at, Box const& box,
                                                     ConstView const& part, Held& held) const {
    zarr::Array const& array = chunks.array();
    std::size_t const size = size_of(array.dtype);
    Box const common = intersect(box, part.box);
    held.chunk.resize(array.inner_bytes());
    // Nothing of it is left of one volume that is covered.
    bool const alone = std::all_of(layout_->leading().begin(), layout_->leading().end(),
                                   [&](std::size_t k) { return array.inner[k] == 1; });
    bool const covered = alone && common == intersect(box, box_of(whole_.dims));
    if (covered || !chunks.read(at, held.chunk, held.scratch))
        for (std::size_t i = 0; i < held.chunk.size(); i += size)
            std::memcpy(held.chunk.data() + i, array.fill.data(), size);
    std::int64_t const sx = layout_->stride(0);
    for (std::int64_t z = common.lower.z; z < common.upper.z; ++z)
        for (std::int64_t y = common.lower.y; y < common.upper.y; ++y) {
            Index3 const in_chunk = Index3{common.lower.x, y, z} - box.lower;
            std::byte* const to = held.chunk.data() + static_cast<std::size_t>(volume_.offset + in_chunk.x * sx +
                                                                               in_chunk.y * layout_->stride(1) +
                                                                               in_chunk.z * layout_->stride(2)) *
                                                          size;
            std::byte const* const from = part.at(common.lower.x, y, z);
            auto const n = static_cast<std::size_t>(common.dims().x);
            if (sx == 1) {
                std::memcpy(to, from, n * size);
                continue;
            }
            for (std::size_t x = 0; x < n; ++x)
                std::memcpy(to + x * static_cast<std::size_t>(sx) * size, from + x * size, size);
        }
    if (array.big_endian) swap_bytes(held.chunk.data(), held.chunk.size() / size, size);
    if (array.codecs.empty()) return held.chunk;
    held.encoded = held.chunk;
    for (zarr::Codec const codec : array.codecs) held.encoded = zarr::encode(codec, held.encoded, size);
    return held.encoded;
}

/// All chunks of a file: those that the region meets are made anew, others are copied as they are encoded.
void RegionWriter::rewrite(zarr::Chunks const& chunks, Index3 file, ConstView const& part, NewFile const& to,
                           Held& held) const {
    zarr::Array const& array = chunks.array();
    Position const of_file = layout_->file_position(volume_, file);
    std::size_t const rank = of_file.size();
    std::vector<std::int64_t> parts(rank);
    std::int64_t count = 1;
    for (std::size_t k = 0; k < rank; ++k) count *= parts[k] = array.chunk[k] / array.inner[k];
    std::vector<std::uint64_t> index(static_cast<std::size_t>(2 * count), zarr::absent);
    std::uint64_t const index_bytes = index.size() * sizeof(std::uint64_t) + (array.index_checksum ? 4 : 0);
    std::uint64_t next = array.sharded && array.index_first ? index_bytes : 0;
    for (std::int64_t i = 0; i < count; ++i) {
        Position at = of_file;
        std::int64_t rest = i;
        for (std::size_t k = rank; k-- > 0; rest /= parts[k]) at[k] = of_file[k] * parts[k] + rest % parts[k];
        std::span<std::byte const> bytes;
        if (Box box; meets(at, part.box, box)) {
            bytes = with_region(chunks, at, box, part, held);
        } else {
            zarr::Chunks::Place const there = chunks.place(at);
            if (!there.file) continue;
            held.encoded.resize(there.size);
            there.file->read(there.begin, held.encoded);
            bytes = held.encoded;
        }
        to.put(next, bytes);
        index[static_cast<std::size_t>(2 * i)] = next;
        index[static_cast<std::size_t>(2 * i + 1)] = bytes.size();
        next += bytes.size();
    }
    if (!array.sharded) return;
    std::span<std::byte const> const plain = std::as_bytes(std::span(index));
    std::uint64_t const place = array.index_first ? 0 : next;
    if (!array.index_checksum) return to.put(place, plain);
    to.put(place, zarr::encode(zarr::Codec::crc32c, plain, 1));
}

/// Under its name at last; the folders on the way may not be there yet.
void RegionWriter::move_to(std::string const& key, std::string const& from) const {
    for (std::size_t slash = found_->array.folder.size() + 1; (slash = key.find('/', slash)) != std::string::npos;
         ++slash)
        zarr::make_directory(key.substr(0, slash));
    if (::rename(from.c_str(), key.c_str()) != 0)
        throw system_error(text("cannot write '", key, "'"), errno,
                           "a part of the region may be there: write it again");
}

void RegionWriter::close() {
    if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
    if (metadata_) move_to(metadata_->first, metadata_->second);
    for (auto const& [key, name] : rewritten_->names()) move_to(key, name);
    directory_.reset();
}

} // namespace

std::unique_ptr<VolumeWriter> zarr_region_writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<RegionWriter>(path, options);
}

} // namespace vkt
