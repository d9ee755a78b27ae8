// Numbers, names and vectors of text headers.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/header_text.h"

#include "libvkt/core/error.h"
#include "libvkt/core/frame.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

namespace vkt {

namespace {

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

constexpr std::int64_t most_files = std::int64_t{1} << 20;

/// The one conversion of a pattern: where it stands and how it pads.
struct Conversion {
    std::size_t begin = 0, end = 0;
    std::size_t width = 0;
    bool zeros = false;
};

std::optional<Conversion> conversion_in(std::string_view pattern) {
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        if (pattern[i] != '%') continue;
        Conversion found{i, i + 1, 0, false};
        while (found.end < pattern.size() && pattern[found.end] == '0') {
            found.zeros = true;
            ++found.end;
        }
        while (found.end < pattern.size() && pattern[found.end] >= '0' && pattern[found.end] <= '9' &&
               found.width <= 64)
            found.width = found.width * 10 + static_cast<std::size_t>(pattern[found.end++] - '0');
        if (found.end < pattern.size() && found.width <= 64 &&
            (pattern[found.end] == 'd' || pattern[found.end] == 'i' || pattern[found.end] == 'u')) {
            ++found.end;
            return found;
        }
    }
    return std::nullopt;
}

/// Of vectors of any size: squares could overflow.
double safe_length(Vec3 v) { return std::hypot(v.x, v.y, v.z); }

} // namespace

std::string_view trimmed(std::string_view s) {
    while (!s.empty() && is_blank(s.front())) s.remove_prefix(1);
    while (!s.empty() && is_blank(s.back())) s.remove_suffix(1);
    return s;
}

std::vector<std::string> words_of(std::string_view s) {
    std::vector<std::string> words;
    for (std::size_t i = 0; i < s.size();) {
        while (i < s.size() && is_blank(s[i])) ++i;
        std::size_t const begin = i;
        while (i < s.size() && !is_blank(s[i])) ++i;
        if (i > begin) words.emplace_back(s.substr(begin, i - begin));
    }
    return words;
}

std::string one_line(std::string s) {
    for (char& c : s)
        if (c == '\n' || c == '\r') c = ' ';
    return s;
}

std::optional<double> number_in(std::string_view word) {
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    double value = 0;
    auto const result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (result.ec != std::errc{} || result.ptr != word.data() + word.size()) return std::nullopt;
    return value;
}

std::optional<double> number_of(Header const& header, std::string const& attribute) {
    auto const found = header.attributes.find(attribute);
    return found == header.attributes.end() ? std::nullopt : number_in(found->second);
}

std::optional<std::int64_t> integer_in(std::string_view word) {
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    std::int64_t value = 0;
    auto const result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (result.ec != std::errc{} || result.ptr != word.data() + word.size()) return std::nullopt;
    return value;
}

bool is_numbered(std::string_view s) { return conversion_in(s).has_value(); }

std::vector<std::string> numbered_files(std::string const& pattern, std::int64_t first, std::int64_t last,
                                        std::int64_t step) {
    auto const conversion = conversion_in(pattern);
    if (!conversion || pattern.find('%', conversion->end) != std::string::npos ||
        pattern.find('%') != conversion->begin)
        throw Error(ErrorKind::data, text("file name pattern '", pattern, "' needs exactly one %d"));
    constexpr std::int64_t farthest = std::int64_t{1} << 40;
    if (step == 0 || std::abs(step) > farthest || first < -farthest || first > farthest || last < -farthest ||
        last > farthest || (step > 0) != (first <= last))
        throw Error(ErrorKind::data, text("file numbers ", first, " to ", last, " by ", step, " make no sequence"));
    std::int64_t const count = (last - first) / step + 1;
    if (count > most_files) throw Error(ErrorKind::data, text("pattern '", pattern, "' stands for ", count, " files"));
    std::vector<std::string> names;
    for (std::int64_t i = 0; i < count; ++i) {
        std::int64_t const number = first + i * step;
        std::string digits = to_text(std::abs(number));
        std::string const sign = number < 0 ? "-" : "";
        std::size_t const length_so_far = digits.size() + sign.size();
        std::size_t const padding = conversion->width > length_so_far ? conversion->width - length_so_far : 0;
        digits =
            conversion->zeros ? sign + std::string(padding, '0') + digits : std::string(padding, ' ') + sign + digits;
        names.push_back(pattern.substr(0, conversion->begin) + digits + pattern.substr(conversion->end));
    }
    return names;
}

