// The stored zero.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/zero.h"

#include "libvkt/core/half.h"

#include <cmath>

namespace vkt {

std::optional<double> stored_zero(Header const& header) {
    double stored = header.values.stored(0);
    if (is_integer(header.dtype)) {
        stored = std::nearbyint(stored);
        if (stored < lowest_of(header.dtype) || stored > highest_of(header.dtype) || std::abs(stored) > 0x1p53)
            return std::nullopt;
    } else if (header.dtype == DataType::float32) {
        stored = static_cast<double>(static_cast<float>(stored));
    } else if (header.dtype == DataType::float16) {
        stored = static_cast<double>(Half(stored));
    }
    if (header.values.physical(stored) != 0) return std::nullopt;
    return stored;
}

} // namespace vkt
