// The lines of NRRD headers.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/nrrd_header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <array>

namespace vkt {

namespace {

constexpr std::size_t largest_header = std::size_t{16} << 20;

/// Every field of NRRD 1 to 5 by its canonical name.
std::vector<std::string> const& field_names() {
    static std::vector<std::string> const names{
        "content",
        "number",
        "type",
        "block size",
        "dimension",
        "space",
        "space dimension",
        "sizes",
        "spacings",
        "thicknesses",
        "axis mins",
        "axis maxs",
        "space directions",
        "centers",
        "kinds",
        "labels",
        "units",
        "min",
        "max",
        "old min",
        "old max",
        "endian",
        "encoding",
        "line skip",
        "byte skip",
        "sample units",
        "space units",
        "space origin",
        "measurement frame",
        "data file",
    };
    return names;
}

/// Canonical name of a field, also when it is written in one word or under its older name; empty if unknown.
std::string canonical_field(std::string_view word) {
    std::string const name = lower_case(trimmed(word));
    if (name == "centerings") return "centers";
    for (auto const& field : field_names()) {
        if (name == field) return field;
        std::string joined = field;
        joined.erase(std::remove(joined.begin(), joined.end(), ' '), joined.end());
        if (name == joined) return field;
    }
    return {};
}

std::string unescaped(std::string_view s) {
    std::string result;
    for (std::size_t i = 0; i < s.size(); ++i) {
        if (s[i] == '\\' && i + 1 < s.size() && (s[i + 1] == 'n' || s[i + 1] == '\\')) {
            result += s[i + 1] == 'n' ? '\n' : '\\';
            ++i;
        } else {
            result += s[i];
        }
    }
    return result;
}

void add_line(NrrdHeader& header, std::string const& line) {
    std::size_t const colon = line.find(':');
    std::size_t const pair = line.find(":=");
    if (colon != std::string::npos && colon != pair) {
        std::string const field = canonical_field(std::string_view(line).substr(0, colon));
        if (!field.empty()) {
            if (!header.fields.emplace(field, trimmed(std::string_view(line).substr(colon + 1))).second)
                throw Error(ErrorKind::data, text("'", header.name, "': field '", field, "' stands twice"));
            return;
        }
    }
    if (pair != std::string::npos) {
        header.pairs[unescaped(std::string_view(line).substr(0, pair))] =
            unescaped(std::string_view(line).substr(pair + 2));
        return;
    }
    if (colon == std::string::npos)
        throw Error(ErrorKind::data, text("'", header.name, "': '", line.substr(0, 60), "' is no NRRD header line"));
    std::string const word = lower_case(trimmed(std::string_view(line).substr(0, colon)));
    std::string const near = nearest_name(word, field_names());
    throw Error(ErrorKind::data, text("'", header.name, "': unknown NRRD field '", word.substr(0, 60), "'"),
                near.empty() ? "" : text("should it be '", near, "'?"));
}

void read_magic(ByteSource& bytes) {
    auto const magic = bytes.read_line();
    if (!magic || !magic->starts_with("NRRD"))
        throw Error(ErrorKind::data, text("'", bytes.name(), "' is no NRRD file"));
    std::string_view const version = trimmed(std::string_view(*magic).substr(4));
    if (version != "00.01" &&
        (version.size() != 4 || !version.starts_with("000") || version[3] < '1' || version[3] > '5'))
        throw Error(ErrorKind::data,
                    text("'", bytes.name(), "': NRRD version '", version.substr(0, 20), "' is not known (1 to 5 are)"));
}

} // namespace

std::string const& NrrdHeader::operator[](std::string const& field) const {
    static std::string const none;
    auto const found = fields.find(field);
    return found == fields.end() ? none : found->second;
}

NrrdHeader read_nrrd_header(ByteSource& bytes) {
    NrrdHeader header;
    header.name = bytes.name();
    read_magic(bytes);
    std::size_t size = 0;
    bool listing = false;
    while (auto const line = bytes.read_line()) {
        size += line->size() + 1;
        if (size > largest_header) throw Error(ErrorKind::data, text("'", header.name, "': the header exceeds 16 MiB"));
        if (line->empty()) return header;
        if (listing) {
            header.listed_files.push_back(*line);
            continue;
        }
        if (line->front() == '#') continue;
        add_line(header, *line);
        listing = header["data file"].starts_with("LIST");
    }
    if (!header.has("data file"))
        throw Error(ErrorKind::data, text("'", header.name, "' ended early: the header has no end"));
    return header;
}

} // namespace vkt
