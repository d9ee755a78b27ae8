// Radiance pictures: lines of text, the size, then rows of pixels with run lengths.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/radiance.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/whole_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace vkt {
namespace {

using Pixel = std::array<std::uint8_t, 4>; ///< red, green, blue, exponent

Error refusal(ByteSource const& bytes, std::string const& why) {
    return {ErrorKind::data, text("the Radiance picture '", bytes.name(), "' ", why)};
}

/// The bytes behind the header.
struct Rest {
    ByteSource const& source;
    std::vector<std::byte> bytes;
    std::size_t at = 0;

    std::uint8_t next() {
        if (at == bytes.size()) throw refusal(source, "ended early");
        return static_cast<std::uint8_t>(bytes[at++]);
    }
    Pixel next_pixel() {
        Pixel pixel;
        for (std::uint8_t& part : pixel) part = next();
        return pixel;
    }
};

/// A row whose four planes are packed one after the other: a count above 128 repeats a value, others are copied.
void read_planes(Rest& rest, std::vector<Pixel>& row) {
    for (std::size_t plane = 0; plane < 4; ++plane)
        for (std::size_t x = 0; x < row.size();) {
            std::size_t const count = rest.next();
            bool const repeats = count > 128;
            std::size_t const n = repeats ? count - 128 : count;
            if (n == 0 || n > row.size() - x) throw refusal(rest.source, "has a run that does not fit its row");
            std::uint8_t const value = repeats ? rest.next() : 0;
            for (std::size_t i = 0; i < n; ++i) row[x++][plane] = repeats ? value : rest.next();
        }
}

/// A row of whole pixels, of which "1 1 1 n" repeats the one before; several such give more digits to the count.
void read_pixels(Rest& rest, Pixel first, std::vector<Pixel>& row) {
    int shift = 0;
    for (std::size_t x = 0; x < row.size();) {
        Pixel const pixel = x == 0 ? first : rest.next_pixel();
        if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
            row[x++] = pixel;
            shift = 0;
            continue;
        }
        std::size_t const n = std::size_t{pixel[3]} << shift;
        if (x == 0 || shift > 16 || n > row.size() - x)
            throw refusal(rest.source, "has a run that does not fit its row");
        for (std::size_t i = 0; i < n; ++i, ++x) row[x] = row[x - 1];
        shift += 8;
    }
}

} // namespace

bool is_radiance(std::span<std::byte const> head) {
    std::string_view const begin(reinterpret_cast<char const*>(head.data()), head.size());
    return begin.starts_with("#?RADIANCE") || begin.starts_with("#?RGBE");
}

RadiancePicture read_radiance(ByteSource& bytes) {
    double exposure = 1;
    auto const line = [&] {
        auto const read = bytes.read_line();
        if (!read) throw refusal(bytes, "ended early");
        return *read;
    };
    for (std::string words = line(); !words.empty(); words = line()) {
        if (words.starts_with("FORMAT=") && words != "FORMAT=32-bit_rle_rgbe")
            throw refusal(bytes, text("has ", words, ", not red, green and blue"));
        if (!words.starts_with("EXPOSURE=")) continue;
        std::string const number = words.substr(std::min(words.size(), words.find_first_not_of(' ', 9)));
        if (!is_number(number) || !(parse_double(number) > 0)) throw refusal(bytes, text("has ", words));
        exposure *= parse_double(number);
    }
    auto const size = split(line(), ' ');
    auto const side = [&](std::string const& word) {
        bool const number =
            !word.empty() && word.size() < 7 && word.find_first_not_of("0123456789") == std::string::npos;
        std::int64_t const n = number ? parse_integer(word) : 0;
        if (n < 1 || n > most_picture_side) throw refusal(bytes, "does not say its size, 1 to 16384 pixels each way");
        return static_cast<int>(n);
    };
    if (size.size() != 4 || size[0] != "-Y" || size[2] != "+X")
        throw refusal(bytes, "does not have its rows from the top and its columns from the left");
    RadiancePicture picture{side(size[3]), side(size[1]), {}};
    std::vector<Pixel> row(static_cast<std::size_t>(picture.width));
    Rest rest{bytes, whole_file(bytes, most_picture_bytes)};
    for (int y = 0; y < picture.height; ++y) {
        Pixel const first = rest.next_pixel();
        bool const packed = first[0] == 2 && first[1] == 2 && first[2] < 128;
        if (packed && first[2] * 256 + first[3] != picture.width) throw refusal(bytes, "has a row of another width");
        if (packed)
            read_planes(rest, row);
        else
            read_pixels(rest, first, row);
        for (Pixel const& pixel : row) {
            double const unit = pixel[3] == 0 ? 0 : std::ldexp(1 / exposure, pixel[3] - 136);
            for (std::size_t c = 0; c < 3; ++c) picture.values.push_back(static_cast<float>(pixel[c] * unit));
        }
    }
    return picture;
}

} // namespace vkt
