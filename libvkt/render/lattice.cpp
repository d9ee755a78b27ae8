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

template <class U>
constexpr LatticeType lattice_type = std::is_same_v<U, std::uint8_t>    ? LatticeType::uint8
                                     : std::is_same_v<U, std::uint16_t> ? LatticeType::uint16
                                     : std::is_same_v<U, std::int16_t>  ? LatticeType::int16
                                                                        : LatticeType::float32;

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

Index3 padded_dims(Index3 dims) {
    constexpr std::int64_t p = 2 * lattice_padding;
    return {dims.x + p, dims.y + p, dims.z + p};
}

/// Room for the voxels of a lattice, and its view.
template <class U> U* make_room(Index3 dims, Lattice& lattice) {
    Index3 const padded = padded_dims(dims);
    std::size_t const bytes = static_cast<std::size_t>(padded.x * padded.y * padded.z) * sizeof(U) + 64;
    lattice.voxels.reserve(bytes);
    auto* const out = reinterpret_cast<U*>(lattice.voxels.write(Space::host));
    std::memset(static_cast<void*>(reinterpret_cast<std::byte*>(out) + bytes - 64), 0, 64);
    lattice.view.data = out;
    lattice.view.type = lattice_type<U>;
    lattice.view.row = padded.x;
    lattice.view.slice = padded.x * padded.y;
    // A chunk of samples no more than four voxels apart, and their neighbours.
    lattice.view.compact = static_cast<double>(lattice.view.slice) * sizeof(U) * (chunk * 4 + 4) < 2147483647.0;
    return out;
}

/// Copies rows with clamped padding, converting each voxel.
template <class T, class U, class Convert>
void fill(View<T const> v, Index3 dims, Lattice& lattice, int threads, Convert convert) {
    constexpr std::int64_t p = lattice_padding;
    Index3 const padded = padded_dims(dims);
    U* const out = make_room<U>(dims, lattice);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::int64_t z = 0; z < padded.z; ++z)
        for (std::int64_t y = 0; y < padded.y; ++y) {
            T const* from = v.data + std::clamp<std::int64_t>(y - p, 0, dims.y - 1) * v.row +
                            std::clamp<std::int64_t>(z - p, 0, dims.z - 1) * v.slice;
            U* to = out + (z * padded.y + y) * padded.x;
            for (std::int64_t x = 0; x < dims.x; ++x) to[x + p] = convert(from[x]);
            for (std::int64_t x = 0; x < p; ++x) to[x] = to[p], to[dims.x + p + x] = to[dims.x + p - 1];
        }
}

/// Clamped padding around voxels that are there.
template <class T> void pad(T* voxels, Index3 dims, int threads) {
    constexpr std::int64_t p = lattice_padding;
    Index3 const padded = padded_dims(dims);
    std::int64_t const slice = padded.x * padded.y;
    auto const copy = [](T* to, T const* from, std::int64_t n) {
        std::memcpy(to, from, static_cast<std::size_t>(n) * sizeof(T));
    };
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::int64_t z = p; z < dims.z + p; ++z) {
        T* const first = voxels + z * slice + p * padded.x;
        for (std::int64_t y = 0; y < dims.y; ++y) {
            T* const row = first + y * padded.x;
            for (std::int64_t x = 0; x < p; ++x) row[x] = row[p], row[dims.x + p + x] = row[dims.x + p - 1];
        }
        for (std::int64_t y = 1; y <= p; ++y) {
            copy(first - y * padded.x, first, padded.x);
            copy(first + (dims.y - 1 + y) * padded.x, first + (dims.y - 1) * padded.x, padded.x);
        }
    }
    for (std::int64_t z = 1; z <= p; ++z) {
        copy(voxels + (p - z) * slice, voxels + p * slice, slice);
        copy(voxels + (dims.z + p - 1 + z) * slice, voxels + (dims.z + p - 1) * slice, slice);
    }
}

