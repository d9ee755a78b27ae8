// What storing results lost, counted: the one counter that drivers, operations and reports share.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace vkt {

/// Voxels that did not come out as computed. Parts merge by addition, in any order.
struct Losses {
    std::int64_t clipped = 0;   ///< outside the range of the stored type
    std::int64_t nan = 0;       ///< not a number, where the stored type cannot say so
    std::int64_t undefined = 0; ///< without a result, as an integer divided by zero; in neither of the others

    Losses& operator+=(Losses const& other) {
        clipped += other.clipped;
        nan += other.nan;
        undefined += other.undefined;
        return *this;
    }
    bool none() const { return clipped == 0 && nan == 0 && undefined == 0; }
    friend bool operator==(Losses const&, Losses const&) = default;
};

} // namespace vkt
