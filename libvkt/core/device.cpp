// The device runtime over the CUDA runtime API, or its absence.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cstring>
#include <limits>

#ifdef VKT_CUDA
#include <algorithm>
#include <array>
#include <cstdint>
#include <cuda_runtime_api.h>
#include <mutex>
#include <omp.h>
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

/// Whether the current device has a pool of memory, which keeps from now on what is freed. Asked once of a device: the
/// questions take longer than an allocation.
bool has_pool() {
    struct Answer {
        std::once_flag asked;
        bool yes = false;
    };
    static std::array<Answer, 64> answers;
    int const device = device_current();
    auto const ask = [device] {
        int supported = 0;
        must(cudaDeviceGetAttribute(&supported, cudaDevAttrMemoryPoolsSupported, device), "its memory is not known");
        if (supported == 0) return false;
        cudaMemPool_t pool = nullptr;
        must(cudaDeviceGetDefaultMemPool(&pool, device), "has no memory pool");
        std::uint64_t keep = ~std::uint64_t{0};
        must(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &keep), "its memory cannot be kept");
        return true;
    };
    auto const index = static_cast<std::size_t>(device);
    if (index >= answers.size()) return ask();
    std::call_once(answers[index].asked, [&] { answers[index].yes = ask(); });
    return answers[index].yes;
}

} // namespace

// In the order of the stream, from memory that was freed: cudaMalloc() and cudaFree() wait for the device, and take as
// long as a kernel that goes through 100 MB.
std::byte* device_allocate(std::size_t bytes) {
    void* data = nullptr;
    std::size_t const size = (bytes + 255) / 256 * 256;
    if (has_pool())
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

namespace {

/// Pinned memory through which large copies go between a GPU and pages that are not: several threads fill a part or
/// empty it while the bus carries others. The driver does that with one thread, which reaches a fifth of what the bus
/// does. Copies stay in the order of the default stream.
class Relay {
public:
    static constexpr std::size_t least = std::size_t{2} << 20; ///< that is worth the threads
    /// False if it cannot be used now, and nothing was done. The memory is had when there is much to copy.
    bool copy(std::byte* device, std::byte* host, std::size_t bytes, bool to_device) {
        std::unique_lock const lock(mutex_, std::try_to_lock);
        if (!lock) return false;
        asked_ += bytes;
        if (memory_ == nullptr && (asked_ < worth_it || !prepare())) return false;
        std::size_t const count = (bytes + part - 1) / part;
        auto const size = [&](std::size_t i) { return std::min(part, bytes - i * part); };
        auto const place = [&](std::size_t i) { return memory_ + i % parts * part; };
        auto const wait = [&](std::size_t i) { must(cudaEventSynchronize(done_[i % parts]), "a copy failed"); };
        auto const send = [&](std::size_t i) {
            void* const there = device + i * part;
            must(to_device ? cudaMemcpyAsync(there, place(i), size(i), cudaMemcpyHostToDevice, nullptr)
                           : cudaMemcpyAsync(place(i), there, size(i), cudaMemcpyDeviceToHost, nullptr),
                 "a copy failed");
            must(cudaEventRecord(done_[i % parts], nullptr), "a copy failed");
        };
        for (std::size_t i = 0, sent = 0; i < count; ++i) {
            if (to_device) {
                wait(i); // for what lay there before, maybe since the last copy
                move(place(i), host + i * part, size(i));
                send(i);
                continue;
            }
            for (; sent < std::min(count, i + parts); ++sent) send(sent);
            wait(i);
            move(host + i * part, place(i), size(i));
        }
        return true;
    }

private:
    static constexpr std::size_t part = std::size_t{8} << 20, parts = 4;
    static constexpr std::size_t worth_it = std::size_t{64} << 20; ///< in all, that is worth the memory

    bool prepare() {
        if (refused_) return false;
        refused_ = true;
        for (cudaEvent_t& event : done_)
            if (event == nullptr && cudaEventCreateWithFlags(&event, cudaEventDisableTiming) != cudaSuccess) {
                (void)cudaGetLastError();
                return false;
            }
        void* memory = nullptr;
        if (cudaHostAlloc(&memory, part * parts, cudaHostAllocPortable) != cudaSuccess) {
            (void)cudaGetLastError();
            return false;
        }
        memory_ = static_cast<std::byte*>(memory);
        refused_ = false;
        return true;
    }
    static void move(std::byte* to, std::byte const* from, std::size_t bytes) {
        constexpr std::size_t piece = std::size_t{512} << 10;
        auto const pieces = static_cast<std::int64_t>((bytes + piece - 1) / piece);
        int const threads = std::min(omp_get_max_threads(), 8);
#pragma omp parallel for num_threads(threads) schedule(static)
        for (std::int64_t i = 0; i < pieces; ++i) {
            std::size_t const at = static_cast<std::size_t>(i) * piece;
            std::memcpy(to + at, from + at, std::min(piece, bytes - at));
        }
    }

    std::mutex mutex_;
    std::size_t asked_ = 0;       ///< bytes
    std::byte* memory_ = nullptr; ///< as long as the process lives
    std::array<cudaEvent_t, parts> done_{};
    bool refused_ = false; ///< there was none
};

/// Whether the current device's relay did it.
bool relayed(void* device, void const* host, std::size_t bytes, bool to_device) {
    static std::array<Relay, 16> relays;
    if (bytes < Relay::least) return false;
    auto const index = static_cast<std::size_t>(device_current());
    cudaPointerAttributes attributes{};
    must(cudaPointerGetAttributes(&attributes, host), "whose memory this is is not known");
    return index < relays.size() && attributes.type == cudaMemoryTypeUnregistered &&
           relays[index].copy(static_cast<std::byte*>(device), static_cast<std::byte*>(const_cast<void*>(host)), bytes,
                              to_device);
}

} // namespace

void copy_to_device(void* device, void const* host, std::size_t bytes) {
    if (relayed(device, host, bytes, true)) return;
    must(cudaMemcpy(device, host, bytes, cudaMemcpyHostToDevice), "copy to the device failed");
}
void copy_to_host(void* host, void const* device, std::size_t bytes) {
    if (relayed(const_cast<void*>(device), host, bytes, false)) return;
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

void refuse_launch() {
    throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
}

unsigned launch_blocks(std::int64_t blocks, std::int64_t along, std::int64_t across) {
    std::int64_t room = std::numeric_limits<std::int32_t>::max();
    for (std::int64_t const count : {blocks, along, across}) {
        if (count > room) refuse_launch();
        if (count == 0) return 0;
        room /= count;
    }
    return static_cast<unsigned>(blocks * along * across);
}

void copy_between(void* to, Space to_space, void const* from, Space from_space, std::size_t bytes) {
    if (to_space == Space::host && from_space == Space::host)
        std::memcpy(to, from, bytes);
    else if (to_space == from_space)
        copy_on_device(to, from, bytes);
    else if (to_space == Space::device)
        copy_to_device(to, from, bytes);
    else
        copy_to_host(to, from, bytes);
}

} // namespace vkt
