// volkit's structured volumes over vkt.h.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

using namespace vkt;
using namespace vkt::volkit;

namespace {

/// Calls as(T()) with the type of a format's voxels.
template <class F> auto with_type_of(vktDataFormat format, F const& as) {
    switch (format) {
    case vktDataFormatInt8:
        return as(std::int8_t());
    case vktDataFormatInt16:
        return as(std::int16_t());
    case vktDataFormatInt32:
        return as(std::int32_t());
    case vktDataFormatUInt8:
        return as(std::uint8_t());
    case vktDataFormatUInt16:
        return as(std::uint16_t());
    case vktDataFormatUInt32:
        return as(std::uint32_t());
    default:
        return as(float());
    }
}

/// Bytes of one value under a mapping.
void store(std::uint8_t* to, double value, vktDataFormat format, double slope, double intercept) {
    auto const as = [&]<class T>(T) {
        T stored;
        if constexpr (std::is_floating_point_v<T>) {
            stored = static_cast<T>(value);
        } else {
            double const exact = std::nearbyint((value - intercept) / slope);
            constexpr auto low = static_cast<double>(std::numeric_limits<T>::min());
            constexpr auto high = static_cast<double>(std::numeric_limits<T>::max());
            stored = std::isnan(exact) ? T(0) : static_cast<T>(std::clamp(exact, low, high));
        }
        std::memcpy(to, &stored, sizeof stored);
    };
    return with_type_of(format, as);
}

float value_of(std::uint8_t const* from, vktDataFormat format, double slope, double intercept) {
    auto const as = [&]<class T>(T stored) {
        std::memcpy(&stored, from, sizeof stored);
        return static_cast<float>(slope * static_cast<double>(stored) + intercept);
    };
    return with_type_of(format, as);
}

/// Where a voxel's bytes lie; throws Error{usage} outside.
std::size_t offset_of(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z) {
    Index3 const n = dims_of(needed(volume, "volume")->volume.get());
    if (x < 0 || y < 0 || z < 0 || x >= n.x || y >= n.y || z >= n.z)
        throw Error(ErrorKind::usage, text("voxel ", x, " ", y, " ", z, " is outside of the volume of ", n));
    return static_cast<std::size_t>(x + n.x * (y + n.y * z)) * volkit::size_of(volume->format);
}

std::uint8_t const* readable(vktStructuredVolume volume) {
    void const* voxels = nullptr;
    if (vkt_voxels(volume->volume.get(), &voxels, nullptr) != VKT_OK) throw Failed{};
    return static_cast<std::uint8_t const*>(voxels);
}

/// The volume with other distances or another mapping, and the same voxels.
void redescribe(vktStructuredVolume volume, std::function<void(vkt_description&)> const& change) {
    vkt_description d = description_of(volume->volume.get());
    change(d);
    vkt_volume* changed = nullptr;
    if (vkt_create(&d, readable(volume), &changed) != VKT_OK) throw Failed{};
    volume->volume.reset(changed);
    volume->own = true;
}

/// What one voxel of this format says about the mapping.
std::unique_ptr<vktStructuredVolume_impl> one_voxel(vktDataFormat format, float low, float high) {
    return made({1, 1, 1}, format, {1, 1, 1}, low, high);
}

} // namespace

uint8_t vktStructuredVolumeGetMaxBytesPerVoxel(void) { return 4; }

void vktStructuredVolumeCreate(vktStructuredVolume* volume, int32_t dimX, int32_t dimY, int32_t dimZ,
                               vktDataFormat dataFormat, float distX, float distY, float distZ, float mappingLo,
                               float mappingHi) {
    if (volume != nullptr) *volume = nullptr;
    volkit::attempt([&] {
        c::need(volume, "volume");
        *volume = made({dimX, dimY, dimZ}, dataFormat, {distX, distY, distZ}, mappingLo, mappingHi).release();
    });
}

void vktStructuredVolumeCreateCopy(vktStructuredVolume* volume, vktStructuredVolume rhs) {
    if (volume != nullptr) *volume = nullptr;
    volkit::attempt([&] {
        c::need(volume, "volume");
        needed(rhs, "rhs");
        vkt_description const d = description_of(rhs->volume.get());
        vkt_volume* copy = nullptr;
        if (vkt_create(&d, readable(rhs), &copy) != VKT_OK) return;
        Owned owned(copy);
        *volume = new vktStructuredVolume_impl{std::move(owned), rhs->format, rhs->low, rhs->high, true};
    });
}

