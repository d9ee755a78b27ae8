// A region of a volume that is there, which is written anew while the rest of it stays.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/view.h"
#include "libvkt/formats/format.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace vkt {

/// What is there: equal volumes, and how messages and commands name them.
struct RegionTarget {
    std::string name;
    Header whole; ///< of each
    std::int64_t volumes = 1;
};

/// The number of the volume of the target that the part is written into after `written` others. Throws Error{usage} if
/// it is not said, if there is none, and for a part that does not fit into it from options.at on, or whose numbers are
/// others.
std::int64_t checked_volume(RegionTarget const& target, Header const& part, WriteOptions const& options,
                            std::int64_t written);

/// The header of what vkt wrote, once the part is in it: how it came about, and how exact it is.
Header with_part(RegionTarget const& target, Header const& part, Index3 at);

/// Voxels of a part as they come, handed on in boxes that end where layers of chunks do.
class RegionLayers {
public:
    /// Of chunks of so many slices at most `most` bytes are held, at least a row.
    void begin(Header const& part, Index3 at, std::int64_t depth, std::size_t most);
    /// `flush` takes dense voxels of a box of the volume.
    void add(std::byte const* voxels, std::size_t n, std::function<void(Box const&, std::byte const*)> const& flush);

private:
    Index3 dims_, at_;
    std::size_t row_ = 0, most_ = 0; ///< bytes
    std::int64_t depth_ = 1;         ///< slices of a layer of chunks that are held at a time; none: some rows
    std::int64_t rows_ = 0;          ///< that were handed on
    std::vector<std::byte> held_;
};

} // namespace vkt
