// Comparing two pictures: errors of light, and how different they look.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/render/image.h"

namespace vkt::render {

/// Of red, green, blue and alpha unless it says otherwise.
struct PictureDifference {
    double max_abs = 0; ///< largest difference of light
    double rmse = 0;    ///< root of the mean squared difference of light
    double relmse = 0;  ///< mean of squared differences by reference^2 + 0.01 (Rousselle, Knaus and Zwicker, 2011)
    double levels = 0;  ///< largest difference as displayed, sRGB of 255 levels; of colours
    double ssim = 0;    ///< mean over the colours, as displayed (Wang and others, 2004); see structural_similarity()
    double flip = 0;    ///< mean over the picture, see flip()
};

/// Throws Error{usage} if the sizes differ. Not finite differences make what they are part of infinite.
PictureDifference compare_pictures(Image const& reference, Image const& test, Execution const& execution);

} // namespace vkt::render
