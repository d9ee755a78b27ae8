// A volume made ready for rays: conversion, padding, histogram.
// SPDX-License-Identifier: MIT
#include "libvkt/render/lattice.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace vkt::render {

namespace {

constexpr int histogram_bins = 4096;

/// IEEE half to float; all halves are floats.
float float_of_half(std::uint16_t half) {
    std::uint32_t const sign = static_cast<std::uint32_t>(half & 0x8000U) << 16, exponent = (half >> 10) & 31U,
                        mantissa = half & 1023U;
    if (exponent == 31) return std::bit_cast<float>(sign | 0x7F800000U | (mantissa << 13));
    if (exponent == 0) {
        float const small = static_cast<float>(mantissa) * 0x1p-24F;
        return sign != 0 ? -small : small;
    }
    return std::bit_cast<float>(sign | ((exponent + 112) << 23) | (mantissa << 13));
}

struct Half {
    std::uint16_t bits;
};
template <class T> double number(T value) {
    if constexpr (std::is_same_v<T, Half>)
        return static_cast<double>(float_of_half(value.bits));
    else
        return static_cast<double>(value);
}

/// Calls body with a null pointer of the element type.
template <class Body> void with_type(DataType type, Body&& body) {
    switch (type) {
    case DataType::uint8:
        return body(static_cast<std::uint8_t const*>(nullptr));
    case DataType::int8:
        return body(static_cast<std::int8_t const*>(nullptr));
    case DataType::uint16:
        return body(static_cast<std::uint16_t const*>(nullptr));
    case DataType::int16:
        return body(static_cast<std::int16_t const*>(nullptr));
    case DataType::uint32:
        return body(static_cast<std::uint32_t const*>(nullptr));
    case DataType::int32:
        return body(static_cast<std::int32_t const*>(nullptr));
    case DataType::uint64:
        return body(static_cast<std::uint64_t const*>(nullptr));
    case DataType::int64:
        return body(static_cast<std::int64_t const*>(nullptr));
    case DataType::float16:
        return body(static_cast<Half const*>(nullptr));
    case DataType::float32:
        return body(static_cast<float const*>(nullptr));
    case DataType::float64:
        return body(static_cast<double const*>(nullptr));
    }
}

struct Extremes {
    double least = std::numeric_limits<double>::infinity(), greatest = -std::numeric_limits<double>::infinity();
    std::int64_t missing = 0, infinite = 0;
};

template <class T> Extremes extremes_of(View<T const> v, Index3 dims, int threads) {
    Extremes all;
#pragma omp parallel num_threads(threads)
    {
        Extremes mine;
#pragma omp for schedule(static) nowait
        for (std::int64_t z = 0; z < dims.z; ++z)
            for (std::int64_t y = 0; y < dims.y; ++y) {
                T const* row = v.data + y * v.row + z * v.slice;
                if constexpr (std::is_integral_v<T>) {
                    T low = row[0], high = row[0];
                    for (std::int64_t x = 0; x < dims.x; ++x) {
                        low = row[x] < low ? row[x] : low;
                        high = row[x] > high ? row[x] : high;
                    }
                    mine.least = std::min(mine.least, number(low));
                    mine.greatest = std::max(mine.greatest, number(high));
                } else {
                    for (std::int64_t x = 0; x < dims.x; ++x) {
                        double const a = number(row[x]);
                        if (std::isfinite(a)) {
                            mine.least = a < mine.least ? a : mine.least;
                            mine.greatest = a > mine.greatest ? a : mine.greatest;
                        } else {
                            ++(std::isnan(a) ? mine.missing : mine.infinite);
                        }
                    }
                }
            }
#pragma omp critical
        {
            all.least = std::min(all.least, mine.least);
            all.greatest = std::max(all.greatest, mine.greatest);
            all.missing += mine.missing;
            all.infinite += mine.infinite;
        }
    }
    return all;
}

/// Adds counts per bin of the stored values; integers (all sums) do not depend on the number of threads.
template <class T>
void count_bins(View<T const> v, Index3 dims, double least, double greatest, std::vector<std::int64_t>& bins,
                int threads) {
    auto const last = static_cast<double>(bins.size() - 1);
    double const scale = greatest > least ? static_cast<double>(bins.size()) / (greatest - least) : 0;
    std::int64_t const n = dims.x * dims.y * dims.z;
    std::int64_t const stride = std::max<std::int64_t>(1, n / (std::int64_t{1} << 25)); // every slice up to 32 M voxels
#pragma omp parallel num_threads(threads)
    {
        std::vector<std::int64_t> mine(bins.size());
#pragma omp for schedule(static) nowait
        for (std::int64_t z = 0; z < dims.z; z += stride)
            for (std::int64_t y = 0; y < dims.y; ++y) {
                T const* row = v.data + y * v.row + z * v.slice;
                for (std::int64_t x = 0; x < dims.x; ++x) {
                    double const place = (number(row[x]) - least) * scale;
                    if (std::isfinite(place)) ++mine[static_cast<std::size_t>(std::clamp(place, 0.0, last))];
                }
            }
#pragma omp critical
        for (std::size_t i = 0; i < bins.size(); ++i) bins[i] += mine[i];
    }
}

/// Copies rows with clamped padding, converting each voxel.
template <class T, class U, class Convert>
void fill(View<T const> v, Index3 dims, Lattice& lattice, int threads, Convert convert) {
    constexpr std::int64_t p = lattice_padding;
    Index3 const padded{dims.x + 2 * p, dims.y + 2 * p, dims.z + 2 * p};
    std::size_t const bytes = static_cast<std::size_t>(padded.x * padded.y * padded.z) * sizeof(U) + 64;
    lattice.voxels.reserve(bytes);
    auto* const out = reinterpret_cast<U*>(lattice.voxels.write(Space::host));
    std::memset(static_cast<void*>(reinterpret_cast<std::byte*>(out) + bytes - 64), 0, 64);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::int64_t z = 0; z < padded.z; ++z)
        for (std::int64_t y = 0; y < padded.y; ++y) {
            T const* from = v.data + std::clamp<std::int64_t>(y - p, 0, dims.y - 1) * v.row +
                            std::clamp<std::int64_t>(z - p, 0, dims.z - 1) * v.slice;
            U* to = out + (z * padded.y + y) * padded.x;
            for (std::int64_t x = 0; x < dims.x; ++x) to[x + p] = convert(from[x]);
            for (std::int64_t x = 0; x < p; ++x) to[x] = to[p], to[dims.x + p + x] = to[dims.x + p - 1];
        }
    lattice.view.data = out;
    lattice.view.row = padded.x;
    lattice.view.slice = padded.x * padded.y;
    // Sixteen samples no more than four voxels apart, and their neighbours.
    lattice.view.compact = static_cast<double>(lattice.view.slice) * sizeof(U) * (16 * 4 + 4) < 2147483647.0;
}

