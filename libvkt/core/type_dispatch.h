// The one dispatch over data types: from a DataType at run time to code for the storage type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/half.h"
#include "libvkt/core/types.h"

#include <cstdint>

namespace vkt {

/// Calls f(T{}) with the storage type T of a data type and returns what it returns. Inlined always: what is compiled
/// for one instruction set must never stand in for the others. constexpr: GPU kernels call it, too.
template <class F> [[gnu::always_inline]] constexpr decltype(auto) with_type(DataType type, F&& f) {
    switch (type) {
    case DataType::uint8:
        return f(std::uint8_t{});
    case DataType::int8:
        return f(std::int8_t{});
    case DataType::uint16:
        return f(std::uint16_t{});
    case DataType::int16:
        return f(std::int16_t{});
    case DataType::uint32:
        return f(std::uint32_t{});
    case DataType::int32:
        return f(std::int32_t{});
    case DataType::uint64:
        return f(std::uint64_t{});
    case DataType::int64:
        return f(std::int64_t{});
    case DataType::float16:
        return f(Half{});
    case DataType::float32:
        return f(float{});
    case DataType::float64:
        break;
    }
    return f(double{}); // so that what is set here is set on every way
}

} // namespace vkt
