// Sums of groups of voxels in long double, and what follows from them and from those of GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/statistics/kernels/running_sums.h"
#include "libvkt/operations/statistics/statistics.h"

namespace vkt {

/// A product whose mantissa is kept where long double has room for another factor.
struct HostProduct {
    long double mantissa = 1;
    std::int64_t exponent = 0;

    void multiply(long double factor) {
        mantissa *= factor;
        long double const size = std::abs(mantissa);
        if (!(size < 0x1p8000L && size > 0x1p-8000L)) rescale();
    }

private:
    void rescale();
};

struct HostNumbers {
    using Real = long double;
    using Product = HostProduct;
    static Real of_double(double value) { return value; }
    static Real of_integer(std::uint64_t size, bool negative) {
        auto const real = static_cast<Real>(size);
        return negative ? -real : real;
    }
};

/// What a GPU summed, as a host has it.
SumsOf<HostNumbers> on_host(SumsOf<DeviceNumbers> const& sums);

/// `lower`: of the block; `width`: of its rows.
PartialStatistics partial_of(SumsOf<HostNumbers> const& sums, DataType type, Index3 lower, std::int64_t width);

} // namespace vkt
