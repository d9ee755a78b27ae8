// Making volumes of TIFF's pages.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tiff/layout.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace vkt::tiff {
namespace {

/// What so many bytes can at most become.
double densest(std::uint16_t compression) {
    switch (compression) {
    case COMPRESSION_NONE:
        return 1;
    case COMPRESSION_PACKBITS:
        return 64;
    case COMPRESSION_LZW:
        return 4096;
    case COMPRESSION_DEFLATE:
    case COMPRESSION_ADOBE_DEFLATE:
        return 1032;
    default:
        return 1e5;
    }
}

/// Nothing is allocated for pages that the file cannot hold.
void check_size(Pages const& pages, Page const& page, std::int64_t planes) {
    double const size = pages.bytes();
    if (!(size > 0)) return;
    double const decoded = static_cast<double>(page.width) * page.height * page.bits / 8 * static_cast<double>(planes);
    if (decoded > size * densest(page.compression) + 64)
        pages.fail(text("ended early: ", planes, " planes of ", static_cast<std::int64_t>(page.width), " by ",
                        static_cast<std::int64_t>(page.height), " pixels are ", bytes_text(decoded), ", the file has ",
                        bytes_text(size)));
}

/// Voxels stay in the order of the file; the geometry says how the picture is to be seen, its origin being the corner
/// that is seen top left.
void orient(Geometry& geometry, Index3 dims, std::uint16_t orientation) {
    bool const rows_are_columns = orientation >= ORIENTATION_LEFTTOP && orientation <= ORIENTATION_LEFTBOT;
    bool const from_right = orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_BOTRIGHT ||
                            orientation == ORIENTATION_RIGHTTOP || orientation == ORIENTATION_RIGHTBOT;
    bool const from_below = orientation == ORIENTATION_BOTRIGHT || orientation == ORIENTATION_BOTLEFT ||
                            orientation == ORIENTATION_RIGHTBOT || orientation == ORIENTATION_LEFTBOT;
    int const across = rows_are_columns ? 1 : 0; // the axis of the volume that is seen as horizontal
    for (int seen = 0; seen < 2; ++seen) {
        int const axis = seen == 0 ? across : 1 - across;
        bool const back = seen == 0 ? from_right : from_below;
        Vec3 direction{0, 0, 0};
        direction[seen] = back ? -1 : 1;
        geometry.direction[static_cast<std::size_t>(axis)] = direction;
        if (back) geometry.origin[seen] = static_cast<double>(dims[axis] - 1) * geometry.spacing[axis];
    }
}

/// Reduced pages show the same as full ones, if their sides are in the same proportion: their pixels are larger, and
/// the middle of the first lies further in, by what is returned along x and y.
Vec3 lie_over_the_full_image(std::optional<Page> const& full, Index3 dims, Geometry& geometry) {
    Vec3 further_in{0, 0, 0};
    if (!full) return further_in;
    double const x = static_cast<double>(full->width) / static_cast<double>(dims.x),
                 y = static_cast<double>(full->height) / static_cast<double>(dims.y);
    // Sides are rounded to whole pixels.
    if (std::abs(static_cast<double>(full->width) / y - static_cast<double>(dims.x)) > 1 &&
        std::abs(static_cast<double>(full->height) / x - static_cast<double>(dims.y)) > 1)
        return further_in; // a picture of something else
    for (int axis = 0; axis < 2; ++axis) {
        double const factor = axis == 0 ? x : y, step = geometry.spacing[axis];
        geometry.spacing[axis] = step * factor;
        further_in[axis] = step * (factor - 1) / 2;
    }
    return further_in;
}

} // namespace

