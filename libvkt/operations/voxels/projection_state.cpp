// Which accumulators a projection needs.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/median_lines.h"
#include "libvkt/operations/voxels/kernels/project.h"

#include <algorithm>
#include <cstdint>
#include <limits>

namespace vkt {
namespace {

/// Bytes of a pixel's accumulators.
struct Needs {
    std::size_t extremes = 0;
    bool whole = false, wide = false, value = false, extra = false, count = false, scale = false;
};

Needs needs(Projection kind, DataType type, std::int64_t n) {
    Needs result;
    bool const sums = kind == Projection::mean || kind == Projection::sum;
    if (kind == Projection::max || kind == Projection::min)
        result.extremes = type == DataType::float16 ? 4 : size_of(type);
    else if (sums && is_integer(type))
        // Differences to 2^63: 32 bits of a value, and as many voxels as leave room for a sign.
        (size_of(type) == 8 || n > std::int64_t{1} << 30 ? result.wide : result.whole) = true;
    else
        result.value = result.count = true;
    result.extra = kind == Projection::std || (result.value && type == DataType::float64);
    result.scale = result.value && type == DataType::float64;
    return result;
}

} // namespace

ProjectionState::ProjectionState() = default;
ProjectionState::ProjectionState(ProjectionState&&) noexcept = default;
ProjectionState& ProjectionState::operator=(ProjectionState&&) noexcept = default;
ProjectionState::~ProjectionState() = default;

ProjectionState::ProjectionState(Projection projection, DataType voxels, int along, Index3 extent)
    : kind(projection), type(voxels), axis(along), dims(extent) {}

std::size_t ProjectionState::bytes() const {
    Needs const n = needs(kind, type, dims[axis]);
    std::size_t const pixel = n.extremes + (n.whole ? 8 : 0) + (n.wide ? 16 : 0) + (n.value ? 8 : 0) +
                              (n.extra ? 8 : 0) + (n.count ? 8 : 0) + (n.scale ? 8 : 0);
    return static_cast<std::size_t>(pixels()) * pixel;
}

void ProjectionState::point(std::byte* memory) {
    Needs const n = needs(kind, type, dims[axis]);
    auto const count_of = static_cast<std::size_t>(pixels());
    auto const next = [&]<class T>(T*& list, bool wanted) { // the widest come first, so that all are aligned
        list = wanted ? reinterpret_cast<T*>(memory) : nullptr;
        memory += wanted ? count_of * sizeof(T) : 0;
    };
    next(wide, n.wide);
    next(whole, n.whole);
    next(value, n.value);
    next(extra, n.extra);
    next(count, n.count);
    next(scale, n.scale);
    next(extremes, n.extremes > 0);
}

void ProjectionState::use(Space space) { point(memory_.update(space)); }

void ProjectionState::begin(Space space) {
    memory_.reserve(bytes());
    std::byte* const memory = memory_.write(space);
    point(memory);
    if (space == Space::device) return;
    if (extremes == nullptr) {
        std::fill_n(memory, bytes(), std::byte{0});
        return;
    }
    with_type(type == DataType::float16 ? DataType::float32 : type, [&]<class T>(T) {
        T start = kind == Projection::max ? std::numeric_limits<T>::lowest() : std::numeric_limits<T>::max();
        if constexpr (std::is_floating_point_v<T>) start = std::numeric_limits<T>::quiet_NaN();
        std::fill_n(reinterpret_cast<T*>(extremes), pixels(), start);
    });
}

std::size_t median_line_bytes(DataType type, std::int64_t n) {
    // 64 lines of keys, and of one byte of each.
    return 64 * static_cast<std::size_t>(n) * (size_of(type) + 1);
}

} // namespace vkt
