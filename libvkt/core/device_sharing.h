// GPU memory that other processes map as well: virtual-memory allocations behind file descriptors.
// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace vkt {

/// Names a GPU, or the part of one that a process was given, alike in all processes and containers of a machine.
using DeviceIdentity = std::array<std::byte, 16>;

/// Tries with the least piece there is whether memory of a GPU can be handed to another process: made, exported,
/// imported and mapped. Makes it the current one of this thread. Throws Error{resources} with what stands in the way:
/// no CUDA, a GPU or driver without the capability, a container that forbids it.
DeviceIdentity try_device_sharing(int device);

/// A piece of GPU memory with a descriptor by which others map it. The memory itself lasts for as long as anybody has
/// it mapped or holds its descriptor, also when the process that made it is gone, and it is gone with the last of them.
class SharedDeviceMemory {
public:
    /// Of the current GPU, at least so many bytes, unspecified. Throws Error{resources}.
    static SharedDeviceMemory create(std::size_t bytes);
    /// Maps what another process made with create() of the same size, on the same GPU; takes ownership of the
    /// descriptor. Throws Error{resources}.
    static SharedDeviceMemory open(int descriptor, std::size_t bytes);
    SharedDeviceMemory(SharedDeviceMemory&& other) noexcept;
    SharedDeviceMemory& operator=(SharedDeviceMemory&& other) noexcept;
    ~SharedDeviceMemory();

    std::byte* data() const { return data_; }
    int descriptor() const { return descriptor_; }

private:
    SharedDeviceMemory() = default;
    void map();

    std::byte* data_ = nullptr;
    std::size_t bytes_ = 0;    ///< whole pages of the GPU
    std::uint64_t handle_ = 0; ///< of the allocation; 0: none
    int device_ = 0;
    int descriptor_ = -1;
    bool mapped_ = false;
};

} // namespace vkt
