// The device runtime behind a handful of functions; without CUDA they say so.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

namespace vkt {

/// All throw Error{resources} when there is no CUDA, no device, or no memory. Copies are complete on return.
int device_count(); ///< 0 without CUDA, driver or device; never throws
std::byte* device_allocate(std::size_t bytes);
void device_free(std::byte* memory) noexcept;
void copy_to_device(void* device, void const* host, std::size_t bytes);
void copy_to_host(void* host, void const* device, std::size_t bytes);
void device_synchronize();

} // namespace vkt
