// BrickTable: where the bricks of a hierarchical volume are, in 4 or 8 bytes each if they are regular.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace vkt {

/// How streams and segments state a packing, beside the extents and the number of levels in their header.
struct PackingRecord {
    std::int32_t block[3] = {};
    std::uint16_t words = 0;     ///< of 32 bits for each brick
    std::uint16_t doublings = 0; ///< how often a brick may be twice as large
};
static_assert(sizeof(PackingRecord) == 16);

/// Regular bricks as numbers. They lie at multiples of one block, counted in finest cells, and of their own cells, and
/// have as many cells as the block, or twice, four times, … as many along every axis of more than one cell, or as many
/// whole ones as fit before the end of the logical grid. The number has the level in its lowest bits, above it how
/// often the block is doubled, and above that the multiples along x, y and z, each in as many bits as the logical grid
/// needs.
class BrickPacking {
public:
    BrickPacking() = default;
    static constexpr int most_doublings = 7;
    /// block: 1 … logical along each axis; levels: 1 + the coarsest level; doublings: 0 … most_doublings.
    BrickPacking(Index3 logical, Index3 block, int levels, int doublings = 0);

    /// None if the record states none that the header allows.
    static std::optional<BrickPacking> of_record(PackingRecord const& record, Header const& header);
    PackingRecord record() const;

    /// Of 32 bits that a brick takes: 1 or 2, or 0 if these are not enough.
    std::size_t words() const { return words_; }
    /// None for bricks that are not regular.
    std::optional<std::uint64_t> pack(Brick const& brick) const;
    /// The inverse. Numbers that pack() does not return may give anything, even no cells at all.
    Brick unpack(std::uint64_t number) const;
    friend bool operator==(BrickPacking const&, BrickPacking const&) = default;

private:
    Index3 logical_{1, 1, 1}, block_{1, 1, 1};
    int levels_ = 1, doublings_ = 0, level_bits_ = 0, doubling_bits_ = 0, bits_[3] = {};
    std::size_t words_ = 0;
};

/// The bricks of a volume in order. Copies share them; they never change.
class BrickTable {
public:
    BrickTable() = default;
    /// Bricks of somebody else, who keeps them for as long as this is used.
    BrickTable(std::span<Brick const> bricks) : records_(bricks.data()), size_(bricks.size()) {}
    BrickTable(std::vector<Brick> const& bricks) : BrickTable(std::span<Brick const>(bricks)) {}
    /// As numbers if that is possible. O(n).
    BrickTable(Index3 logical, std::vector<Brick> bricks);
    /// Of numbers in packing.words() words each, the lower one first, with so many cells in all. Throws Error{data} for
    /// numbers that pack() does not return, and for other cells.
    BrickTable(BrickPacking const& packing, std::vector<std::uint32_t> words, std::int64_t cells);

    /// What bricks take at most, if they are not regular.
    static constexpr std::size_t most_bytes_per_brick = sizeof(Brick) + 1;

    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    Brick operator[](std::size_t i) const { return words_ != nullptr ? packing_.unpack(number(i)) : records_[i]; }
    Brick front() const { return (*this)[0]; }
    /// Some of them, for as long as this is kept.
    BrickTable part(std::size_t first, std::size_t count) const;
    std::vector<Brick> list() const { return {begin(), end()}; }
    /// Itself if nobody else has to keep the bricks, else a copy.
    BrickTable kept(Index3 logical) const { return owned_ ? *this : BrickTable(logical, list()); }

    /// Cells of all bricks before this one, which may be size(): where its own begin. Reads up to 15 bricks.
    std::int64_t offset(std::size_t i) const;
    /// Cells of some bricks.
    std::int64_t cells(std::size_t first, std::size_t count) const { return offset(first + count) - offset(first); }

    /// How they are packed, for streams and segments with this header; of no words if they are not, or not so that the
    /// header tells.
    PackingRecord packing_for(Header const& header) const;
    /// Their numbers, if they are packed.
    std::span<std::uint32_t const> words() const { return {words_, words_ != nullptr ? size_ * packing_.words() : 0}; }
    /// Memory that they take.
    std::size_t bytes() const;

    class Iterator {
    public:
        using iterator_category = std::input_iterator_tag;
        using value_type = Brick;
        using difference_type = std::ptrdiff_t;
        using pointer = void;
        using reference = Brick;
        Iterator(BrickTable const& table, std::size_t at) : table_(&table), at_(at) {}
        Brick operator*() const { return (*table_)[at_]; }
        Iterator& operator++() {
            ++at_;
            return *this;
        }
        bool operator==(Iterator const& other) const { return at_ == other.at_; }

    private:
        BrickTable const* table_;
        std::size_t at_;
    };
    Iterator begin() const { return {*this, 0}; }
    Iterator end() const { return {*this, size_}; }

    friend bool operator==(BrickTable const& a, BrickTable const& b);

private:
    struct Owned {
        std::vector<Brick> records;
        std::vector<std::uint32_t> words;
        std::vector<std::int64_t> offsets; ///< of every 16th brick, unless all have equally many cells
    };

    void own(std::shared_ptr<Owned> owned);
    std::uint64_t number(std::size_t i) const {
        return packing_.words() == 1 ? words_[i] : words_[2 * i] | std::uint64_t{words_[2 * i + 1]} << 32;
    }

    std::shared_ptr<Owned const> owned_;
    Brick const* records_ = nullptr;
    std::uint32_t const* words_ = nullptr;
    std::int64_t const* offsets_ = nullptr;
    std::size_t size_ = 0;
    std::int64_t each_ = 0; ///< cells of every brick, 0 if they differ or nobody has counted
    BrickPacking packing_;
};

} // namespace vkt
