// Mirrored copies.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/flip.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {

void flip_box(ConstView from, AnyView to, Axis axis, Execution const& execution) {
    copy_box(execution, from, to, {axis == Axis::x, axis == Axis::y, axis == Axis::z});
}

} // namespace VKT_BACKEND

} // namespace vkt
