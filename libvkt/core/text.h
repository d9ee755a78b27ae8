// Text helpers: joining values into messages, numbers that round-trip, sizes, nearest-name suggestions.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <string>
#include <string_view>
#include <vector>

namespace vkt {

std::string to_text(double value); ///< shortest decimal that reads back to the same double
std::string to_text(float value);
std::string to_text(std::int64_t value);
std::string to_text(std::uint64_t value);
std::string to_text(Index3 value);   ///< "x y z"
std::string to_text(Vec3 value);     ///< "x y z"
std::string to_text(Box const& box); ///< "x0:x1,y0:y1,z0:z1"
inline std::string to_text(int value) { return to_text(static_cast<std::int64_t>(value)); }
inline std::string to_text(std::string_view value) { return std::string(value); }
inline std::string to_text(char const* value) { return value; }
inline std::string to_text(std::string const& value) { return value; }
inline std::string to_text(DataType type) { return std::string(name_of(type)); }

/// Concatenates the texts of its arguments.
template <class... Args> std::string text(Args const&... args) {
    std::string result;
    (result.append(to_text(args)), ...);
    return result;
}

std::string bytes_text(double bytes); ///< "12.0 MiB"
std::string two_digits(double value); ///< "0.31", "1.2e+03": to two significant digits
std::string six_digits(double value); ///< the same to six: what a reader wants of a value
std::string lower_case(std::string_view text);
/// The same text in UTF-8: bytes that are not part of a valid sequence are taken as Latin-1. Valid text stays as it is.
std::string in_utf8(std::string_view text);
std::vector<std::string> split(std::string_view text, char separator);
std::string join(std::vector<std::string> const& parts, std::string_view separator);
/// A character of UTF-8 text.
struct Character {
    char32_t code = 0;     ///< U+FFFD for a byte that is no UTF-8
    std::size_t bytes = 0; ///< that it takes, at least 1
    bool valid = false;    ///< it is UTF-8
    /// False of what terminals act on, what breaks lines and what turns the direction of writing.
    bool visible() const;
};
/// The first one of text that is not empty.
Character first_character(std::string_view text);
/// Text from files, streams and arguments as a person may see it, in one line: characters that are not visible() appear
/// as \n, \t, \x1b or \u202e, bytes that are no UTF-8 as \xff. All else is left alone, backslashes too.
std::string printable(std::string_view text);

/// Quotes a word for a POSIX shell if it needs quoting. Words that are not printable() as they are become $'…', which
/// bash, zsh and ksh know, so that a line is always one line.
std::string shell_quoted(std::string_view word);
/// Splits like a POSIX shell does for words: quotes (also $'…'), backslashes, blanks. Throws Error{usage} on an open
/// quote.
std::vector<std::string> shell_words(std::string_view line);
/// The words of each stage of a pipeline: the same, parted at bars outside quotes. A stage may be empty.
std::vector<std::vector<std::string>> shell_stages(std::string_view line);

/// The candidate nearest to a word (edit distance at most a third of its length, at least 1), or empty.
std::string nearest_name(std::string_view word, std::vector<std::string> const& candidates);

/// Numbers must be consumed whole; throw Error{usage} naming the text. parse_size reads "512", "64KiB", "1.5G".
double parse_double(std::string_view text);
bool is_number(std::string_view text); ///< what parse_double takes
std::int64_t parse_integer(std::string_view text);
std::uint64_t parse_size(std::string_view text);

} // namespace vkt
