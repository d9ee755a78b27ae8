// Ranges of bricks.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/cells.h"
#include "libvkt/amr/tree.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace vkt {

namespace {

template <class T> ValueRange range_of(T const* cells, std::int64_t n) {
    using Value = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    Value const limit = std::numeric_limits<Value>::has_infinity ? std::numeric_limits<Value>::infinity()
                                                                 : std::numeric_limits<Value>::max();
    Value const lowest =
        std::numeric_limits<Value>::has_infinity ? static_cast<Value>(-limit) : std::numeric_limits<Value>::lowest();
    // In lanes, because comparisons of floats may not be reordered for a compiler; NaN is below and above nothing.
    constexpr std::int64_t lanes = 16;
    Value low[lanes], high[lanes];
    std::fill_n(low, lanes, limit);
    std::fill_n(high, lanes, lowest);
    std::int64_t i = 0;
    for (; i + lanes <= n; i += lanes)
#pragma omp simd
        for (std::int64_t lane = 0; lane < lanes; ++lane) {
            Value const v = static_cast<Value>(cells[i + lane]);
            low[lane] = v < low[lane] ? v : low[lane];
            high[lane] = v > high[lane] ? v : high[lane];
        }
    for (; i < n; ++i) {
        Value const v = static_cast<Value>(cells[i]);
        low[0] = v < low[0] ? v : low[0];
        high[0] = v > high[0] ? v : high[0];
    }
    Value const least = *std::min_element(low, low + lanes), most = *std::max_element(high, high + lanes);
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (n == 0 || least > most) return {infinity, -infinity}; // nothing but NaN
    return {static_cast<double>(least), static_cast<double>(most)};
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
    with_type(volume.header().dtype, [&]<class T>(T) {
        auto const* const cells = reinterpret_cast<T const*>(data);
#pragma omp parallel for num_threads(execution.threads) schedule(static)
        for (std::int64_t i = 0; i < count; ++i) {
            std::size_t const b = which[static_cast<std::size_t>(i)];
            ranges[static_cast<std::size_t>(i)] = range_of(cells + volume.brick_offset(b), volume.bricks()[b].cells());
        }
    });
    return ranges;
}

std::vector<ValueRange> brick_ranges(std::byte const* cells, DataType type, BrickTable const& bricks,
                                     Execution const& execution) {
    std::vector<std::int64_t> offsets;
    offsets.reserve(bricks.size());
    std::int64_t offset = 0;
    for (Brick const& brick : bricks) offsets.push_back(std::exchange(offset, offset + brick.cells()));
    std::vector<ValueRange> ranges(bricks.size());
    with_type(type, [&]<class T>(T) {
        auto const* const values = reinterpret_cast<T const*>(cells);
#pragma omp parallel for num_threads(execution.threads) schedule(static)
        for (std::size_t i = 0; i < ranges.size(); ++i) ranges[i] = range_of(values + offsets[i], bricks[i].cells());
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