void vktStructuredVolumeDestroy(vktStructuredVolume volume) { delete volume; }

void vktStructuredVolumeSetDims3i(vktStructuredVolume volume, int32_t dimX, int32_t dimY, int32_t dimZ) {
    volkit::attempt([&] { take(volume, std::move(made_like(needed(volume, "volume"), {dimX, dimY, dimZ})->volume)); });
}

void vktStructuredVolumeGetDims3i(vktStructuredVolume volume, int32_t* dimX, int32_t* dimY, int32_t* dimZ) {
    vktVec3i_t const dims = vktStructuredVolumeGetDims3iv(volume);
    if (dimX != nullptr) *dimX = dims.x;
    if (dimY != nullptr) *dimY = dims.y;
    if (dimZ != nullptr) *dimZ = dims.z;
}

void vktStructuredVolumeSetDims3iv(vktStructuredVolume volume, vktVec3i_t dims) {
    vktStructuredVolumeSetDims3i(volume, dims.x, dims.y, dims.z);
}

vktVec3i_t vktStructuredVolumeGetDims3iv(vktStructuredVolume volume) {
    vktVec3i_t dims = {0, 0, 0};
    volkit::attempt([&] {
        Index3 const n = dims_of(needed(volume, "volume")->volume.get());
        dims = {static_cast<int>(n.x), static_cast<int>(n.y), static_cast<int>(n.z)};
    });
    return dims;
}

void vktStructuredVolumeSetDataFormat(vktStructuredVolume volume, vktDataFormat dataFormat) {
    volkit::attempt([&] {
        vktStructuredVolume_impl other{nullptr, dataFormat, needed(volume, "volume")->low, volume->high, false};
        vktVec3f_t const dist = vktStructuredVolumeGetDist3fv(volume);
        other.volume = std::move(made(dims_of(volume->volume.get()), dataFormat, dist, other.low, other.high)->volume);
        *volume = std::move(other);
    });
}

vktDataFormat vktStructuredVolumeGetDataFormat(vktStructuredVolume volume) {
    return volume == nullptr ? vktDataFormatUnspecified : volume->format;
}

void vktStructuredVolumeSetDist3f(vktStructuredVolume volume, float distX, float distY, float distZ) {
    volkit::attempt([&] {
        redescribe(needed(volume, "volume"), [&](vkt_description& d) {
            d.spacing[0] = double{distX};
            d.spacing[1] = double{distY};
            d.spacing[2] = double{distZ};
        });
    });
}

void vktStructuredVolumeGetDist3f(vktStructuredVolume volume, float* distX, float* distY, float* distZ) {
    vktVec3f_t const dist = vktStructuredVolumeGetDist3fv(volume);
    if (distX != nullptr) *distX = dist.x;
    if (distY != nullptr) *distY = dist.y;
    if (distZ != nullptr) *distZ = dist.z;
}

void vktStructuredVolumeSetDist3fv(vktStructuredVolume volume, vktVec3f_t dist) {
    vktStructuredVolumeSetDist3f(volume, dist.x, dist.y, dist.z);
}

vktVec3f_t vktStructuredVolumeGetDist3fv(vktStructuredVolume volume) {
    vktVec3f_t dist = {0, 0, 0};
    volkit::attempt([&] {
        vkt_description const d = description_of(needed(volume, "volume")->volume.get());
        dist = {static_cast<float>(d.spacing[0]), static_cast<float>(d.spacing[1]), static_cast<float>(d.spacing[2])};
    });
    return dist;
}

void vktStructuredVolumeSetVoxelMapping2f(vktStructuredVolume volume, float lo, float hi) {
    volkit::attempt([&] {
        needed(volume, "volume");
        vkt_description const like = description_of(one_voxel(volume->format, lo, hi)->volume.get());
        redescribe(volume, [&](vkt_description& d) {
            d.slope = like.slope;
            d.intercept = like.intercept;
        });
        volume->low = lo;
        volume->high = hi;
    });
}

