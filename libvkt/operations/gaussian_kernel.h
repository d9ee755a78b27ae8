// What the Gaussian's host side and its kernels agree on.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/types.h"
#include "libvkt/core/view.h"
#include "libvkt/operations/gaussian_taps.h"

#include <array>

namespace vkt {

/// The three passes of one volume.
struct GaussianPasses {
    std::array<GaussianTaps, 3> taps; ///< along x, y, z
    Index3 dims;                      ///< of the volume
    Boundary boundary = Boundary::mirror;
    double border_value = 0; ///< stored value outside, for Boundary::border
    bool wide = false;       ///< float64 intermediates
};

/// Planes already filtered along x and y that the next run may use again: a ring per tile of the xy plane. They depend
/// on nothing but the input, so results do not depend on whether they were kept.
struct GaussianPlanes {
    Buffer storage;
    Box area;                        ///< output region in x and y (z unused) to which the rings belong
    std::int64_t begin = 0, end = 0; ///< slices held
    std::int64_t layout = 0;         ///< tiles and threads the rings were made for

    void forget() { begin = end = 0; }
};

} // namespace vkt
