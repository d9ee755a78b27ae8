// Rows of labels from runs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/numeric.h"

#include <span>

namespace vkt {

/// `row`, a row of unsigned integers, becomes names[i] from edges[2 i] to before edges[2 i + 1], and 0 elsewhere. It
/// may be written around the caches: stream_fence() before others read it.
VKT_CPU_KERNEL(paint_row,
               (std::span<std::int32_t const> edges, std::uint32_t const* names, AnyView row,
                Execution const& execution),
               (edges, names, row, execution))

} // namespace vkt
