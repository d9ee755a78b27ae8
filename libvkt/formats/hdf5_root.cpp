// Names in the root group of an HDF5 file.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5_root.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace vkt {
namespace {

constexpr std::int64_t longest = std::int64_t{4} << 20; ///< of what is looked at in one place
constexpr int most_parts = 64;                          ///< of an object header
constexpr std::uint64_t nowhere = ~std::uint64_t{0};

/// Answers with none where the metadata cannot be followed.
class RootGroup {
public:
    RootGroup(ByteSource const& bytes, std::string_view words) : bytes_(bytes), words_(words) {}

    std::optional<bool> names() {
        for (std::int64_t const at : {0, 512, 1024, 2048}) // behind a user block
            if (part(at, 8) == "\x89HDF\r\n\x1a\n") return superblock(part(at, 128));
        return {};
    }

private:
    static std::uint64_t number(std::string_view from, std::size_t at, std::size_t n) {
        std::uint64_t value = 0;
        for (std::size_t i = n; i-- > 0;)
            value = value << 8 | (at + i < from.size() ? static_cast<unsigned char>(from[at + i]) : 0);
        return value;
    }
    /// Up to n bytes; fewer at the end of the file.
    std::string part(std::int64_t at, std::int64_t n) const {
        if (at < 0 || at >= bytes_.size()) return {};
        std::string got(static_cast<std::size_t>(std::min({n, longest, bytes_.size() - at})), '\0');
        bytes_.read_at(at, got.data(), got.size());
        return got;
    }
    /// At an address, as the file has them.
    std::string part_at(std::uint64_t address, std::uint64_t n) const {
        if (address > nowhere / 4) return {};
        return part(static_cast<std::int64_t>(address + base_),
                    static_cast<std::int64_t>(std::min<std::uint64_t>(n, longest)));
    }
    bool in(std::string_view some) const { return some.find(words_) != std::string_view::npos; }

    std::optional<bool> superblock(std::string const& block) {
        std::uint64_t const version = number(block, 8, 1);
        if (version >= 2) {
            if (version > 3 || number(block, 9, 2) != 0x0808) return {};
            base_ = number(block, 12, 8);
            return base_ <= longest ? object(number(block, 36, 8)) : std::nullopt;
        }
        std::size_t const more = version == 1 ? 4 : 0;
        if (number(block, 13, 2) != 0x0808) return {};
        base_ = number(block, 24 + more, 8);
        if (base_ > longest) return {};
        if (number(block, 72 + more, 4) == 1) return heap(number(block, 88 + more, 8)); // kept with the entry
        return object(number(block, 64 + more, 8));
    }

    /// The local heap in which a symbol table has its names.
    std::optional<bool> heap(std::uint64_t address) const {
        std::string const head = part_at(address, 32);
        std::uint64_t const size = number(head, 8, 8);
        if (!head.starts_with("HEAP") || size > longest) return {};
        std::string const names = part_at(number(head, 24, 8), size);
        if (names.size() < size) return {};
        return in(names);
    }

    std::optional<bool> object(std::uint64_t address) {
        std::string const head = part_at(address, 64);
        if (head.starts_with("OHDR")) {
            std::uint64_t const flags = number(head, 5, 1);
            std::size_t const at = 6 + ((flags & 0x20) != 0 ? 16 : 0) + ((flags & 0x10) != 0 ? 4 : 0);
            std::size_t const width = std::size_t{1} << (flags & 3);
            return messages(address + at + width, number(head, at, width), true, (flags & 4) != 0);
        }
        if (number(head, 0, 1) != 1) return {};
        return messages(address + 16, number(head, 8, 4), false, false);
    }

