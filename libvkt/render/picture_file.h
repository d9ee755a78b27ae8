// Files of pictures: PNG, PFM and OpenEXR, written from light and read back as light.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/picture_texts.h"
#include "libvkt/render/image.h"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace vkt::render {

enum class PictureFormat : std::uint8_t { png, pfm, exr };

/// By the suffix of its name; without one PNG. Throws Error{usage} for others.
PictureFormat picture_format(std::string const& path);
/// What names of pictures may end in.
std::vector<std::string> picture_suffixes();

/// Where the first pixel of a picture lies in the whole one; whole_width 0: it is the whole one.
struct Part {
    int x = 0, y = 0, whole_width = 0, whole_height = 0;
    friend bool operator==(Part const&, Part const&) = default;
};

struct PictureOptions {
    PictureFormat format = PictureFormat::png;
    int depth = 0; ///< bits a channel: 8 or 16 of PNG, 16 or 32 of OpenEXR, 32 of PFM; 0: 8, 32, 32
    Part part;
    PngEffort png{};
};

/// Throws Error{usage} for a depth or a transparent background that the format does not have, Error{failure} for a
/// format that this build lacks.
void check(PictureOptions const& options, Background const& background, std::string const& path);

using vkt::PictureTexts;

/// PNG: sRGB, texts in chunks. OpenEXR: linear, premultiplied, texts as attributes, layers as channels (which keep 32
/// bits). PFM: linear colours over the background and nothing else. RGB if the background is opaque, else RGBA, which
/// PFM does not have: check() first. The same picture gives the same bytes.
std::vector<std::byte> encode_picture(Image const& image, Background const& background,
                                      std::vector<Layer> const& layers, PictureTexts const& texts,
                                      PictureOptions const& options);

/// A picture that was read.
struct PictureContents {
    Image image; ///< without alpha the transmittance is 0 everywhere
    bool alpha = false;
    std::vector<Layer> layers; ///< of OpenEXR
    PictureTexts texts;
    PictureOptions options; ///< that would write it again

    /// The text under this keyword; empty if there is none.
    std::string text(std::string_view keyword) const;
};

/// PNG of any kind, PFM and OpenEXR, by content. Throws Error{data} for other and for damaged files.
PictureContents read_picture(ByteSource& bytes);

/// Whether these bytes begin such a file.
bool is_picture_file(std::span<std::byte const> head);

} // namespace vkt::render