void vktStructuredVolumeGetVoxelMapping2f(vktStructuredVolume volume, float* lo, float* hi) {
    if (volume == nullptr) return;
    if (lo != nullptr) *lo = volume->low;
    if (hi != nullptr) *hi = volume->high;
}

void vktStructuredVolumeSetVoxelMapping2fv(vktStructuredVolume volume, vktVec2f_t mapping) {
    vktStructuredVolumeSetVoxelMapping2f(volume, mapping.x, mapping.y);
}

vktVec2f_t vktStructuredVolumeGetVoxelMapping2fv(vktStructuredVolume volume) {
    return volume == nullptr ? vktVec2f_t{0, 0} : vktVec2f_t{volume->low, volume->high};
}

vktBox3f_t vktStructuredVolumeGetDomainBounds(vktStructuredVolume volume) {
    return vktStructuredVolumeGetObjectBounds(volume);
}

vktBox3f_t vktStructuredVolumeGetObjectBounds(vktStructuredVolume volume) {
    vktVec3i_t const n = vktStructuredVolumeGetDims3iv(volume);
    vktVec3f_t const dist = vktStructuredVolumeGetDist3fv(volume);
    return {{0, 0, 0},
            {static_cast<float>(n.x) * dist.x, static_cast<float>(n.y) * dist.y, static_cast<float>(n.z) * dist.z}};
}

vktBox3f_t vktStructuredVolumeGetWorldBounds(vktStructuredVolume volume) {
    return vktStructuredVolumeGetObjectBounds(volume);
}

uint8_t* vktStructuredVolumeGetData(vktStructuredVolume volume) {
    uint8_t* data = nullptr;
    volkit::attempt([&] { data = writable(needed(volume, "volume")); });
    return data;
}

void vktStructuredVolumeSetValue(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, float value) {
    volkit::attempt([&] {
        std::size_t const at = offset_of(volume, x, y, z);
        vkt_description const d = description_of(volume->volume.get());
        store(writable(volume) + at, double{value}, volume->format, d.slope, d.intercept);
    });
}

void vktStructuredVolumeGetValue(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, float* value) {
    volkit::attempt([&] {
        c::need(value, "value");
        std::size_t const at = offset_of(volume, x, y, z);
        vkt_description const d = description_of(volume->volume.get());
        *value = value_of(readable(volume) + at, volume->format, d.slope, d.intercept);
    });
}

void vktStructuredVolumeSetBytes(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, uint8_t const* data) {
    volkit::attempt([&] {
        c::need(data, "data");
        std::size_t const at = offset_of(volume, x, y, z);
        std::memcpy(writable(volume) + at, data, volkit::size_of(volume->format));
    });
}

void vktStructuredVolumeGetBytes(vktStructuredVolume volume, int32_t x, int32_t y, int32_t z, uint8_t* data) {
    volkit::attempt([&] {
        c::need(data, "data");
        std::memcpy(data, readable(volume) + offset_of(volume, x, y, z), volkit::size_of(volume->format));
    });
}

size_t vktStructuredVolumeGetSizeInBytes(vktStructuredVolume volume) {
    size_t bytes = 0;
    volkit::attempt([&] {
        void const* voxels = nullptr;
        (void)vkt_voxels(needed(volume, "volume")->volume.get(), &voxels, &bytes);
    });
    return bytes;
}

void vktStructuredVolumeMigrate(vktStructuredVolume) {}

vktError vktMapVoxel(uint8_t* dst, float value, vktDataFormat dataFormat, float mappingLo, float mappingHi) {
    return run("vktMapVoxel", [&] {
        c::need(dst, "dst");
        vkt_description const d = description_of(one_voxel(dataFormat, mappingLo, mappingHi)->volume.get());
        store(dst, double{value}, dataFormat, d.slope, d.intercept);
    });
}

vktError vktUnmapVoxel(float* value, uint8_t const* src, vktDataFormat dataFormat, float mappingLo, float mappingHi) {
    return run("vktUnmapVoxel", [&] {
        c::need(value, "value");
        c::need(src, "src");
        vkt_description const d = description_of(one_voxel(dataFormat, mappingLo, mappingHi)->volume.get());
        *value = value_of(src, dataFormat, d.slope, d.intercept);
    });
}
