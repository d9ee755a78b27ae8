// Counting in bins on GPUs: the slot of a voxel as CPUs find it, by a guess that the edges beside it correct.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/histogram.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/statistics/kernels/device_counts.h"

#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Voxels of one byte have a counter for each of their patterns.
struct PatternSlot {
    template <class T> using is_cheap = std::true_type;
    VKT_HD int operator()(std::uint8_t v) const { return v; }
};

struct TableSlot {
    template <class T> using is_cheap = std::true_type;
    std::int32_t const* table;
    VKT_DEVICE int operator()(std::uint16_t v) const { return table[v]; }
};

/// float32 with a positive slope: the edge next to a voxel is guessed in float32, and the least float32 beyond that
/// edge tells on which side of it the voxel lies. There are no others to ask, and no branches.
struct FloatSlot {
    template <class T> using is_cheap = std::true_type;
    float const* first; ///< count + 1: the least that is not below each edge; above it, for the last one
    int count;
    float factor, summand;

    __device__ __forceinline__ float const* table() const { return first; }
    __device__ __forceinline__ unsigned table_size() const { return static_cast<unsigned>(count) + 1; }
    /// With a copy of the table that is nearer.
    __device__ __forceinline__ int operator()(float voxel, float const* near) const {
        // What is added leaves no room for a fraction, and lets the sum's bits count: the hardware's roundings and
        // conversions take four times as long.
        float const at = fminf(fmaxf(madd(voxel, factor, summand), 0.0f), static_cast<float>(count));
        int const edge = __float_as_int(at + driver::rounding) - static_cast<int>(driver::rounding_bits),
                  bin = voxel >= near[edge] ? edge : edge - 1;
        int const slot = bin < 0 ? count : bin < count ? bin : count + 1;
        return voxel == voxel ? slot : count + 2;
    }
    __device__ __forceinline__ int operator()(float voxel) const { return (*this)(voxel, first); }
};

struct ValueSlot {
    template <class T> using is_cheap = std::false_type;
    double const* edges;
    int count;
    double slope, intercept, scale, scaled_low, per_unit, low, high, near;

    template <class T> VKT_DEVICE int operator()(T voxel) const {
        auto const stored = static_cast<double>(voxel);
        double value = slope * stored + intercept;
        if (!(value - value == 0) && stored - stored == 0) value = fma(slope, stored, intercept);
        if (value != value) return count + 2;
        if (value < low) return count;
        if (value > high) return count + 1;
        double const at = (value * scale - scaled_low) * per_unit, last = count - 1.0;
        auto k = static_cast<int>(at > 0 ? at < last ? at : last : 0);
        double const rest = at - k;
        if (rest < near || rest > 1 - near) {
            while (k > 0 && value < edges[k]) --k;
            while (k + 1 < count && value >= edges[k + 1]) ++k;
        }
        return k;
    }
};

/// 64-bit integers, from the first edge on.
struct WholeSlot {
    Int128 const* edges;
    Int128 base, highest;
    int count;
    double scaled_low, per_unit;

    template <class T> VKT_DEVICE int operator()(T voxel) const {
        Int128 const value = voxel;
        if (value < base) return count;
        if (value > highest) return count + 1;
        double const at = (static_cast<double>(value - base) - scaled_low) * per_unit, last = count - 1.0;
        auto k = static_cast<int>(at < last ? at : last);
        while (k > 0 && value < edges[k]) --k;
        while (k + 1 < count && value >= edges[k + 1]) ++k;
        return k;
    }
};

/// The least float32 whose value is not below each edge, above the last one, by bisection of all of them; the slope is
/// positive.
std::vector<float> first_floats(std::vector<double> const& edges, ValueMap const& map) {
    constexpr std::int64_t infinity = 0x7f800000; // in the order of values; -0 follows 0 from below
    auto const float_at = [](std::int64_t place) {
        std::uint32_t const bits = place >= 0 ? static_cast<std::uint32_t>(place)
                                              : std::uint32_t{0x80000000} | static_cast<std::uint32_t>(-place);
        return std::bit_cast<float>(bits);
    };
    auto const place_of = [](float v) {
        auto const bits = std::bit_cast<std::uint32_t>(v);
        return (bits >> 31) != 0 ? -static_cast<std::int64_t>(bits & 0x7fffffff) : static_cast<std::int64_t>(bits);
    };
    std::vector<float> first;
    for (double const& edge : edges) {
        auto const reached = [&](std::int64_t place) {
            double const value = map.slope * static_cast<double>(float_at(place)) + map.intercept;
            return &edge == &edges.back() ? value > edge : value >= edge;
        };
        // What is not below the edge begins in (low, high]: mostly near the edge itself, mapped back.
        std::int64_t low = -infinity, high = infinity;
        std::int64_t const guess = place_of(static_cast<float>((edge - map.intercept) / map.slope));
        for (std::int64_t const near : {guess - 4, guess + 4})
            if (near > low && near < high) (reached(near) ? high : low) = near;
        while (high - low > 1) {
            std::int64_t const middle = low + (high - low) / 2;
            (reached(middle) ? high : low) = middle;
        }
        first.push_back(float_at(high));
    }
    return first;
}

