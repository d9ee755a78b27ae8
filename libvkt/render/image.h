// Pictures: linear float pixels, and PNG files of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/byte_source.h"
#include "libvkt/render/colormap.h"

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace vkt::render {

/// Row by row from the top: premultiplied linear red, green, blue and the transmittance (1 - alpha).
struct Image {
    int width = 0, height = 0;
    std::vector<float> pixels;

    float const* at(int x, int y) const {
        return pixels.data() +
               4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
    }
};

/// Floats beside the colours, a plane each, under the name that OpenEXR has for it: "Z", "normal.X".
struct Layer {
    std::string name;
    std::vector<float> values; ///< width * height
};

/// What shows where nothing else does. sRGB; alpha 0 keeps the picture transparent.
struct Background {
    Color color{0.07, 0.075, 0.09};
    double alpha = 1;
};

/// Eight bits per channel in sRGB: RGB if the background is opaque, else RGBA with straight alpha. The background is
/// laid behind in linear light; rounding is to nearest.
std::vector<unsigned char> to_bytes(Image const& image, Background const& background);

/// Light over the background: linear red, green, blue, premultiplied, and alpha.
std::array<float, 4> over(float const* pixel, Background const& background);

/// How much is done for a small file.
struct PngEffort {
    int threads = 1;
    bool quick = false; ///< somebody waits: the file may be larger
};

/// A PNG file (sRGB chunk, given text chunks as keyword and text) of 8 or 16 bits a channel. The same picture gives the
/// same bytes, whatever the threads.
std::vector<std::byte> to_png(Image const& image, Background const& background,
                              std::vector<std::pair<std::string, std::string>> const& texts, int depth = 8,
                              PngEffort effort = {});

/// Whether these bytes begin a PNG file.
bool is_png(std::span<std::byte const> head);
/// The texts of a PNG file in chunks such as to_png() writes (iTXt, not compressed), in their order; reads it to its
/// end. Throws Error{data} if it ends early or a chunk is damaged.
std::vector<std::pair<std::string, std::string>> read_png_texts(ByteSource& bytes);

} // namespace vkt::render
