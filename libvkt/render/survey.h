// What the cells of a volume hold: their range, and how many there are of every value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/cells.h"
#include "libvkt/render/transfer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

namespace vkt::render {

struct Range {
    double least = std::numeric_limits<double>::infinity(), greatest = -std::numeric_limits<double>::infinity();
    std::int64_t missing = 0, infinite = 0;

    bool empty() const { return !(least <= greatest); }
    void add(Range const& other) {
        least = std::min(least, other.least);
        greatest = std::max(greatest, other.greatest);
        missing += other.missing;
        infinite += other.infinite;
    }
};

template <class T> Range range_of(T const* cells, std::int64_t n) {
    Range range;
    if constexpr (std::is_integral_v<T>) {
        if (n == 0) return range;
        T low = cells[0], high = cells[0];
        for (std::int64_t i = 0; i < n; ++i) {
            low = cells[i] < low ? cells[i] : low;
            high = cells[i] > high ? cells[i] : high;
        }
        range.least = static_cast<double>(low), range.greatest = static_cast<double>(high);
    } else {
        for (std::int64_t i = 0; i < n; ++i) {
            auto const value = static_cast<double>(cells[i]);
            if (std::isfinite(value)) {
                range.least = value < range.least ? value : range.least;
                range.greatest = value > range.greatest ? value : range.greatest;
            } else {
                ++(std::isnan(value) ? range.missing : range.infinite);
            }
        }
    }
    return range;
}

/// Counts of cells in equal bins over a range. Integers: the order in which they are added does not matter.
class Bins {
public:
    explicit Bins(Range const& range) : counts_(4096) {
        // Times a power of two no extent of finite values overflows, and none is so small that its inverse does.
        double const extent = range.greatest - range.least;
        unit_ = extent > 0x1p1000 ? 0x1p-100 : extent < 0x1p-900 ? 0x1p100 : 1;
        least_ = range.least * unit_;
        if (range.greatest > range.least)
            scale_ = static_cast<double>(counts_.size()) / (range.greatest * unit_ - least_);
    }

    template <class T> void count(T const* cells, std::int64_t n, std::int64_t weight = 1) {
        auto const last = static_cast<double>(counts_.size() - 1);
        for (std::int64_t i = 0; i < n; ++i) {
            double const place = (static_cast<double>(cells[i]) * unit_ - least_) * scale_;
            if (std::isfinite(place)) counts_[static_cast<std::size_t>(std::clamp(place, 0.0, last))] += weight;
        }
    }
    void add(Bins const& other) {
        for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
    }
    std::vector<std::int64_t> const& counts() const { return counts_; }

private:
    std::vector<std::int64_t> counts_;
    double unit_ = 1, least_ = 0, scale_ = 0;
};

/// How cells become floats: less an offset. Infinite ones become the nearest finite value.
struct Narrowing {
    double offset = 0, lower = 0, upper = 0; ///< limits of what is left after the offset

    float operator()(double value) const {
        double const v = value - offset;
        return static_cast<float>(v < lower ? lower : v > upper ? upper : v);
    }
};

/// Floats and what fits into them keep their values. Where wider types lie further from zero than they are spread,
/// their median is subtracted, so that floats keep the differences; a few outliers do not matter for it.
/// `cell(i)` for i in [0, n): some of them are looked at.
template <class Cell> Narrowing narrowing_of(DataType type, Range const& range, std::int64_t n, Cell cell) {
    if (!computes_in_double(type)) return {0, range.least, range.greatest};
    constexpr std::int64_t most = std::int64_t{1} << 16;
    std::vector<double> some;
    for (std::int64_t k = 0; k < std::min(n, most); ++k) {
        // Multiples of the golden ratio, modulo 1, are spread evenly, whatever the extent of a row.
        double const turns = 0.61803398874989485 * static_cast<double>(k), place = turns - std::floor(turns);
        double const value = cell(n <= most ? k : static_cast<std::int64_t>(place * static_cast<double>(n)));
        if (std::isfinite(value)) some.push_back(value);
    }
    auto const quantile = [&](double share) {
        auto const at = some.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(some.size() - 1));
        std::nth_element(some.begin(), at, some.end());
        return *at;
    };
    double offset = 0;
    if (!some.empty()) {
        double const median = quantile(0.5), spread = quantile(0.95) - quantile(0.05);
        offset = std::abs(median) > spread ? median : 0;
    }
    constexpr double limit = std::numeric_limits<float>::max() / 4.0; // differences are floats too
    return {offset, std::max(range.least - offset, -limit), std::min(range.greatest - offset, limit)};
}

/// In physical values. The total is what was counted, which may be a part of the volume.
Histogram histogram_of(Range const& range, Bins const& bins, ValueMap const& values);

} // namespace vkt::render
