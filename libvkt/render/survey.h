// What the cells of a volume hold: their range, and how many there are of every value.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/transfer.h"

#include <algorithm>
#include <cmath>
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
    explicit Bins(Range const& range)
        : counts_(4096), least_(range.least),
          scale_(range.greatest > range.least ? static_cast<double>(counts_.size()) / (range.greatest - range.least)
                                              : 0) {}

    template <class T> void count(T const* cells, std::int64_t n, std::int64_t weight = 1) {
        auto const last = static_cast<double>(counts_.size() - 1);
        for (std::int64_t i = 0; i < n; ++i) {
            double const place = (static_cast<double>(cells[i]) - least_) * scale_;
            if (std::isfinite(place)) counts_[static_cast<std::size_t>(std::clamp(place, 0.0, last))] += weight;
        }
    }
    void add(Bins const& other) {
        for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
    }
    std::vector<std::int64_t> const& counts() const { return counts_; }

private:
    std::vector<std::int64_t> counts_;
    double least_, scale_;
};

/// In physical values. The total is what was counted, which may be a part of the volume.
Histogram histogram_of(Range const& range, Bins const& bins, ValueMap const& values);

} // namespace vkt::render