    /// Of an object header, in the layout of its version 2 or 1.
    std::optional<bool> messages(std::uint64_t address, std::uint64_t size, bool second, bool ordered) {
        if (size > longest || ++parts_ > most_parts) return {};
        std::string const all = part_at(address, size);
        if (all.size() < size) return {};
        std::size_t const head = second ? (ordered ? 6 : 4) : 8;
        for (std::size_t at = 0; at + head <= all.size();) {
            std::uint64_t const type = number(all, at, second ? 1 : 2);
            std::size_t const length = number(all, at + (second ? 1 : 2), 2), from = at + head;
            if (length > all.size() - from) return {};
            std::string_view const message = std::string_view(all).substr(from, length);
            std::optional<bool> found = false;
            if (type == 0x02) { // where more links are than fit here
                std::size_t const order = (number(message, 1, 1) & 1) != 0 ? 8 : 0;
                if (std::uint64_t const links = number(message, 2 + order, 8); links != nowhere) found = many(links);
            } else if (type == 0x06) { // a link
                found = in(message);
            } else if (type == 0x10) { // the header goes on
                std::uint64_t const frame = second ? 4 : 0, bytes = number(message, 8, 8);
                if (bytes < 2 * frame) return {};
                found = messages(number(message, 0, 8) + frame, bytes - 2 * frame, second, ordered);
            } else if (type == 0x11) {
                found = heap(number(message, 8, 8));
            }
            if (!found || *found) return found;
            at = from + length;
        }
        return false;
    }

    /// The fractal heap in which many links lie.
    std::optional<bool> many(std::uint64_t address) const {
        std::string const head = part_at(address, 146);
        std::uint64_t const width = number(head, 110, 2), start = number(head, 112, 8), most = number(head, 120, 8),
                            rows = number(head, 140, 2), root = number(head, 132, 8);
        if (!head.starts_with("FRHP") || number(head, 7, 2) != 0 || start == 0 || start > most || most > longest ||
            rows > 64 || width > 64)
            return {};
        if (rows == 0) return block(root, start);
        std::string const table = part_at(root, 21 + number(head, 128, 2) / 8 + 8 * width * rows);
        if (!table.starts_with("FHIB")) return {};
        for (std::uint64_t i = 0, at = 13 + (number(head, 128, 2) + 7) / 8; i < width * rows; ++i, at += 8) {
            std::uint64_t const row = i / width, size = row < 2 ? start : start << std::min<std::uint64_t>(row - 1, 32);
            if (size > most) return {}; // of blocks, no links
            std::uint64_t const place = number(table, at, 8);
            if (place == nowhere) continue;
            if (auto const found = block(place, size); !found || *found) return found;
        }
        return false;
    }
    std::optional<bool> block(std::uint64_t address, std::uint64_t size) const {
        std::string const links = part_at(address, size);
        if (links.size() < size || !links.starts_with("FHDB")) return {};
        return in(links);
    }

    ByteSource const& bytes_;
    std::string_view words_;
    std::uint64_t base_ = 0;
    int parts_ = 0;
};

/// In blocks that stay in the cache.
bool near_an_end(ByteSource const& bytes, std::string_view words) {
    constexpr std::int64_t block = std::int64_t{256} << 10;
    auto const overlap = std::ssize(words) - 1;
    std::vector<char> part(static_cast<std::size_t>(block + overlap));
    auto const found_in = [&](std::int64_t from, std::int64_t end) {
        for (; from < end; from += block) {
            auto const n = static_cast<std::size_t>(std::min(block + overlap, bytes.size() - from));
            bytes.read_at(from, part.data(), n);
            if (::memmem(part.data(), n, words.data(), words.size()) != nullptr) return true;
        }
        return false;
    };
    std::int64_t const first = std::min(longest, bytes.size()), last = std::max(first, bytes.size() - longest);
    return found_in(0, first) || found_in(last, bytes.size());
}

} // namespace

bool root_group_names(ByteSource const& bytes, std::string_view words) {
    if (auto const found = RootGroup(bytes, words).names()) return *found;
    return near_an_end(bytes, words);
}

} // namespace vkt
