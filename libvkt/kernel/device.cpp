// Stubs for builds without CUDA; libvkt/cuda/device.cu replaces them otherwise.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/device.h"

#ifndef VKT_CUDA

#include "libvkt/core/error.h"

namespace vkt {
namespace {

[[noreturn]] void no_cuda() {
    throw Error(ErrorKind::resources, "this vkt was built without CUDA", "use --device cpu, or build with -DVKT_CUDA=ON");
}

} // namespace

int device_count() { return 0; }
std::byte* device_allocate(std::size_t) { no_cuda(); }
void device_free(std::byte*) noexcept {}
void copy_to_device(void*, void const*, std::size_t) { no_cuda(); }
void copy_to_host(void*, void const*, std::size_t) { no_cuda(); }
void device_synchronize() {}

} // namespace vkt

#endif
