// Text helpers.
// SPDX-License-Identifier: MIT
#include "libvkt/core/text.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <utility>

namespace vkt {
namespace {

template <class T> std::string chars(T value) {
    std::array<char, 40> buffer{};
    auto const result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return {buffer.data(), result.ptr};
}

template <class T> T parse_whole(std::string_view word, char const* what) {
    T value{};
    std::string_view digits = word;
    if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
    auto const result = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (digits.empty() || result.ec == std::errc::invalid_argument || result.ptr != digits.data() + digits.size())
        throw Error(ErrorKind::usage, text("'", word, "' is not ", what));
    if (result.ec == std::errc::result_out_of_range)
        throw Error(ErrorKind::usage, text("'", word, "' is out of range"));
    return value;
}

/// Insertions, deletions, substitutions and swaps of neighbours (optimal string alignment).
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> before_last, last(b.size() + 1), row(b.size() + 1);
    std::iota(last.begin(), last.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            std::size_t const substitution = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
            row[j] = std::min({last[j] + 1, row[j - 1] + 1, substitution});
            bool const swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            if (swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
        }
        before_last = std::exchange(last, row);
    }
    return last.back();
}

std::string hexadecimal(std::uint32_t value, int digits) {
    std::array<char, 16> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%0*x", digits, value);
    return buffer.data();
}

constexpr std::string_view escape_letters = "abefnrtv";
constexpr std::string_view escaped_controls = "\a\b\x1b\f\n\r\t\v";

int digit_of(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return 16;
}

/// What stands for one character within $'…', from behind the backslash on; `i` is left at its last character.
char escaped_character(std::string_view line, std::size_t& i) {
    char const c = line[i];
    if (auto const letter = escape_letters.find(c); letter != std::string_view::npos) return escaped_controls[letter];
    int const base = c == 'x' ? 16 : digit_of(c) < 8 ? 8 : 0;
    if (base == 0) return c; // quotes and backslashes stand for themselves
    std::size_t const begin = c == 'x' ? i + 1 : i, most = begin + (c == 'x' ? 2 : 3);
    std::size_t end = begin;
    int value = 0;
    for (; end < std::min(most, line.size()) && digit_of(line[end]) < base; ++end)
        value = value * base + digit_of(line[end]);
    if (end == begin) return c;
    i = end - 1;
    return static_cast<char>(value);
}

/// Splits like a shell does; with `bars` a bar outside quotes begins the words of the next stage.
std::vector<std::vector<std::string>> words_of(std::string_view line, bool bars) {
    std::vector<std::vector<std::string>> stages(1);
    std::string word;
    bool in_word = false;
    char quote = 0;
    auto const close_word = [&] {
        if (in_word) stages.back().push_back(word);
        word.clear();
        in_word = false;
    };
    for (std::size_t i = 0; i < line.size(); ++i) {
        char const c = line[i];
        if (quote == '$') { // $'…'
            if (c == '\'')
                quote = 0;
            else
                word += c == '\\' && i + 1 < line.size() ? escaped_character(line, ++i) : c;
        } else if (quote != 0) {
            if (c == quote)
                quote = 0;
            else if (quote == '"' && c == '\\' && i + 1 < line.size())
                word += line[++i];
            else
                word += c;
        } else if (c == ' ' || c == '\t' || c == '\n') {
            close_word();
        } else if (bars && c == '|') {
            close_word();
            stages.emplace_back();
        } else {
            in_word = true;
            if (c == '$' && i + 1 < line.size() && line[i + 1] == '\'')
                quote = c, ++i;
            else if (c == '\'' || c == '"')
                quote = c;
            else
                word += c == '\\' && i + 1 < line.size() ? line[++i] : c;
        }
    }
    if (quote != 0) throw Error(ErrorKind::usage, text("missing closing ", std::string(1, quote), " in: ", line));
    close_word();
    return stages;
}

/// Length of the valid UTF-8 sequence that the text begins with; 0 if there is none (RFC 3629: no surrogates, shortest
/// forms only, up to U+10FFFF).
std::size_t sequence_length(std::string_view s) {
    auto const byte = [&](std::size_t i) { return static_cast<unsigned char>(s[i]); };
    unsigned char const first = byte(0);
    if (first < 0x80) return 1;
    std::size_t const n = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
    if (first < 0xC2 || first > 0xF4 || s.size() < n) return 0;
    for (std::size_t i = 1; i < n; ++i)
        if ((byte(i) & 0xC0U) != 0x80) return 0;
    unsigned char const second = byte(1);
    bool const bad = (first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) ||
                     (first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F);
    return bad ? 0 : n;
}

} // namespace

