// Decoding the pixels of DICOM: what GDCM decodes, and what is read as it lies there or in runs of bytes.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/pixels.h"

#include "libvkt/formats/gdcm/elements.h"
#include "libvkt/formats/gdcm/stream.h"
#include "libvkt/formats/raw_source.h"

#include <gdcmImageReader.h>
#include <gdcmReader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace vkt::dicom {
namespace {

/// Luma and two differences of colour as red, green and blue (PS3.3, C.7.6.3.1.2): the three bytes of a pixel are
/// `apart` from one another.
void luma_to_rgb(std::vector<char>& pixels, std::size_t apart) {
    auto const rounded = [](double v) {
        return static_cast<char>(static_cast<unsigned char>(std::clamp(std::floor(v + 0.5), 0.0, 255.0)));
    };
    for (std::size_t group = 0; group + 3 * apart <= pixels.size(); group += 3 * apart)
        for (std::size_t i = group; i < group + apart; ++i) {
            auto const value = [&](std::size_t k) {
                return static_cast<double>(static_cast<unsigned char>(pixels[i + k * apart]));
            };
            double const luma = value(0), blue = value(1) - 128, red = value(2) - 128;
            pixels[i] = rounded(luma + 1.402 * red);
            pixels[i + apart] = rounded(luma - 0.114 * 1.772 / 0.587 * blue - 0.299 * 1.402 / 0.587 * red);
            pixels[i + 2 * apart] = rounded(luma + 1.772 * blue);
        }
}

/// Runs of bytes (PackBits), which become every `step`th of those of `to`, as many as there is room for.
bool unpack_runs(std::span<unsigned char const> from, std::span<char> to, std::size_t step) {
    std::size_t in = 0, out = 0;
    while (out < to.size()) {
        if (in == from.size()) return false;
        unsigned const control = from[in++];
        if (control == 128) continue;
        bool const literal = control < 128;
        std::size_t const n = literal ? control + 1 : 257 - control;
        if (from.size() - in < (literal ? n : 1)) return false;
        for (std::size_t i = 0; i < n && out < to.size(); ++i, out += step)
            to[out] = static_cast<char>(from[in + (literal ? i : 0)]);
        in += literal ? n : 1;
    }
    return true;
}

} // namespace

void check_pixels(std::istream& stream, gdcm::File const& file, Input const& input, std::int64_t found, Slice& slice) {
    gdcm::TransferSyntax const syntax = file.GetHeader().GetDataSetTransferSyntax();
    // Places in a deflated file are none in what it holds.
    if (syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) return;
    auto const refuse = [&](std::string const& what) {
        throw Error(ErrorKind::data, text("'", input.full(slice.file), "': ended early: ", what));
    };
    std::int64_t at = stream.tellg();
    stream.clear();
    stream.seekg(0, std::ios::end);
    std::int64_t const size = stream.tellg();
    bool const big = syntax == gdcm::TransferSyntax::ExplicitVRBigEndian;
    // Two numbers of 16 bits, a tag, or one of 32.
    auto const word = [&](std::int64_t position, bool tag) {
        std::array<unsigned char, 4> b{};
        stream.seekg(position);
        stream.read(reinterpret_cast<char*>(b.data()), b.size());
        auto const half = [&](std::size_t i) -> std::uint32_t {
            return big ? b[i] * 256U + b[i + 1] : b[i] + b[i + 1] * 256U;
        };
        return tag || big ? half(0) << 16 | half(2) : half(2) << 16 | half(0);
    };
    auto const begin_at = [&](std::int64_t place) {
        return place >= 12 && place <= size &&
               (word(place - 12, true) == 0x7fe00010 || word(place - 8, true) == 0x7fe00010);
    };
    // Where types are missing that a file claims to write, GDCM goes on to its end.
    if (!begin_at(at)) at = found;
    if (!begin_at(at)) refuse("it has no pixels");
    std::uint32_t const length = word(at - 4, false);
    constexpr std::uint32_t undefined = 0xffffffff, item = 0xfffee000, end_of_items = 0xfffee0dd;
    if (length != undefined) {
        std::string const colours = element_text(file.GetDataSet(), 0x0028, 0x0004);
        bool const halved = colours.ends_with("_422") || colours.ends_with("_420"); // some share their chroma
        double const needed = static_cast<double>(slice.columns * slice.rows) * static_cast<double>(slice.frames) *
                              static_cast<double>(halved ? 2 : slice.samples) * static_cast<double>(slice.bits) / 8;
        if (static_cast<double>(length) < needed) refuse("it has fewer pixels than it says");
        if (length > size - at) refuse(text("pixels of ", std::int64_t{length}, " bytes, ", size - at, " found"));
        std::array<char, 2> type{};
        stream.seekg(at - 8);
        stream.read(type.data(), type.size());
        slice.words = word(at - 12, true) != 0x7fe00010 || std::string_view(type.data(), 2) != "OB";
        slice.big_endian = big;
        if (!halved && (slice.bits == 8 || slice.bits == 16 || slice.bits == 32)) slice.pixels_at = at;
        return;
    }
    slice.runs = syntax == gdcm::TransferSyntax::RLELossless;
    if (slice.runs && slice.bits % 8 == 0 && slice.bits <= 32) slice.pixels_at = at;
    while (true) {
        if (size - at < 8) refuse("its encoded pixels have no end");
        std::uint32_t const tag = word(at, true), bytes = word(at + 4, false);
        if (tag == end_of_items) return;
        if (tag != item) refuse("its encoded pixels are no fragments");
        if (bytes > size - at - 8) refuse("a fragment of its encoded pixels is incomplete");
        at += 8 + std::int64_t{bytes};
    }
}

