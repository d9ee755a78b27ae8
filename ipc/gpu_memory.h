// Memory of a GPU as streams see it: made here, exported, mapped there. Tests put files in memory in its place.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/device_sharing.h"
#include "libvkt/core/view.h"

#include <cstddef>
#include <memory>

namespace vkt::ipc {

/// A piece of memory behind a descriptor that both ends of a pipe map.
class RingMemory {
public:
    RingMemory() = default;
    virtual ~RingMemory() = default;
    RingMemory(RingMemory const&) = delete;
    RingMemory& operator=(RingMemory const&) = delete;

    virtual std::byte* data() const = 0;
    virtual int descriptor() const = 0;
};

/// One GPU. What it makes dies with the last process that has it mapped or holds its descriptor.
class GpuMemory {
public:
    GpuMemory() = default;
    virtual ~GpuMemory() = default;
    GpuMemory(GpuMemory const&) = delete;
    GpuMemory& operator=(GpuMemory const&) = delete;

    /// Alike for the two ends if memory of one can be mapped by the other. Throws Error{resources} where none can be
    /// shared, with the reason.
    virtual DeviceIdentity identity() = 0;
    /// Unspecified voxels' room. Throws Error{resources}.
    virtual std::unique_ptr<RingMemory> create(std::size_t bytes) = 0;
    /// What the other end made of so many bytes; takes ownership of the descriptor. Throws Error{resources}.
    virtual std::unique_ptr<RingMemory> open(int descriptor, std::size_t bytes) = 0;
    /// Waits until all that this process does with its memory is done. Throws Error{resources} if any of it failed.
    virtual void settle() = 0;
    virtual Space space() const { return Space::device; }
    /// Of a slab that is left here: large, since the GPU changes from one process to the other and back for each (0.3
    /// ms on an H200), but a few must not matter beside its memory.
    virtual std::size_t slab_bytes() = 0;
};

/// A GPU through CUDA. Another thread begins at once to get hold of it, which takes some tenths of a second. Throws
/// Error{resources}, beginning with `asked` ("--transport gpu"), in builds without CUDA and where there is no such GPU.
std::shared_ptr<GpuMemory> cuda_memory(int gpu, char const* asked);

} // namespace vkt::ipc