template <class T>
void count_values(ConstView in, Bins const& bins, BrickGrid const& grid, unsigned long long* counts) {
    std::vector<double> const edges(bins.edges(), bins.edges() + bins.count() + 1);
    if constexpr (std::is_same_v<T, float>) {
        double const factor = bins.map().slope * bins.scale() * bins.per_unit(),
                     summand = (bins.map().intercept * bins.scale() - bins.scaled_low()) * bins.per_unit();
        // Of values within the bins neither product nor summand is larger than the latter and the number of bins
        // together. Nearer than a half the guess has to be.
        double const unsure = 0x1p-15 + (std::abs(summand) + bins.count()) * 0x1p-21;
        bool const trusted = bins.map().slope > 0 && !bins.far() && unsure < 0.25 && std::abs(factor) > 0x1p-100 &&
                             std::abs(factor) < 0x1p100;
        if (trusted) {
            driver::DeviceList<float> const first(first_floats(edges, bins.map()));
            FloatSlot const slot{first.get(), bins.count(), static_cast<float>(factor), static_cast<float>(summand)};
            return driver::count_on_device<T>(in, grid, slot, bins.slots(), counts);
        }
    }
    driver::DeviceList<double> const list(edges);
    ValueSlot const slot{
        list.get(),        bins.count(),    bins.map().slope, bins.map().intercept, bins.scale(),
        bins.scaled_low(), bins.per_unit(), edges.front(),    edges.back(),         bins.far() ? 1 : 0x1p-16};
    driver::count_on_device<T>(in, grid, slot, bins.slots(), counts);
}

template <class T> void count_whole(ConstView in, Bins const& bins, BrickGrid const& grid, unsigned long long* counts) {
    std::vector<Int128> const edges(bins.whole_edges(), bins.whole_edges() + bins.count() + 1);
    driver::DeviceList<Int128> const list(edges);
    WholeSlot const slot{list.get(), edges.front(), bins.highest(), bins.count(), bins.scaled_low(), bins.per_unit()};
    driver::count_on_device<T>(in, grid, slot, bins.slots(), counts);
}

/// Adds the counts of the 256 patterns of each brick to those of the slots that they are in.
__global__ void __launch_bounds__(256) patterns_kernel(unsigned long long const* patterns, std::int32_t const* table,
                                                       unsigned slots, unsigned long long* counts) {
    unsigned long long const found = patterns[blockIdx.x * 256ULL + threadIdx.x];
    if (found != 0)
        atomicAdd(counts + static_cast<std::size_t>(blockIdx.x) * slots + static_cast<unsigned>(table[threadIdx.x]),
                  found);
}

void count_patterns(ConstView in, Bins const& bins, BrickGrid const& grid, std::int32_t const* table,
                    unsigned long long* counts) {
    driver::DeviceCounters const patterns(static_cast<std::size_t>(grid.count()) * 256);
    driver::count_on_device<std::uint8_t>(in, grid, PatternSlot{}, 256, patterns.get());
    patterns_kernel<<<static_cast<unsigned>(grid.count()), 256>>>(patterns.get(), table,
                                                                  static_cast<unsigned>(bins.slots()), counts);
    check_launch("count");
}

} // namespace

void count_in_bins(ConstView in, Bins const& bins, BrickGrid const& grid, std::uint64_t* counts, Execution const&) {
    auto* const to = reinterpret_cast<unsigned long long*>(counts);
    if (!bins.table().empty()) {
        driver::DeviceList<std::int32_t> const table(bins.table());
        if (size_of(in.type) == 1) return count_patterns(in, bins, grid, table.get(), to);
        return driver::count_on_device<std::uint16_t>(in, grid, TableSlot{table.get()}, bins.slots(), to);
    }
    with_type(in.type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T> && sizeof(T) == 8) {
            if (bins.wide()) return count_whole<T>(in, bins, grid, to);
        }
        if constexpr (sizeof(T) >= 4) count_values<T>(in, bins, grid, to);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