template <class T> void convert(ConstView voxels, Extremes const& extremes, Lattice& lattice, int threads) {
    View<T const> const v = voxels.as<T>();
    Index3 const dims = voxels.dims();
    if constexpr (std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::uint16_t> ||
                  std::is_same_v<T, std::int16_t>) {
        lattice.view.type = std::is_same_v<T, std::uint8_t> ? LatticeType::uint8
                            : std::is_signed_v<T>           ? LatticeType::int16
                                                            : LatticeType::uint16;
        fill<T, T>(v, dims, lattice, threads, [](T a) { return a; });
    } else if constexpr (std::is_same_v<T, std::int8_t>) {
        lattice.view.type = LatticeType::int16;
        fill<T, std::int16_t>(v, dims, lattice, threads, [](T a) { return std::int16_t{a}; });
    } else {
        // Floats keep their bits; wider types lose least when they are centred first.
        bool const keep = std::is_same_v<T, float> || std::is_same_v<T, Half>;
        double const offset = keep ? 0.0 : extremes.least + 0.5 * (extremes.greatest - extremes.least);
        lattice.offset = offset;
        lattice.view.type = LatticeType::float32;
        double const least = extremes.least, greatest = extremes.greatest;
        fill<T, float>(v, dims, lattice, threads, [=](T a) {
            double const value = number(a);
            return static_cast<float>((value < least ? least : value > greatest ? greatest : value) - offset);
        });
    }
}

} // namespace

Lattice make_lattice(ConstView voxels, ValueMap const& values, Execution const& execution) {
    Lattice lattice;
    lattice.dims = voxels.dims();
    Histogram& h = lattice.histogram;
    h.bins.resize(histogram_bins);
    h.total = voxels.box.voxels();
    with_type(voxels.type, [&](auto* type) {
        using T = std::remove_cvref_t<decltype(*type)>;
        Extremes const e = extremes_of<T>(voxels.as<T>(), voxels.dims(), execution.threads);
        if (!(e.least <= e.greatest))
            throw Error(ErrorKind::data, "the volume has no finite voxel", "vkt stats tells what it holds");
        count_bins<T>(voxels.as<T>(), voxels.dims(), e.least, e.greatest, h.bins, execution.threads);
        h.least = values.physical(e.least), h.greatest = values.physical(e.greatest);
        h.missing = e.missing, h.infinite = e.infinite;
        lattice.missing = e.missing > 0;
        convert<T>(voxels, e, lattice, execution.threads);
    });
    if (values.slope < 0) {
        std::swap(h.least, h.greatest);
        std::reverse(h.bins.begin(), h.bins.end());
    }
    lattice.cells = make_cell_grid(lattice.view, lattice.dims, execution.threads);
    return lattice;
}

} // namespace vkt::render
