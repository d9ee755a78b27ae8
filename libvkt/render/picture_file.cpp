// Files of pictures: what each format keeps, PNG decoded with libpng.
// SPDX-License-Identifier: MIT
#include "libvkt/render/picture_file.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/exr.h"
#include "libvkt/formats/pfm.h"
#include "libvkt/formats/whole_file.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace vkt::render {

namespace {

/// Under this keyword a PNG file keeps which part it is: "x y width height", of the whole picture.
constexpr char part_keyword[] = "Part of picture";

char const* name_of(PictureFormat format) {
    return format == PictureFormat::png ? "PNG" : format == PictureFormat::pfm ? "PFM" : "OpenEXR";
}

std::vector<int> depths_of(PictureFormat format) {
    if (format == PictureFormat::png) return {8, 16};
    return format == PictureFormat::exr ? std::vector{32, 16} : std::vector{32};
}

std::vector<std::byte> encode_pfm(Image const& image, Background const& background) {
    PfmPicture picture{image.width, image.height, 3, {}};
    picture.values.reserve(image.pixels.size() / 4 * 3);
    for (std::size_t i = 0; i < image.pixels.size(); i += 4) {
        auto const light = over(image.pixels.data() + i, background);
        picture.values.insert(picture.values.end(), light.begin(), light.begin() + 3);
    }
    return pfm_bytes(picture);
}

std::vector<std::byte> encode_exr(Image const& image, Background const& background, std::vector<Layer> const& layers,
                                  PictureTexts const& texts, PictureOptions const& options) {
    FloatPicture picture;
    picture.width = image.width, picture.height = image.height;
    picture.x = options.part.x, picture.y = options.part.y;
    picture.whole_width = options.part.whole_width, picture.whole_height = options.part.whole_height;
    picture.texts = texts;
    std::size_t const n = image.pixels.size() / 4, channels = background.alpha < 1 ? 4 : 3;
    for (std::size_t c = 0; c < channels; ++c)
        picture.planes.push_back({std::string(1, "RGBA"[c]), std::vector<float>(n), options.depth == 16});
    for (std::size_t i = 0; i < n; ++i) {
        auto const light = over(image.pixels.data() + 4 * i, background);
        for (std::size_t c = 0; c < channels; ++c) picture.planes[c].values[i] = light[c];
    }
    for (Layer const& layer : layers) picture.planes.push_back({layer.name, layer.values, false});
    return exr_bytes(picture, "writing OpenEXR");
}

/// What libpng wants from memory.
struct PngBytes {
    std::span<std::byte const> bytes;
    std::size_t at = 0;
};

void take(png_structp png, png_bytep to, std::size_t n) {
    auto& from = *static_cast<PngBytes*>(png_get_io_ptr(png));
    if (n > from.bytes.size() - from.at) throw Error(ErrorKind::data, "it ended early");
    std::memcpy(to, from.bytes.data() + from.at, n);
    from.at += n;
}
[[noreturn]] void fail_reading(png_structp, char const* message) { throw Error(ErrorKind::data, message); }
void ignore_warning(png_structp, char const*) {}

/// Channels of 8 or 16 bits as linear light.
void store(png_bytep row, bool wide, bool alpha, std::vector<float> const& linear, float* to, int width) {
    std::size_t const channels = alpha ? 4 : 3;
    auto const level = [&](std::size_t i) {
        return wide ? std::size_t{row[2 * i]} << 8 | row[2 * i + 1] : std::size_t{row[i]};
    };
    auto const most = static_cast<float>(linear.size() - 1);
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); ++x, to += 4) {
        float const share = alpha ? static_cast<float>(level(4 * x + 3)) / most : 1.0F;
        for (std::size_t c = 0; c < 3; ++c) to[c] = linear[level(channels * x + c)] * share;
        to[3] = 1 - share;
    }
}

