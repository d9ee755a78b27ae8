// GPU memory over the device runtime.
// SPDX-License-Identifier: MIT
#include "ipc/gpu_memory.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"

#include <future>

namespace vkt::ipc {
namespace {

class CudaPiece : public RingMemory {
public:
    explicit CudaPiece(SharedDeviceMemory memory) : memory_(std::move(memory)) {}
    std::byte* data() const override { return memory_.data(); }
    int descriptor() const override { return memory_.descriptor(); }

private:
    SharedDeviceMemory memory_;
};

class CudaMemory : public GpuMemory {
public:
    explicit CudaMemory(int gpu)
        : gpu_(gpu), identity_(std::async(std::launch::async, [gpu] { return try_device_sharing(gpu); })) {}

    DeviceIdentity identity() override { return identity_.get(); }
    std::unique_ptr<RingMemory> create(std::size_t bytes) override {
        device_select(gpu_);
        return std::make_unique<CudaPiece>(SharedDeviceMemory::create(bytes));
    }
    std::unique_ptr<RingMemory> open(int descriptor, std::size_t bytes) override {
        device_select(gpu_);
        return std::make_unique<CudaPiece>(SharedDeviceMemory::open(descriptor, bytes));
    }
    void settle() override {
        device_select(gpu_);
        device_synchronize();
    }

private:
    int gpu_;
    std::shared_future<DeviceIdentity> identity_;
};

} // namespace

std::shared_ptr<GpuMemory> cuda_memory(int gpu, char const* asked) {
    if (!built_with_cuda())
        throw Error(ErrorKind::resources, text(asked, ": this vkt was built without CUDA"),
                    "use --transport shm, or build with -DVKT_CUDA=ON");
    int const found = gpu_count();
    if (gpu < 0 || gpu >= found)
        throw Error(ErrorKind::resources, text(asked, ": there is no GPU ", gpu, " (", found, " found)"),
                    "use --transport shm");
    return std::make_shared<CudaMemory>(gpu);
}

} // namespace vkt::ipc
