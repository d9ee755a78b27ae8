// The device runtime: memory, copies, synchronisation. Without CUDA everything but device_count() throws.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstddef>
#include <string>
#include <vector>

namespace vkt {

/// Throws Error{resources}: this build has no CUDA.
[[noreturn]] void throw_without_cuda();

/// Number of usable CUDA devices; 0 without CUDA, driver or device. Never throws.
int device_count();
/// Makes a device the current one of this thread. Throws Error{resources}.
void device_select(int device);
int device_current();
/// The device whose memory this is, managed memory included; -1 for memory of the host. Throws Error{resources} without
/// CUDA.
int device_of(void const* memory);

struct DeviceFacts {
    std::string name;
    int major = 0, minor = 0;         ///< compute capability
    std::size_t memory = 0, free = 0; ///< bytes
    std::vector<int> reaches;         ///< other devices whose memory it can read
};
/// Makes the device the current one. Throws Error{resources}.
DeviceFacts device_facts(int device);

/// Device memory, 256-byte aligned; its size is rounded up to 256 bytes, so that whole words at its end may be read.
/// It comes from the device's pool, which keeps what is freed, and both happen in the order of the default stream.
/// Throws Error{resources}.
std::byte* device_allocate(std::size_t bytes);
/// `device` is the one that it is from, if that may be another than the current one.
void device_free(std::byte* data, int device = -1) noexcept;

/// Copies in stream order; the call returns when the host memory may be used again.
void copy_to_device(void* device, void const* host, std::size_t bytes);
void copy_to_host(void* host, void const* device, std::size_t bytes);
void copy_on_device(void* to, void const* from, std::size_t bytes);
/// Any of these, or memcpy.
void copy_between(void* to, Space to_space, void const* from, Space from_space, std::size_t bytes);
void device_clear(void* device, std::size_t bytes); ///< zeroes, in stream order
/// Waits for all work and throws Error{resources} with CUDA's reason if any of it failed.
void device_synchronize();
/// Throws Error{resources} naming the kernel if the last launch was refused. Called by the drivers after every launch.
void check_launch(char const* kernel);
/// Throws Error{resources}: there is more than one launch takes.
[[noreturn]] void refuse_launch();
/// So many blocks, of so many along and across, as launches count them. Throws Error{resources} beyond 2^31 - 1.
unsigned launch_blocks(std::int64_t blocks, std::int64_t along = 1, std::int64_t across = 1);

} // namespace vkt
