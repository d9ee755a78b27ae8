// Sums and roundings that the resampling kernels of both devices share.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/resample/kernels/resample.h"

namespace vkt::VKT_BACKEND {

/// The type in which up to eight voxels are added: exactly for integers, in their own precision for floats.
template <class T>
using Sum = std::conditional_t<
    !std::is_integral_v<T>, std::conditional_t<std::is_same_v<T, double>, double, float>,
    std::conditional_t<sizeof(T) <= 2, std::int32_t, std::conditional_t<sizeof(T) == 4, std::int64_t, Int128>>>;

/// A term of the mean of 2^shift voxels: floats are divided first, so that no sum overflows.
template <class T> VKT_HD Sum<T> term_of(T v, Sum<T> share) {
    if constexpr (std::is_integral_v<T>)
        return static_cast<Sum<T>>(v);
    else
        return static_cast<Sum<T>>(v) * share;
}

/// The mean of 2^shift voxels from their terms, halves to even.
template <class T> VKT_HD T mean_of(Sum<T> sum, int shift) {
    if constexpr (std::is_integral_v<T>) {
        Sum<T> const half = (Sum<T>(1) << shift) / 2;
        return static_cast<T>(shift == 0 ? sum : (sum + half - 1 + ((sum >> shift) & 1)) >> shift);
    } else {
        return round_to<T>(sum);
    }
}

template <class T> inline Sum<T> share_of(int shift) {
    return std::is_integral_v<T> ? Sum<T>(1) : Sum<T>(1) / static_cast<Sum<T>>(1 << shift);
}

/// Sum of the weights of output o along an axis that stay in the volume.
VKT_HD double inside_of(AxisTable const& taps, std::int64_t o) {
    return taps.inside != nullptr ? taps.inside[o] : taps.divisor;
}

VKT_HD std::int64_t as_whole(double weight) { return static_cast<std::int64_t>(weight); }

/// A weighted sum divided by its divisor. A finite sum of float64 cannot be infinite only for being divided last.
template <class T> VKT_HD double divided(double total, double divisor) {
    double const mean = total / divisor;
    if constexpr (std::is_same_v<T, double>) {
        constexpr double most = std::numeric_limits<double>::max();
        double const kept = mean > most ? most : mean < -most ? -most : mean;
        return total - total == 0 ? kept : mean;
    }
    return mean;
}

/// sum / divisor of whole numbers, halves to even.
template <class T> VKT_HD T rounded_quotient(Int128 sum, std::int64_t divisor) {
    Int128 quotient = sum / divisor, left = sum - quotient * divisor;
    if (left < 0) {
        quotient -= 1;
        left += divisor;
    }
    left = 2 * left - divisor;
    bool const up = left > 0 || (left == 0 && (quotient & 1) != 0);
    return static_cast<T>(quotient + (up ? 1 : 0));
}

inline int log2_of(Index3 factors) { return static_cast<int>(factors.x + factors.y + factors.z - 3); }

} // namespace vkt::VKT_BACKEND
