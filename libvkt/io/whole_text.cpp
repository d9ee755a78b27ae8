// Reading a text file of moderate size.
// SPDX-License-Identifier: MIT
#include "libvkt/io/whole_text.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/byte_source.h"

namespace vkt {

std::string whole_text(std::string const& file, std::size_t most) {
    constexpr std::size_t piece = std::size_t{1} << 16;
    auto const bytes = open_bytes(file);
    std::string content;
    while (content.size() <= most) {
        std::size_t const before = content.size();
        content.resize(before + piece);
        std::size_t const n = bytes->read(content.data() + before, piece);
        content.resize(before + n);
        if (n == 0) return content;
    }
    throw Error(ErrorKind::data,
                text("'", file, "' is too long: it has more than ", bytes_text(static_cast<double>(most))));
}

} // namespace vkt
