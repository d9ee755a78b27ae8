// A volume made ready for rays: conversion, padding, histogram.
// SPDX-License-Identifier: MIT
#include "libvkt/render/lattice.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/render/inner/sampler.h"
#include "libvkt/render/survey.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <omp.h>
#include <utility>
#include <vector>

namespace vkt::render {

namespace {

/// Calls body with an empty `part` of the result and a row, for every stride-th row; adds up the parts.
template <class T, class Part, class Body>
Part over_rows(View<T const> v, Index3 dims, std::int64_t stride, int threads, Part const& empty, Body body) {
    Part all = empty;
    std::vector<Part> parts(static_cast<std::size_t>(threads), empty); // here it may be said that there is no memory
#pragma omp parallel num_threads(threads)
    {
        Part mine = std::move(parts[static_cast<std::size_t>(omp_get_thread_num())]);
#pragma omp for schedule(static) nowait
        for (std::int64_t row = 0; row < dims.y * dims.z; row += stride)
            body(mine, v.data + row % dims.y * v.row + row / dims.y * v.slice);
#pragma omp critical
        all.add(mine);
    }
    return all;
}

/// Every row of up to 32 M voxels is counted. Strides that share no factor with the rows of a slice meet all of these.
std::int64_t counting_stride(Index3 dims) {
    std::int64_t stride = std::max<std::int64_t>(1, dims.x * dims.y * dims.z / (std::int64_t{1} << 25));
    while (std::gcd(stride, dims.y) > 1) ++stride;
    return stride;
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
    // A chunk of samples no more than four voxels apart, and their neighbours.
    lattice.view.compact = static_cast<double>(lattice.view.slice) * sizeof(U) * (chunk * 4 + 4) < 2147483647.0;
}

template <class T> void convert(ConstView voxels, Range const& range, Lattice& lattice, int threads) {
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
        Narrowing const narrow = narrowing_of(voxels.type, range, dims.x * dims.y * dims.z, [&](std::int64_t i) {
            std::int64_t const row = i / dims.x;
            std::int64_t const y = row % dims.y, z = row / dims.y;
            return static_cast<double>(v.data[i % dims.x + y * v.row + z * v.slice]);
        });
        lattice.rescaling = narrow.rescaling;
        lattice.view.type = LatticeType::float32;
        fill<T, float>(v, dims, lattice, threads, [=](T a) { return narrow(static_cast<double>(a)); });
    }
}

} // namespace

double Lattice::at(Index3 voxel) const {
    std::int64_t const i =
        voxel.x + lattice_padding + (voxel.y + lattice_padding) * view.row + (voxel.z + lattice_padding) * view.slice;
    switch (view.type) {
    case LatticeType::uint8:
        return static_cast<std::uint8_t const*>(view.data)[i];
    case LatticeType::uint16:
        return static_cast<std::uint16_t const*>(view.data)[i];
    case LatticeType::int16:
        return static_cast<std::int16_t const*>(view.data)[i];
    default:
        return static_cast<double>(static_cast<float const*>(view.data)[i]);
    }
}

Lattice make_lattice(ConstView voxels, ValueMap const& values, Execution const& execution) {
    Lattice lattice;
    lattice.dims = voxels.dims();
    Index3 const dims = voxels.dims();
    with_cell_type(voxels.type, [&]<class T>(T) {
        View<T const> const v = voxels.as<T>();
        Range const range = over_rows(v, dims, 1, execution.threads, Range{},
                                      [&](Range& part, T const* row) { part.add(range_of(row, dims.x)); });
        if (range.empty())
            throw Error(ErrorKind::data, "the volume has no finite voxel", "vkt stats tells what it holds");
        Bins const bins = over_rows(v, dims, counting_stride(dims), execution.threads, Bins(range),
                                    [&](Bins& part, T const* row) { part.count(row, dims.x); });
        lattice.histogram = histogram_of(range, bins, values);
        lattice.missing = range.missing > 0;
        convert<T>(voxels, range, lattice, execution.threads);
    });
    lattice.cells = make_cell_grid(lattice.view, lattice.dims, execution.threads);
    return lattice;
}

} // namespace vkt::render
