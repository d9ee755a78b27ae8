// Sums of one group of voxels in one block of rows: the same on hosts, in long double, and on GPUs.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/kernel/numeric.h"
#include "libvkt/operations/statistics/kernels/extended.h"

#include <cstdint>
#include <type_traits>

namespace vkt {

/// The numbers of GPUs; those of hosts are long double, see host_sums.h.
struct DeviceProduct {
    Extended mantissa{std::uint64_t{1} << 63, -63, false};
    std::int64_t exponent = 0;

    VKT_HD void multiply(Extended factor) {
        mantissa = mantissa * factor;
        exponent = mantissa.mantissa == 0 ? 0 : exponent + mantissa.exponent + 63;
        mantissa.exponent = mantissa.mantissa == 0 ? 0 : -63;
    }
};

struct DeviceNumbers {
    using Real = Extended;
    using Product = DeviceProduct;
    VKT_HD static Real of_double(double value) { return Extended(value); }
    VKT_HD static Real of_integer(std::uint64_t size, bool negative) { return Extended::of_integer(size, negative); }
};

/// Values are stored ones; the product is of physical ones. Of integers all bits are kept, in 64; floats are doubles.
template <class Numbers> struct SumsOf {
    std::int64_t finite = 0, nan = 0, above = 0, below = 0;
    std::int64_t low_at = -1, high_at = -1; ///< the first voxel that has them, in the block's order; -1: no number
    std::uint64_t low = 0, high = 0, first = 0;
    Int128 integer_sum = 0;
    Unsigned128 integer_squares = 0;                 ///< of up to 32 bits
    typename Numbers::Real differences{}, squares{}; ///< of all others: from the first finite value
    typename Numbers::Product product;
};

template <class T, class Numbers> class RunningSums {
public:
    static constexpr bool integer = std::is_integral_v<T>;
    static constexpr bool exact = integer && sizeof(T) <= 4;

    /// The next voxel, number `at` of the block.
    VKT_HD void add(T stored, std::int64_t at, ValueMap const& map, bool mapped) {
        auto const value = static_cast<double>(stored);
        if constexpr (!integer) {
            if (value != value) {
                ++sums_.nan;
                return;
            }
        }
        if (sums_.low_at < 0 || less(stored, low_)) {
            low_ = stored;
            sums_.low_at = at;
        }
        if (sums_.high_at < 0 || less(high_, stored)) {
            high_ = stored;
            sums_.high_at = at;
        }
        if constexpr (!integer) {
            if (value - value != 0) {
                (value > 0 ? sums_.above : sums_.below) += 1;
                return;
            }
        }
        if (sums_.finite++ == 0) first_ = stored;
        if constexpr (integer) sums_.integer_sum += stored;
        if constexpr (exact) {
            auto const wide = static_cast<std::int64_t>(stored);
            auto const size = static_cast<std::uint64_t>(wide < 0 ? -wide : wide);
            sums_.integer_squares += size * size;
        } else {
            Real const difference = difference_from_first(stored);
            sums_.differences = sums_.differences + difference;
            sums_.squares = sums_.squares + difference * difference;
        }
        Real factor = Numbers::of_double(value);
        if (mapped) factor = Numbers::of_double(map.slope) * factor + Numbers::of_double(map.intercept);
        sums_.product.multiply(factor);
    }

    VKT_HD SumsOf<Numbers> sums() const {
        SumsOf<Numbers> result = sums_;
        result.low = bits(low_);
        result.high = bits(high_);
        result.first = bits(first_);
        return result;
    }

private:
    using Real = typename Numbers::Real;

    VKT_HD static bool less(T a, T b) {
        if constexpr (integer)
            return a < b;
        else
            return static_cast<double>(a) < static_cast<double>(b);
    }
    VKT_HD Real difference_from_first(T stored) const {
        if constexpr (integer) {
            bool const negative = stored < first_;
            auto const a = static_cast<std::uint64_t>(stored), b = static_cast<std::uint64_t>(first_);
            return Numbers::of_integer(negative ? b - a : a - b, negative);
        } else {
            return Numbers::of_double(static_cast<double>(stored)) - Numbers::of_double(static_cast<double>(first_));
        }
    }
    VKT_HD static std::uint64_t bits(T stored) {
        if constexpr (integer)
            return static_cast<std::uint64_t>(stored);
        else
            return detail::bits_as<std::uint64_t>(static_cast<double>(stored));
    }

    SumsOf<Numbers> sums_;
    T low_{}, high_{}, first_{};
};

/// A slab cut into blocks of rows of one slice, in x-fastest order.
struct RowBlocks {
    Index3 dims;           ///< of the slab
    std::int64_t rows = 1; ///< of a block
    std::int64_t per_slice = 1, count = 0;

    VKT_HD RowBlocks(Index3 slab, std::int64_t rows_of_block)
        : dims(slab), rows(rows_of_block), per_slice((slab.y - 1) / rows_of_block + 1), count(per_slice * slab.z) {}
    VKT_HD std::int64_t z(std::int64_t block) const { return block / per_slice; }
    VKT_HD std::int64_t first_row(std::int64_t block) const { return block % per_slice * rows; }
    VKT_HD std::int64_t rows_of(std::int64_t block) const {
        std::int64_t const left = dims.y - first_row(block);
        return left < rows ? left : rows;
    }
};

/// What a GPU finds of a group in a block.
struct GroupInBlock {
    std::int64_t key = 0, block = 0;
    SumsOf<DeviceNumbers> sums;
};

} // namespace vkt
