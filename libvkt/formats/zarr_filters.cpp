// Undoing the filters of Zarr arrays.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_filters.h"

#include "libvkt/core/type_dispatch.h"
#include "libvkt/formats/raw_source.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace vkt::zarr {
namespace {

/// Of integers what C and NumPy make of them, of floats beyond their range the nearest, and 0 of NaN.
template <class To, class From> To converted(From value) {
    if constexpr (std::is_same_v<From, Half>) {
        return converted<To>(static_cast<float>(value));
    } else if constexpr (std::is_same_v<To, Half>) {
        return Half(static_cast<double>(value));
    } else if constexpr (std::is_integral_v<To> && std::is_floating_point_v<From>) {
        constexpr auto low = std::numeric_limits<To>::lowest(), high = std::numeric_limits<To>::max();
        if (std::isnan(value)) return 0;
        // Around, as NumPy's conversions go: what was encoded with a wrap comes back.
        if (std::abs(value) < static_cast<From>(0x1p63)) return static_cast<To>(static_cast<std::int64_t>(value));
        if (value <= static_cast<From>(low)) return low;
        return value >= static_cast<From>(high) ? high : static_cast<To>(value);
    } else {
        return static_cast<To>(value);
    }
}

template <class From, class To> To sum(To before, From difference) {
    if constexpr (std::is_integral_v<To>) // around, as in NumPy
        return static_cast<To>(static_cast<std::uint64_t>(before) +
                               static_cast<std::uint64_t>(converted<To>(difference)));
    else if constexpr (std::is_same_v<To, Half>)
        return Half(static_cast<float>(before) + static_cast<float>(converted<To>(difference)));
    else
        return before + converted<To>(difference);
}

template <class To, class From>
void undo_one(Filter const& filter, std::byte const* from, std::byte* to, std::size_t n) {
    To last{};
    for (std::size_t i = 0; i < n; ++i) {
        From stored;
        std::memcpy(&stored, from + i * sizeof stored, sizeof stored);
        if (filter.kind == Filter::Kind::delta)
            last = sum<From, To>(last, stored);
        else if (filter.kind == Filter::Kind::scale)
            last = converted<To>(converted<double>(stored) / filter.scale + filter.offset);
        else
            last = converted<To>(stored);
        std::memcpy(to + i * sizeof last, &last, sizeof last);
    }
}

void together(std::span<std::byte const> from, std::span<std::byte> to, std::size_t element) {
    std::size_t const n = from.size() / element;
    for (std::size_t b = 0; b < element; ++b)
        for (std::size_t i = 0; i < n; ++i) to[i * element + b] = from[b * n + i];
    std::memcpy(to.data() + n * element, from.data() + n * element, from.size() - n * element);
}

} // namespace

std::size_t filtered_bytes(std::span<Filter const> filters, DataType type, std::size_t n) {
    if (!filters.empty() && filters.back().kind == Filter::Kind::bits) return 1 + (n + 7) / 8;
    for (Filter const& filter : filters)
        if (filter.kind != Filter::Kind::bytes_apart) type = filter.to;
    return n * size_of(type);
}

void undo(std::span<Filter const> filters, bool swapped, std::span<std::byte> encoded, std::size_t element,
          LargeVector<std::byte>& scratch, std::span<std::byte> to) {
    bool swap = swapped;
    std::span<std::byte> bytes = encoded;
    LargeVector<std::byte> other;
    auto const room = [](LargeVector<std::byte>& memory, std::size_t n) {
        if (memory.size() < n) memory.resize(n);
        return std::span(memory.data(), n);
    };
    for (std::size_t i = filters.size(); i-- > 0;) {
        Filter const& filter = filters[i];
        if (filter.kind == Filter::Kind::bits) {
            std::span<std::byte> const target = room(scratch, to.size() / element);
            for (std::size_t k = 0; k < target.size(); ++k) target[k] = bytes[1 + k / 8] >> (7 - k % 8) & std::byte{1};
            bytes = target;
            continue;
        }
        if (filter.kind == Filter::Kind::bytes_apart) {
            std::span<std::byte> const target = room(bytes.data() == scratch.data() ? other : scratch, bytes.size());
            together(bytes, target, filter.element);
            bytes = target;
            continue;
        }
        std::size_t const n = bytes.size() / size_of(filter.to);
        if (swap) swap_bytes(bytes.data(), n, size_of(filter.to));
        swap = false;
        std::span<std::byte> const target =
            room(bytes.data() == scratch.data() ? other : scratch, n * size_of(filter.from));
        with_type(filter.to, [&]<class From>(From) {
            with_type(filter.from, [&]<class To>(To) { undo_one<To, From>(filter, bytes.data(), target.data(), n); });
        });
        bytes = target;
    }
    std::memcpy(to.data(), bytes.data(), std::min(to.size(), bytes.size()));
    if (swap) swap_bytes(to.data(), to.size() / element, element); // bytes alone were moved
}

} // namespace vkt::zarr
