// Counting values by pattern.
// SPDX-License-Identifier: MIT
#if VKT_HOST
#include "libvkt/operations/quantiles.h"

#include "libvkt/kernel/kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace vkt {
namespace {

constexpr std::size_t most_counters = std::size_t{1} << 21;

/// The upper halves of float64 patterns, rounded, arranged to ascend with the value.
std::uint32_t key_of(double value) {
    auto const bits = static_cast<std::uint32_t>((std::bit_cast<std::uint64_t>(value) + 0x80000000u) >> 32);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
double value_of(std::uint32_t key) {
    std::uint32_t const bits = (key & 0x80000000u) != 0 ? key & 0x7fffffffu : ~key;
    return std::bit_cast<double>(std::uint64_t{bits} << 32);
}

template <class T> void count_small(ConstView slab, std::uint64_t* counters, int threads) {
    View<T const> const in = slab.as<T>();
    Box const box = slab.box;
    constexpr std::size_t bins = std::size_t{1} << (8 * sizeof(T));
    constexpr int lowest = std::numeric_limits<T>::lowest();
#pragma omp parallel num_threads(threads) if (slab.box.voxels() > 65536)
    {
        std::vector<std::uint64_t> mine(bins);
#pragma omp for collapse(2) schedule(static)
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                T const* const row = &in(box.lower.x, y, z);
                std::int64_t const n = box.dims().x;
                for (std::int64_t x = 0; x < n; ++x)
                    ++mine[static_cast<std::size_t>(static_cast<int>(row[x]) - lowest)];
            }
#pragma omp critical(vkt_quantiles)
        for (std::size_t i = 0; i < bins; ++i) counters[i] += mine[i];
    }
}

} // namespace

Quantiles::Quantiles(DataType type) : type_(type), exact_(is_integer(type) && size_of(type) <= 2) {
    if (exact_)
        counters_.resize(std::size_t{1} << (8 * size_of(type)));
    else
        leaves_.assign(65536, -1);
}

void Quantiles::add(ConstView slab, int threads) {
    if (exact_) return add_exactly(slab, threads);
    baseline::for_each_type(type_, [&]<class T>(T) {
        View<T const> const in = slab.as<T>();
        Box const box = slab.box;
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) add_value(static_cast<double>(in(x, y, z)));
    });
}

void Quantiles::add_exactly(ConstView slab, int threads) {
    switch (type_) {
    case DataType::uint8:
        count_small<std::uint8_t>(slab, counters_.data(), threads);
        break;
    case DataType::int8:
        count_small<std::int8_t>(slab, counters_.data(), threads);
        break;
    case DataType::uint16:
        count_small<std::uint16_t>(slab, counters_.data(), threads);
        break;
    default:
        count_small<std::int16_t>(slab, counters_.data(), threads);
        break;
    }
    count_ += slab.box.voxels();
}

void Quantiles::add_value(double value) {
    if (!std::isfinite(value)) return;
    if (!shifted_) {
        shifted_ = true;
        low_ = high_ = value;
        half_shift_ = value / 2;
    }
    low_ = std::min(low_, value);
    high_ = std::max(high_, value);
    std::uint32_t const key = key_of(value / 2 - half_shift_); // halved, no difference of doubles overflows
    std::int32_t& leaf = leaves_[key >> 16];
    if (leaf < 0) leaf = new_leaf();
    ++counters_[(static_cast<std::size_t>(leaf) << leaf_bits_) + ((key & 0xffffu) >> (16 - leaf_bits_))];
    ++count_;
}

std::int32_t Quantiles::new_leaf() {
    while ((static_cast<std::size_t>(leaf_count_ + 1) << leaf_bits_) > most_counters) coarsen();
    ++leaf_count_;
    counters_.resize(static_cast<std::size_t>(leaf_count_) << leaf_bits_);
    return leaf_count_ - 1;
}

/// Merges neighbouring counters, which halves the resolution of every leaf.
void Quantiles::coarsen() {
    std::size_t const n = counters_.size() / 2;
    for (std::size_t i = 0; i < n; ++i) counters_[i] = counters_[2 * i] + counters_[2 * i + 1];
    counters_.resize(n);
    --leaf_bits_;
}

double Quantiles::value_at_rank(std::int64_t rank) const {
    std::int64_t before = 0;
    if (exact_) {
        for (std::size_t i = 0; i < counters_.size(); ++i) {
            before += static_cast<std::int64_t>(counters_[i]);
            if (before > rank) return lowest_of(type_) + static_cast<double>(i);
        }
        return highest_of(type_);
    }
    for (std::uint32_t prefix = 0; prefix < 65536; ++prefix) {
        if (leaves_[prefix] < 0) continue;
        std::int64_t inside = 0;
        auto const begin = static_cast<std::size_t>(leaves_[prefix]) << leaf_bits_;
        for (std::size_t j = 0; j < std::size_t{1} << leaf_bits_; ++j)
            inside += static_cast<std::int64_t>(counters_[begin + j]);
        if (before + inside > rank) return std::clamp(value_in_leaf(prefix, rank - before), low_, high_);
        before += inside;
    }
    return high_;
}

double Quantiles::value_in_leaf(std::uint32_t prefix, std::int64_t rank) const {
    auto const begin = static_cast<std::size_t>(leaves_[prefix]) << leaf_bits_;
    int const lost = 16 - leaf_bits_;
    std::int64_t before = 0;
    for (std::uint32_t j = 0; j < 1u << leaf_bits_; ++j) {
        auto const here = static_cast<std::int64_t>(counters_[begin + j]);
        if (before + here <= rank) {
            before += here;
            continue;
        }
        std::uint32_t const key = (prefix << 16) + (j << lost);
        double const from = value_of(key);
        if (lost == 0) return 2 * (half_shift_ + from);
        double const to = value_of(key + (1u << lost) - 1);
        double const share = (static_cast<double>(rank - before) + 0.5) / static_cast<double>(here);
        return 2 * (half_shift_ + from + (to - from) * share);
    }
    return high_;
}

double Quantiles::percentile(double percent) const {
    if (count_ == 0) return std::numeric_limits<double>::quiet_NaN();
    double const position = percent / 100 * static_cast<double>(count_ - 1);
    auto const rank = static_cast<std::int64_t>(position);
    double const below = value_at_rank(rank);
    double const share = position - static_cast<double>(rank);
    if (share == 0 || rank + 1 >= count_) return below;
    return std::lerp(below, value_at_rank(rank + 1), share);
}

} // namespace vkt
#endif
