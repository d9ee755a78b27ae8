// Segmentations as 3D Slicer keeps them (.seg.nrrd): a volume of labels in NRRD whose pairs say what each label is
// (https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html).
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/slab_sink.h"

#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace vkt {

/// "NAME.seg.nrrd", in letters of any case.
bool is_segmentation_name(std::string const& path);

/// Smallest box around each label's voxels.
using LabelBoxes = std::map<std::int64_t, Box>;

/// The attributes of a header with those of a segmentation: what they said of labels, SegmentN_Name and so on, is kept
/// for the label that SegmentN_LabelValue says, extents are those of the boxes, and labels of which they said nothing
/// get an ID, a name and a colour. Of stated labels without voxels the extent is empty.
std::map<std::string, std::string> segment_attributes(std::map<std::string, std::string> attributes,
                                                      LabelBoxes const& boxes);

/// Writes a volume of integers, of which 0 is background. The header, which comes first, tells extents that are known
/// last: voxels wait in memory or, beyond a share of the budget, in a temporary file. `header_text` makes the header of
/// such a volume, compressed by gzip or not. Throws Error{usage} for floats, negative labels, more than 32767 of them
/// and several volumes.
std::unique_ptr<VolumeWriter> segmentation_writer(std::string const& path, WriteOptions const& options,
                                                  std::string (*header_text)(Header const&, bool gzip));

} // namespace vkt