DataType type_of(Pages const& pages, Page const& page) {
    int const bits = page.bits;
    if (page.compression == COMPRESSION_SGILOG || page.compression == COMPRESSION_SGILOG24 ||
        page.compression == COMPRESSION_OJPEG)
        pages.fail("its pages are encoded for display, as LogLuv or old JPEG", "convert it first: tiffcp -c zip");
    if (page.photometric == PHOTOMETRIC_YCBCR && page.compression != COMPRESSION_JPEG)
        pages.fail("its colours are subsampled (YCbCr)", "convert it first: tiff2rgba");
    if (!TIFFIsCODECConfigured(page.compression))
        pages.fail(text("its compression, number ", static_cast<int>(page.compression), ", is unknown to this libtiff"),
                   "convert it first: tiffcp -c zip");
    for (Page const& any : pages.taken())
        if (any.predictor != PREDICTOR_NONE)
            pages.fail(
                text("it states differences between pixels (Predictor ", static_cast<int>(any.predictor),
                     ") with compression ", static_cast<int>(any.compression),
                     ", which has none: readers do not agree what its values are"),
                "tifffile takes them for differences, tiffcp -c zip does not: convert it with the one that is right");
    switch (page.format) {
    case SAMPLEFORMAT_IEEEFP:
        if (bits == 16) return DataType::float16;
        if (bits == 32) return DataType::float32;
        if (bits == 64) return DataType::float64;
        break;
    case SAMPLEFORMAT_INT:
        if (bits == 8) return DataType::int8;
        if (bits == 16) return DataType::int16;
        if (bits == 32) return DataType::int32;
        if (bits == 64) return DataType::int64;
        break;
    case SAMPLEFORMAT_UINT:
    case SAMPLEFORMAT_VOID:
        if (bits == 64) return DataType::uint64;
        if (bits >= 1 && bits <= 32)
            return bits <= 8 ? DataType::uint8 : bits <= 16 ? DataType::uint16 : DataType::uint32;
        break;
    default:
        pages.fail("its values are complex numbers; a volume has one number in each voxel",
                   "take a part of them with tifffile");
    }
    pages.fail(text("its values have ", bits, " bits, which no type of voxel has"));
}

void read_geometry(Pages const& pages, TiffDescription const& about, Header& header) {
    Words const& words = pages.words();
    auto const spacing = [](double resolution, double unit) {
        double const s = unit / resolution;
        return resolution > 0 && std::isfinite(s) && s > 0 ? s : 1;
    };
    std::string unit = about.unit;
    bool const counted = about.kind == TiffDescription::Kind::imagej; // pixels per unit of the description
    if (words.resolution_x > 0 && words.resolution_y > 0) {
        double per = 1;
        if (!counted || (unit.empty() && words.resolution_unit != RESUNIT_NONE)) {
            per = words.resolution_unit == RESUNIT_CENTIMETER ? 10 : words.resolution_unit == RESUNIT_INCH ? 25.4 : 1;
            if (per != 1 && about.kind != TiffDescription::Kind::ome) unit = "mm";
        }
        header.geometry.spacing.x = spacing(words.resolution_x, per);
        header.geometry.spacing.y = spacing(words.resolution_y, per);
    }
    if (about.kind == TiffDescription::Kind::ome) header.geometry.spacing = {1, 1, 1};
    if (about.spacing_x) header.geometry.spacing.x = *about.spacing_x;
    if (about.spacing_y) header.geometry.spacing.y = *about.spacing_y;
    if (about.spacing_z) header.geometry.spacing.z = *about.spacing_z;
    if (!unit.empty() && unit.find('"') == std::string::npos)
        header.attributes["space units"] = text("\"", unit, "\" \"", unit, "\" \"", unit, "\"");
    if (about.values) header.values = *about.values;
    header.units = about.value_unit;
    Geometry& geometry = header.geometry;
    Vec3 const further_in = lie_over_the_full_image(pages.full(), header.dims, geometry);
    orient(geometry, header.dims, pages.taken().front().orientation);
    for (int seen = 0; seen < 2; ++seen)
        geometry.origin[seen] +=
            std::abs(geometry.direction[0][seen]) * further_in.x + std::abs(geometry.direction[1][seen]) * further_in.y;
}

