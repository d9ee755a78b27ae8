// Which voxels are of an object, on a GPU; what bits.h is for rows on CPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"

#include <optional>
#include <type_traits>

namespace vkt::VKT_BACKEND {
namespace {

/// Neither zero nor NaN; or, of `holes`, zero.
template <class T> struct IsObject {
    using C = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    C zero; ///< the stored one
    bool any, holes;

    explicit IsObject(std::optional<double> stored, bool of_holes = false)
        : zero(static_cast<C>(stored.value_or(0))), any(stored.has_value()), holes(of_holes) {}
    __device__ bool operator()(C v) const {
        if (holes) return any && v == zero;
        if constexpr (std::is_integral_v<T>)
            return !any || v != zero;
        else
            return any ? v < zero || v > zero : v == v;
    }
};

} // namespace
} // namespace vkt::VKT_BACKEND
