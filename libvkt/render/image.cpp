// Pictures: sRGB bytes and PNG.
// SPDX-License-Identifier: MIT
#include "libvkt/render/image.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/png_rows.h"

#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

namespace vkt::render {

namespace {

/// linear_to_srgb in 8 bits without pow per pixel: the thresholds between neighbouring levels are exact.
class Encoder {
public:
    Encoder() {
        for (std::size_t i = 0; i < 255; ++i)
            thresholds_[i] = static_cast<float>(srgb_to_linear((static_cast<double>(i) + 0.5) / 255));
    }
    unsigned char operator()(float linear) const {
        return static_cast<unsigned char>(std::upper_bound(thresholds_.begin(), thresholds_.end(), linear) -
                                          thresholds_.begin());
    }

private:
    std::array<float, 255> thresholds_{};
};

void append(png_structp png, png_bytep data, std::size_t n) {
    auto& out = *static_cast<std::vector<std::byte>*>(png_get_io_ptr(png));
    auto const* bytes = reinterpret_cast<std::byte const*>(data);
    out.insert(out.end(), bytes, bytes + n);
}

[[noreturn]] void fail(png_structp, char const* message) {
    std::string const what = message;
    bool const memory = what.find("memory") != std::string::npos;
    throw Error(memory ? ErrorKind::resources : ErrorKind::failure, "cannot encode PNG: " + what);
}

/// Whatever it warns of and goes on with has no place among the messages of a stage.
void ignore(png_structp, char const*) {}

} // namespace

namespace {

/// Pixels as bytes of sRGB, three channels over an opaque background, else four.
class Levels8 {
public:
    explicit Levels8(Background const& background) : opaque_(background.alpha >= 1) {
        auto const linear = [](double v) { return static_cast<float>(srgb_to_linear(v)); };
        back_ = {linear(background.color.red), linear(background.color.green), linear(background.color.blue)};
        back_alpha_ = static_cast<float>(background.alpha);
    }
    std::size_t channels() const { return opaque_ ? 3 : 4; }
    void row(float const* pixels, std::size_t n, unsigned char* to) const {
        std::size_t const channels = this->channels();
        for (std::size_t i = 0; i < n; ++i, to += channels) {
            float const* p = pixels + 4 * i;
            if (i > 0 && std::memcmp(p, p - 4, 4 * sizeof(float)) == 0) { // as most of the background is
                std::memcpy(to, to - channels, channels);
                continue;
            }
            float const behind = p[3] * back_alpha_, alpha = 1 - p[3] * (1 - back_alpha_);
            for (std::size_t c = 0; c < 3; ++c) {
                float const light = p[c] + behind * back_[c];
                to[c] = encode_(opaque_ ? light : alpha > 0 ? light / alpha : 0.0F);
            }
            if (!opaque_) to[3] = static_cast<unsigned char>(std::lround(255 * std::clamp(alpha, 0.0F, 1.0F)));
        }
    }

private:
    Encoder encode_;
    bool opaque_;
    std::array<float, 3> back_{};
    float back_alpha_ = 1;
};

} // namespace

std::vector<unsigned char> to_bytes(Image const& image, Background const& background) {
    Levels8 const levels(background);
    std::size_t const n = image.pixels.size() / 4;
    std::vector<unsigned char> bytes(n * levels.channels());
    levels.row(image.pixels.data(), n, bytes.data());
    return bytes;
}

std::array<float, 4> over(float const* pixel, Background const& background) {
    auto const alpha = static_cast<float>(background.alpha);
    auto const linear = [&](double v) { return pixel[3] * alpha * static_cast<float>(srgb_to_linear(v)); };
    return {pixel[0] + linear(background.color.red), pixel[1] + linear(background.color.green),
            pixel[2] + linear(background.color.blue), 1 - pixel[3] * (1 - alpha)};
}

namespace {

/// The same in 16 bits, of which the high ones come first.
void wide_row(float const* pixels, std::size_t n, Background const& background, unsigned char* to) {
    bool const opaque = background.alpha >= 1;
    auto const put = [&](double share) {
        auto const level = static_cast<unsigned>(std::lround(65535 * std::clamp(share, 0.0, 1.0)));
        *to++ = static_cast<unsigned char>(level >> 8);
        *to++ = static_cast<unsigned char>(level & 255);
    };
    std::size_t const size = opaque ? 6 : 8;
    for (std::size_t i = 0; i < n; ++i) {
        float const* p = pixels + 4 * i;
        if (i > 0 && std::memcmp(p, p - 4, 4 * sizeof(float)) == 0) {
            std::memcpy(to, to - size, size);
            to += size;
            continue;
        }
        std::array<float, 4> const light = over(p, background);
        for (std::size_t c = 0; c < 3; ++c)
            put(linear_to_srgb(opaque ? light[c] : light[3] > 0 ? light[c] / light[3] : 0.0F));
        if (!opaque) put(light[3]);
    }
}

} // namespace

std::vector<std::byte> to_png(Image const& image, Background const& background,
                              std::vector<std::pair<std::string, std::string>> const& texts, int depth,
                              PngEffort effort) {
    bool const opaque = background.alpha >= 1;
    Levels8 const levels(background);
    auto const width = static_cast<std::size_t>(image.width), channels = levels.channels(),
               pixel = channels * (depth == 16 ? 2 : 1);
    auto const fill = [&](int y, unsigned char* to) {
        float const* const row = image.pixels.data() + 4 * width * static_cast<std::size_t>(y);
        if (depth == 16)
            wide_row(row, width, background, to);
        else
            levels.row(row, width, to);
    };
    constexpr int usual = 5, quick = 1;
    auto const strips =
        packed_rows({image.height, width * pixel, pixel, fill}, effort.quick ? quick : usual, effort.threads);
    std::vector<std::byte> out;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, fail, ignore);
    if (png == nullptr) throw Error(ErrorKind::resources, "no memory for the PNG encoder");
    png_infop info = png_create_info_struct(png);
    try {
        if (info == nullptr) throw Error(ErrorKind::resources, "no memory for the PNG encoder");
        png_set_write_fn(png, &out, append, nullptr);
        png_set_IHDR(png, info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height), depth,
                     opaque ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE,
                     PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
        std::vector<png_text> chunks;
        for (auto const& [key, value] : texts) {
            png_text chunk{};
            chunk.compression = PNG_ITXT_COMPRESSION_NONE;
            chunk.key = const_cast<char*>(key.c_str());
            chunk.text = const_cast<char*>(value.c_str());
            chunk.itxt_length = value.size();
            chunks.push_back(chunk);
        }
        if (!chunks.empty()) png_set_text(png, info, chunks.data(), static_cast<int>(chunks.size()));
        png_write_info(png, info);
        for (auto const& strip : strips)
            png_write_chunk(png, reinterpret_cast<png_const_bytep>("IDAT"), strip.data(), strip.size());
        png_write_chunk(png, reinterpret_cast<png_const_bytep>("IEND"), nullptr, 0);
    } catch (...) {
        png_destroy_write_struct(&png, &info);
        throw;
    }
    png_destroy_write_struct(&png, &info);
    return out;
}

