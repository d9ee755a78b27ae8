// What the Gaussian's host side and its kernels agree on.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/types.h"
#include "libvkt/core/view.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/gaussian_taps.h"

#include <array>
#include <limits>

namespace vkt {

// A quarter of each value is what the passes average: then neither a pair nor a difference of the largest floats
// overflows. Results are four times that, twice the sum of a pair.
inline constexpr double gaussian_scale = 0.25;

/// The three passes of one volume.
struct GaussianPasses {
    std::array<GaussianTaps, 3> taps; ///< along x, y, z
    Index3 dims;                      ///< of the volume
    Boundary boundary = Boundary::mirror;
    double border_value = 0; ///< stored value outside, for Boundary::border; any number, not only voxels of the type
    bool clips = false;      ///< the border value lies outside the type, so that results may
    bool wide = false;       ///< float64 intermediates
    std::int64_t run_height = 4; ///< CPU: output slices for which the ring of input slices is made
    std::int64_t plane_bytes = std::int64_t{32} << 20; ///< CPU: slices filtered along z together take no more than this
};

/// Input slices that the next run may use again (on the GPU: planes already filtered along x and y). They depend on
/// nothing but the input, so results do not depend on whether they were kept.
struct GaussianPlanes {
    Buffer storage, scratch;
    Box area;                        ///< output region of the last run
    std::int64_t begin = 0, end = 0; ///< slices held
    std::int64_t layout = 0;         ///< GPU: tiles the planes were made for
    std::int64_t input_end = none;   ///< CPU: the ring holds the input slices up to here

    static constexpr std::int64_t none = std::numeric_limits<std::int64_t>::min();

    void forget() {
        begin = end = 0;
        input_end = none;
    }
    bool held() const { return input_end != none; }
    /// True if the ring holds what a run of `box` needs of the slices that the last run used.
    bool continues(Box const& box) const {
        return held() && box.lower.z == end && box.lower.x == area.lower.x && box.upper.x == area.upper.x &&
               box.lower.y == area.lower.y && box.upper.y == area.upper.y;
    }
};

/// Input region that an output region needs: grown by the radius and cut to the volume. Slices wrap outside, and so do
/// rows unless all of them are needed.
Box gaussian_input(GaussianPasses const& passes, Box const& output);

VKT_KERNEL(gaussian_run,
           (GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
            Execution const& execution),
           (passes, planes, in, out, losses, execution))

} // namespace vkt
