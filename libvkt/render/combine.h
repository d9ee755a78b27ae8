// One picture of several: the mean of pictures of the same, and parts put together.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/picture_file.h"

#include <vector>

namespace vkt::render {

/// The mean of pictures of one size, weighted by the paths a pixel that their texts tell; all weigh the same if none
/// does. Layers "variance.*" become those of the mean, of pictures that have nothing random in common; other layers
/// and texts stay if all have the same. Throws Error{usage} if sizes differ, only some tell their paths, or two are of
/// the same paths.
PictureContents mean_of(std::vector<PictureContents> const& pictures);

/// The whole picture of its parts, with the texts that all have alike. Throws Error{usage} if pixels are missing or
/// there twice, or the parts are not of one kind.
PictureContents join_of(std::vector<PictureContents> const& parts);

} // namespace vkt::render