namespace {

constexpr std::string_view signature = "\x89PNG\r\n\x1a\n";

std::uint32_t big_endian(std::byte const* bytes) {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint32_t>(bytes[i]);
    return value;
}

/// Keyword and text of an iTXt chunk; nothing of a compressed one.
std::optional<std::pair<std::string, std::string>> text_of(std::string_view chunk) {
    std::size_t const end = chunk.find('\0');
    if (end == std::string_view::npos || chunk.size() < end + 3 || chunk[end + 1] != 0) return {};
    std::size_t const language = chunk.find('\0', end + 3);
    std::size_t const keyword = language == std::string_view::npos ? language : chunk.find('\0', language + 1);
    if (keyword == std::string_view::npos) return {};
    return std::pair(std::string(chunk.substr(0, end)), std::string(chunk.substr(keyword + 1)));
}

} // namespace

bool is_png(std::span<std::byte const> head) {
    return head.size() >= signature.size() && std::memcmp(head.data(), signature.data(), signature.size()) == 0;
}

std::vector<std::pair<std::string, std::string>> read_png_texts(ByteSource& bytes) {
    auto const damaged = [&](char const* how) {
        return Error(ErrorKind::data, vkt::text("the PNG picture '", bytes.name(), "' ", how));
    };
    constexpr std::uint32_t most = 16 << 20; // of a text; what is longer is passed over
    std::vector<std::pair<std::string, std::string>> texts;
    bytes.skip(static_cast<std::int64_t>(signature.size()));
    for (;;) {
        std::array<std::byte, 8> head{};
        bytes.read_exactly(head.data(), head.size());
        std::uint32_t const length = big_endian(head.data());
        std::string_view const type(reinterpret_cast<char const*>(head.data()) + 4, 4);
        if (length > 0x7fffffff) throw damaged("has an impossible chunk");
        if (type == "IEND") return texts;
        if (type != "iTXt" || length > most) {
            std::array<std::byte, 4> sum{};
            bytes.skip(length);
            bytes.read_exactly(sum.data(), sum.size()); // is there, and with it all before it
            continue;
        }
        std::string chunk(std::size_t{length} + 4, '\0');
        bytes.read_exactly(chunk.data(), chunk.size());
        uLong sum = crc32(0, reinterpret_cast<Bytef const*>(type.data()), 4);
        sum = crc32(sum, reinterpret_cast<Bytef const*>(chunk.data()), length);
        if (sum != big_endian(reinterpret_cast<std::byte const*>(chunk.data()) + length))
            throw damaged("is damaged: a checksum does not match");
        chunk.resize(length);
        if (auto found = text_of(chunk)) texts.push_back(std::move(*found));
    }
}

} // namespace vkt::render
