// Physical values of voxels and of rows of them, in double. For kernel sources and their host parts.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/rows.h"

namespace vkt::VKT_BACKEND {

/// As ValueMap::physical() has it.
VKT_HD double physical_value(double stored, double slope, double intercept) {
    double const value = slope * stored + intercept;
    bool const beyond = value - value != 0 && stored - stored == 0;
    return beyond ? __builtin_fma(slope, stored, intercept) : value;
}

/// Of n voxels of a row, from `at` on. On CPUs.
inline void load_values(ConstView view, Index3 at, std::int64_t n, ValueMap const& map, double* to) {
    for (std::int64_t i = 0; i < n; i += row_piece)
        load_row(view.type, view.at(at.x + i, at.y, at.z), to + i, row_piece < n - i ? row_piece : n - i);
    if (map.slope == 1 && map.intercept == 0) return;
    for (std::int64_t i = 0; i < n; ++i) to[i] = physical_value(to[i], map.slope, map.intercept);
}

} // namespace vkt::VKT_BACKEND
