// Zarr's filters: what numbers became before they were compressed.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/large_vector.h"
#include "libvkt/core/types.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace vkt::zarr {

/// One step of encoding, as numcodecs has it.
struct Filter {
    enum class Kind : std::uint8_t {
        delta,       ///< differences of neighbours
        scale,       ///< (number - offset) * scale, rounded
        cast,        ///< another type; rounded before, if at all
        bytes_apart, ///< first bytes of all elements, then second ones ("shuffle")
        bits,        ///< of bools, behind a byte that counts those of the last byte that are none; the last filter
    };
    Kind kind = Kind::cast;
    DataType from = DataType::uint8, to = DataType::uint8; ///< what it takes, and what it makes of it
    double scale = 1, offset = 0;
    std::size_t element = 1; ///< bytes, of bytes_apart
};

/// Bytes of `n` elements of `type` once they went through the filters.
std::size_t filtered_bytes(std::span<Filter const> filters, DataType type, std::size_t n);

/// Undoes the filters, the last one first: `encoded` has as many bytes as filtered_bytes() says, and is changed;
/// numbers of more than one byte are in the other order than this machine's if `swapped`. `to` is written in this
/// machine's; its elements have `element` bytes.
void undo(std::span<Filter const> filters, bool swapped, std::span<std::byte> encoded, std::size_t element,
          LargeVector<std::byte>& scratch, std::span<std::byte> to);

} // namespace vkt::zarr
