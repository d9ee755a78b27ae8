// Volumes of labels: how a header says that voxels name things, what it says of each of these, and colours for them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/label_marks.h"

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace vkt {

/// Says so of a volume whose labels are new: what was said of others is forgotten.
void mark_as_labels(Header& header);

/// Whether stored values are labels, by what the header says: integers, and the attribute, the pairs of a segmentation
/// or the intent code of NIfTI for labels (1002).
bool holds_labels(Header const& header);

/// What is said of a label. Colours are sRGB, 0 to 1.
struct LabelText {
    std::string name;
    std::optional<std::array<double, 3>> color;
};
/// By label, from pairs SegmentN_LabelValue, SegmentN_Name and SegmentN_Color; of two with one label the first counts.
std::map<std::int64_t, LabelText> label_texts(std::map<std::string, std::string> const& attributes);

/// A colour for a label, always the same one: hues in steps of the golden ratio around their circle, so that each is
/// far from those of the labels before it, bright, dark and pale by turns. sRGB, 0 to 1, three digits.
std::array<double, 3> label_color(std::int64_t label);

} // namespace vkt
