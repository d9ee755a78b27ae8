// Small vectors for the inner loops of rendering: three floats, three doubles, four floats in one register.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/host_device.h"

namespace vkt::render {

struct Float3 {
    float x, y, z;
};
VKT_HD Float3 operator+(Float3 a, Float3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
VKT_HD Float3 operator-(Float3 a, Float3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
VKT_HD Float3 operator*(Float3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
VKT_HD float dot(Float3 a, Float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

struct Double3 {
    double x, y, z;
};
VKT_HD Double3 operator+(Double3 a, Double3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
VKT_HD Double3 operator-(Double3 a, Double3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
VKT_HD Double3 operator*(Double3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
VKT_HD double dot(Double3 a, Double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
VKT_HD Float3 to_float(Double3 a) {
    return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}

VKT_HD Float3 to_float(Float3 a) { return a; }

/// Linear map of three dimensions, by columns.
struct Matrix3 {
    Double3 x, y, z;
};
VKT_HD Double3 operator*(Matrix3 const& m, Double3 v) { return m.x * v.x + m.y * v.y + m.z * v.z; }

/// Extinction and the three emissions, or their integrals, side by side.
#ifdef __CUDACC__
struct alignas(16) Quad {
    float v[4];
    VKT_HD float operator[](int i) const { return v[i]; }
    VKT_HD float& operator[](int i) { return v[i]; }
};
VKT_HD Quad operator+(Quad a, Quad b) { return {{a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]}}; }
VKT_HD Quad operator-(Quad a, Quad b) { return {{a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]}}; }
VKT_HD Quad operator*(Quad a, float s) { return {{a[0] * s, a[1] * s, a[2] * s, a[3] * s}}; }
#else
using Quad = float __attribute__((vector_size(16)));
#endif

} // namespace vkt::render
