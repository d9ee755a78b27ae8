// Affine transforms as text: twelve or sixteen numbers, or ITK's transform files.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/affine.h"

#include <string>
#include <string_view>

namespace vkt {

struct TransformText {
    Affine map;       ///< points of the result to points of the input
    bool itk = false; ///< in ITK's world: left-posterior-superior
};

/// Twelve numbers, three rows of four (the last column is the shift), or sixteen with a last row 0 0 0 1, separated by
/// blanks, commas, semicolons or ends of lines; lines may end in a # comment. Or "#Insight Transform File V1.0" with
/// linear transforms in three dimensions, composites included, which are applied from the last to the first. `name` is
/// for messages. Throws Error{data} if it is neither, is not finite, or cannot be inverted.
TransformText parse_transform(std::string_view text, std::string_view name);

} // namespace vkt
