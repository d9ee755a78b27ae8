// Volumes of the C API that are made of a header as JSON and of voxels that the program has.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

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

} // namespace

vkt_status vkt_create_from_header(char const* json, void const* voxels, size_t bytes, vkt_release_function release,
                                  void* user, vkt_volume** volume) {
    return guarded([&](Call&) {
        need(json, "json");
        need(voxels, "voxels");
        need(volume, "volume");
        Header header = header_of(json, bytes);
        if (release == nullptr) {
            *volume = wrapped(copy_of(std::move(header), voxels));
            return;
        }
        auto const owner = std::make_shared<VoxelOwner>();
        *volume = wrapped(in_place(std::move(header), voxels, owner));
        owner->release = release; // nothing can fail any more
        owner->user = user;
    });
}