std::vector<Plane> arrange(Pages const& pages, TiffDescription const& about, ParsedGrids& grids) {
    Page const& first = pages.taken().front();
    auto const count = static_cast<std::int64_t>(pages.taken().size());
    std::int64_t slices = about.slices, channels = about.channels, frames = about.frames;
    bool const one_block = count == 1 && about.images > 1;
    std::int64_t const there = one_block ? about.images : count;
    if (slices == 0) slices = there;
    if (about.pages.empty() && slices * channels * frames != there) {
        if (slices * channels * frames > there)
            pages.fail(text("ended early: its description speaks of ", slices * channels * frames,
                            " pages, the file holds ", there));
        slices = there;
        channels = frames = 1;
    }
    std::int64_t const samples = first.samples;
    check_size(pages, first, there * samples);
    grids.volumes = frames * channels * samples;
    grids.header.dims = {first.width, first.height, slices};
    static char const* const rgb[] = {"red", "green", "blue", "alpha"};
    bool const colours = first.photometric == PHOTOMETRIC_RGB || first.photometric == PHOTOMETRIC_YCBCR;
    std::vector<Plane> planes;
    for (std::int64_t t = 0; t < frames; ++t)
        for (std::int64_t c = 0; c < channels; ++c)
            for (std::int64_t s = 0; s < samples; ++s) {
                for (std::int64_t z = 0; z < slices; ++z) {
                    std::int64_t const page =
                        !about.pages.empty() ? about.pages[static_cast<std::size_t>((t * channels + c) * slices + z)]
                        : about.kind == TiffDescription::Kind::imagej ? (t * slices + z) * channels + c
                                                                      : t * slices + z;
                    planes.push_back({static_cast<std::size_t>(page), static_cast<std::uint16_t>(s)});
                }
                std::map<std::string, std::string> said;
                std::int64_t const channel = c * samples + s;
                if (channels * samples > 1) {
                    bool const named = channel < std::ssize(about.channel_names) &&
                                       !about.channel_names[static_cast<std::size_t>(channel)].empty();
                    said["channel"] = named              ? about.channel_names[static_cast<std::size_t>(channel)]
                                      : colours && s < 4 ? std::string(rgb[s])
                                                         : to_text(channel);
                }
                if (frames > 1) {
                    said["sequence position"] = to_text(static_cast<double>(t) * about.interval.value_or(1));
                    said["sequence step"] = to_text(about.interval.value_or(1));
                    if (about.interval) said["sequence units"] = text("\"", about.interval_unit, "\"");
                }
                if (grids.volumes > 1) grids.attributes.push_back(std::move(said));
            }
    return planes;
}

void find_places(Pages const& pages, std::vector<Plane> const& planes, TiffDescription const& about,
                 ParsedGrids& grids) {
    if (pages.several_files()) return;
    std::error_code error;
    std::uint64_t const size = std::filesystem::file_size(pages.path(), error);
    for (Page const& page : pages.taken()) {
        if (page.begin == 0) return;
        if (!error && page.end > size)
            pages.fail(text("ended early: a page's voxels end at byte ", static_cast<std::int64_t>(page.end), " of ",
                            static_cast<std::int64_t>(size)));
    }
    bool const one_block = pages.taken().size() == 1 && about.images > 1;
    auto const slice = static_cast<std::int64_t>(pages.taken().front().width) * pages.taken().front().height *
                       pages.taken().front().bits / 8;
    for (Plane const& plane : planes) {
        Page const& page = pages.taken()[one_block ? 0 : plane.page];
        grids.places.push_back(static_cast<std::int64_t>(page.begin) +
                               (one_block ? static_cast<std::int64_t>(plane.page) * slice : 0));
    }
    grids.big_endian = TIFFIsBigEndian(pages.handle()) != 0;
}

} // namespace vkt::tiff
