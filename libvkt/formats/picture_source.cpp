// Planes of pixels as volumes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/picture_source.h"

#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/exr.h"
#include "libvkt/formats/pfm.h"
#include "libvkt/formats/raw_source.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace vkt {
namespace {

/// The planes of a picture that is held.
class PlaneSource : public Source {
public:
    PlaneSource(FloatPicture picture, std::string name, ReadOptions const& options)
        : picture_(std::move(picture)), name_(std::move(name)) {
        if (!options.variable.empty()) choose(options.variable);
        header_.dims = {picture_.width, picture_.height, 1};
        if (options.spacing) header_.geometry.spacing = *options.spacing;
        // A part of a larger picture lies where it is there.
        header_.geometry.origin.x = picture_.x * header_.geometry.spacing.x;
        header_.geometry.origin.y = picture_.y * header_.geometry.spacing.y;
        mark_as_given(header_);
        check(header_);
    }

    bool next_volume() override {
        if (index_ + 1 >= std::ssize(picture_.planes)) return false;
        FloatPicture::Plane const& plane = picture_.planes[static_cast<std::size_t>(++index_)];
        header_.dtype = plane.half ? DataType::float16 : DataType::float32;
        if (picture_.planes.size() > 1 || plane.name != "Y") header_.attributes["channel"] = in_utf8(plane.name);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void finish() override {}

    void read(AnyView out) override {
        if (out.box.empty()) return;
        if (!box_of(header_.dims).contains(out.box) || index_ < 0)
            throw Error(ErrorKind::failure, text("region ", out.box, " is outside of '", name_, "'"));
        FloatPicture::Plane const& plane = picture_.planes[static_cast<std::size_t>(index_)];
        std::int64_t const n = out.dims().x;
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; ++y) {
            float const* const from = plane.values.data() + y * header_.dims.x + out.box.lower.x;
            std::byte* const to = out.at(out.box.lower.x, y, 0);
            if (!plane.half) {
                std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(float));
                continue;
            }
            for (std::int64_t x = 0; x < n; ++x) { // which held them exactly before
                Half const half(from[x]);
                std::memcpy(to + x * static_cast<std::int64_t>(sizeof half), &half, sizeof half);
            }
        }
    }

private:
    void choose(std::string const& channel) {
        auto const& planes = picture_.planes;
        auto const names = collect(planes, [](FloatPicture::Plane const& plane) { return plane.name; });
        if (std::find(names.begin(), names.end(), channel) == names.end())
            throw Error(ErrorKind::usage,
                        text("'", name_, "' has no channel '", channel, "', but ", join(names, ", ")));
        std::erase_if(picture_.planes, [&](FloatPicture::Plane const& plane) { return plane.name != channel; });
    }

    FloatPicture picture_;
    std::string name_;
    Header header_;
    std::int64_t index_ = -1;
};

/// The numbers behind the magic of a PGM file, between which comments may stand; one blank ends the last.
std::int64_t pgm_number(ByteSource& bytes) {
    constexpr std::int64_t most = 1 << 20;
    auto const fail = [&](char const* what) { throw Error(ErrorKind::data, text("'", bytes.name(), "': ", what)); };
    auto const next = [&]() -> char {
        std::byte one{};
        bytes.read_exactly(&one, 1);
        return static_cast<char>(one);
    };
    char c = next();
    while (c == '#' || c == ' ' || (c >= '\t' && c <= '\r')) {
        while (c == '#') {
            while (c != '\n' && c != '\r') c = next();
        }
        c = next();
    }
    std::int64_t number = 0;
    for (; c >= '0' && c <= '9'; c = next()) {
        number = number * 10 + (c - '0');
        if (number > most) fail("a number in its header is too large");
    }
    if (c != ' ' && !(c >= '\t' && c <= '\r')) fail("its header is no PGM header");
    return number;
}

} // namespace

bool is_pgm(std::span<std::byte const> head) {
    if (head.size() < 3) return false;
    auto const at = [&](std::size_t i) { return static_cast<char>(head[i]); };
    bool const blank = at(2) == ' ' || at(2) == '#' || (at(2) >= '\t' && at(2) <= '\r');
    return at(0) == 'P' && (at(1) == '2' || at(1) == '3' || at(1) == '5' || at(1) == '6') && blank;
}

std::unique_ptr<Source> open_pgm(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::byte magic[2]{};
    bytes->read_exactly(magic, sizeof magic);
    char const kind = static_cast<char>(magic[1]);
    RawLayout layout;
    layout.header.dims.x = pgm_number(*bytes);
    layout.header.dims.y = pgm_number(*bytes);
    std::int64_t const highest = pgm_number(*bytes);
    if (highest < 1 || highest > 65535)
        throw Error(ErrorKind::data,
                    text("'", bytes->name(), "': its highest value, ", highest, ", is not 1 to 65535"));
    layout.header.dtype = highest > 255 ? DataType::uint16 : DataType::uint8;
    layout.big_endian = true;
    if (kind == '2' || kind == '3') layout.encoding = Encoding::text;
    if (kind == '3' || kind == '6') layout.components.count = 3;
    if (options.spacing) layout.header.geometry.spacing = *options.spacing;
    return raw_source(std::move(bytes), std::move(layout));
}

std::unique_ptr<Source> open_pfm(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    PfmPicture const pfm = read_pfm(*bytes);
    FloatPicture picture;
    picture.width = pfm.width, picture.height = pfm.height;
    auto const channels = static_cast<std::size_t>(pfm.channels);
    for (std::size_t c = 0; c < channels; ++c) {
        FloatPicture::Plane plane{channels == 1 ? "Y" : std::string(1, "RGB"[c]), {}, false};
        for (std::size_t i = c; i < pfm.values.size(); i += channels) plane.values.push_back(pfm.values[i]);
        picture.planes.push_back(std::move(plane));
    }
    return std::make_unique<PlaneSource>(std::move(picture), bytes->name(), options);
}

std::unique_ptr<Source> open_exr(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    return std::make_unique<PlaneSource>(read_exr(*bytes), bytes->name(), options);
}

} // namespace vkt
