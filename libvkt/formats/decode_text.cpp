// Decimal text to samples, a word at a time from blocks of input.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/decode_text.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/type_dispatch.h"

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

/// What a decimal that no T can hold rounds to: infinity or zero, as strtod and every other reader of text say. `word`
/// is a number with a magnitude far from 1, so that the sign of its decimal exponent decides.
template <class T> T rounded_far(std::string_view word) {
    bool const negative = word.front() == '-';
    std::size_t const e = std::min(word.find_first_of("eE"), word.size());
    std::int64_t exponent = 0;
    if (e < word.size()) {
        std::size_t const digits = e + (word[e + 1] == '+' ? 2 : 1);
        auto const result = std::from_chars(word.data() + digits, word.data() + word.size(), exponent);
        if (result.ec != std::errc{}) exponent = word[e + 1] == '-' ? -1'000'000 : 1'000'000;
    }
    std::string_view const mantissa = word.substr(0, e);
    auto const point = static_cast<std::int64_t>(std::min(mantissa.find('.'), mantissa.size()));
    exponent += point - static_cast<std::int64_t>(mantissa.find_first_of("123456789"));
    T const far = exponent > 0 ? std::numeric_limits<T>::infinity() : T{0};
    return negative ? -far : far;
}

/// False if the word is no number of this type.
template <class T> bool parse_sample(std::string_view word, T& value) {
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    char const* const end = word.data() + word.size();
    auto const result = std::from_chars(word.data(), end, value);
    if (result.ptr == end && result.ec == std::errc{}) return true;
    if constexpr (std::is_integral_v<T>) {
        double number = 0;
        auto const fraction = std::from_chars(word.data(), end, number);
        if (fraction.ptr != end || fraction.ec != std::errc{} || std::trunc(number) != number) return false;
        // 2^digits is exact in double, unlike the largest value of 64-bit types.
        double const limit = std::ldexp(1.0, std::numeric_limits<T>::digits);
        if (number >= limit || number < (std::is_signed_v<T> ? -limit : 0.0)) return false;
        value = static_cast<T>(number);
        return true;
    } else {
        if (result.ptr != end || result.ec != std::errc::result_out_of_range) return false;
        value = rounded_far<T>(word);
        return true;
    }
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
    return with_type(type, [&]<class T>(T) -> std::unique_ptr<ByteStream> {
        if constexpr (std::is_same_v<T, Half>)
            throw Error(ErrorKind::data, text("'", bytes.name(), "': text of float16 samples is not a known encoding"));
        else
            return std::make_unique<TextStream<T>>(bytes);
    });
}

} // namespace vkt
