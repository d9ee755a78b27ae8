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

/// The power of two that brings a positive number to 2^exponent or up to twice that, or as near as doubles can.
inline double scale_to(double magnitude, int exponent) {
    return std::ldexp(1.0, std::clamp(exponent - std::ilogb(magnitude), -1000, 1000));
}

/// Counts of cells in equal bins over a range. Integers: the order in which they are added does not matter.
class Bins {
public:
    explicit Bins(Range const& range) : counts_(4096) {
        // Neither the difference of the ends nor what it is divided by needs to be a double.
        double const largest = std::max(std::abs(range.least), std::abs(range.greatest));
        if (std::isfinite(largest) && largest > 0) unit_ = scale_to(largest, -2);
        least_ = range.least * unit_;
        double const width = range.greatest * unit_ - least_;
        if (width > 0) per_width_ = static_cast<double>(counts_.size()) / width;
    }

    template <class T> void count(T const* cells, std::int64_t n, std::int64_t weight = 1) {
        auto const last = static_cast<double>(counts_.size() - 1);
        for (std::int64_t i = 0; i < n; ++i) {
            double const place = (static_cast<double>(cells[i]) * unit_ - least_) * per_width_;
            if (std::isfinite(place)) counts_[static_cast<std::size_t>(std::clamp(place, 0.0, last))] += weight;
        }
    }
    void add(Bins const& other) {
        for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
    }
    std::vector<std::int64_t> const& counts() const { return counts_; }

private:
    std::vector<std::int64_t> counts_;
    double unit_ = 1, least_ = 0, per_width_ = 0;
};

/// How cells become floats. Infinite ones become the nearest finite value.
struct Narrowing {
    Rescaling rescaling;
    double lower = 0, upper = 0; ///< limits of what comes out

    float operator()(double value) const {
        double const v = value * rescaling.scale - rescaling.offset * rescaling.scale;
        return static_cast<float>(v < lower ? lower : v > upper ? upper : v);
    }
};

/// An offset for types wider than floats that lie further from zero than they are spread: the median of some values,
/// so that floats keep the differences; a few outliers do not matter for it.
inline double offset_for(std::vector<double>& some) {
    if (some.empty()) return 0;
    auto const quantile = [&](double share) {
        auto const at = some.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(some.size() - 1));
        std::nth_element(some.begin(), at, some.end());
        return *at;
    };
    double const median = quantile(0.5), spread = quantile(0.95) - quantile(0.05);
    return std::abs(median) > spread ? median : 0;
}

/// The median distance from the offset, of those that have some; 0 if there is none.
inline double typical_distance(std::vector<double> const& some, double offset) {
    std::vector<double> distances;
    for (double const value : some)
        if (value != offset) distances.push_back(std::abs(value - offset));
    if (distances.empty()) return 0;
    auto const middle = distances.begin() + std::ssize(distances) / 2;
    std::nth_element(distances.begin(), middle, distances.end());
    return *middle;
}

/// Floats and what fits into them keep their values, unless these are so large or so small that differences of them, or
/// the distances of a transfer function's nodes, are no floats. `cell(i)` for i in [0, n): some of them are looked at.
template <class Cell> Narrowing narrowing_of(DataType type, Range const& range, std::int64_t n, Cell cell) {
    constexpr std::int64_t most = std::int64_t{1} << 16;
    std::vector<double> some;
    for (std::int64_t k = 0; computes_in_double(type) && k < std::min(n, most); ++k) {
        // Multiples of the golden ratio, modulo 1, are spread evenly, whatever the extent of a row.
        double const turns = 0.61803398874989485 * static_cast<double>(k), place = turns - std::floor(turns);
        double const value = cell(n <= most ? k : static_cast<std::int64_t>(place * static_cast<double>(n)));
        if (std::isfinite(value)) some.push_back(value);
    }
    Narrowing narrow;
    Rescaling& to = narrow.rescaling;
    to.offset = offset_for(some);
    double largest = std::max(std::abs(range.least - to.offset), std::abs(range.greatest - to.offset));
    if (!(largest > 0)) largest = std::abs(to.offset); // of a single value
    largest = std::min(largest, std::numeric_limits<double>::max());
    constexpr double tiny = 0x1p-64;
    if (largest > Rescaling::limit)
        to.scale = scale_to(largest, std::ilogb(Rescaling::limit) - 2); // the true one may be twice as large
    else if (largest > 0 && largest < tiny)
        to.scale = scale_to(largest, 0);
    // Where a few values are so much larger than the others that these would be lost, it is the few that are limited.
    double const common = typical_distance(some, to.offset);
    if (common > 0 && common * to.scale < tiny)
        to.scale = common >= tiny && common <= Rescaling::limit ? 1 : scale_to(common, 0);
    narrow.lower = narrow.rescaling.of(range.least);
    narrow.upper = narrow.rescaling.of(range.greatest);
    return narrow;
}

/// In physical values. The total is what was counted, which may be a part of the volume.
Histogram histogram_of(Range const& range, Bins const& bins, ValueMap const& values);

} // namespace vkt::render