std::string to_text(double value) { return chars(value); }
std::string to_text(float value) { return chars(value); }
std::string to_text(std::int64_t value) { return chars(value); }
std::string to_text(std::uint64_t value) { return chars(value); }
std::string to_text(Index3 v) { return text(v.x, " ", v.y, " ", v.z); }
std::string to_text(Vec3 v) { return text(v.x, " ", v.y, " ", v.z); }
std::string to_text(Box const& b) {
    return text(b.lower.x, ":", b.upper.x, ",", b.lower.y, ":", b.upper.y, ",", b.lower.z, ":", b.upper.z);
}

namespace {

std::string in_digits(char const* form, double value) {
    std::array<char, 32> digits{};
    std::snprintf(digits.data(), digits.size(), form, value);
    return digits.data();
}

} // namespace

std::string two_digits(double value) { return in_digits("%.2g", value); }
std::string six_digits(double value) { return in_digits("%.6g", value); }

std::string bytes_text(double bytes) {
    std::array const units{"B", "KiB", "MiB", "GiB", "TiB"};
    std::size_t unit = 0;
    while (bytes >= 1024 && unit + 1 < units.size()) {
        bytes /= 1024;
        ++unit;
    }
    std::array<char, 48> buffer{};
    std::snprintf(buffer.data(), buffer.size(), unit == 0 ? "%.0f %s" : "%.1f %s", bytes, units[unit]);
    return buffer.data();
}

std::string lower_case(std::string_view word) {
    std::string result(word);
    for (char& c : result) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c);
    return result;
}

std::string in_utf8(std::string_view s) {
    std::string result;
    result.reserve(s.size());
    while (!s.empty()) {
        std::size_t const n = sequence_length(s);
        if (n > 0) {
            result += s.substr(0, n);
        } else {
            auto const code = static_cast<unsigned char>(s.front());
            result += static_cast<char>(0xC0U | code >> 6U);
            result += static_cast<char>(0x80U | (code & 0x3FU));
        }
        s.remove_prefix(std::max<std::size_t>(n, 1));
    }
    return result;
}

std::vector<std::string> split(std::string_view line, char separator) {
    std::vector<std::string> parts;
    std::size_t begin = 0;
    for (std::size_t end = line.find(separator); end != std::string_view::npos; end = line.find(separator, begin)) {
        parts.emplace_back(line.substr(begin, end - begin));
        begin = end + 1;
    }
    parts.emplace_back(line.substr(begin));
    return parts;
}

std::string join(std::vector<std::string> const& parts, std::string_view separator) {
    std::string result;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        if (i > 0) result.append(separator);
        result.append(parts[i]);
    }
    return result;
}

bool Character::visible() const {
    bool const control = code < 0x20 || (code >= 0x7f && code < 0xa0), line_break = code == 0x2028 || code == 0x2029;
    bool const direction = code == 0x61c || code == 0x200e || code == 0x200f || (code >= 0x202a && code <= 0x202e) ||
                           (code >= 0x2066 && code <= 0x2069);
    return valid && !control && !line_break && !direction;
}

Character first_character(std::string_view text) {
    auto const byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])); };
    std::uint32_t const first = byte(0);
    if (first < 0x80) return {first, 1, true};
    std::size_t const n = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
    Character const none{0xfffd, 1, false};
    if (first < 0xc2 || first > 0xf4 || text.size() < n) return none;
    std::uint32_t code = first & (0x7fU >> n);
    for (std::size_t i = 1; i < n; ++i) {
        if ((byte(i) & 0xc0) != 0x80) return none;
        code = code << 6 | (byte(i) & 0x3f);
    }
    bool const longer = code < (n == 3 ? 0x800U : 0x10000U) && n > 2, surrogate = code >= 0xd800 && code < 0xe000;
    if (longer || surrogate || code > 0x10ffff) return none;
    return {code, n, true};
}

std::string printable(std::string_view text) {
    std::string result;
    result.reserve(text.size());
    while (!text.empty()) {
        Character const c = first_character(text);
        if (c.visible())
            result += text.substr(0, c.bytes);
        else if (c.code == '\n' || c.code == '\t' || c.code == '\r')
            result += c.code == '\n' ? "\\n" : c.code == '\t' ? "\\t" : "\\r";
        else if (c.bytes == 1)
            result += "\\x" + hexadecimal(static_cast<unsigned char>(text.front()), 2);
        else
            result += "\\u" + hexadecimal(c.code, 4);
        text.remove_prefix(c.bytes);
    }
    return result;
}

std::string shell_quoted(std::string_view word) {
    if (printable(word) != word) {
        std::string quoted = "$'";
        while (!word.empty()) {
            Character const c = first_character(word);
            std::string_view const bytes = word.substr(0, c.bytes);
            word.remove_prefix(c.bytes);
            if (c.code == '\'' || c.code == '\\') quoted += '\\';
            if (c.visible()) {
                quoted += bytes;
                continue;
            }
            for (char const b : bytes) { // three octal digits cannot run into what follows
                std::array<char, 8> octal{};
                std::snprintf(octal.data(), octal.size(), "\\%03o",
                              static_cast<unsigned>(static_cast<unsigned char>(b)));
                quoted += octal.data();
            }
        }
        return quoted + "'";
    }
    bool plain = !word.empty();
    for (char c : word) {
        bool const letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        plain = plain && (letter || std::string_view("_-./:,+=%@").find(c) != std::string_view::npos);
    }
    if (plain) return std::string(word);
    std::string quoted = "'";
    for (char c : word) {
        if (c == '\'')
            quoted += "'\\''";
        else
            quoted += c;
    }
    return quoted + "'";
}

