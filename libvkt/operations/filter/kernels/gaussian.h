// What the Gaussian's host side and its kernels agree on.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/types.h"
#include "libvkt/core/view.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/filter/gaussian_taps.h"

#include <array>

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
    std::int64_t run_height = 4; ///< CPU: output slices for which the cascade's rings are made
};

/// How a CPU goes through an output region of these dims: in tiles of some columns and slices and any number of rows,
/// row by row. Counted in values of the compute type.
struct GaussianLayout {
    GaussianLayout(GaussianPasses const& passes, Index3 region);

    static constexpr std::int64_t group = 8; ///< rows of a slice filtered along y, and then along x, together

    Index3 tile;                     ///< of the output
    std::int64_t slices;             ///< of the input, under a tile
    std::int64_t rows, pitch, slice; ///< of rings of rows, one for each slice of a tile
    std::int64_t strip_z, strip_y;   ///< columns filtered along an axis together
    std::int64_t values;             ///< all that a thread holds
};

/// GPU: planes already filtered along x and y that the next run may use again. They depend on nothing but the input, so
/// results do not depend on whether they were kept. CPU: what threads work with.
struct GaussianPlanes {
    Buffer storage, scratch;
    Box area;                        ///< output region of the last run
    std::int64_t begin = 0, end = 0; ///< slices held
    std::int64_t layout = 0;         ///< tiles the planes were made for

    void forget() { begin = end = 0; }
};

/// Input region that an output region needs: grown by the radius and cut to the volume. Slices wrap outside, and so do
/// rows unless all of them are needed.
Box gaussian_input(GaussianPasses const& passes, Box const& output);

VKT_KERNEL(gaussian_run,
           (GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
            Execution const& execution),
           (passes, planes, in, out, losses, execution))

} // namespace vkt