/// Whether rays sample it as it is.
template <class T>
constexpr bool is_kept =
    std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::uint16_t> || std::is_same_v<T, std::int16_t>;

template <class T> void convert(ConstView voxels, Range const& range, Lattice& lattice, int threads) {
    View<T const> const v = voxels.as<T>();
    Index3 const dims = voxels.dims();
    if constexpr (is_kept<T>) {
        fill<T, T>(v, dims, lattice, threads, [](T a) { return a; });
    } else if constexpr (std::is_same_v<T, std::int8_t>) {
        fill<T, std::int16_t>(v, dims, lattice, threads, [](T a) { return std::int16_t{a}; });
    } else {
        Narrowing const narrow = narrowing_of(voxels.type, range, dims.x * dims.y * dims.z, [&](std::int64_t i) {
            std::int64_t const row = i / dims.x;
            std::int64_t const y = row % dims.y, z = row / dims.y;
            return static_cast<double>(v.data[i % dims.x + y * v.row + z * v.slice]);
        });
        lattice.rescaling = narrow.rescaling;
        fill<T, float>(v, dims, lattice, threads, [=](T a) { return narrow(static_cast<double>(a)); });
    }
}

/// Range and histogram of the voxels.
template <class T> Range survey(View<T const> v, Lattice& lattice, ValueMap const& values, int threads) {
    Index3 const dims = lattice.dims;
    Range const range =
        over_rows(v, dims, 1, threads, Range{}, [&](Range& part, T const* row) { part.add(range_of(row, dims.x)); });
    if (range.empty()) throw Error(ErrorKind::data, "the volume has no finite voxel", "vkt stats tells what it holds");
    Bins const bins = over_rows(v, dims, counting_stride(dims), threads, Bins(range),
                                [&](Bins& part, T const* row) { part.count(row, dims.x); });
    lattice.histogram = histogram_of(range, bins, values);
    lattice.missing = range.missing > 0;
    return range;
}

} // namespace

double Lattice::at(Index3 voxel) const {
    std::int64_t const i =
        voxel.x + lattice_padding + (voxel.y + lattice_padding) * view.row + (voxel.z + lattice_padding) * view.slice;
    return with_lattice_type(view.type,
                             [&]<class T>(T) { return static_cast<double>(static_cast<T const*>(view.data)[i]); });
}

Lattice make_lattice(ConstView voxels, ValueMap const& values, Execution const& execution) {
    Lattice lattice;
    lattice.dims = voxels.dims();
    with_type(voxels.type, [&]<class T>(T) {
        Range const range = survey<T>(voxels.as<T>(), lattice, values, execution.threads);
        convert<T>(voxels, range, lattice, execution.threads);
    });
    lattice.cells = make_cell_grid(lattice.view, lattice.dims, execution.threads);
    return lattice;
}

Lattice make_lattice(Header const& header, VoxelReader const& read, Execution const& execution) {
    Lattice lattice;
    lattice.dims = header.dims;
    bool kept = false;
    with_type(header.dtype, [&]<class T>(T) {
        if constexpr (is_kept<T>) {
            kept = true;
            T* const all = make_room<T>(header.dims, lattice);
            std::int64_t const row = lattice.view.row, slice = lattice.view.slice;
            T* const first = all + lattice_padding * (1 + row + slice);
            read({reinterpret_cast<std::byte*>(first), header.dtype, box_of(header.dims), row, slice, Space::host});
            pad(all, header.dims, execution.threads);
            survey<T>({first, {0, 0, 0}, row, slice}, lattice, header.values, execution.threads);
        }
    });
    if (!kept) {
        Volume volume(header);
        read(volume.mutable_view());
        return make_lattice(volume.view(), header.values, execution);
    }
    lattice.cells = make_cell_grid(lattice.view, lattice.dims, execution.threads);
    return lattice;
}

} // namespace vkt::render