/// Bits of all frames, one after another from the lowest of the first byte on (PS3.5, 8.1.1), as a byte each.
bool FrameDecoder::single_bits(gdcm::DataSet const& set, Slice const& slice) {
    gdcm::ByteValue const* const value =
        set.FindDataElement(pixel_data) ? set.GetDataElement(pixel_data).GetByteValue() : nullptr;
    auto const count = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * slice.frames);
    if (value == nullptr || value->GetPointer() == nullptr || value->GetLength() < (count + 7) / 8) return false;
    pixels_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
        pixels_[i] = static_cast<char>(static_cast<unsigned char>(value->GetPointer()[i / 8]) >> (i % 8) & 1);
    planar_ = false;
    return true;
}

/// All frames of the file, decoded; the last one is kept.
std::vector<char> const& FrameDecoder::pixels(Input const& input, Slice const& slice) {
    if (held_ && held_file_ == slice.file) return pixels_;
    held_ = false;
    held_frame_ = -1;
    std::string const name = input.full(slice.file);
    FileStream stream(name);
    gdcm::ImageReader reader;
    reader.SetStream(stream);
    auto const refuse = [&](std::string const& what) {
        throw Error(ErrorKind::data, text("'", name, "': damaged: ", what));
    };
    if (slice.bits == 1) { // GDCM ends the process
        gdcm::Reader bits;
        bits.SetStream(stream);
        if (!bits.Read() || !single_bits(bits.GetFile().GetDataSet(), slice))
            refuse("its single bits cannot be read, or are encoded, which is not read");
        held_file_ = slice.file;
        held_ = true;
        return pixels_;
    }
    if (!reader.Read()) refuse("its pixels cannot be read by GDCM, or are encoded in a way that it does not know");
    gdcm::Image const& image = reader.GetImage();
    std::int64_t const frames = image.GetNumberOfDimensions() > 2 ? image.GetDimension(2) : 1;
    if (image.GetDimension(0) != slice.columns || image.GetDimension(1) != slice.rows || frames < slice.frames)
        refuse("its pixels have another extent than it says");
    auto const needed = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * frames) *
                        static_cast<std::size_t>(image.GetPixelFormat().GetPixelSize() /
                                                 std::max<unsigned>(image.GetPixelFormat().GetSamplesPerPixel(), 1));
    if (image.GetBufferLength() != needed && image.GetPixelFormat().GetBitsAllocated() != 12)
        refuse("its pixels are not as many as it says");
    pixels_.resize(image.GetBufferLength());
    if (!image.GetBuffer(pixels_.data())) refuse("its pixels cannot be decoded");
    planar_ = image.GetPlanarConfiguration() == 1;
    gdcm::PhotometricInterpretation const colours = image.GetPhotometricInterpretation();
    if (colours == gdcm::PhotometricInterpretation::YBR_FULL ||
        colours == gdcm::PhotometricInterpretation::YBR_FULL_422)
        to_colours(slice);
    auto const bytes = static_cast<std::size_t>((slice.bits + 7) / 8);
    if (pixels_.size() < static_cast<std::size_t>(slice.columns * slice.rows * slice.samples * slice.frames) * bytes)
        refuse("it ended early");
    held_file_ = slice.file;
    held_ = true;
    return pixels_;
}

void FrameDecoder::to_colours(Slice const& slice) {
    if (slice.samples == 3 && slice.bits == 8)
        luma_to_rgb(pixels_, planar_ ? static_cast<std::size_t>(slice.columns * slice.rows) : 1);
}

