// Constant fill.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/fill.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace VKT_BACKEND {

void fill_box(AnyView out, VoxelBytes const& voxel, Execution const& execution) {
    for_each_size(size_of(out.type), [&]<class U>(U) {
        U bits;
        std::memcpy(&bits, voxel.data(), sizeof bits);
        fill(execution, out.box, out.as<U>(), bits);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
