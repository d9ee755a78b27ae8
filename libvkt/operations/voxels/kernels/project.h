// Reducing lines of voxels to pixels.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/buffer.h"
#include "libvkt/core/wide.h"
#include "libvkt/kernel/numeric.h"

namespace vkt {

enum class Projection : std::uint8_t { max, min, mean, sum, std, median };

/// Accumulators of the pixels of an image, row after row; which of them there are depends on kind and type, the others
/// are null.
struct ProjectionState {
    Projection kind = Projection::max;
    DataType type = DataType::uint8;
    int axis = 2;
    Index3 dims;                   ///< of the volume
    std::byte* extremes = nullptr; ///< max, min: of the voxels' type, float32 for float16
    std::int64_t* whole = nullptr; ///< sums of integers
    Int128* wide = nullptr;        ///< … that 64 bits may not hold
    double* value = nullptr;       ///< sums of floats; means
    double* extra = nullptr;       ///< what rounding of those of float64 lost; sums of squared deviations
    double* count = nullptr;       ///< values so far: floats, and std
    double* scale = nullptr;       ///< of float64: values were multiplied by this power of two, or not if it is 0
    std::int64_t nan = 0;

    // Compiled once, since kernels for newer processors have such a state, too.
    ProjectionState();
    ProjectionState(Projection kind, DataType type, int axis, Index3 dims);
    ProjectionState(ProjectionState&&) noexcept;
    ProjectionState& operator=(ProjectionState&&) noexcept;
    ~ProjectionState();
    std::int64_t pixels() const { return dims.x * dims.y * dims.z / dims[axis]; }
    std::int64_t row() const { return axis == 0 ? dims.y : dims.x; } ///< pixels in a row
    std::size_t bytes() const;                                       ///< once it is in use
    /// Nothing was added so far; the accumulators are here, and on the host hold what they have then.
    void begin(Space space);
    /// The accumulators are here now, with what they held elsewhere.
    void use(Space space);

private:
    void point(std::byte* memory);
    Buffer memory_;
};

/// What float64 is multiplied by when its sum would overflow: lines have fewer than 2^63 voxels.
inline constexpr double scale_of_sums = 0x1p-64;

/// Adds the voxels of a slab, which follows the last one.
VKT_KERNEL(project_add, (ProjectionState & state, ConstView slab, Execution const& execution), (state, slab, execution))
/// The pixels of out.box.
VKT_KERNEL(project_store, (ProjectionState & state, AnyView out, Losses& losses, Execution const& execution),
           (state, out, losses, execution))

} // namespace vkt
