// Volumes of the C API that are made of a header as JSON and of voxels that the program has.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <utility>

using namespace vkt;
using namespace vkt::c;

namespace {

/// Tells the program when nothing uses its voxels any more, once `release` has been set.
struct VoxelOwner {
    VoxelOwner() = default;
    ~VoxelOwner() {
        if (release != nullptr) release(user);
    }
    VoxelOwner(VoxelOwner const&) = delete;
    VoxelOwner& operator=(VoxelOwner const&) = delete;

    vkt_release_function release = nullptr;
    void* user = nullptr;
};

/// Throws Error{data} for hierarchical volumes, Error{usage} if the voxels are not as many bytes.
Header header_of(char const* json, std::size_t bytes) {
    Header header = header_from_json(json);
    if (header.kind == Kind::hierarchical)
        throw Error(ErrorKind::data, "a hierarchical volume is no box of voxels", "a stream can hold it");
    header.dry_run = header.timing = false;
    // Directions are of length 1, and what they are longer is spacing: the same places.
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 const direction = header.geometry.direction[static_cast<std::size_t>(axis)];
        if (std::abs(length(direction) - 1) > 1e-9)
            set_axis(header.geometry, axis, direction * header.geometry.spacing[axis], "the direction");
    }
    mark_as_given(header);
    if (bytes != header.bytes())
        throw Error(ErrorKind::usage, text("the voxels are ", static_cast<std::uint64_t>(bytes), " bytes, not ",
                                           static_cast<std::uint64_t>(header.bytes())));
    return header;
}

Volume copy_of(Header header, void const* voxels) {
    Volume result(std::move(header));
    AnyView const view = result.mutable_view();
    std::memcpy(view.data, voxels, view.bytes());
    return result;
}

Volume in_place(Header header, void const* voxels, std::shared_ptr<VoxelOwner> owner) {
    if (reinterpret_cast<std::uintptr_t>(voxels) % size_of(header.dtype) != 0)
        throw Error(ErrorKind::usage, "the voxels are not aligned to their size", "let them be copied");
    // Volumes that are inputs are never written to.
    auto* const data = const_cast<std::byte*>(static_cast<std::byte const*>(voxels));
    std::size_t const bytes = header.bytes();
    return Volume(std::move(header), Buffer::adopt(data, bytes, std::move(owner)));
}

/// Device memory of whatever alignment as kernels need it.
Volume copy_on_device(Header header, void const* voxels) {
    Volume result(std::move(header));
    vkt::copy_on_device(result.buffer().write(Space::device), voxels, result.header().bytes());
    device_synchronize();
    return result;
}

Volume in_place_on_device(Header header, void const* voxels, int device, std::shared_ptr<VoxelOwner> owner) {
    if (reinterpret_cast<std::uintptr_t>(voxels) % 256 != 0)
        throw Error(ErrorKind::usage, "the voxels are not aligned to 256 bytes", "let them be copied");
    auto* const data = const_cast<std::byte*>(static_cast<std::byte const*>(voxels));
    std::size_t const bytes = header.bytes();
    return Volume(std::move(header), Buffer::adopt_on_device(data, device, bytes, std::move(owner)));
}

/// The volume that `make` makes of an owner, which is told of the program's voxels when nothing can fail any more.
template <class Make> vkt_volume* owning(vkt_release_function release, void* user, Make make) {
    auto const owner = std::make_shared<VoxelOwner>();
    vkt_volume* const volume = wrapped(make(owner));
    owner->release = release;
    owner->user = user;
    return volume;
}

} // namespace

vkt_status vkt_create_from_header(char const* json, void const* voxels, size_t bytes, vkt_release_function release,
                                  void* user, vkt_volume** volume) {
    return guarded([&](Call& call) {
        need(json, "json");
        need(voxels, "voxels");
        need(volume, "volume");
        Header header = header_of(json, bytes);
        if (release == nullptr) {
            check_budget(bytes, call.execution());
            *volume = wrapped(copy_of(std::move(header), voxels));
            return;
        }
        *volume = owning(release, user, [&](auto const& owner) { return in_place(std::move(header), voxels, owner); });
    });
}

vkt_status vkt_create_on_device(char const* json, void const* voxels, size_t bytes, vkt_release_function release,
                                void* user, vkt_volume** volume) {
    return guarded([&](Call&) {
        need(json, "json");
        need(voxels, "voxels");
        need(volume, "volume");
        int const device = device_of(voxels);
        if (device < 0)
            throw Error(ErrorKind::usage, "the voxels are in memory of the host",
                        "vkt_create_from_header() takes them");
        Header header = header_of(json, bytes);
        device_select(device);
        device_synchronize();
        if (release == nullptr)
            *volume = wrapped(copy_on_device(std::move(header), voxels));
        else
            *volume = owning(release, user, [&](auto const& owner) {
                return in_place_on_device(std::move(header), voxels, device, owner);
            });
    });
}
