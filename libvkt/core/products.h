// Products of vectors: dot and cross, and the lengths that come of them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/types.h"

#include <cmath>

namespace vkt {

inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double length(Vec3 a) { return std::sqrt(dot(a, a)); }
/// Of length 1; the length must not be 0.
inline Vec3 unit(Vec3 a) { return a * (1 / length(a)); }

} // namespace vkt
