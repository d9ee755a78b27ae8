// What the host side of the Gaussian and its kernel by way of a coarser lattice agree on.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/filter/gaussian_cascade.h"
#include "libvkt/operations/filter/kernels/gaussian.h"

namespace vkt {

/// A cascade on one volume; boundary, border value, width, clipping and run height are those of the direct passes.
struct CascadePasses {
    GaussianPasses const* direct = nullptr;
    GaussianCascade const* cascade = nullptr;
};

/// Values that whole registers may reach beyond the end of a row.
inline constexpr std::int64_t cascade_margin = 32;

/// Where things lie for regions of these dims, counted in values of the compute type. Slices are thinned along y and x
/// as they come, then along z; planes of nodes are smoothed along y and x, then along z. All are kept in rings.
struct CascadeLayout {
    CascadeLayout(CascadePasses const& passes, Index3 region);

    std::int64_t wide_x, wide_y, x, y;          ///< nodes before the Gaussian, and those read
    std::int64_t wide_pitch, pitch;             ///< of rows of them
    std::int64_t thin_slots, wide_slots, slots; ///< slices; planes before and after the Gaussian along z
    std::int64_t raw_slots;                     ///< planes not yet smoothed, where they are not slices
    std::int64_t rows, row_pitch;               ///< a thread: rows thinned along y together, of voxels
    std::int64_t phase_pitch, strip;            ///< a thread: nodes of a phase; columns worked on together
    std::int64_t scratch;                       ///< a thread, all of it

    std::int64_t thin_values() const { return thin_slots * wide_y * wide_pitch; }
    std::int64_t raw_values() const { return raw_slots * wide_y * wide_pitch; }
    std::int64_t wide_values() const { return wide_slots * y * pitch; }
    std::int64_t values() const { return slots * y * pitch; }
    std::int64_t ring_values() const { return thin_values() + raw_values() + wide_values() + values(); }
};

/// What the next run may use again, if it goes on where the last one ended.
struct CascadePlanes {
    Buffer storage, scratch;
    Box area;                                              ///< output region of the last run
    std::int64_t end = 0;                                  ///< of the output
    std::int64_t thin_end = 0, wide_end = 0, node_end = 0; ///< slices and planes that are held end here
    bool held = false;

    bool continues(Box const& box) const {
        return held && box.lower.z == end && box.lower.x == area.lower.x && box.upper.x == area.upper.x &&
               box.lower.y == area.lower.y && box.upper.y == area.upper.y;
    }
};

/// Input region that an output region needs.
Box cascade_input(CascadePasses const& passes, Box const& output);

VKT_KERNEL(gaussian_cascade_run,
           (CascadePasses const& passes, CascadePlanes& planes, ConstView in, AnyView out, Losses& losses,
            Execution const& execution),
           (passes, planes, in, out, losses, execution))

} // namespace vkt