std::vector<std::string> shell_words(std::string_view line) { return words_of(line, false).front(); }
std::vector<std::vector<std::string>> shell_stages(std::string_view line) { return words_of(line, true); }

namespace {

/// What other tools call values that options may have, and what they are called here.
constexpr std::pair<std::string_view, std::string_view> elsewhere[] = {
    {"reflect", "mirror"},
    {"symmetric", "mirror"},
    {"nearest", "clamp"},
    {"edge", "clamp"},
    {"replicate", "clamp"},
    {"extend", "clamp"},
    {"periodic", "wrap"},
    {"repeat", "wrap"},
    {"circular", "wrap"},
    {"grid-wrap", "wrap"},
    {"constant", "border"},
    {"zero", "border"},
    {"--size", "--dims"},
    {"--shape", "--dims"},
    {"plus", "add"},
    {"+", "add"},
    {"minus", "sub"},
    {"subtract", "sub"},
    {"times", "mul"},
    {"multiply", "mul"},
    {"*", "mul"},
    {"divide", "div"},
    {"/", "div"},
    {">", "gt"},
    {">=", "ge"},
    {"<", "lt"},
    {"<=", "le"},
    {"==", "eq"},
    {"!=", "ne"},
    {"ln", "log"},
    {"average", "mean"},
    {"avg", "mean"},
    {"minimum", "min"},
    {"maximum", "max"},
    {"mip", "max"},
    {"stddev", "std"},
    {"dilation", "dilate"},
    {"erosion", "erode"},
    {"opening", "open"},
    {"closing", "close"},
    {"sphere", "ball"},
    {"cube", "box"},
    {"trilinear", "linear"},
    {"tricubic", "cubic"},
    {"lanczos", "lanczos3"},
    {"spline", "bspline3"},
    {"mm", "world"},
    {"physical", "world"},
    {"index", "voxel"},
};

} // namespace

std::string nearest_name(std::string_view word, std::vector<std::string> const& candidates) {
    std::string const lower = lower_case(word);
    for (auto const& [other, ours] : elsewhere)
        if (lower == other && std::find(candidates.begin(), candidates.end(), ours) != candidates.end())
            return std::string(ours);
    // Half-typed: the shortest name that begins so.
    std::string best;
    std::size_t const bare = word.find_first_not_of('-');
    if (bare != std::string_view::npos && word.size() - bare >= 2)
        for (auto const& candidate : candidates)
            if (candidate.starts_with(word) && (best.empty() || candidate.size() < best.size())) best = candidate;
    if (!best.empty()) return best;
    std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
    for (auto const& candidate : candidates) {
        std::size_t const distance = edit_distance(lower, lower_case(candidate));
        bool const alike = distance < std::max(word.size(), candidate.size());
        if (alike && distance < best_distance) {
            best_distance = distance;
            best = candidate;
        }
    }
    return best;
}

bool is_number(std::string_view word) {
    try {
        (void)parse_double(word);
        return true;
    } catch (Error const&) {
        return false;
    }
}

double parse_double(std::string_view word) {
    double const value = parse_whole<double>(word, "a number");
    if (std::isnan(value)) throw Error(ErrorKind::usage, text("'", word, "' is not a number"));
    return value;
}

std::int64_t parse_integer(std::string_view word) { return parse_whole<std::int64_t>(word, "an integer"); }

std::uint64_t parse_size(std::string_view word) {
    std::size_t const end = word.find_first_not_of("0123456789.");
    std::string_view const digits = word.substr(0, end);
    double const number = is_number(digits) ? parse_double(digits) : 0; // 0 is no size
    std::string unit = lower_case(end == std::string_view::npos ? "" : word.substr(end));
    if (!unit.empty() && unit.back() == 'b') unit.pop_back();
    if (!unit.empty() && unit.back() == 'i') unit.pop_back();
    double factor = 0;
    if (unit.empty()) factor = 1;
    if (unit == "k") factor = 1024.0;
    if (unit == "m") factor = 1024.0 * 1024;
    if (unit == "g") factor = 1024.0 * 1024 * 1024;
    if (unit == "t") factor = 1024.0 * 1024 * 1024 * 1024;
    double const bytes = number * factor;
    if (factor == 0 || !(bytes >= 1) || bytes > 9e18)
        throw Error(ErrorKind::usage, text("'", word, "' is not a size"), "write bytes or a unit: 512M, 2GiB");
    return static_cast<std::uint64_t>(bytes);
}

} // namespace vkt
