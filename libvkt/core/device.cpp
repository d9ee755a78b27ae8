// The device runtime over the CUDA runtime API, or its absence.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#ifdef VKT_CUDA
#include <cuda_runtime_api.h>
#endif

namespace vkt {

void throw_without_cuda() {
    throw Error(ErrorKind::resources, "this build of vkt has no CUDA", "use --device cpu, or build with -DVKT_CUDA=ON");
}

#ifdef VKT_CUDA

namespace {

void must(cudaError_t status, char const* what) {
    if (status == cudaSuccess) return;
    (void)cudaGetLastError(); // what is reported here must not be reported again by the next call
    throw Error(ErrorKind::resources, text("GPU: ", what, ": ", cudaGetErrorString(status)),
                status == cudaErrorMemoryAllocation ? "use --device cpu or a smaller --memory" : "use --device cpu");
}

} // namespace

int device_count() {
    int count = 0;
    if (cudaGetDeviceCount(&count) == cudaSuccess) return count;
    (void)cudaGetLastError();
    return 0;
}

void device_select(int device) { must(cudaSetDevice(device), "cannot be selected"); }
int device_current() {
    int device = 0;
    must(cudaGetDevice(&device), "which one is in use is not known");
    return device;
}

int device_of(void const* memory) {
    cudaPointerAttributes attributes{};
    must(cudaPointerGetAttributes(&attributes, memory), "whose memory this is is not known");
    bool const its = attributes.type == cudaMemoryTypeDevice || attributes.type == cudaMemoryTypeManaged;
    return its ? attributes.device : -1;
}

DeviceFacts device_facts(int device) {
    device_select(device);
    cudaDeviceProp properties{};
    must(cudaGetDeviceProperties(&properties, device), "has no properties");
    DeviceFacts facts{properties.name, properties.major, properties.minor, 0, 0, {}};
    must(cudaMemGetInfo(&facts.free, &facts.memory), "its memory is not known");
    for (int other = 0; other < device_count(); ++other) {
        int reaches = 0;
        if (other != device && cudaDeviceCanAccessPeer(&reaches, device, other) == cudaSuccess && reaches != 0)
            facts.reaches.push_back(other);
    }
    return facts;
}

namespace {

/// The pool of the current device, which from now on keeps what is freed; null where the driver has none.
cudaMemPool_t device_pool() {
    int const device = device_current();
    int supported = 0;
    must(cudaDeviceGetAttribute(&supported, cudaDevAttrMemoryPoolsSupported, device), "its memory is not known");
    if (supported == 0) return nullptr;
    cudaMemPool_t pool = nullptr;
    must(cudaDeviceGetDefaultMemPool(&pool, device), "has no memory pool");
    std::uint64_t keep = ~std::uint64_t{0};
    must(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &keep), "its memory cannot be kept");
    return pool;
}

} // namespace

// In the order of the stream, from memory that was freed: cudaMalloc() and cudaFree() wait for the device, and take as
// long as a kernel that goes through 100 MB.
std::byte* device_allocate(std::size_t bytes) {
    void* data = nullptr;
    std::size_t const size = (bytes + 255) / 256 * 256;
    if (device_pool() != nullptr)
        must(cudaMallocAsync(&data, size, nullptr), "cannot allocate memory");
    else
        must(cudaMalloc(&data, size), "cannot allocate memory");
    return static_cast<std::byte*>(data);
}

void device_free(std::byte* data, int device) noexcept {
    if (data == nullptr) return;
    int current = device;
    if (device >= 0 && cudaGetDevice(&current) == cudaSuccess && current != device) (void)cudaSetDevice(device);
    if (cudaFreeAsync(data, nullptr) != cudaSuccess) {
        (void)cudaGetLastError();
        (void)cudaFree(data);
    }
    if (current != device) (void)cudaSetDevice(current);
}

void copy_to_device(void* device, void const* host, std::size_t bytes) {
    must(cudaMemcpy(device, host, bytes, cudaMemcpyHostToDevice), "copy to the device failed");
}
void copy_to_host(void* host, void const* device, std::size_t bytes) {
    must(cudaMemcpy(host, device, bytes, cudaMemcpyDeviceToHost), "copy from the device failed");
}
void copy_on_device(void* to, void const* from, std::size_t bytes) {
    must(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, nullptr), "copy on the device failed");
}
void device_clear(void* device, std::size_t bytes) {
    must(cudaMemsetAsync(device, 0, bytes, nullptr), "cannot clear device memory");
}
void device_synchronize() { must(cudaDeviceSynchronize(), "a kernel failed"); }
void check_launch(char const* kernel) {
    cudaError_t const status = cudaGetLastError();
    if (status == cudaSuccess) return;
    throw Error(ErrorKind::resources, text("GPU: kernel ", kernel, " cannot be launched: ", cudaGetErrorString(status)),
                "use --device cpu");
}

#else

int device_count() { return 0; }
void device_select(int) { throw_without_cuda(); }
int device_current() { throw_without_cuda(); }
int device_of(void const*) { throw_without_cuda(); }
DeviceFacts device_facts(int) { throw_without_cuda(); }
std::byte* device_allocate(std::size_t) { throw_without_cuda(); }
void device_free(std::byte*, int) noexcept {}
void copy_to_device(void*, void const*, std::size_t) { throw_without_cuda(); }
void copy_to_host(void*, void const*, std::size_t) { throw_without_cuda(); }
void copy_on_device(void*, void const*, std::size_t) { throw_without_cuda(); }
void device_clear(void*, std::size_t) { throw_without_cuda(); }
void device_synchronize() {}
void check_launch(char const*) { throw_without_cuda(); }

#endif

} // namespace vkt
