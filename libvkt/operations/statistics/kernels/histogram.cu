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

/// float32 with a positive slope: a voxel's place among the bins is worked out in float32 and rounded down. Where that
/// is nearer to an edge than its roundings are, the least float32 that is not below the edge tells on which side of it
/// the voxel lies. There are no other edges to ask.
struct FloatSlot {
    template <class T> using is_cheap = std::true_type;
    float const* first; ///< of each bin, the least float32 in it
    float last;         ///< of the last one, the largest
    int count;
    float factor, summand;
    float unsure; ///< a place this near to an edge, less than 0.25, is not to be trusted; below 0: it always is

    // Lanes count what is under, the bins, what is over, twice, and NaN.
    __device__ __forceinline__ unsigned lane_slots() const { return static_cast<unsigned>(count) + 4; }
    __device__ __forceinline__ unsigned slot_of_lane(unsigned slot) const {
        auto const n = static_cast<unsigned>(count);
        return slot == 0 ? n : slot <= n ? slot - 1 : slot <= n + 2 ? n + 1 : n + 2;
    }
    __device__ __forceinline__ float const* table() const { return first; }
    __device__ __forceinline__ unsigned table_size() const { return static_cast<unsigned>(count); }

    /// What lanes count some voxels in, if that is easily seen: false if one of them wants a closer look.
    template <int N> __device__ __forceinline__ bool quickly(float const (&voxels)[N], int (&slots)[N]) const {
        float odd = 0; // NaN, if one of them is not finite
        bool sure = true;
        float at[N], sum[N];
#pragma unroll
        for (int k = 0; k < N; ++k) {
            odd = madd(voxels[k], 0.0f, odd);
            at[k] = fminf(fmaxf(place(voxels[k]), -0.5f), static_cast<float>(count) + 1.5f);
            // What is added leaves no room for a fraction, and lets the sum's bits count: the hardware's roundings and
            // conversions take four times as long.
            sum[k] = __fadd_rd(at[k], driver::rounding + 1);
            int const bits = __float_as_int(sum[k]), none = static_cast<int>(driver::rounding_bits);
            slots[k] = bits - none;
            sure = sure && bits != none + count + 1; // perhaps the upper edge of the last bin
        }
        if (unsure >= 0) {
#pragma unroll
            for (int k = 0; k < N; ++k)
                sure = sure && fabsf(at[k] - (sum[k] - (driver::rounding + 1)) - 0.5f) < 0.5f - unsure;
        }
        return sure && odd == odd;
    }
    /// With a copy of the table that is nearer.
    __device__ __forceinline__ int closely(float voxel, float const* near) const {
        if (voxel != voxel) return count + 3;
        if (voxel > last) return count + 2;
        float const at = fminf(fmaxf(place(voxel), -0.75f), static_cast<float>(count) - 0.25f), edge = rintf(at);
        bool const above = fabsf(at - edge) <= unsure ? voxel >= near[static_cast<int>(edge)] : at >= edge;
        return static_cast<int>(edge) + (above ? 1 : 0);
    }
    __device__ __forceinline__ int operator()(float voxel) const {
        return static_cast<int>(slot_of_lane(static_cast<unsigned>(closely(voxel, first))));
    }

    /// Whether the place alone tells, whatever the voxel is: it grows with the voxel, so that it need only be right for
    /// the first voxel of every bin and the one before.
    bool is_exact(std::vector<float> const& firsts) const {
        for (int bin = 0; bin < count; ++bin) {
            float const voxel = firsts[static_cast<std::size_t>(bin)],
                        before = std::nextafter(voxel, -std::numeric_limits<float>::infinity());
            double const own = summand, rest = own - bin;
            if (rest + bin != own || own - rest != bin) return false;
            if (std::fma(double{voxel}, double{factor}, rest) < 0 ||
                std::fma(double{before}, double{factor}, rest) >= 0)
                return false;
        }
        return true;
    }

private:
    __device__ __forceinline__ float place(float voxel) const { return __fmaf_rd(voxel, factor, summand); }
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

/// The least float32 whose value is not below each edge, and the least whose value is above the last one, by bisection
/// of all of them; the slope is positive.
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
            std::vector<float> firsts = first_floats(edges, bins.map());
            float const last = std::nextafter(firsts.back(), -std::numeric_limits<float>::infinity());
            firsts.pop_back();
            driver::DeviceList<float> const first(firsts);
            FloatSlot slot{first.get(),
                           last,
                           bins.count(),
                           static_cast<float>(factor),
                           static_cast<float>(summand),
                           static_cast<float>(unsure)};
            if (slot.is_exact(firsts)) slot.unsure = -1;
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
