// The module openexr: files in memory, written and read with OpenEXR.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/exr.h"
#include "libvkt/formats/whole_file.h"
#include "libvkt/io/module.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <half.h>

#include <algorithm>
#include <cstring>

namespace vkt {
namespace {

class MemoryOutput : public Imf::OStream {
public:
    explicit MemoryOutput(std::vector<std::byte>& bytes) : OStream("a picture"), bytes_(bytes) {}
    void write(char const* from, int n) override {
        auto const count = static_cast<std::size_t>(n);
        bytes_.resize(std::max(bytes_.size(), at_ + count));
        std::memcpy(bytes_.data() + at_, from, count);
        at_ += count;
    }
    std::uint64_t tellp() override { return at_; }
    void seekp(std::uint64_t to) override { at_ = to; }

private:
    std::vector<std::byte>& bytes_;
    std::size_t at_ = 0;
};

class MemoryInput : public Imf::IStream {
public:
    MemoryInput(std::span<std::byte const> bytes, std::string const& name) : IStream(name.c_str()), bytes_(bytes) {}
    bool read(char* to, int n) override {
        auto const count = static_cast<std::size_t>(n);
        if (at_ > bytes_.size() || count > bytes_.size() - at_) throw Error(ErrorKind::data, "it ended early");
        std::memcpy(to, bytes_.data() + at_, count);
        at_ += count;
        return at_ < bytes_.size();
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t to) override { at_ = to; }

private:
    std::span<std::byte const> bytes_;
    std::size_t at_ = 0;
};

/// Where a plane would begin if it began at the data window's origin, as frame buffers are described.
char* origin_of(void* first, Imath::Box2i const& window, std::size_t pixel, std::size_t row) {
    return static_cast<char*>(first) - static_cast<std::ptrdiff_t>(pixel) * window.min.x -
           static_cast<std::ptrdiff_t>(row) * window.min.y;
}

std::vector<std::byte> encode(FloatPicture const& picture) {
    Imath::Box2i const data{{picture.x, picture.y}, {picture.x + picture.width - 1, picture.y + picture.height - 1}};
    bool const part = picture.whole_width > 0;
    Imath::Box2i const display{
        {0, 0}, {(part ? picture.whole_width : picture.width) - 1, (part ? picture.whole_height : picture.height) - 1}};
    Imf::Header header(display, data);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (auto const& [name, value] : picture.texts) header.insert(name, Imf::StringAttribute(value));
    Imf::FrameBuffer buffer;
    std::vector<std::vector<half>> halves;
    halves.reserve(picture.planes.size());
    for (FloatPicture::Plane const& plane : picture.planes) {
        Imf::PixelType const type = plane.half ? Imf::HALF : Imf::FLOAT;
        header.channels().insert(plane.name, Imf::Channel(type));
        void* first = const_cast<float*>(plane.values.data());
        std::size_t const size = plane.half ? sizeof(half) : sizeof(float);
        if (plane.half) first = halves.emplace_back(plane.values.begin(), plane.values.end()).data();
        std::size_t const row = size * static_cast<std::size_t>(picture.width);
        buffer.insert(plane.name, Imf::Slice(type, origin_of(first, data, size, row), size, row));
    }
    std::vector<std::byte> bytes;
    try {
        MemoryOutput stream(bytes);
        Imf::OutputFile file(stream, header, 0);
        file.setFrameBuffer(buffer);
        file.writePixels(picture.height);
    } catch (Error const&) {
        throw;
    } catch (std::bad_alloc const&) {
        throw;
    } catch (std::exception const& error) {
        throw Error(ErrorKind::failure, text("cannot encode OpenEXR: ", error.what()));
    }
    return bytes;
}

/// Attributes end where they say, within the file: OpenEXR takes memory for texts and lists before it reads them.
void check_attributes(std::span<std::byte const> bytes) {
    auto const number = [&](std::size_t at) {
        std::uint32_t value = 0;
        for (std::size_t i = 4; i-- > 0;) value = value << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
        return value;
    };
    auto const ended = [] { throw Error(ErrorKind::data, "its header ended early"); };
    if (bytes.size() < 8) ended();
    bool const several_parts = (number(4) & 0x1000) != 0;
    std::size_t at = 8;
    auto const word = [&] { // without its zero, behind which `at` is then
        std::size_t const begin = at;
        while (at < bytes.size() && bytes[at] != std::byte{0}) ++at;
        if (at++ >= bytes.size()) ended();
        return at - 1 - begin;
    };
    for (;;) {
        if (word() == 0) { // the end of a header, and of all of them if the next is empty
            if (!several_parts || (at < bytes.size() && bytes[at] == std::byte{0})) return;
            continue;
        }
        word(); // its type
        if (bytes.size() - at < 4 || number(at) > bytes.size() - at - 4) ended();
        at += 4 + number(at);
    }
}

FloatPicture decode_unguarded(std::span<std::byte const> bytes, std::string const& name) {
    check_attributes(bytes);
    // Before it takes memory for their lines.
    Imf::Header::setMaxImageSize(most_picture_side, most_picture_side);
    Imf::Header::setMaxTileSize(most_picture_side, most_picture_side);
    MemoryInput stream(bytes, name);
    Imf::InputFile file(stream, 0);
    Imf::Header const& header = file.header();
    Imath::Box2i const data = header.dataWindow(), display = header.displayWindow();
    auto const side = [](int low, int high) { return std::int64_t{high} - low + 1; };
    std::int64_t const width = side(data.min.x, data.max.x), height = side(data.min.y, data.max.y);
    if (width < 1 || height < 1 || width > most_picture_side || height > most_picture_side)
        throw Error(ErrorKind::data, text("it has ", width, " by ", height, " pixels"));
    FloatPicture picture;
    picture.width = static_cast<int>(width), picture.height = static_cast<int>(height);
    if (data != display) {
        std::int64_t const whole_width = side(display.min.x, display.max.x),
                           whole_height = side(display.min.y, display.max.y);
        std::int64_t const x = std::int64_t{data.min.x} - display.min.x, y = std::int64_t{data.min.y} - display.min.y;
        if (x < 0 || y < 0 || x + width > whole_width || y + height > whole_height || whole_width > most_picture_side ||
            whole_height > most_picture_side)
            throw Error(ErrorKind::data, "its pixels lie outside of its display window");
        picture.x = static_cast<int>(x), picture.y = static_cast<int>(y);
        picture.whole_width = static_cast<int>(whole_width), picture.whole_height = static_cast<int>(whole_height);
    }
    for (auto i = header.begin(); i != header.end(); ++i)
        if (auto const* const value = dynamic_cast<Imf::StringAttribute const*>(&i.attribute()))
            picture.texts.emplace_back(i.name(), value->value());
    Imf::FrameBuffer buffer;
    constexpr std::size_t most_planes = 64;
    for (auto i = header.channels().begin(); i != header.channels().end(); ++i) {
        if (i.channel().xSampling != 1 || i.channel().ySampling != 1)
            throw Error(ErrorKind::data, text("its channel ", i.name(), " is subsampled"));
        if (picture.planes.size() == most_planes)
            throw Error(ErrorKind::data, text("it has more than ", most_planes, " channels"));
        picture.planes.push_back({i.name(), {}, i.channel().type == Imf::HALF});
    }
    // Nothing is allocated for what the file cannot hold: no compression packs more tightly than this.
    constexpr double densest = 16384, at_least = 64 << 20;
    double const needed = static_cast<double>(width * height) * 4 * static_cast<double>(picture.planes.size());
    if (needed > std::max(at_least, densest * static_cast<double>(bytes.size())))
        throw Error(ErrorKind::data, text("it ended early: ", width, " by ", height, " pixels in ",
                                          bytes_text(static_cast<double>(bytes.size()))));
    for (FloatPicture::Plane& plane : picture.planes) {
        plane.values.resize(static_cast<std::size_t>(width * height));
        std::size_t const row = sizeof(float) * static_cast<std::size_t>(width);
        buffer.insert(plane.name, Imf::Slice(Imf::FLOAT, origin_of(plane.values.data(), data, sizeof(float), row),
                                             sizeof(float), row));
    }
    file.setFrameBuffer(buffer);
    file.readPixels(data.min.y, data.max.y);
    return picture;
}

FloatPicture decode(std::span<std::byte const> bytes, std::string const& name) {
    try {
        return decode_unguarded(bytes, name);
    } catch (std::bad_alloc const&) {
        throw;
    } catch (std::exception const& error) {
        throw Error(ErrorKind::data, text("the OpenEXR picture '", name, "' cannot be read: ", error.what()));
    }
}

constexpr ExrFunctions functions{encode, decode};

} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_openexr;
vkt::ModuleExport const vkt_module_openexr{VKT_VERSION, &vkt::functions, nullptr};
}
