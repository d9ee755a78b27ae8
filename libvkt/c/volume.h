// A volume as the C API hands it out.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/c/vkt.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"

#include <memory>
#include <mutex>
#include <string>
#include <vector>

struct vkt_volume {
    vkt::Volume volume;
    std::string dtype, remarks{};
    mutable std::mutex reporting{};
    mutable std::unique_ptr<vkt::Operation> reporter{}; ///< until it is asked
    mutable std::string report{};
};

namespace vkt::c {

vkt_volume* wrapped(Volume volume);
/// Copies that share the voxels. Throws Error{usage} for null pointers.
std::vector<Volume> volumes_of(vkt_volume const* const* inputs, size_t count);
/// Takes what was lost, one remark a line.
Listener into(std::string& remarks);

} // namespace vkt::c
