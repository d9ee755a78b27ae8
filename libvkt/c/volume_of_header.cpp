// Headers from JSON, voxels copied or kept where they are.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volume_of_header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cstdint>
#include <cstring>
#include <utility>

namespace vkt {

Volume volume_of_header(std::string_view json, void const* voxels, std::size_t bytes,
                        std::shared_ptr<VoxelOwner> owner) {
    Header header = header_from_json(json);
    if (header.kind == Kind::hierarchical)
        throw Error(ErrorKind::data, "a hierarchical volume is no box of voxels", "its form is the stream");
    header.dry_run = header.timing = false;
    mark_as_given(header);
    if (bytes != header.bytes())
        throw Error(ErrorKind::usage, text("the voxels are ", static_cast<std::uint64_t>(bytes), " bytes, not ",
                                           static_cast<std::uint64_t>(header.bytes())));
    if (!owner) {
        Volume result(std::move(header));
        std::memcpy(result.mutable_view().data, voxels, bytes);
        return result;
    }
    if (reinterpret_cast<std::uintptr_t>(voxels) % size_of(header.dtype) != 0)
        throw Error(ErrorKind::usage, "the voxels are not aligned to their size", "let them be copied");
    // Volumes that are inputs are never written to.
    auto* const data = const_cast<std::byte*>(static_cast<std::byte const*>(voxels));
    return Volume(std::move(header), Buffer::adopt(data, bytes, std::move(owner)));
}

} // namespace vkt
