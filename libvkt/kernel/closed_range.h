// Ends of ranges in the type that values are compared in: they mean the same as the numbers given.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/backend.h"

#include <cmath>
#include <limits>

namespace vkt::VKT_BACKEND {

/// The least value of a floating-point type that is not below a number.
template <class C> C least_from(double number) {
    C const nearest = static_cast<C>(number);
    return static_cast<double>(nearest) < number ? std::nextafter(nearest, std::numeric_limits<C>::infinity())
                                                 : nearest;
}
/// The greatest that is not above it.
template <class C> C greatest_to(double number) {
    C const nearest = static_cast<C>(number);
    return static_cast<double>(nearest) > number ? std::nextafter(nearest, -std::numeric_limits<C>::infinity())
                                                 : nearest;
}

} // namespace vkt::VKT_BACKEND
