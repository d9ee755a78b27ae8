// The device runtime over the CUDA runtime API, or its absence.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#ifdef VKT_CUDA
#include <cuda_runtime_api.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
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

namespace {

/// Two page-locked pieces through which ordinary memory goes: the bus takes one while threads fill or empty the other.
/// (What the driver does with such memory is one thread's work, at a fifth of the bus's speed.)
class Ferry {
public:
    static constexpr std::size_t piece_bytes = std::size_t{8} << 20;
    /// From here on it is faster than the driver.
    static constexpr std::size_t worth_it = std::size_t{1} << 20;

    explicit Ferry(int device) : device_(device) {
        for (Piece& piece : pieces_) {
            must(cudaMallocHost(&piece.data, piece_bytes), "cannot allocate page-locked host memory");
            must(cudaEventCreateWithFlags(&piece.free, cudaEventDisableTiming), "cannot make an event");
        }
    }
    int device() const { return device_; }

    /// Rows are no longer than a piece.
    void to_device(std::byte* device, std::byte const* host, CopyRows const& r) {
        std::size_t const each = piece_bytes / r.bytes;
        for (std::size_t first = 0, turn = 0; first < r.count; first += each, turn ^= 1) {
            Piece const& piece = pieces_[turn];
            std::size_t const n = std::min(each, r.count - first);
            must(cudaEventSynchronize(piece.free), "copy to the device failed");
            copy_rows(piece.bytes(), r.bytes, host + first * r.host_pitch, r.host_pitch, r.bytes, n);
            must(cudaMemcpy2DAsync(device + first * r.device_pitch, r.device_pitch, piece.data, r.bytes, r.bytes, n,
                                   cudaMemcpyHostToDevice, nullptr),
                 "copy to the device failed");
            must(cudaEventRecord(piece.free, nullptr), "copy to the device failed");
        }
    }

    void to_host(std::byte* host, std::byte const* device, CopyRows const& r) {
        std::size_t const each = piece_bytes / r.bytes;
        auto const count = [&](std::size_t first) { return std::min(each, r.count - first); };
        auto const fetch = [&](std::size_t first, Piece const& piece) {
            must(cudaMemcpy2DAsync(piece.data, r.bytes, device + first * r.device_pitch, r.device_pitch, r.bytes,
                                   count(first), cudaMemcpyDeviceToHost, nullptr),
                 "copy from the device failed");
            must(cudaEventRecord(piece.free, nullptr), "copy from the device failed");
        };
        if (r.count > 0) fetch(0, pieces_[0]);
        for (std::size_t first = 0, turn = 0; first < r.count; first += each, turn ^= 1) {
            if (first + each < r.count) fetch(first + each, pieces_[turn ^ 1]);
            must(cudaEventSynchronize(pieces_[turn].free), "copy from the device failed");
            copy_rows(host + first * r.host_pitch, r.host_pitch, pieces_[turn].bytes(), r.bytes, r.bytes, count(first));
        }
    }

private:
    struct Piece {
        Piece() = default;
        Piece(Piece const&) = delete;
        Piece& operator=(Piece const&) = delete;
        ~Piece() {
            if (free != nullptr) (void)cudaEventDestroy(free);
            if (data != nullptr) (void)cudaFreeHost(data);
        }
        void* data = nullptr;
        cudaEvent_t free = nullptr; ///< when the device has done with it
        std::byte* bytes() const { return static_cast<std::byte*>(data); }
    };

    static void copy_rows(std::byte* to, std::size_t to_pitch, std::byte const* from, std::size_t from_pitch,
                          std::size_t bytes, std::size_t rows) {
        // A memory bus is full with a few.
        int const threads = std::clamp(static_cast<int>(rows * bytes / (std::size_t{512} << 10)), 1,
                                       std::min(6, omp_get_max_threads()));
#pragma omp parallel for num_threads(threads) schedule(static)
        for (std::ptrdiff_t row = 0; row < static_cast<std::ptrdiff_t>(rows); ++row)
            std::memcpy(to + static_cast<std::size_t>(row) * to_pitch,
                        from + static_cast<std::size_t>(row) * from_pitch, bytes);
    }

