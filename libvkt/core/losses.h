// What storing results lost: counted by drivers, added up over regions, said in one line at the end.
// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

namespace vkt {

/// Numbers of voxels.
struct Losses {
    std::int64_t clipped = 0;   ///< outside the range of the output type, stored as its nearest end
    std::int64_t nan = 0;       ///< not a number, where the output type has none: stored as 0
    std::int64_t undefined = 0; ///< a functor's own count, such as of integers divided by zero
    Losses& operator+=(Losses const& other) {
        clipped += other.clipped;
        nan += other.nan;
        undefined += other.undefined;
        return *this;
    }
    std::vector<std::int64_t*> counters() { return {&clipped, &nan, &undefined}; }
    bool any() const { return (clipped | nan | undefined) != 0; }
};

} // namespace vkt
