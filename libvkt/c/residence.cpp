// Where the voxels of the C API's volumes are: asked, moved, handed out.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"

#include <optional>

using namespace vkt;
using namespace vkt::c;

namespace {

void need_voxels(Volume const& volume) {
    if (volume.header().kind == Kind::hierarchical)
        throw Error(ErrorKind::usage, "a hierarchical volume is no box of voxels",
                    "make a grid of it: resample --cells 50M");
}

/// The contents on a GPU: the one that has them, else the one that the options name.
std::byte const* on_gpu(Volume const& volume, ExecutionOptions options) {
    if (options.device == "auto" || options.device == "cpu") options.device = "gpu";
    Execution const execution = options.execution();
    Buffer& buffer = volume.buffer();
    if (!buffer.resident(Space::device)) device_select(execution.gpu);
    return buffer.read(Space::device);
}

} // namespace

vkt_status vkt_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes) {
    return guarded([&](Call&) {
        need(volume, "volume");
        need(voxels, "voxels");
        need_voxels(volume->volume);
        ConstView const view = volume->volume.view();
        *voxels = view.data;
        if (bytes != nullptr) *bytes = view.bytes();
    });
}

vkt_status vkt_device_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes, int* device) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(voxels, "voxels");
        need_voxels(volume->volume);
        *voxels = on_gpu(volume->volume, call.policy());
        device_select(volume->volume.buffer().device());
        device_synchronize();
        if (bytes != nullptr) *bytes = volume->volume.header().bytes();
        if (device != nullptr) *device = volume->volume.buffer().device();
    });
}

vkt_status vkt_residence(vkt_volume const* volume, int* host, int* device) {
    return guarded([&](Call&) {
        need(volume, "volume");
        need(host, "host");
        need(device, "device");
        Buffer const& buffer = volume->volume.buffer();
        *host = buffer.resident(Space::host) ? 1 : 0;
        *device = buffer.resident(Space::device) ? buffer.device() : -1;
    });
}

vkt_status vkt_migrate(vkt_volume const* volume, char const* device) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(device, "device");
        ExecutionOptions options = call.policy();
        options.device = device;
        bool const gpu = options.execution().device == Device::gpu;
        if (gpu)
            on_gpu(volume->volume, options);
        else
            volume->volume.buffer().read(Space::host);
    });
}
