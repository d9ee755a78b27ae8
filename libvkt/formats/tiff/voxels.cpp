// Reading TIFF's strips and tiles of integers and floats of any width that a volume can hold.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tiff/voxels.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/tiff/complaint.h"

#include <algorithm>
#include <cstring>

namespace vkt::tiff {
namespace {

void copy_row(Page const& page, DataType type, std::byte const* row, std::uint32_t first, std::uint32_t count,
              std::uint16_t sample, std::byte* to) {
    std::size_t const per_pixel = page.planar == PLANARCONFIG_SEPARATE ? 1 : page.samples;
    std::size_t const element = size_of(type);
    if (page.bits == 8 * element) {
        std::byte const* from = row + (first * per_pixel + sample) * element;
        if (per_pixel == 1) {
            std::memcpy(to, from, count * element);
            return;
        }
        for (std::uint32_t i = 0; i < count; ++i)
            std::memcpy(to + i * element, from + i * per_pixel * element, element);
        return;
    }
    for (std::uint32_t i = 0; i < count; ++i) {
        std::size_t bit = ((first + i) * per_pixel + sample) * page.bits;
        std::uint32_t value = 0;
        if (page.bits == 24) { // libtiff has put its bytes into the order of this machine
            std::byte const* const p = row + bit / 8;
            value = std::to_integer<std::uint32_t>(p[0]) | std::to_integer<std::uint32_t>(p[1]) << 8 |
                    std::to_integer<std::uint32_t>(p[2]) << 16;
        } else {
            for (int left = page.bits; left > 0; --left, ++bit)
                value = value << 1 | (std::to_integer<std::uint32_t>(row[bit / 8]) >> (7 - bit % 8) & 1u);
        }
        if (element == 1) {
            to[i] = static_cast<std::byte>(value);
        } else if (element == 2) {
            auto const narrow = static_cast<std::uint16_t>(value);
            std::memcpy(to + i * 2, &narrow, 2);
        } else {
            std::memcpy(to + i * 4, &value, 4);
        }
    }
}

} // namespace

/// A strip or tile, decoded.
std::byte const* PlaneReader::unit(Pages const& pages, std::size_t page, std::uint32_t index, std::size_t bytes) {
    if (held_page_ == page && held_unit_ == index && held_.size() == bytes) return held_.data();
    held_page_ = static_cast<std::size_t>(-1);
    held_.resize(bytes);
    complaint().clear();
    auto const size = static_cast<tmsize_t>(bytes);
    tmsize_t const got = pages.taken()[page].tiled ? TIFFReadEncodedTile(pages.handle(), index, held_.data(), size)
                                                   : TIFFReadEncodedStrip(pages.handle(), index, held_.data(), size);
    if (got < size)
        pages.fail(text("damaged: ", pages.taken()[page].tiled ? "tile " : "strip ", static_cast<std::int64_t>(index),
                        " of page ", static_cast<std::int64_t>(page), " cannot be decoded",
                        complaint().empty() ? "" : ": ", complaint()));
    held_page_ = page;
    held_unit_ = index;
    return held_.data();
}

void PlaneReader::read(Pages& pages, Plane const& plane, DataType type, Box const& box, std::byte* slice) {
    std::size_t const element = size_of(type);
    Index3 const size = box.dims();
    pages.go_to(plane.page);
    Page const& page = pages.taken()[plane.page];
    auto const y0 = static_cast<std::uint32_t>(box.lower.y), y1 = static_cast<std::uint32_t>(box.upper.y);
    auto const x0 = static_cast<std::uint32_t>(box.lower.x), x1 = static_cast<std::uint32_t>(box.upper.x);
    std::uint16_t const apart = page.planar == PLANARCONFIG_SEPARATE ? plane.sample : std::uint16_t{0};
    std::uint16_t const within = page.planar == PLANARCONFIG_SEPARATE ? std::uint16_t{0} : plane.sample;
    auto const place = [&](std::uint32_t x, std::uint32_t y) {
        return slice + (static_cast<std::size_t>(y - y0) * static_cast<std::size_t>(size.x) + (x - x0)) * element;
    };
    if (page.tiled) {
        std::uint32_t width = 0, height = 0;
        TIFFGetField(pages.handle(), TIFFTAG_TILEWIDTH, &width);
        TIFFGetField(pages.handle(), TIFFTAG_TILELENGTH, &height);
        auto const bytes = static_cast<std::size_t>(TIFFTileSize64(pages.handle()));
        auto const row = static_cast<std::size_t>(TIFFTileRowSize64(pages.handle()));
        if (width == 0 || height == 0 || bytes == 0 || row * height > bytes)
            pages.fail("damaged: its tiles have no size");
        for (std::uint32_t ty = y0 / height * height; ty < y1; ty += height)
            for (std::uint32_t tx = x0 / width * width; tx < x1; tx += width) {
                std::byte const* const tile =
                    unit(pages, plane.page, TIFFComputeTile(pages.handle(), tx, ty, 0, apart), bytes);
                std::uint32_t const from = std::max(tx, x0), until = std::min(tx + width, x1);
                for (std::uint32_t y = std::max(ty, y0); y < std::min(ty + height, y1); ++y)
                    copy_row(page, type, tile + (y - ty) * row, from - tx, until - from, within, place(from, y));
            }
        return;
    }
    std::uint32_t rows = 0;
    TIFFGetFieldDefaulted(pages.handle(), TIFFTAG_ROWSPERSTRIP, &rows);
    rows = std::min(rows, page.height);
    auto const row = static_cast<std::size_t>(TIFFScanlineSize64(pages.handle()));
    if (rows == 0 || row == 0) pages.fail("damaged: its strips have no rows");
    for (std::uint32_t sy = y0 / rows * rows; sy < y1; sy += rows) {
        std::uint32_t const here = std::min(rows, page.height - sy);
        std::byte const* const strip =
            unit(pages, plane.page, TIFFComputeStrip(pages.handle(), sy, apart), row * std::size_t{here});
        for (std::uint32_t y = std::max(sy, y0); y < std::min(sy + rows, y1); ++y)
            copy_row(page, type, strip + (y - sy) * row, x0, x1 - x0, within, place(x0, y));
    }
}

} // namespace vkt::tiff
