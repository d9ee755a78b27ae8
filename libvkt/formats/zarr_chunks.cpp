// Chunks of Zarr arrays: where they lie in files and shards, and what undoes their codecs.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_array.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/raw_source.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vkt::zarr {
namespace {

/// Bytes that are going to be read, at the beginning of memory that is kept.
std::span<std::byte> room(LargeVector<std::byte>& memory, std::size_t n) {
    if (memory.size() < n) memory.resize(n);
    return {memory.data(), n};
}

} // namespace

Chunks::Chunks(std::shared_ptr<Store const> store, Array array) : store_(std::move(store)), array_(std::move(array)) {
    for (Codec const codec : array_.codecs) require(codec, store_->shown(array_.folder));
}

std::shared_ptr<std::vector<std::uint64_t> const> Chunks::index_of(StoredFile const& opened,
                                                                   std::string const& key) const {
    {
        std::lock_guard const lock(mutex_);
        if (auto const found = indices_.find(key); found != indices_.end()) return found->second;
    }
    std::string const file = store_->shown(key);
    std::size_t count = 1;
    for (std::size_t i = 0; i < array_.chunk.size(); ++i)
        count *= static_cast<std::size_t>(array_.chunk[i] / array_.inner[i]);
    std::size_t const bytes = count * 16, stored = bytes + (array_.index_checksum ? 4 : 0);
    if (opened.size() < stored) throw Error(ErrorKind::data, text("'", file, "' ended early: no whole shard"));
    std::vector<std::byte> held(stored);
    opened.read(array_.index_first ? 0 : opened.size() - stored, held);
    auto const index = std::make_shared<std::vector<std::uint64_t>>(2 * count);
    std::span<std::byte> const to(reinterpret_cast<std::byte*>(index->data()), bytes);
    if (array_.index_checksum)
        decode(Codec::crc32c, held, to, file);
    else
        std::memcpy(to.data(), held.data(), bytes);
    std::lock_guard const lock(mutex_);
    if (indices_.size() > 256) indices_.clear();
    return indices_[key] = index;
}

/// What compression can make of a chunk at worst.
std::size_t Chunks::most_encoded() const { return 2 * std::max(array_.inner_bytes(), array_.filtered_bytes()) + 4096; }

Chunks::Place Chunks::place(Position const& at) const {
    Position of_file = at;
    std::size_t within = 0;
    for (std::size_t i = 0; i < at.size(); ++i) {
        std::int64_t const parts = array_.chunk[i] / array_.inner[i];
        of_file[i] = at[i] / parts;
        within = within * static_cast<std::size_t>(parts) + static_cast<std::size_t>(at[i] % parts);
    }
    Place place{nullptr, key_of(array_.folder, array_.key(of_file)), 0, 0};
    place.file = store_->open(place.key);
    if (!place.file) return place;
    place.size = place.file->size();
    if (array_.sharded) {
        auto const index = index_of(*place.file, place.key);
        std::uint64_t const whole = place.size;
        place.begin = (*index)[2 * within];
        place.size = (*index)[2 * within + 1];
        if (place.begin == absent && place.size == absent) {
            place.file.reset();
            return place;
        }
        if (place.begin > whole || place.size > whole - place.begin)
            throw Error(ErrorKind::data,
                        text("'", store_->shown(place.key), "': damaged: a chunk lies outside of its shard"));
    }
    if (place.size > most_encoded())
        throw Error(ErrorKind::data, text("'", store_->shown(place.key), "': damaged: ",
                                          static_cast<std::int64_t>(place.size), " bytes are too many for a chunk"));
    return place;
}

void Chunks::check_size(Place const& place, std::size_t size, std::size_t expected) const {
    if (size != expected)
        throw Error(ErrorKind::data,
                    text("'", store_->shown(place.key), "': damaged: ", static_cast<std::int64_t>(size), " bytes, ",
                         static_cast<std::int64_t>(expected), " expected"));
}

bool Chunks::read(Position const& at, std::span<std::byte> result, Scratch& scratch) const {
    Place const from = place(at);
    if (!from.file) return false;
    auto const& codecs = array_.codecs;
    std::string const file = store_->shown(from.key);
    bool const filtered = !array_.filters.empty();
    std::span<std::byte> const to = filtered ? room(scratch.filtered, array_.filtered_bytes()) : result;
    if (codecs.empty()) {
        check_size(from, from.size, to.size());
        from.file->read(from.begin, to);
    } else {
        std::span<std::byte> bytes = room(scratch.encoded, from.size);
        from.file->read(from.begin, bytes);
        LargeVector<std::byte>*held = &scratch.encoded, *other = &scratch.decoded;
        for (std::size_t i = codecs.size(); i-- > 0;) {
            auto const checksums_before = static_cast<std::size_t>(
                std::count_if(codecs.begin(), codecs.begin() + static_cast<std::ptrdiff_t>(i), is_checksum));
            if (checksums_before < i && !is_checksum(codecs[i])) { // what was compressed before is compressed again
                std::span<std::byte> const target = room(*other, most_encoded());
                bytes = target.first(decode_some(codecs[i], bytes, target, file));
                std::swap(held, other);
                continue;
            }
            std::size_t size = to.size() + 4 * checksums_before;
            if (is_checksum(codecs[i])) size = std::max<std::size_t>(bytes.size(), 4) - 4;
            std::span<std::byte> const target = i > 0 || size != to.size() ? room(*other, size) : to;
            decode(codecs[i], bytes, target, file);
            bytes = target;
            std::swap(held, other);
        }
        check_size(from, bytes.size(), to.size());
    }
    if (filtered)
        undo(array_.filters, array_.big_endian, to, size_of(array_.dtype), scratch.unfiltered, result);
    else if (array_.big_endian)
        swap_bytes(result.data(), result.size() / size_of(array_.dtype), size_of(array_.dtype));
    return true;
}

} // namespace vkt::zarr