void decode_png(std::span<std::byte const> bytes, PictureContents& into) {
    PngBytes from{bytes};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, fail_reading, ignore_warning);
    if (png == nullptr) throw Error(ErrorKind::resources, "no memory for the PNG decoder");
    png_infop info = png_create_info_struct(png);
    try {
        if (info == nullptr) throw Error(ErrorKind::resources, "no memory for the PNG decoder");
        png_set_read_fn(png, &from, take);
        png_set_user_limits(png, most_picture_side, most_picture_side);
        png_read_info(png, info);
        png_set_expand(png);
        png_set_gray_to_rgb(png);
        int const passes = png_set_interlace_handling(png);
        png_read_update_info(png, info);
        into.image.width = static_cast<int>(png_get_image_width(png, info));
        into.image.height = static_cast<int>(png_get_image_height(png, info));
        bool const wide = png_get_bit_depth(png, info) == 16;
        into.options.depth = wide ? 16 : 8;
        into.alpha = (png_get_color_type(png, info) & PNG_COLOR_MASK_ALPHA) != 0;
        std::size_t const row = png_get_rowbytes(png, info);
        std::vector<unsigned char> levels(row * static_cast<std::size_t>(into.image.height));
        for (int pass = 0; pass < passes; ++pass)
            for (int y = 0; y < into.image.height; ++y)
                png_read_row(png, levels.data() + static_cast<std::size_t>(y) * row, nullptr);
        png_read_end(png, nullptr);
        std::vector<float> linear(wide ? 65536 : 256);
        for (std::size_t i = 0; i < linear.size(); ++i)
            linear[i] =
                static_cast<float>(srgb_to_linear(static_cast<double>(i) / static_cast<double>(linear.size() - 1)));
        auto const width = static_cast<std::size_t>(into.image.width);
        into.image.pixels.resize(4 * width * static_cast<std::size_t>(into.image.height));
        for (std::size_t y = 0; y < static_cast<std::size_t>(into.image.height); ++y)
            store(levels.data() + y * row, wide, into.alpha, linear, into.image.pixels.data() + 4 * width * y,
                  into.image.width);
    } catch (...) {
        png_destroy_read_struct(&png, &info, nullptr);
        throw;
    }
    png_destroy_read_struct(&png, &info, nullptr);
}

PictureContents contents_of_png(ByteSource& bytes) {
    PictureContents picture;
    std::vector<std::byte> const file = whole_file(bytes, most_picture_bytes);
    ByteSource again(bytes.name(), [&, at = std::size_t{0}](std::byte* to, std::size_t n) mutable {
        std::size_t const part = std::min(n, file.size() - at);
        std::memcpy(to, file.data() + at, part);
        at += part;
        return part;
    });
    picture.texts = read_png_texts(again);
    try {
        decode_png(file, picture);
    } catch (Error const& error) {
        throw Error(error.kind(), vkt::text("the PNG picture '", bytes.name(), "' cannot be read: ", error.what()));
    }
    std::string const part = picture.text(part_keyword);
    std::erase_if(picture.texts, [](auto const& entry) { return entry.first == part_keyword; });
    auto const words = part.empty() ? std::vector<std::string>{} : split(part, ' ');
    if (words.size() == 4)
        picture.options.part = {static_cast<int>(parse_integer(words[0])), static_cast<int>(parse_integer(words[1])),
                                static_cast<int>(parse_integer(words[2])), static_cast<int>(parse_integer(words[3]))};
    return picture;
}

PictureContents contents_of_pfm(ByteSource& bytes) {
    PfmPicture const pfm = read_pfm(bytes);
    PictureContents picture;
    picture.options = {PictureFormat::pfm, 32, {}};
    picture.image = {pfm.width, pfm.height, {}};
    auto const channels = static_cast<std::size_t>(pfm.channels);
    for (std::size_t i = 0; i < pfm.values.size(); i += channels)
        for (std::size_t c = 0; c < 4; ++c)
            picture.image.pixels.push_back(c == 3 ? 0.0F : pfm.values[i + std::min(c, channels - 1)]);
    return picture;
}

