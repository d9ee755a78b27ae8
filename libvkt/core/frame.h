// World frames: what the axes of the world mean, and one lattice as seen from another frame.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <string>
#include <string_view>

namespace vkt {

/// ITK's and DICOM's frame, the one of MetaImage files.
inline constexpr std::string_view lps_frame = "left-posterior-superior";

/// The frame's full name as NRRD has it, from what the attribute "space" may hold: short forms such as "RAS", any case,
/// with or without "-time". "" is no frame: nobody knows what the axes mean.
std::string frame_name(std::string_view space);
std::string frame_of(Header const& header);
/// True for left-posterior-superior, right-anterior-superior and left-anterior-superior, which differ in signs only.
bool is_anatomical(std::string_view frame);
/// True if positions in one frame can be told in the other: both anatomical, or the same, known or not.
bool comparable_frames(std::string_view a, std::string_view b);

/// The header's lattice in a frame comparable with its own; in any other it is returned as it is.
Geometry geometry_in(std::string_view frame, Header const& header);
/// The lattice of `other` in the frame of `here`, and in its unit of lengths if both say theirs. Throws Error{usage} if
/// their frames cannot be compared.
Geometry geometry_beside(Header const& here, Header const& other);
/// What a header says of the frame and the unit in which the numbers of its lattice, taken from `like`, are meant.
void take_world(Header const& like, Header& header);
/// True if both lattices are the same in a common frame and unit, as same_geometry has it.
bool same_place(Header const& a, Header const& b);

} // namespace vkt
