// Data of .vti files, unpacked block by block.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vti_data.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/decode.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/unpack.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace vkt {
namespace {

constexpr std::int64_t most_blocks = std::int64_t{1} << 28;

[[noreturn]] void damaged(std::string const& name, std::string const& what, std::string const& hint = {}) {
    throw Error(ErrorKind::data, text("'", name, "': ", what), hint);
}

int base64_value(unsigned char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

bool is_blank(unsigned char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// Bytes that lie in the file plain or in base64, from `begin` on, at most to `end`.
class Encoded {
public:
    Encoded(ByteSource const& bytes, std::string const& name, std::int64_t begin, std::int64_t end, bool base64)
        : bytes_(bytes), name_(name), begin_(begin), end_(end), base64_(base64) {}

    /// Bytes that can be there at most.
    std::int64_t most() const { return base64_ ? (end_ - begin_) / 4 * 3 + 3 : end_ - begin_; }

    void read(std::int64_t position, std::byte* to, std::int64_t n) {
        if (position < 0 || n < 0 || position > most() || n > most() - position) early();
        if (!base64_) {
            bytes_.read_at(begin_ + position, to, static_cast<std::size_t>(n));
            return;
        }
        constexpr std::int64_t portion = std::int64_t{192} << 10; // a multiple of 3
        while (n > 0) {
            std::int64_t const group = position / 3, skip = position % 3;
            std::int64_t const count = std::min(n, portion - skip), groups = (skip + count + 2) / 3;
            if (begin_ + 4 * group + 4 * groups > end_) early();
            letters_.resize(static_cast<std::size_t>(4 * groups));
            bytes_.read_at(begin_ + 4 * group, letters_.data(), letters_.size());
            decoded_.resize(static_cast<std::size_t>(3 * groups));
            std::int64_t const got = decode();
            if (got < skip + count) early();
            std::memcpy(to, decoded_.data() + skip, static_cast<std::size_t>(count));
            to += count;
            position += count;
            n -= count;
        }
    }

private:
    [[noreturn]] void early() const { damaged(name_, "ended early: an array is incomplete"); }

    /// Bytes that the letters stand for.
    std::int64_t decode() {
        std::int64_t got = 0;
        for (std::size_t g = 0; g < letters_.size(); g += 4) {
            std::uint32_t value = 0;
            int letters = 0;
            for (std::size_t i = 0; i < 4; ++i) {
                int const digit = base64_value(letters_[g + i]);
                if (digit < 0 && letters_[g + i] != '=') damaged(name_, "an array is no base64");
                if (digit >= 0 && letters != static_cast<int>(i)) damaged(name_, "an array is no base64");
                if (digit >= 0) ++letters;
                value = value << 6 | static_cast<std::uint32_t>(std::max(digit, 0));
            }
            for (int i = 0; i < letters - 1; ++i)
                decoded_[static_cast<std::size_t>(got++)] = static_cast<std::byte>(value >> (16 - 8 * i));
            if (letters < 4) break;
        }
        return got;
    }

    ByteSource const& bytes_;
    std::string const& name_;
    std::int64_t begin_, end_;
    bool base64_;
    std::vector<unsigned char> letters_;
    std::vector<std::byte> decoded_;
};

} // namespace

class VtiData::Impl {
public:
    Impl(ByteSource const& bytes, VtiStructure const& structure, VtiArray const& array, std::int64_t size)
        : bytes_(bytes), s_(structure), array_(array), size_(size), element_(size_of(array.type)) {
        if (array.format == VtiArray::Format::ascii) {
            read_ascii();
            return;
        }
        std::int64_t begin = array.begin, end = array.end;
        bool const appended = array.format == VtiArray::Format::appended, base64 = !appended || s_.appended_base64;
        if (appended) {
            if (s_.appended < 0) damaged(s_.name, "has no appended data, of which an array speaks");
            if (array.begin > bytes.size() - s_.appended)
                damaged(s_.name, text("ended early: array '", printable(array.name), "' begins behind its end"));
            begin = s_.appended + array.begin;
            end = bytes.size();
        }
        if (base64 && !appended) begin = plain_base64(begin, end);
        ByteSource const& from = unwrapped_ ? *unwrapped_ : bytes_;
        open(from, begin, end, base64);
    }

    void read(std::int64_t position, std::byte* to, std::int64_t n) {
        if (position < 0 || n < 0 || position > size_ - n)
            throw Error(ErrorKind::failure, text("'", s_.name, "': bytes outside of an array"));
        if (!values_.empty()) {
            std::memcpy(to, values_.data() + position, static_cast<std::size_t>(n));
            return;
        }
        std::byte* const first = to;
        std::int64_t const all = n;
        if (s_.compressor == VtiStructure::Compressor::none) {
            encoded_->read(data_ + position, to, n);
        } else {
            while (n > 0) {
                std::int64_t const block = position / block_size_, inside = position % block_size_;
                std::vector<std::byte> const& decoded = this->block(block);
                std::int64_t const count = std::min(n, std::ssize(decoded) - inside);
                std::memcpy(to, decoded.data() + inside, static_cast<std::size_t>(count));
                to += count;
                position += count;
                n -= count;
            }
        }
        if (element_ > 1 && s_.big_endian != (std::endian::native == std::endian::big))
            swap_bytes(first, static_cast<std::size_t>(all) / element_, element_);
    }

private:
    /// Letters without blanks between them can be read anywhere; others are copied together.
    std::int64_t plain_base64(std::int64_t begin, std::int64_t& end) {
        char c = 0;
        while (begin < end && (bytes_.read_at(begin, &c, 1), is_blank(static_cast<unsigned char>(c)))) ++begin;
        while (begin < end && (bytes_.read_at(end - 1, &c, 1), is_blank(static_cast<unsigned char>(c)))) --end;
        std::string letters;
        std::string block;
        bool blanks = false;
        for (std::int64_t at = begin; at < end && (at < begin + 65536 || blanks); at += std::ssize(block)) {
            block.resize(static_cast<std::size_t>(std::min<std::int64_t>(65536, end - at)));
            bytes_.read_at(at, block.data(), block.size());
            for (char const letter : block)
                if (is_blank(static_cast<unsigned char>(letter)))
                    blanks = true;
                else
                    letters += letter;
        }
        if (!blanks) return begin;
        end = std::ssize(letters);
        // As bytes that can be read anywhere.
        unwrapped_ = text_bytes(letters);
        return 0;
    }

    static std::unique_ptr<ByteSource> text_bytes(std::string const& letters);

    std::uint64_t header_word(Encoded& from, std::int64_t index) const {
        std::size_t const width = s_.wide_header ? 8 : 4;
        std::array<std::byte, 8> raw{};
        from.read(index * static_cast<std::int64_t>(width), raw.data(), static_cast<std::int64_t>(width));
        return word_of(raw.data(), width);
    }

    std::uint64_t word_of(std::byte const* raw, std::size_t width) const {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < width; ++i)
            value = value << 8 | std::to_integer<std::uint64_t>(raw[s_.big_endian ? i : width - 1 - i]);
        return value;
    }

    void open(ByteSource const& from, std::int64_t begin, std::int64_t end, bool base64) {
        std::int64_t const width = s_.wide_header ? 8 : 4;
        Encoded head(from, s_.name, begin, end, base64);
        // Where what follows a header of n bytes begins, if that is encoded by itself.
        auto const behind = [&](std::int64_t n) { return begin + (base64 ? (n + 2) / 3 * 4 : n); };
        if (s_.compressor == VtiStructure::Compressor::none) {
            check_size(header_word(head, 0));
            // Some writers encode the number of bytes by itself, others with the data.
            char last = 0;
            if (base64) from.read_at(behind(width) - 1, &last, 1);
            bool const apart = last == '=';
            encoded_.emplace(from, s_.name, apart ? behind(width) : begin, end, base64);
            data_ = apart ? 0 : width;
            return;
        }
        std::uint64_t const blocks = header_word(head, 0), size = header_word(head, 1), last = header_word(head, 2);
        if (blocks == 0 || blocks > static_cast<std::uint64_t>(most_blocks) ||
            static_cast<std::int64_t>(blocks + 3) * width > head.most())
            damaged(s_.name, text("array '", printable(array_.name), "' claims ", blocks, " blocks"));
        auto const n = static_cast<std::int64_t>(blocks);
        // The last block may be a part of one, also where it is the only one: then blocks are larger than the array.
        std::uint64_t stated = 0;
        if (size == 0 || last > size || __builtin_mul_overflow(size, last == 0 ? blocks : blocks - 1, &stated) ||
            __builtin_add_overflow(stated, last, &stated))
            damaged(s_.name, text("array '", printable(array_.name), "' claims blocks of sizes that cannot be"));
        check_size(stated);
        block_size_ = static_cast<std::int64_t>(std::min(size, static_cast<std::uint64_t>(size_)));
        std::vector<std::byte> table(static_cast<std::size_t>((n + 3) * width));
        head.read(0, table.data(), std::ssize(table));
        std::int64_t const data = behind((n + 3) * width);
        std::int64_t position = 0;
        starts_.reserve(static_cast<std::size_t>(n) + 1);
        for (std::int64_t i = 0; i < n; ++i) {
            starts_.push_back(position);
            std::uint64_t const bytes = word_of(table.data() + (i + 3) * width, static_cast<std::size_t>(width));
            if (bytes > static_cast<std::uint64_t>(end - begin))
                damaged(s_.name, "ended early: an array is incomplete");
            position += static_cast<std::int64_t>(bytes);
        }
        starts_.push_back(position);
        encoded_.emplace(from, s_.name, data, end, base64);
        if (position > encoded_->most()) damaged(s_.name, "ended early: an array is incomplete");
        // Nothing is allocated that so few bytes cannot become.
        double const densest = s_.compressor == VtiStructure::Compressor::lzma ? 1e5 : 1032;
        if (static_cast<double>(size_) > densest * static_cast<double>(position) + 64)
            damaged(s_.name, text("array '", printable(array_.name), "' is compressed to fewer bytes than can be"));
    }

    void check_size(std::uint64_t stated) const {
        if (stated != static_cast<std::uint64_t>(size_))
            damaged(s_.name,
                    text("array '", printable(array_.name), "' has ", stated, " bytes, its extent needs ", size_));
    }

    Packing packing() const {
        switch (s_.compressor) {
        case VtiStructure::Compressor::lz4:
            return Packing::lz4;
        case VtiStructure::Compressor::lzma:
            return Packing::lzma;
        case VtiStructure::Compressor::none:
        case VtiStructure::Compressor::zlib:
            break;
        }
        return Packing::deflate;
    }

    std::vector<std::byte> const& block(std::int64_t index) {
        for (Block& held : held_)
            if (held.index == index) return held.bytes;
        Block& held = held_[next_++ % held_.size()];
        held.index = -1;
        auto const i = static_cast<std::size_t>(index);
        std::int64_t const size = std::min(block_size_, size_ - index * block_size_);
        packed_.resize(static_cast<std::size_t>(starts_[i + 1] - starts_[i]));
        encoded_->read(starts_[i], packed_.data(), std::ssize(packed_));
        held.bytes.resize(static_cast<std::size_t>(size));
        require(packing(), s_.name);
        if (!unpack(packing(), packed_, held.bytes))
            damaged(s_.name, text("damaged compressed data in array '", printable(array_.name), "'"));
        held.index = index;
        return held.bytes;
    }

    /// Numbers as text can only be found by reading all before them.
    void read_ascii();

    ByteSource const& bytes_;
    VtiStructure const& s_;
    VtiArray const& array_;
    std::int64_t size_;
    std::size_t element_;
    std::unique_ptr<ByteSource> unwrapped_;
    std::optional<Encoded> encoded_;
    std::int64_t data_ = 0, block_size_ = 1;
    std::vector<std::int64_t> starts_;
    struct Block {
        std::int64_t index = -1;
        std::vector<std::byte> bytes;
    };
    std::array<Block, 4> held_;
    std::size_t next_ = 0;
    std::vector<std::byte> packed_;
    std::vector<std::byte> values_; ///< of text
};

std::unique_ptr<ByteSource> VtiData::Impl::text_bytes(std::string const& letters) {
    return seekable_bytes(
        std::make_unique<ByteSource>("an array", [&letters, at = std::size_t{0}](std::byte* to, std::size_t n) mutable {
            std::size_t const count = std::min(n, letters.size() - at);
            std::memcpy(to, letters.data() + at, count);
            at += count;
            return count;
        }));
}

void VtiData::Impl::read_ascii() {
    if (least_encoded_bytes(Encoding::text, size_, array_.type) > array_.end - array_.begin)
        damaged(s_.name, text("ended early: array '", printable(array_.name), "' has too few values"));
    ByteSource words(s_.name, [this, at = array_.begin](std::byte* to, std::size_t n) mutable {
        auto const count = std::min<std::int64_t>(static_cast<std::int64_t>(n), array_.end - at);
        bytes_.read_at(at, to, static_cast<std::size_t>(count));
        at += count;
        return static_cast<std::size_t>(count);
    });
    auto const stream = decode(words, Encoding::text, array_.type);
    values_.resize(static_cast<std::size_t>(size_));
    std::byte more{};
    std::size_t const got = stream->read(values_.data(), values_.size());
    if (got < values_.size() || stream->read(&more, 1) > 0)
        damaged(s_.name, text("array '", printable(array_.name), "' has ", got < values_.size() ? "fewer" : "more",
                              " values than its extent"));
}

VtiData::VtiData(ByteSource const& bytes, VtiStructure const& structure, VtiArray const& array, std::int64_t size)
    : impl_(std::make_unique<Impl>(bytes, structure, array, size)) {}
VtiData::~VtiData() = default;
void VtiData::read(std::int64_t position, std::byte* to, std::int64_t n) { impl_->read(position, to, n); }

} // namespace vkt