    int device_;
    std::array<Piece, 2> pieces_;
};

/// This thread's, for the device that it uses; null where page-locked memory cannot be had.
Ferry* ferry() {
    thread_local std::unique_ptr<Ferry> own;
    thread_local bool none = false;
    int const device = device_current();
    if (none) return nullptr;
    if (!own || own->device() != device) {
        own.reset();
        try {
            own = std::make_unique<Ferry>(device);
        } catch (Error const&) {
            none = true;
        }
    }
    return own.get();
}

/// One row of many bytes, as rows of a size that threads can share; what is left of it is less than one.
CopyRows cut(std::size_t bytes) {
    std::size_t const part = std::size_t{256} << 10;
    return {part, bytes / part, part, part};
}

} // namespace

void copy_to_device(void* device, void const* host, std::size_t bytes) {
    CopyRows const parts = cut(bytes);
    std::size_t done = 0;
    if (Ferry* const boat = bytes >= Ferry::worth_it ? ferry() : nullptr) {
        boat->to_device(static_cast<std::byte*>(device), static_cast<std::byte const*>(host), parts);
        done = parts.count * parts.bytes;
    }
    if (done < bytes)
        must(cudaMemcpy(static_cast<std::byte*>(device) + done, static_cast<std::byte const*>(host) + done,
                        bytes - done, cudaMemcpyHostToDevice),
             "copy to the device failed");
}

void copy_to_host(void* host, void const* device, std::size_t bytes) {
    CopyRows const parts = cut(bytes);
    std::size_t done = 0;
    if (Ferry* const boat = bytes >= Ferry::worth_it ? ferry() : nullptr) {
        boat->to_host(static_cast<std::byte*>(host), static_cast<std::byte const*>(device), parts);
        done = parts.count * parts.bytes;
    }
    if (done < bytes)
        must(cudaMemcpy(static_cast<std::byte*>(host) + done, static_cast<std::byte const*>(device) + done,
                        bytes - done, cudaMemcpyDeviceToHost),
             "copy from the device failed");
}

void copy_to_device(void* device, void const* host, CopyRows const& r) {
    if (r.bytes == 0) return;
    Ferry* const boat = r.bytes <= Ferry::piece_bytes && r.bytes * r.count >= Ferry::worth_it ? ferry() : nullptr;
    if (boat != nullptr)
        return boat->to_device(static_cast<std::byte*>(device), static_cast<std::byte const*>(host), r);
    must(cudaMemcpy2D(device, r.device_pitch, host, r.host_pitch, r.bytes, r.count, cudaMemcpyHostToDevice),
         "copy to the device failed");
}

void copy_to_host(void* host, void const* device, CopyRows const& r) {
    if (r.bytes == 0) return;
    Ferry* const boat = r.bytes <= Ferry::piece_bytes && r.bytes * r.count >= Ferry::worth_it ? ferry() : nullptr;
    if (boat != nullptr) return boat->to_host(static_cast<std::byte*>(host), static_cast<std::byte const*>(device), r);
    must(cudaMemcpy2D(host, r.host_pitch, device, r.device_pitch, r.bytes, r.count, cudaMemcpyDeviceToHost),
         "copy from the device failed");
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
std::byte* device_allocate(std::size_t) { throw_without_cuda(); }
void device_free(std::byte*, int) noexcept {}
void copy_to_device(void*, void const*, std::size_t) { throw_without_cuda(); }
void copy_to_host(void*, void const*, std::size_t) { throw_without_cuda(); }
void copy_to_device(void*, void const*, CopyRows const&) { throw_without_cuda(); }
void copy_to_host(void*, void const*, CopyRows const&) { throw_without_cuda(); }
void copy_on_device(void*, void const*, std::size_t) { throw_without_cuda(); }
void device_clear(void*, std::size_t) { throw_without_cuda(); }
void device_synchronize() {}
void check_launch(char const*) { throw_without_cuda(); }

#endif

} // namespace vkt