PictureContents contents_of_exr(ByteSource& bytes) {
    FloatPicture exr = read_exr(bytes);
    PictureContents picture;
    picture.texts = std::move(exr.texts);
    picture.image = {exr.width, exr.height, {}};
    auto const n = static_cast<std::size_t>(exr.width) * static_cast<std::size_t>(exr.height);
    FloatPicture::Plane const* planes[4] = {exr.find("R"), exr.find("G"), exr.find("B"), exr.find("A")};
    if (planes[0] == nullptr && planes[1] == nullptr && planes[2] == nullptr)
        std::fill_n(planes, 3, exr.find("Y")); // grey
    for (auto const* plane : {planes[0], planes[1], planes[2]})
        if (plane == nullptr)
            throw Error(ErrorKind::data,
                        vkt::text("the OpenEXR picture '", bytes.name(), "' has neither R, G and B nor Y"));
    picture.alpha = planes[3] != nullptr;
    picture.options = {
        PictureFormat::exr, planes[0]->half ? 16 : 32, {exr.x, exr.y, exr.whole_width, exr.whole_height}};
    picture.image.pixels.resize(4 * n);
    for (std::size_t i = 0; i < n; ++i) {
        float* const p = picture.image.pixels.data() + 4 * i;
        for (std::size_t c = 0; c < 3; ++c) p[c] = planes[c]->values[i];
        p[3] = picture.alpha ? 1 - planes[3]->values[i] : 0.0F;
    }
    for (FloatPicture::Plane& plane : exr.planes)
        if (std::find(std::begin(planes), std::end(planes), &plane) == std::end(planes))
            picture.layers.push_back({plane.name, std::move(plane.values)});
    return picture;
}

} // namespace

std::vector<std::string> picture_suffixes() { return {".png", ".exr", ".pfm"}; }

PictureFormat picture_format(std::string const& path) {
    std::string const name = lower_case(path.substr(path.rfind('/') + 1));
    if (name.ends_with(".exr")) return PictureFormat::exr;
    if (name.ends_with(".pfm")) return PictureFormat::pfm;
    auto const dot = name.rfind('.');
    bool const bare = dot == std::string::npos || name.find_first_not_of('.') >= dot;
    if (!bare && !name.ends_with(".png"))
        throw Error(ErrorKind::usage, vkt::text("'", path, "': files of that kind are not written"),
                    vkt::text("end the name in ", join(picture_suffixes(), " or ")));
    return PictureFormat::png;
}

void check(PictureOptions const& options, Background const& background, std::string const& path) {
    auto const possible = depths_of(options.format);
    if (options.depth != 0 && std::find(possible.begin(), possible.end(), options.depth) == possible.end())
        throw Error(ErrorKind::usage,
                    vkt::text("--depth ", options.depth, ": ", name_of(options.format), " pictures have ",
                              join(collect(possible, [](int d) { return to_text(d); }), " or "), " bits a channel"));
    if (options.format == PictureFormat::pfm && background.alpha < 1)
        throw Error(ErrorKind::usage,
                    vkt::text("'", path, "': PFM pictures have no alpha, and the background is clear"),
                    "write OpenEXR or PNG, or make the background opaque");
    if (options.format == PictureFormat::pfm && options.part.whole_width > 0)
        throw Error(ErrorKind::usage, vkt::text("'", path, "': PFM pictures do not say which part of another they are"),
                    "write OpenEXR or PNG");
    if (options.format == PictureFormat::exr) require_exr(vkt::text(path, ": writing OpenEXR"));
}

std::vector<std::byte> encode_picture(Image const& image, Background const& background,
                                      std::vector<Layer> const& layers, PictureTexts const& texts,
                                      PictureOptions const& options) {
    if (options.format == PictureFormat::pfm) return encode_pfm(image, background);
    if (options.format == PictureFormat::exr) return encode_exr(image, background, layers, texts, options);
    PictureTexts all = texts;
    Part const& p = options.part;
    if (p.whole_width > 0)
        all.emplace_back(part_keyword, vkt::text(p.x, " ", p.y, " ", p.whole_width, " ", p.whole_height));
    return to_png(image, background, all, options.depth == 16 ? 16 : 8, options.png);
}

std::string PictureContents::text(std::string_view keyword) const {
    for (auto const& [key, value] : texts)
        if (key == keyword) return value;
    return {};
}

bool is_picture_file(std::span<std::byte const> head) { return is_png(head) || is_pfm(head) || is_exr(head); }

PictureContents read_picture(ByteSource& bytes) {
    auto const head = bytes.peek(8);
    if (is_png(head)) return contents_of_png(bytes);
    if (is_exr(head)) return contents_of_exr(bytes);
    if (is_pfm(head)) return contents_of_pfm(bytes);
    throw Error(ErrorKind::data, vkt::text("'", bytes.name(), "' is no PNG, PFM or OpenEXR picture"));
}

} // namespace vkt::render
