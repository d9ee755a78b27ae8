// PFM: three lines of text, then floats.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/pfm.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/whole_file.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>

namespace vkt {
namespace {

void swap_bytes(std::byte* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) std::reverse(values + 4 * i, values + 4 * i + 4);
}

constexpr bool little = std::endian::native == std::endian::little;

} // namespace

std::vector<std::byte> pfm_bytes(PfmPicture const& picture) {
    std::string const head =
        text(picture.channels == 3 ? "PF\n" : "Pf\n", picture.width, " ", picture.height, "\n-1.0\n");
    std::size_t const row = 4 * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.channels);
    std::vector<std::byte> bytes(head.size() + row * static_cast<std::size_t>(picture.height));
    std::memcpy(bytes.data(), head.data(), head.size());
    auto const* const from = reinterpret_cast<std::byte const*>(picture.values.data());
    for (int y = 0; y < picture.height; ++y)
        std::memcpy(bytes.data() + head.size() + static_cast<std::size_t>(picture.height - 1 - y) * row,
                    from + static_cast<std::size_t>(y) * row, row);
    if (!little) swap_bytes(bytes.data() + head.size(), picture.values.size());
    return bytes;
}

bool is_pfm(std::span<std::byte const> head) {
    if (head.size() < 3) return false;
    auto const at = [&](std::size_t i) { return static_cast<char>(head[i]); };
    return at(0) == 'P' && (at(1) == 'F' || at(1) == 'f') && at(2) == '\n';
}

PfmPicture read_pfm(ByteSource& bytes) {
    auto const refuse = [&](std::string const& why) {
        return Error(ErrorKind::data, text("the PFM picture '", bytes.name(), "' ", why));
    };
    auto const line = [&] {
        auto const read = bytes.read_line();
        if (!read) throw refuse("ended early");
        return *read;
    };
    PfmPicture picture;
    picture.channels = line() == "PF" ? 3 : 1;
    auto const size = split(line(), ' ');
    auto const side = [&](std::string const& word) {
        if (word.empty() || word.size() > 6 || word.find_first_not_of("0123456789") != std::string::npos)
            throw refuse("does not say its size");
        std::int64_t const n = parse_integer(word);
        if (n < 1 || n > most_picture_side) throw refuse(text("has ", n, " pixels one way"));
        return static_cast<int>(n);
    };
    if (size.size() != 2) throw refuse("does not say its size");
    picture.width = side(size[0]), picture.height = side(size[1]);
    std::string const scale = line();
    if (!is_number(scale) || parse_double(scale) == 0) throw refuse("does not say its byte order");
    bool const is_little = parse_double(scale) < 0;
    std::size_t const row = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.channels);
    for (int y = picture.height - 1; y >= 0; --y) { // rows are there before memory is taken for them
        std::vector<float> values(row);
        bytes.read_exactly(values.data(), 4 * row);
        picture.values.insert(picture.values.end(), values.begin(), values.end());
    }
    if (is_little != little) swap_bytes(reinterpret_cast<std::byte*>(picture.values.data()), picture.values.size());
    for (int y = 0; y < picture.height / 2; ++y) {
        auto const at = [&](int i) { return picture.values.begin() + static_cast<std::ptrdiff_t>(row) * i; };
        std::swap_ranges(at(y), at(y + 1), at(picture.height - 1 - y));
    }
    return picture;
}

} // namespace vkt
