// What storing into a smaller type lost, counted and said in one line.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/losses.h"
#include "libvkt/engine/operation.h"
#include "libvkt/operations/common/number.h"

namespace vkt {

/// "12034 of 16777216 voxels (0.07 %) clipped to [0,255]" and the like; nothing if nothing was lost.
std::vector<Remark> store_remarks(Losses const& counts, std::int64_t voxels, DataType type);
/// "the value 300 does not fit uint8: stored as 255 in 315 voxels"; nothing if it fits, or if no voxel holds it.
/// `stored` is the value before rounding, as the volume's value map has it.
std::vector<Remark> value_remarks(Number const& value, Number const& stored, DataType type, std::int64_t voxels);
/// "N of M voxels (P %)", with as many digits as tell it from zero.
std::string share_text(std::int64_t part, std::int64_t whole);

} // namespace vkt
