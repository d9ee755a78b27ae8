// Small volumes for unit tests: made, read as doubles, compared bit for bit.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/type_dispatch.h"
#include "libvkt/core/volume.h"

#include <cstring>
#include <random>
#include <type_traits>
#include <vector>

namespace vkt {

inline Header header_of(Index3 dims, DataType type) {
    Header header;
    header.dims = dims;
    header.dtype = type;
    return header;
}

/// Uniform noise: integers over 0…100 (all positive), floats over [0, 100).
inline Volume noise_volume(Index3 dims, DataType type, unsigned seed) {
    Volume volume(header_of(dims, type));
    std::mt19937 random(seed);
    with_type(type, [&]<class T>(T) {
        T* const values = reinterpret_cast<T*>(volume.mutable_view().data);
        for (std::int64_t i = 0; i < dims.x * dims.y * dims.z; ++i) {
            double const v = static_cast<double>(random()) * 100 / 4294967296.0;
            if constexpr (std::is_same_v<T, Half>)
                values[i] = Half(v);
            else
                values[i] = static_cast<T>(v);
        }
    });
    return volume;
}

inline std::vector<double> values_of(Volume const& volume) {
    std::vector<double> values;
    with_type(volume.header().dtype, [&]<class T>(T) {
        T const* const from = reinterpret_cast<T const*>(volume.view().data);
        for (std::int64_t i = 0; i < volume.header().voxels(); ++i) values.push_back(static_cast<double>(from[i]));
    });
    return values;
}

inline bool same_voxels(Volume const& a, Volume const& b) {
    return a.header().dims == b.header().dims && a.header().dtype == b.header().dtype &&
           std::memcmp(a.view().data, b.view().data, a.view().bytes()) == 0;
}

} // namespace vkt
