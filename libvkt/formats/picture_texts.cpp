// Texts of pictures.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/picture_texts.h"

#include "libvkt/formats/header_text.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>

namespace vkt {
namespace {

constexpr std::size_t most_history = 400'000;

std::string big_endian(std::uint32_t number) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(number >> shift & 255);
    return bytes;
}

} // namespace

PictureTexts texts_of_history(History const& history) {
    return {{"Software", "vkt " VKT_VERSION},
            {"History", history_as_shell(history)},
            {history_keyword, history_text(history, most_history)}};
}

std::string png_text_chunk(std::string const& keyword, std::string const& content) {
    std::string chunk = "iTXt" + keyword;
    chunk.append(5, '\0'); // ends the keyword; not compressed, of no language, with no other keyword
    chunk += content;
    uLong const sum = crc32(0, reinterpret_cast<Bytef const*>(chunk.data()), static_cast<uInt>(chunk.size()));
    return big_endian(static_cast<std::uint32_t>(chunk.size() - 4)) + chunk +
           big_endian(static_cast<std::uint32_t>(sum));
}

std::string with_png_texts(std::string const& file, PictureTexts const& texts) {
    constexpr std::size_t head = 8 + 12 + 13; // signature and IHDR, which is the first chunk
    std::string result = file.substr(0, head);
    for (auto const& [keyword, content] : texts) result += png_text_chunk(keyword, content);
    return result.append(file, std::min(head, file.size()), std::string::npos);
}

} // namespace vkt
