// Volumes of a header as JSON and of voxels that the caller has: for the C API.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/c/vkt.h"
#include "libvkt/core/volume.h"

#include <cstddef>
#include <memory>
#include <string_view>

namespace vkt {

/// Calls `release` when it goes, if that has been set.
class VoxelOwner {
public:
    VoxelOwner() = default;
    ~VoxelOwner() {
        if (release != nullptr) release(user);
    }
    VoxelOwner(VoxelOwner const&) = delete;
    VoxelOwner& operator=(VoxelOwner const&) = delete;

    vkt_release_function release = nullptr;
    void* user = nullptr;
};

/// A structured volume; its voxels are a copy if there is no owner, else those that it keeps. Throws Error{data} for a
/// header that is none and for hierarchical ones, Error{usage} if the voxels are not as many bytes, or not aligned.
Volume volume_of_header(std::string_view json, void const* voxels, std::size_t bytes,
                        std::shared_ptr<VoxelOwner> owner);

} // namespace vkt