/// A frame as it lies in the file, in this machine's byte order.
void FrameDecoder::read_plain(std::istream& stream, Slice const& slice) {
    std::int64_t const size = slice.columns * slice.rows * slice.samples * slice.bits / 8, first = size * slice.frame;
    // Bytes of words of two in the other order: those of pairs are exchanged.
    bool const pairs = slice.big_endian && slice.bits == 8 && slice.words;
    std::int64_t const before = pairs ? first % 2 : 0, more = pairs ? (before + size) % 2 : 0;
    pixels_.resize(static_cast<std::size_t>(before + size + more));
    stream.seekg(slice.pixels_at + first - before);
    stream.read(pixels_.data(), std::ssize(pixels_));
    if (stream.gcount() < before + size) pixels_.clear(); // it has become shorter
    std::size_t const element = pairs ? 2 : slice.big_endian ? static_cast<std::size_t>(slice.bits / 8) : 1;
    if (element > 1) swap_bytes(reinterpret_cast<std::byte*>(pixels_.data()), pixels_.size() / element, element);
    if (!pixels_.empty()) {
        pixels_.erase(pixels_.begin(), pixels_.begin() + before);
        pixels_.resize(static_cast<std::size_t>(size));
    }
    planar_ = slice.planar && slice.samples > 1;
}

/// A frame out of its fragment: a segment for each byte of a sample, the highest first, one sample after another
/// (PS3.5, annex G). They become planes.
bool FrameDecoder::read_runs(std::istream& stream, Slice const& slice) {
    auto const number = [](unsigned char const* b) {
        return b[0] | std::uint32_t{b[1]} << 8 | std::uint32_t{b[2]} << 16 | std::uint32_t{b[3]} << 24;
    };
    std::int64_t at = slice.pixels_at;
    std::uint32_t bytes = 0;
    for (std::int64_t i = 0; i <= slice.frame + 1; ++i) { // the first item is a table of the others
        std::array<unsigned char, 8> head{};
        stream.seekg(at);
        stream.read(reinterpret_cast<char*>(head.data()), head.size());
        bytes = number(head.data() + 4);
        if (!stream || number(head.data()) != 0xe000fffe) return false; // item, in the order of its bytes
        at += 8 + (i <= slice.frame ? std::int64_t{bytes} : 0);
    }
    std::vector<unsigned char> fragment(bytes);
    stream.read(reinterpret_cast<char*>(fragment.data()), std::ssize(fragment));
    constexpr std::size_t head = 64;
    auto const width = static_cast<std::size_t>(slice.bits / 8),
               n = static_cast<std::size_t>(slice.columns * slice.rows);
    std::size_t const segments = static_cast<std::size_t>(slice.samples) * width;
    if (!stream || fragment.size() < head || segments > 15 || number(fragment.data()) != segments) return false;
    pixels_.resize(n * segments);
    for (std::size_t i = 0; i < segments; ++i) {
        std::size_t const begin = number(fragment.data() + 4 + 4 * i),
                          end = i + 1 < segments ? number(fragment.data() + 8 + 4 * i) : fragment.size();
        if (begin < head || begin > end || end > fragment.size()) return false;
        std::size_t const sample = i / width, byte = width - 1 - i % width;
        std::span<char> const plane = std::span(pixels_).subspan(sample * n * width, n * width);
        if (!unpack_runs(std::span(fragment).subspan(begin, end - begin), plane.subspan(byte), width)) return false;
    }
    planar_ = true;
    return true;
}

std::span<char const> FrameDecoder::frame_of(Input const& input, Slice const& slice) {
    auto const bytes = static_cast<std::size_t>(slice.bits <= 8 ? 1 : slice.bits <= 16 ? 2 : 4);
    auto const size = static_cast<std::size_t>(slice.columns * slice.rows * slice.samples) * bytes;
    if (slice.pixels_at < 0) {
        std::vector<char> const& all = pixels(input, slice);
        if (all.size() < size * static_cast<std::size_t>(slice.frame + 1))
            input.fail("ended early: a frame is missing");
        return std::span(all).subspan(size * static_cast<std::size_t>(slice.frame), size);
    }
    if (held_ && held_file_ == slice.file && held_frame_ == slice.frame) return pixels_;
    held_ = false;
    FileStream stream(input.full(slice.file));
    if (slice.runs && !read_runs(stream, slice))
        throw Error(ErrorKind::data, text("'", input.full(slice.file), "': damaged: its runs of bytes are no frame"));
    if (!slice.runs) read_plain(stream, slice);
    if (pixels_.size() != size) throw Error(ErrorKind::data, text("'", input.full(slice.file), "' has become shorter"));
    if (slice.photometric == "YBR_FULL") to_colours(slice);
    held_file_ = slice.file;
    held_frame_ = slice.frame;
    held_ = true;
    return pixels_;
}

} // namespace vkt::dicom
