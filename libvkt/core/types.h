// Plain data that every layer and every back end shares: indices, boxes, vectors, data types, boundaries.
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace vkt {

/// A voxel index or an extent in voxels; x runs fastest in memory. 64-bit so that no product of extents wraps.
struct Index3 {
    std::int64_t x = 0, y = 0, z = 0;

    std::int64_t& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
    std::int64_t operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
    friend bool operator==(Index3 const&, Index3 const&) = default;
    friend Index3 operator+(Index3 a, Index3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Index3 operator-(Index3 a, Index3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
};

/// Half-open region of voxels [lower, upper).
struct Box {
    Index3 lower, upper;

    Index3 dims() const { return upper - lower; }
    bool empty() const { return upper.x <= lower.x || upper.y <= lower.y || upper.z <= lower.z; }
    std::int64_t voxels() const { return empty() ? 0 : dims().x * dims().y * dims().z; }
    bool contains(Box const& b) const {
        return b.lower.x >= lower.x && b.lower.y >= lower.y && b.lower.z >= lower.z && b.upper.x <= upper.x &&
               b.upper.y <= upper.y && b.upper.z <= upper.z;
    }
    friend bool operator==(Box const&, Box const&) = default;
};

inline Box box_of(Index3 dims) { return {{0, 0, 0}, dims}; }

inline Box intersect(Box const& a, Box const& b) {
    return {{std::max(a.lower.x, b.lower.x), std::max(a.lower.y, b.lower.y), std::max(a.lower.z, b.lower.z)},
            {std::min(a.upper.x, b.upper.x), std::min(a.upper.y, b.upper.y), std::min(a.upper.z, b.upper.z)}};
}

inline Box grow(Box const& b, Index3 by) { return {b.lower - by, b.upper + by}; }

/// A point, direction, spacing or scale in floating point.
struct Vec3 {
    double x = 0, y = 0, z = 0;

    double& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
    double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
    friend bool operator==(Vec3 const&, Vec3 const&) = default;
    friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
};

/// Storage types of voxels. The order is part of the stream's and the C API's contract: append only.
enum class DataType : std::uint8_t {
    uint8,
    int8,
    uint16,
    int16,
    uint32,
    int32,
    uint64,
    int64,
    float16,
    float32,
    float64,
};

inline constexpr int data_type_count = 11;

/// Bytes per voxel. Inlined, as is_integer: both are asked for once a piece of a row.
[[gnu::always_inline]] constexpr std::size_t size_of(DataType type) {
    constexpr std::uint8_t bytes[data_type_count] = {1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
    return bytes[static_cast<std::size_t>(type)];
}
std::string_view name_of(DataType type); ///< canonical name, "uint8" … "float64"
[[gnu::always_inline]] constexpr bool is_integer(DataType type) { return type < DataType::float16; }
bool is_signed(DataType type);    ///< floats are signed
double lowest_of(DataType type);  ///< smallest finite value
double highest_of(DataType type); ///< largest finite value (rounded to double for 64-bit integers)
/// Accepts canonical and common names in any case: uint8 u8 uchar byte, float f32 single, … Throws Error{usage}.
DataType parse_data_type(std::string_view text);

/// How a volume continues outside its box. mirror is half-sample symmetric (… c b a | a b c …).
enum class Boundary : std::uint8_t { mirror, clamp, wrap, border };

enum class Axis : std::uint8_t { x, y, z };

/// Index of the voxel that stands at position i of a line of n voxels under a boundary; -1 where the border value does.
/// Folds any number of times, so halos may exceed the volume. Always inlined, like all that kernels call: a copy
/// compiled for a newer processor must not be left for the linker to pick.
[[gnu::always_inline]] constexpr std::int64_t fold(std::int64_t i, std::int64_t n, Boundary boundary) {
    if (i >= 0 && i < n) return i;
    switch (boundary) {
    case Boundary::clamp:
        return i < 0 ? 0 : n - 1;
    case Boundary::wrap:
        if (i >= -n && i < 2 * n) return i < 0 ? i + n : i - n; // nearly always, and divisions take long
        return ((i % n) + n) % n;
    case Boundary::mirror: {
        if (i >= -n && i < 2 * n) return i < 0 ? -1 - i : 2 * n - 1 - i;
        std::int64_t const period = 2 * n;
        std::int64_t const j = ((i % period) + period) % period;
        return j < n ? j : period - 1 - j;
    }
    case Boundary::border:
        break;
    }
    return -1;
}

/// Axes along which a copy reverses the order of the voxels.
struct Mirror {
    bool x = false, y = false, z = false;
};

} // namespace vkt
