// Ranges of bricks.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/cells.h"
#include "libvkt/amr/tree.h"

#include <numeric>

namespace vkt {

namespace {

template <class T> ValueRange range_of(T const* cells, std::int64_t n) {
    using Value = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    Value const limit = std::numeric_limits<Value>::has_infinity ? std::numeric_limits<Value>::infinity()
                                                                 : std::numeric_limits<Value>::max();
    Value const lowest =
        std::numeric_limits<Value>::has_infinity ? static_cast<Value>(-limit) : std::numeric_limits<Value>::lowest();
    Value low = limit, high = lowest;
    std::int64_t valid = 0;
    for (std::int64_t i = 0; i < n; ++i) {
        Value const v = static_cast<Value>(cells[i]);
        low = v < low ? v : low;
        high = v > high ? v : high;
        if constexpr (std::is_floating_point_v<Value>)
            valid += std::isnan(v) ? 0 : 1;
        else
            ++valid;
    }
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (valid == 0) return {infinity, -infinity};
    return {static_cast<double>(low), static_cast<double>(high)};
}

} // namespace

std::vector<ValueRange> brick_ranges(Volume const& volume, Execution const& execution) {
    std::vector<std::size_t> all(volume.bricks().size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    return brick_ranges(volume, all, execution);
}

std::vector<ValueRange> brick_ranges(Volume const& volume, std::span<std::size_t const> which,
                                     Execution const& execution) {
    std::vector<ValueRange> ranges(which.size());
    std::byte const* const data = volume.buffer().read(Space::host);
    auto const count = static_cast<std::int64_t>(which.size());
    with_cell_type(volume.header().dtype, [&]<class T>(T) {
        auto const* const cells = reinterpret_cast<T const*>(data);
#pragma omp parallel for num_threads(execution.threads) schedule(static)
        for (std::int64_t i = 0; i < count; ++i) {
            std::size_t const b = which[static_cast<std::size_t>(i)];
            ranges[static_cast<std::size_t>(i)] = range_of(cells + volume.brick_offset(b), volume.bricks()[b].cells());
        }
    });
    return ranges;
}

ValueRange united(std::span<ValueRange const> ranges) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    ValueRange all{infinity, -infinity};
    for (ValueRange const& range : ranges) {
        all.minimum = range.minimum < all.minimum ? range.minimum : all.minimum;
        all.maximum = range.maximum > all.maximum ? range.maximum : all.maximum;
    }
    return all;
}

} // namespace vkt
