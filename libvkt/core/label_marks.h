// What a header says of labels: that voxels are some, and, pair by pair as 3D Slicer writes them, what each is called.
// Formats, operations and renderers read and write these attributes; here is what they are called.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace vkt {

/// The attribute that says of a volume that its values are labels.
inline constexpr char meaning_key[] = "meaning", labels_meaning[] = "labels";

/// SegmentN_FIELD, as 3D Slicer writes its pairs.
struct SegmentKey {
    std::int64_t number;
    std::string field;
};
std::optional<SegmentKey> segment_key(std::string_view key);

/// Removes what is said of each label.
void forget_label_names(Header& header);
/// … and that there are labels, the intent code of NIfTI among it.
void forget_labels(Header& header);

} // namespace vkt
