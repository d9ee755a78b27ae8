// Edges, and the slow and sure way to a value's bin.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/bins.h"

#include "libvkt/kernel/numeric.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace vkt {
namespace {

Int128 ceiling(double value) { return static_cast<Int128>(std::ceil(std::clamp(value, -0x1p100, 0x1p100))); }

/// n / d for d > 0, rounded up.
Int128 ceiling(Int128 n, Int128 d) {
    Int128 const quotient = n / d;
    return quotient * d < n ? quotient + 1 : quotient;
}

} // namespace

Bins::Bins(DataType type, ValueMap const& map, Number const& low, Number const& high, int count)
    : type_(type), map_(map), low_(low), high_(high), count_(count) {
    bool const whole = is_integer(type) && map == ValueMap{};
    exact_ = whole && low.whole && high.whole;
    wide_ = whole && size_of(type) == 8;
    // Neither the difference of the ends nor what divides by it needs to be a double.
    double const extent = high.value - low.value;
    if (!std::isfinite(extent)) scale_ = 0.25;
    if (extent < 0x1p-900) scale_ = 0x1p500;
    scaled_low_ = low.value * scale_;
    per_unit_ = count / (high.value * scale_ - scaled_low_);
    far_ = !(std::max(std::abs(low.value), std::abs(high.value)) * scale_ * per_unit_ < 0x1p30);
    for (int k = 0; k <= count && !wide_; ++k) {
        double value = edge(k);
        // 2^40 is beyond all types that get here.
        if (exact_)
            value = static_cast<double>(
                std::clamp<Int128>(*low.whole + ceiling(Int128{k} * (*high.whole - *low.whole), count),
                                   -(Int128{1} << 40), Int128{1} << 40));
        edges_.push_back(value);
    }
    if (wide_) {
        for (int k = 0; k <= count; ++k)
            whole_edges_.push_back(exact_ ? *low.whole + ceiling(Int128{k} * (*high.whole - *low.whole), count)
                                          : ceiling(edge(k)));
        highest_ =
            high.whole ? *high.whole : static_cast<Int128>(std::floor(std::clamp(high.value, -0x1p100, 0x1p100)));
        // Values are counted from the first edge; what lies between it and the lower end is less than one.
        double const rest = exact_ ? 0 : static_cast<double>(whole_edges_.front()) - low.value;
        double const width = exact_ ? static_cast<double>(*high.whole - *low.whole) : extent;
        scale_ = 1;
        scaled_low_ = std::isfinite(rest) && std::abs(rest) <= 1 ? -rest : 0;
        per_unit_ = count / width;
    }
    if (size_of(type) > 2) return;
    table_.resize(std::size_t{1} << (8 * size_of(type)));
    for (std::size_t bits = 0; bits < table_.size(); ++bits) table_[bits] = slot_of(value_of_pattern(type, bits));
}

Bins Bins::of_patterns(DataType type) {
    Bins bins;
    bins.type_ = type;
    bins.edges_ = {0, 0};
    bins.table_.resize(std::size_t{1} << (8 * size_of(type)));
    std::iota(bins.table_.begin(), bins.table_.end(), 0);
    bins.count_ = static_cast<int>(bins.table_.size());
    return bins;
}

double Bins::value_of_pattern(DataType type, std::size_t bits) {
    double value = 0;
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) <= 2) {
            auto const pattern = static_cast<std::uint16_t>(bits);
            T stored;
            std::memcpy(static_cast<void*>(&stored), &pattern, sizeof stored);
            value = static_cast<double>(stored);
        }
    });
    return value;
}

double Bins::edge(int k) const {
    if (k == 0) return low_.value;
    if (k == count_) return high_.value;
    if (exact_) {
        Int128 const steps = Int128{k} * (*high_.whole - *low_.whole), whole = steps / count_;
        return static_cast<double>(*low_.whole + whole) + static_cast<double>(steps - whole * count_) / count_;
    }
    double const width = high_.value - low_.value;
    if (std::isfinite(width)) return low_.value + k * (width / count_);
    double const share = static_cast<double>(k) / count_;
    return low_.value * (1 - share) + high_.value * share;
}

std::string Bins::edge_text(int k) const {
    if (exact_) {
        Int128 const steps = Int128{k} * (*high_.whole - *low_.whole);
        if (steps % count_ == 0) return to_text(*low_.whole + steps / count_);
    }
    return to_text(edge(k));
}

int Bins::slot_of(double stored) const {
    double const value = map_.physical(stored);
    if (std::isnan(value)) return missing();
    if (value < edges_.front()) return under();
    if (value > edges_.back()) return over();
    auto const above = std::upper_bound(edges_.begin(), edges_.end(), value);
    return static_cast<int>(std::min<std::ptrdiff_t>(above - edges_.begin() - 1, count_ - 1));
}

int Bins::slot_of(Int128 stored) const {
    if (stored < whole_edges_.front()) return under();
    if (stored > highest_) return over();
    auto const above = std::upper_bound(whole_edges_.begin(), whole_edges_.end(), stored);
    return static_cast<int>(std::min<std::ptrdiff_t>(above - whole_edges_.begin() - 1, count_ - 1));
}

} // namespace vkt
