// Regular bricks as numbers, and tables of bricks.
// SPDX-License-Identifier: MIT
#include "libvkt/core/brick_table.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

namespace vkt {
namespace {

constexpr std::size_t offset_step = 16;
constexpr std::int64_t largest_block = std::numeric_limits<std::int32_t>::max(); ///< as records state it

double volume(Index3 n) { return static_cast<double>(n.x) * static_cast<double>(n.y) * static_cast<double>(n.z); }

int bits_for(std::int64_t largest) { return static_cast<int>(std::bit_width(static_cast<std::uint64_t>(largest))); }

/// The packing that suits bricks if any does: of the smallest that do not end with the grid, doubled as often as the
/// largest need.
std::optional<BrickPacking> packing_of(Index3 logical, std::vector<Brick> const& bricks) {
    Index3 largest{1, 1, 1};
    int levels = 1;
    for (Brick const& brick : bricks) {
        if (brick.level < 0 || brick.dims.x < 1 || brick.dims.y < 1 || brick.dims.z < 1) return std::nullopt;
        levels = std::max(levels, brick.level + 1);
        for (int a = 0; a < 3; ++a) largest[a] = std::max(largest[a], brick.dims[a]);
    }
    if (bricks.empty() || levels > max_level + 1) return std::nullopt;
    for (int a = 0; a < 3; ++a)
        if (largest[a] > std::min<std::int64_t>(logical[a], largest_block)) return std::nullopt;
    Index3 block = largest;
    for (Brick const& brick : bricks)
        for (int a = 0; a < 3; ++a) {
            std::int64_t const width = logical[a] == 1 ? 1 : brick.cell_width();
            bool const ends = brick.lower[a] > logical[a] - (brick.dims[a] + 1) * width; // no room for one more cell
            if (!ends) block[a] = std::min(block[a], brick.dims[a]);
        }
    int doublings = 0;
    for (int a = 0; a < 3; ++a) doublings = std::max(doublings, bits_for((largest[a] - 1) / block[a]));
    if (doublings > BrickPacking::most_doublings) return std::nullopt;
    BrickPacking const packing(logical, block, levels, doublings);
    return packing.words() > 0 ? std::optional(packing) : std::nullopt;
}

} // namespace

BrickPacking::BrickPacking(Index3 logical, Index3 block, int levels, int doublings)
    : logical_(logical), block_(block), levels_(levels), doublings_(doublings), level_bits_(bits_for(levels - 1)),
      doubling_bits_(bits_for(doublings)) {
    int bits = level_bits_ + doubling_bits_;
    for (int a = 0; a < 3; ++a) {
        bits_[a] = bits_for((logical[a] - 1) / block[a]);
        bits += bits_[a];
    }
    words_ = bits <= 32 ? 1 : bits <= 64 ? 2 : 0;
}

std::optional<BrickPacking> BrickPacking::of_record(PackingRecord const& record, Header const& header) {
    Index3 const block{record.block[0], record.block[1], record.block[2]};
    for (int a = 0; a < 3; ++a)
        if (block[a] < 1 || block[a] > header.dims[a]) return std::nullopt;
    if (header.level_count < 1 || header.level_count > max_level + 1) return std::nullopt;
    if (record.doublings > most_doublings) return std::nullopt;
    BrickPacking const packing(header.dims, block, header.level_count, record.doublings);
    if (packing.words() == 0 || packing.words() != record.words) return std::nullopt;
    return packing;
}

PackingRecord BrickPacking::record() const {
    return {
        {static_cast<std::int32_t>(block_.x), static_cast<std::int32_t>(block_.y), static_cast<std::int32_t>(block_.z)},
        static_cast<std::uint16_t>(words_),
        static_cast<std::uint16_t>(doublings_)};
}

std::optional<std::uint64_t> BrickPacking::pack(Brick const& brick) const {
    if (brick.level < 0 || brick.level >= levels_) return std::nullopt;
    auto number = static_cast<std::uint64_t>(brick.level);
    int shift = level_bits_ + doubling_bits_;
    for (int a = 0; a < 3; ++a) {
        std::int64_t const width = logical_[a] == 1 ? 1 : brick.cell_width();
        if (brick.lower[a] < 0 || brick.lower[a] >= logical_[a] || brick.lower[a] % block_[a] != 0 ||
            brick.lower[a] % width != 0)
            return std::nullopt;
        if (bits_[a] > 0) number |= static_cast<std::uint64_t>(brick.lower[a] / block_[a]) << shift;
        shift += bits_[a];
    }
    if (brick.dims.x < 1 || brick.dims.y < 1 || brick.dims.z < 1) return std::nullopt;
    // At the end of the grid several sizes may be the same brick: it has the number of the smallest.
    for (int doubled = 0; doubled <= doublings_; ++doubled) {
        std::uint64_t const sized = number | static_cast<std::uint64_t>(doubled) << level_bits_;
        if (unpack(sized) == brick) return sized;
    }
    return std::nullopt;
}

Brick BrickPacking::unpack(std::uint64_t number) const {
    Brick brick;
    auto const take = [&](int bits) {
        std::uint64_t const low = number & ((std::uint64_t{1} << bits) - 1);
        number >>= bits;
        return static_cast<std::int64_t>(low);
    };
    brick.level = static_cast<int>(take(level_bits_));
    std::int64_t const times = std::int64_t{1} << take(doubling_bits_);
    for (int a = 0; a < 3; ++a) {
        brick.lower[a] = take(bits_[a]) * block_[a];
        std::int64_t const left = (logical_[a] - brick.lower[a]) >> (logical_[a] == 1 ? 0 : brick.level);
        brick.dims[a] = std::min(logical_[a] == 1 ? block_[a] : block_[a] * times, left);
    }
    return brick;
}

BrickTable::BrickTable(Index3 logical, std::vector<Brick> bricks) : size_(bricks.size()) {
    auto owned = std::make_shared<Owned>();
    auto const packing = packing_of(logical, bricks);
    bool packs = packing.has_value();
    if (packs) packing_ = *packing;
    if (packs) owned->words.reserve(size_ * packing_.words());
    for (std::size_t i = 0; packs && i < size_; ++i) {
        auto const number = packing_.pack(bricks[i]);
        packs = number.has_value();
        if (!packs) break;
        owned->words.push_back(static_cast<std::uint32_t>(*number));
        if (packing_.words() == 2) owned->words.push_back(static_cast<std::uint32_t>(*number >> 32));
    }
    if (!packs) {
        owned->words = {};
        owned->records = std::move(bricks);
    }
    own(std::move(owned));
}

BrickTable::BrickTable(BrickPacking const& packing, std::vector<std::uint32_t> words, std::int64_t cells)
    : words_(words.data()), size_(words.size() / packing.words()), packing_(packing) {
    for (std::size_t i = 0; i < size_; ++i) {
        Brick const brick = (*this)[i];
        if (packing.pack(brick) != number(i) ||
            volume(brick.dims) > static_cast<double>(cells)) // as a double: never wraps
            throw Error(ErrorKind::data, text("brick ", static_cast<std::int64_t>(i), " is impossible"));
        cells -= brick.cells();
    }
    if (cells != 0) throw Error(ErrorKind::data, "bricks are missing");
    auto owned = std::make_shared<Owned>();
    owned->words = std::move(words);
    own(std::move(owned));
}

void BrickTable::own(std::shared_ptr<Owned> owned) {
    if (owned->words.empty())
        records_ = owned->records.data();
    else
        words_ = owned->words.data();
    each_ = size_ > 0 ? front().cells() : 0;
    std::int64_t cells = 0;
    for (std::size_t i = 0; i <= size_; ++i) {
        if (i % offset_step == 0) owned->offsets.push_back(cells);
        std::int64_t const own = i < size_ ? (*this)[i].cells() : each_;
        each_ = own == each_ ? each_ : 0;
        cells += own;
    }
    if (each_ > 0) owned->offsets = {};
    offsets_ = each_ > 0 ? nullptr : owned->offsets.data();
    owned_ = std::move(owned);
}

std::int64_t BrickTable::offset(std::size_t i) const {
    if (each_ > 0) return static_cast<std::int64_t>(i) * each_;
    std::size_t const from = offsets_ != nullptr ? i / offset_step * offset_step : 0;
    std::int64_t cells = offsets_ != nullptr ? offsets_[i / offset_step] : 0;
    for (std::size_t k = from; k < i; ++k) cells += (*this)[k].cells();
    return cells;
}

BrickTable BrickTable::part(std::size_t first, std::size_t count) const {
    BrickTable some = *this;
    some.size_ = count;
    some.offsets_ = nullptr;
    some.owned_ = nullptr;
    if (words_ != nullptr)
        some.words_ += first * packing_.words();
    else
        some.records_ += first;
    return some;
}

PackingRecord BrickTable::packing_for(Header const& header) const {
    if (words_ == nullptr) return {};
    PackingRecord const record = packing_.record();
    return BrickPacking::of_record(record, header) == packing_ ? record : PackingRecord{};
}

std::size_t BrickTable::bytes() const {
    std::size_t const each = words_ != nullptr ? packing_.words() * sizeof(std::uint32_t) : sizeof(Brick);
    return size_ * each + (owned_ ? owned_->offsets.size() * sizeof(std::int64_t) : 0);
}

bool operator==(BrickTable const& a, BrickTable const& b) {
    if (a.size_ != b.size_) return false;
    if (a.words_ != nullptr && b.words_ != nullptr && a.packing_ == b.packing_)
        return std::equal(a.words().begin(), a.words().end(), b.words().begin());
    for (std::size_t i = 0; i < a.size_; ++i)
        if (!(a[i] == b[i])) return false;
    return true;
}

} // namespace vkt
