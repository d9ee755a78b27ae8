// CUDA's virtual memory management, or its absence. The driver's functions are asked for at run time: nothing is
// linked.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device_sharing.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstring>
#include <unistd.h>
#include <utility>

#ifdef VKT_CUDA
#include <cuda.h>
#include <cuda_runtime_api.h>
#endif

namespace vkt {

SharedDeviceMemory::SharedDeviceMemory(SharedDeviceMemory&& other) noexcept { *this = std::move(other); }

SharedDeviceMemory& SharedDeviceMemory::operator=(SharedDeviceMemory&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    std::swap(handle_, other.handle_);
    std::swap(device_, other.device_);
    std::swap(descriptor_, other.descriptor_);
    std::swap(mapped_, other.mapped_);
    return *this;
}

#ifdef VKT_CUDA

namespace {

constexpr CUmemAllocationHandleType by_descriptor = CU_MEM_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR;
/// The version whose functions are asked for; cuDeviceGetUuid tells the parts of a divided GPU apart since 11.4.
constexpr unsigned driver_version = 12000;

template <class Function> Function driver_function(char const* name) {
    void* found = nullptr;
    cudaDriverEntryPointQueryResult state{};
#if CUDART_VERSION >= 12050
    cudaError_t const status =
        cudaGetDriverEntryPointByVersion(name, &found, driver_version, cudaEnableDefault, &state);
#else
    cudaError_t const status = cudaGetDriverEntryPoint(name, &found, cudaEnableDefault, &state);
#endif
    if (status == cudaSuccess && state == cudaDriverEntryPointSuccess && found != nullptr)
        return reinterpret_cast<Function>(found);
    (void)cudaGetLastError();
    throw Error(ErrorKind::resources, text("GPU: the driver has no ", name));
}

/// What is used of the driver.
struct Driver {
    decltype(&::cuGetErrorString) error_string = driver_function<decltype(error_string)>("cuGetErrorString");
    decltype(&::cuDeviceGetUuid) uuid = driver_function<decltype(uuid)>("cuDeviceGetUuid");
    decltype(&::cuDeviceGetAttribute) attribute = driver_function<decltype(attribute)>("cuDeviceGetAttribute");
    decltype(&::cuMemGetAllocationGranularity) granularity =
        driver_function<decltype(granularity)>("cuMemGetAllocationGranularity");
    decltype(&::cuMemCreate) create = driver_function<decltype(create)>("cuMemCreate");
    decltype(&::cuMemRelease) release = driver_function<decltype(release)>("cuMemRelease");
    decltype(&::cuMemExportToShareableHandle) export_handle =
        driver_function<decltype(export_handle)>("cuMemExportToShareableHandle");
    decltype(&::cuMemImportFromShareableHandle) import_handle =
        driver_function<decltype(import_handle)>("cuMemImportFromShareableHandle");
    decltype(&::cuMemAddressReserve) reserve = driver_function<decltype(reserve)>("cuMemAddressReserve");
    decltype(&::cuMemAddressFree) free_address = driver_function<decltype(free_address)>("cuMemAddressFree");
    decltype(&::cuMemMap) map = driver_function<decltype(map)>("cuMemMap");
    decltype(&::cuMemUnmap) unmap = driver_function<decltype(unmap)>("cuMemUnmap");
    decltype(&::cuMemSetAccess) set_access = driver_function<decltype(set_access)>("cuMemSetAccess");

