// What ImageDescription tags say about a stack: ImageJ's lines, OME's XML, tifffile's shape, vkt's own header.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Planes of a hyperstack and their places in the file.
struct TiffDescription {
    enum class Kind : std::uint8_t { plain, imagej, ome, shaped };
    Kind kind = Kind::plain;
    std::int64_t slices = 0, channels = 1, frames = 1; ///< slices 0: nobody says, all pages are slices
    /// ImageJ, tifffile: pages that there should be; if the file has one, the voxels of the others follow its own.
    std::int64_t images = 0;
    /// OME, tifffile: the page of each plane, [frame][channel][slice]. OME counts all pages of the file, tifffile those
    /// of one size.
    std::vector<std::int64_t> pages;
    /// OME: other files that hold planes, and for each plane which of them has it, from 1 on; 0 is this file. Empty if
    /// all of them lie here. `pages` counts those of each file.
    std::vector<std::string> files;
    std::vector<std::size_t> file_of;
    bool image_found = false; ///< OME: the image that was asked for is there
    std::optional<double> spacing_x, spacing_y, spacing_z, interval;
    std::string interval_unit = "s";
    std::string unit; ///< of the spacing, "mm"; empty: nobody says
    std::vector<std::string> channel_names;
    std::optional<ValueMap> values;
    std::string value_unit;
    std::vector<std::string> not_read;
    std::optional<Header> ours; ///< what vkt wrote
};

/// What a description is about.
struct TiffDescribed {
    std::string file;           ///< its name, for messages
    std::int64_t pages = 1;     ///< of one size
    std::int64_t all_pages = 1; ///< of any size
    std::int64_t samples = 1;   ///< values in each pixel, which OME counts among the channels
    std::string own_name;       ///< as other files call it; empty if it has none
    std::string image;          ///< OME: the one that is asked for; empty, or one that is not there: the first
};

/// Throws Error{data} where a description that is OME's contradicts itself; what is no description at all is plain.
TiffDescription tiff_description(std::string const& text, TiffDescribed const& about);

} // namespace vkt