void complete_directions(Geometry& geometry, std::array<bool, 3> known) {
    auto& d = geometry.direction;
    auto const count = std::count(known.begin(), known.end(), true);
    if (count == 0) d = Geometry{}.direction;
    if (count == 1) {
        // The next axis along its own coordinate, made perpendicular to the one that is there.
        auto const given = static_cast<std::size_t>(std::find(known.begin(), known.end(), true) - known.begin());
        std::size_t const next = (given + 1) % 3;
        Vec3 helper;
        if (std::abs(d[given][static_cast<int>(next)]) < 0.9)
            helper[static_cast<int>(next)] = 1;
        else
            helper[static_cast<int>(given)] = -1;
        double const along = dot(helper, d[given]);
        Vec3 const v = helper - d[given] * along;
        d[next] = v * (1 / safe_length(v));
        known[next] = true;
    }
    if (count == 1 || count == 2) {
        auto const missing = static_cast<std::size_t>(std::find(known.begin(), known.end(), false) - known.begin());
        Vec3 const v = cross(d[(missing + 1) % 3], d[(missing + 2) % 3]);
        double const l = safe_length(v);
        if (!(l > 1e-9)) throw Error(ErrorKind::data, "the directions of two axes are parallel");
        d[missing] = v * (1 / l);
    }
    for (auto& direction : d) direction = direction + Vec3{}; // no negative zeros
}

void set_axis(Geometry& geometry, int axis, Vec3 vector, std::string const& what) {
    double const l = safe_length(vector);
    if (!(l > 0) || !std::isfinite(l))
        throw Error(ErrorKind::data, text(what, " of axis ", axis, " is zero or not finite"));
    geometry.spacing[axis] = l;
    // Components, not a product with 1/l: axis-aligned directions stay exactly 1.
    geometry.direction[static_cast<std::size_t>(axis)] = {vector.x / l + 0.0, vector.y / l + 0.0,
                                                          vector.z / l + 0.0}; // no negative zeros
}

bool same_lattice(Header const& a, Header const& b) {
    return a.dims == b.dims && a.dtype == b.dtype && same_place(a, b) && a.values == b.values;
}

std::string history_text(History const& history, std::size_t most_bytes) {
    auto const line_of = [](History kept) {
        Header header;
        header.history = std::move(kept);
        std::string const json = to_json(header), key = "\"history\": ";
        std::size_t const begin = json.rfind("\n " + key) + 2 + key.size(); // the last key, on a line of its own
        return json.substr(begin, json.size() - begin - 2);
    };
    for (std::size_t bytes = most_bytes; bytes > 0; bytes /= 2)
        if (std::string line = line_of(folded(history, most_history_steps, bytes)); line.size() <= most_bytes)
            return line;
    return line_of({{}, {}, step_count(history)}); // a single step is too long
}

bool says_error(Header const& header) {
    return !header.error.silent() && (header.history || !(header.error == VolumeError::given()));
}

VolumeError parse_volume_error(std::string const& json) {
    try {
        return volume_error_from_json(json);
    } catch (Error const&) {
        return VolumeError::lost("the file states it in a way that is not understood");
    }
}

std::string attributes_text(std::map<std::string, std::string> const& attributes) {
    return nlohmann::ordered_json(attributes).dump();
}

std::map<std::string, std::string> parse_attributes(std::string const& json) {
    // Through the header's own reader, which guards against nesting and wrong types.
    std::string header = to_json(Header{});
    header.resize(header.rfind('}'));
    try {
        return header_from_json(header + ", \"attributes\": " + json + "}").attributes;
    } catch (Error const&) {
        return {};
    }
}

std::optional<History> parse_history(std::string const& json) {
    // The header's own reader guards against nesting and wrong types; it gets a header that is otherwise trivial.
    std::string header = to_json(Header{});
    std::size_t const end = header.rfind('}');
    if (end == std::string::npos) return std::nullopt;
    header.resize(end);
    header += ", \"history\": " + json + "}";
    try {
        return header_from_json(header).history;
    } catch (Error const&) {
        return std::nullopt;
    }
}

} // namespace vkt