    void must(CUresult status, char const* what) const {
        if (status == CUDA_SUCCESS) return;
        char const* reason = nullptr;
        if (error_string(status, &reason) != CUDA_SUCCESS || reason == nullptr) reason = "unknown error";
        throw Error(ErrorKind::resources, text("GPU: ", what, ": ", reason), "use --transport shm");
    }
};

/// Throws Error{resources} for drivers that lack a function.
Driver const& driver() {
    static Driver const functions;
    return functions;
}

CUmemAllocationProp properties_on(int device) {
    CUmemAllocationProp properties{};
    properties.type = CU_MEM_ALLOCATION_TYPE_PINNED;
    properties.requestedHandleTypes = by_descriptor;
    properties.location.type = CU_MEM_LOCATION_TYPE_DEVICE;
    properties.location.id = device;
    return properties;
}

/// Both ends round alike: they share the GPU.
std::size_t whole_pages(std::size_t bytes, int device) {
    CUmemAllocationProp const properties = properties_on(device);
    std::size_t page = 0;
    driver().must(driver().granularity(&page, &properties, CU_MEM_ALLOC_GRANULARITY_MINIMUM),
                  "the size of its pages is not known");
    return (std::max<std::size_t>(bytes, 1) + page - 1) / page * page;
}

} // namespace

DeviceIdentity try_device_sharing(int device) {
    device_select(device);
    (void)cudaFree(nullptr); // before CUDA 12 a GPU is not begun with by choosing it
    int supported = 0;
    driver().must(
        driver().attribute(&supported, CU_DEVICE_ATTRIBUTE_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR_SUPPORTED, device),
        "what it can do is not known");
    if (supported == 0)
        throw Error(ErrorKind::resources, text("GPU: the driver exports no memory of GPU ", device),
                    "use --transport shm");
    SharedDeviceMemory const made = SharedDeviceMemory::create(1);
    SharedDeviceMemory const mapped = SharedDeviceMemory::open(::dup(made.descriptor()), 1);
    CUuuid uuid{};
    driver().must(driver().uuid(&uuid, device), "its name is not known");
    DeviceIdentity identity;
    static_assert(sizeof identity == sizeof uuid);
    std::memcpy(identity.data(), &uuid, sizeof uuid);
    return identity;
}

SharedDeviceMemory SharedDeviceMemory::create(std::size_t bytes) {
    SharedDeviceMemory memory;
    memory.device_ = device_current();
    memory.bytes_ = whole_pages(bytes, memory.device_);
    CUmemAllocationProp const properties = properties_on(memory.device_);
    CUmemGenericAllocationHandle handle = 0;
    driver().must(driver().create(&handle, memory.bytes_, &properties, 0), "cannot allocate memory to share");
    memory.handle_ = handle;
    driver().must(driver().export_handle(&memory.descriptor_, handle, by_descriptor, 0), "cannot export memory");
    memory.map();
    return memory;
}

SharedDeviceMemory SharedDeviceMemory::open(int descriptor, std::size_t bytes) {
    SharedDeviceMemory memory;
    memory.descriptor_ = descriptor; // closed whatever happens
    memory.device_ = device_current();
    memory.bytes_ = whole_pages(bytes, memory.device_);
    CUmemGenericAllocationHandle handle = 0;
    driver().must(
        driver().import_handle(&handle, reinterpret_cast<void*>(static_cast<std::intptr_t>(descriptor)), by_descriptor),
        "cannot import the memory of another process");
    memory.handle_ = handle;
    memory.map();
    return memory;
}

void SharedDeviceMemory::map() {
    CUdeviceptr address = 0;
    driver().must(driver().reserve(&address, bytes_, 0, 0, 0), "no room for shared memory");
    data_ = reinterpret_cast<std::byte*>(address);
    driver().must(driver().map(address, bytes_, 0, handle_, 0), "cannot map shared memory");
    mapped_ = true;
    CUmemAccessDesc access{};
    access.location = properties_on(device_).location;
    access.flags = CU_MEM_ACCESS_FLAGS_PROT_READWRITE;
    driver().must(driver().set_access(address, bytes_, &access, 1), "cannot use shared memory");
}

SharedDeviceMemory::~SharedDeviceMemory() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (handle_ == 0) return;
    auto const address = reinterpret_cast<CUdeviceptr>(data_);
    if (mapped_) (void)driver().unmap(address, bytes_);
    if (data_ != nullptr) (void)driver().free_address(address, bytes_);
    (void)driver().release(handle_);
}

#else

DeviceIdentity try_device_sharing(int) { throw_without_cuda(); }
SharedDeviceMemory SharedDeviceMemory::create(std::size_t) { throw_without_cuda(); }
SharedDeviceMemory SharedDeviceMemory::open(int descriptor, std::size_t) {
    ::close(descriptor);
    throw_without_cuda();
}
void SharedDeviceMemory::map() {}
SharedDeviceMemory::~SharedDeviceMemory() = default;

#endif

} // namespace vkt
