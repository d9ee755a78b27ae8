// Border fill and region copies in host memory; device memory goes to the CUDA side.
// SPDX-License-Identifier: MIT
#include "libvkt/kernel/border.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace vkt {

#ifdef VKT_CUDA
void fill_border_on_device(AnyView window, Box const& inside, Index3 dims, Boundary boundary, double border_value);
void copy_region_on_device(ConstView from, AnyView to);
#endif

namespace {

template <class T> void store(std::array<std::byte, 8>& voxel, double value) {
    auto const low = static_cast<double>(std::numeric_limits<T>::lowest());
    auto const high = static_cast<double>(std::numeric_limits<T>::max());
    T stored{};
    if constexpr (std::numeric_limits<T>::is_integer) {
        double const rounded = std::nearbyint(value);
        stored = rounded <= low    ? std::numeric_limits<T>::lowest()
                 : rounded >= high ? std::numeric_limits<T>::max()
                                   : static_cast<T>(rounded);
    } else {
        stored = static_cast<T>(value);
    }
    std::memcpy(voxel.data(), &stored, sizeof stored);
}

/// The bytes of a border value: integers round half to even and saturate.
std::array<std::byte, 8> voxel_bytes(DataType type, double value) {
    std::array<std::byte, 8> voxel{};
    switch (type) {
    case DataType::uint8:
        store<std::uint8_t>(voxel, value);
        break;
    case DataType::int8:
        store<std::int8_t>(voxel, value);
        break;
    case DataType::uint16:
        store<std::uint16_t>(voxel, value);
        break;
    case DataType::int16:
        store<std::int16_t>(voxel, value);
        break;
    case DataType::uint32:
        store<std::uint32_t>(voxel, value);
        break;
    case DataType::int32:
        store<std::int32_t>(voxel, value);
        break;
    case DataType::uint64:
        store<std::uint64_t>(voxel, value);
        break;
    case DataType::int64:
        store<std::int64_t>(voxel, value);
        break;
    case DataType::float16: {
        Half const half(static_cast<float>(value));
        std::memcpy(voxel.data(), &half, sizeof half);
        break;
    }
    case DataType::float32:
        store<float>(voxel, value);
        break;
    case DataType::float64:
        store<double>(voxel, value);
        break;
    }
    return voxel;
}

/// One row from x0 to x1 of constant voxels.
void fill_row(std::byte* row, std::int64_t count, std::array<std::byte, 8> const& voxel, std::size_t size) {
    for (std::int64_t i = 0; i < count; ++i) std::memcpy(row + static_cast<std::size_t>(i) * size, voxel.data(), size);
}

struct HostFill {
    AnyView window;
    Box inside;
    Index3 dims;
    Boundary boundary;
    std::array<std::byte, 8> voxel;
    std::size_t size;

    void columns(std::int64_t y, std::int64_t z, std::int64_t x0, std::int64_t x1) const {
        for (std::int64_t x = x0; x < x1; ++x) {
            std::int64_t const from = fold(x, dims.x, boundary);
            std::memcpy(window.at(x, y, z), from < 0 ? voxel.data() : window.at(from, y, z), size);
        }
    }

    void row(std::int64_t y, std::int64_t z) const {
        Box const& w = window.box;
        std::int64_t const from = fold(y, dims.y, boundary);
        if (from < 0)
            fill_row(window.at(w.lower.x, y, z), w.dims().x, voxel, size);
        else
            std::memcpy(window.at(w.lower.x, y, z), window.at(w.lower.x, from, z),
                        static_cast<std::size_t>(w.dims().x) * size);
    }

    void slice(std::int64_t z) const {
        Box const& w = window.box;
        std::int64_t const from = inside.empty() ? -1 : fold(z, dims.z, boundary);
        for (std::int64_t y = w.lower.y; y < w.upper.y; ++y) {
            if (from < 0)
                fill_row(window.at(w.lower.x, y, z), w.dims().x, voxel, size);
            else
                std::memcpy(window.at(w.lower.x, y, z), window.at(w.lower.x, y, from),
                            static_cast<std::size_t>(w.dims().x) * size);
        }
    }

    void run() const {
        Box const& w = window.box;
        for (std::int64_t z = inside.lower.z; z < inside.upper.z && !inside.empty(); ++z) {
            for (std::int64_t y = inside.lower.y; y < inside.upper.y; ++y) {
                columns(y, z, w.lower.x, inside.lower.x);
                columns(y, z, inside.upper.x, w.upper.x);
            }
            for (std::int64_t y = w.lower.y; y < inside.lower.y; ++y) row(y, z);
            for (std::int64_t y = inside.upper.y; y < w.upper.y; ++y) row(y, z);
        }
        for (std::int64_t z = w.lower.z; z < w.upper.z; ++z)
            if (inside.empty() || z < inside.lower.z || z >= inside.upper.z) slice(z);
    }
};

} // namespace

void fill_border(AnyView window, Box const& inside, Index3 volume_dims, Boundary boundary, double border_value,
                 Execution const&) {
#ifdef VKT_CUDA
    if (window.space == Space::device)
        return fill_border_on_device(window, inside, volume_dims, boundary, border_value);
#endif
    HostFill const fill{
        window, inside, volume_dims, boundary, voxel_bytes(window.type, border_value), size_of(window.type)};
    fill.run();
}

void copy_region(ConstView from, AnyView to, Execution const&) {
    if (from.space == Space::host && to.space == Space::host) return copy(from, to);
#ifdef VKT_CUDA
    copy_region_on_device(from, to);
#else
    throw Error(ErrorKind::resources, "device memory in a build without CUDA");
#endif
}

} // namespace vkt
