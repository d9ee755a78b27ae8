// Decimal text to samples, a word at a time from blocks of input.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/decode_text.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace vkt {

namespace {

constexpr std::size_t block = std::size_t{64} << 10;
constexpr std::size_t longest_word = 400; // the longest exact double takes fewer characters

bool separates(char c) { return c == ' ' || (c >= '\t' && c <= '\r') || c == ','; }

template <class T> bool parse_exactly(std::string_view word, T& value) {
    auto const result = std::from_chars(word.data(), word.data() + word.size(), value);
    return result.ec == std::errc{} && result.ptr == word.data() + word.size();
}

/// False if the word is no number of this type.
template <class T> bool parse_sample(std::string_view word, T& value) {
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    if (parse_exactly(word, value)) return true;
    if constexpr (std::is_integral_v<T>) {
        double number = 0;
        if (!parse_exactly(word, number) || std::trunc(number) != number) return false;
        // 2^digits is exact in double, unlike the largest value of 64-bit types.
        double const limit = std::ldexp(1.0, std::numeric_limits<T>::digits);
        if (number >= limit || number < (std::is_signed_v<T> ? -limit : 0.0)) return false;
        value = static_cast<T>(number);
        return true;
    }
    return false;
}

template <class T> class TextStream : public ByteStream {
public:
    explicit TextStream(ByteSource& bytes) : bytes_(bytes), data_(block) {}

    std::size_t read(std::byte* to, std::size_t n) override {
        std::size_t done = 0;
        while (done < n) {
            // Callers may ask for part of a sample; the rest is kept.
            if (held_ == 0 && !next_sample()) break;
            std::size_t const count = std::min(held_, n - done);
            std::memcpy(to + done, reinterpret_cast<std::byte const*>(&sample_) + (sizeof(T) - held_), count);
            held_ -= count;
            done += count;
        }
        return done;
    }

private:
    bool next_sample() {
        std::string_view const word = next_word();
        if (word.empty()) return false;
        if (!parse_sample(word, sample_))
            throw Error(ErrorKind::data,
                        text("'", bytes_.name(), "': '", word.substr(0, 40), "' is no sample of this type"));
        held_ = sizeof(T);
        return true;
    }
    bool refill() {
        next_ = 0;
        count_ = bytes_.read(data_.data(), data_.size());
        return count_ > 0;
    }
    /// A view into the block if the word lies in it whole, which nearly all do.
    std::string_view next_word() {
        char c = 0;
        do {
            if (next_ == count_ && !refill()) return {};
            c = data_[next_++];
        } while (separates(c));
        std::size_t const begin = next_ - 1;
        while (next_ < count_ && !separates(data_[next_])) ++next_;
        if (next_ < count_) return checked({data_.data() + begin, next_ - begin});
        word_.assign(data_.data() + begin, next_ - begin);
        while (refill()) {
            while (next_ < count_ && !separates(data_[next_])) ++next_;
            word_.append(data_.data(), std::min(next_, longest_word));
            checked(word_);
            if (next_ < count_) break;
        }
        return checked(word_);
    }
    std::string_view checked(std::string_view word) const {
        if (word.size() > longest_word)
            throw Error(ErrorKind::data, text("'", bytes_.name(), "': '", word.substr(0, 40), "…' is no sample"));
        return word;
    }

    ByteSource& bytes_;
    std::vector<char> data_;
    std::string word_;
    std::size_t next_ = 0, count_ = 0, held_ = 0;
    T sample_{};
};

} // namespace

std::unique_ptr<ByteStream> decode_text(ByteSource& bytes, DataType type) {
    switch (type) {
    case DataType::uint8:
        return std::make_unique<TextStream<std::uint8_t>>(bytes);
    case DataType::int8:
        return std::make_unique<TextStream<std::int8_t>>(bytes);
    case DataType::uint16:
        return std::make_unique<TextStream<std::uint16_t>>(bytes);
    case DataType::int16:
        return std::make_unique<TextStream<std::int16_t>>(bytes);
    case DataType::uint32:
        return std::make_unique<TextStream<std::uint32_t>>(bytes);
    case DataType::int32:
        return std::make_unique<TextStream<std::int32_t>>(bytes);
    case DataType::uint64:
        return std::make_unique<TextStream<std::uint64_t>>(bytes);
    case DataType::int64:
        return std::make_unique<TextStream<std::int64_t>>(bytes);
    case DataType::float32:
        return std::make_unique<TextStream<float>>(bytes);
    case DataType::float64:
        return std::make_unique<TextStream<double>>(bytes);
    case DataType::float16:
        break;
    }
    throw Error(ErrorKind::data, text("'", bytes.name(), "': text of float16 samples is not a known encoding"));
}

} // namespace vkt
