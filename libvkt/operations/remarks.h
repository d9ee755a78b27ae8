// What storing into a smaller type lost, counted and said in one line.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/engine/operation.h"

namespace vkt {

/// "12034 of 16777216 voxels (0.07 %) clipped to [0,255]" and the like; nothing if nothing was lost.
std::vector<Remark> store_remarks(Losses const& counts, std::int64_t voxels, DataType type);
/// "N of M voxels (P %)", with as many digits as tell it from zero.
std::string share_text(std::int64_t part, std::int64_t whole);

} // namespace vkt
