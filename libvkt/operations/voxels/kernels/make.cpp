// Test fields: each is a function that fills a piece of a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/make.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/philox.h"
#include "libvkt/kernel/rows.h"

#include <cmath>
#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// cos(2 pi u) from its Taylor series on a quarter turn: the same bits wherever IEEE arithmetic holds, to 1e-15.
VKT_HD double cos_turns(double u) {
    u -= (u + 6755399441055744.0) - 6755399441055744.0; // the nearest whole number
    u = u < 0 ? -u : u;
    bool const flip = u > 0.25;
    u = flip ? 0.5 - u : u;
    double const x = u * 6.283185307179586476925, x2 = x * x;
    double term = 1, sum = 1;
    for (int k = 1; k <= 12; ++k) {
        term *= -x2 / static_cast<double>((2 * k - 1) * (2 * k));
        sum += term;
    }
    return flip ? -sum : sum;
}

/// The four random words of a block.
VKT_HD void philox_block(std::uint64_t block, std::uint64_t seed, std::uint32_t* words) {
    PhiloxBlock const random =
        philox({{static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(block >> 32), 0, 0}},
               static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32));
    for (int i = 0; i < 4; ++i) words[i] = random.word[i];
}

/// The words of the blocks that voxels take in their order: one each, or two where R holds more than 32 bits.
template <class R, bool Wide> struct Noise {
    Index3 dims;
    std::uint64_t seed;
    double low, width;       ///< of floating types
    Int128 whole_low, count; ///< of integers; 0: floating

    VKT_HD R value(std::uint64_t bits) const {
        if (count == 0)
            return static_cast<R>(
                low + width * (Wide ? static_cast<double>(bits >> 11) * 0x1p-53 : static_cast<double>(bits) * 0x1p-32));
        // bits / 2^k of the number of integers, rounded down: no integer is more than 2^-k likelier.
        if constexpr (Wide)
            return static_cast<R>(
                whole_low +
                static_cast<Int128>((static_cast<Unsigned128>(bits) * static_cast<Unsigned128>(count)) >> 64));
        else
            return static_cast<R>(static_cast<std::int64_t>(whole_low) +
                                  static_cast<std::int64_t>((bits * static_cast<std::uint64_t>(count)) >> 32));
    }
    VKT_HD R operator()(double x, double y, double z) const {
        constexpr std::int64_t each = Wide ? 2 : 1;
        auto const whole = [](double v) { return static_cast<std::int64_t>(v); };
        std::int64_t const word = (whole(x) + dims.x * (whole(y) + dims.y * whole(z))) * each;
        std::uint32_t words[4];
        philox_block(static_cast<std::uint64_t>(word / 4), seed, words);
        std::uint64_t bits = words[word % 4];
        if constexpr (Wide) bits |= static_cast<std::uint64_t>(words[word % 4 + 1]) << 32;
        return value(bits);
    }
    void row_at(std::int64_t n, std::int64_t x, std::int64_t y, std::int64_t z, R* out) const {
        constexpr std::int64_t each = Wide ? 2 : 1;
        alignas(64) std::uint32_t words[2 * row_piece + 8];
        std::int64_t const word = (x + dims.x * (y + dims.y * z)) * each, last = word + n * each - 1;
        auto const first = static_cast<std::uint64_t>(word / 4);
        std::int64_t const blocks = last / 4 - word / 4 + 1;
        std::uint64_t const key = seed;
#pragma omp simd
        for (std::int64_t b = 0; b < blocks; ++b)
            philox_block(first + static_cast<std::uint64_t>(b), key, words + 4 * b);
        std::uint32_t const* const w = words + word % 4;
        Noise const f = *this;
        for (std::int64_t i = 0; i < n; ++i) {
            std::uint64_t bits = w[i * each];
            if constexpr (Wide) bits |= static_cast<std::uint64_t>(w[2 * i + 1]) << 32;
            out[i] = f.value(bits);
        }
    }
};

struct Ramp {
    Axis axis;
    double first, last, steps;
    VKT_HD double operator()(double x, double y, double z) const {
        return first + (last - first) * (axis == Axis::x ? x : axis == Axis::y ? y : z) / steps;
    }
};

struct Checkerboard {
    double period, low, high;
    static VKT_HD double floor_of(double v, double period) { // v >= 0
        return static_cast<double>(static_cast<std::int64_t>(v / period));
    }
    VKT_HD double operator()(double x, double y, double z) const {
        double const sum = floor_of(x, period) + floor_of(y, period) + floor_of(z, period);
        return sum == 2 * floor_of(sum, 2) ? low : high;
    }
};

struct Ball {
    BallField field;
    VKT_HD double operator()(double x, double y, double z) const {
        Vec3 const p{x - field.center.x, y - field.center.y, z - field.center.z};
        double const square = p.x * p.x + p.y * p.y + p.z * p.z;
        if (field.edge == SphereEdge::distance) return std::sqrt(square) - field.radius;
        return square <= field.radius * field.radius ? field.inside : field.outside;
    }
};

struct MarschnerLobb {
    MarschnerLobbField field;
    static VKT_HD double position(double i, std::int64_t n) {
        return (2 * i + 1 - static_cast<double>(n)) / static_cast<double>(n);
    }
    VKT_HD double operator()(double x, double y, double z) const {
        double const u = position(x, field.dims.x), v = position(y, field.dims.y), w = position(z, field.dims.z);
        double const depth = 1 - cos_turns(w / 4 - 0.25); // 1 - sin(pi z / 2)
        double const wave = cos_turns(field.frequency * cos_turns(std::sqrt(u * u + v * v) / 4));
        double const value = (depth + field.amplitude * (1 + wave)) / (2 * (1 + field.amplitude));
        return field.low + (field.high - field.low) * value;
    }
};

} // namespace

void make_ramp(AnyView out, Axis axis, double first, double last, std::int64_t n, Execution const& execution) {
    Losses losses;
    map_at<double>(execution, out, losses,
                   Ramp{axis, first, last, static_cast<double>(n > 1 ? n - 1 : std::int64_t{1})});
}

void make_checkerboard(AnyView out, std::int64_t period, double low, double high, Execution const& execution) {
    Losses losses;
    map_at<double>(execution, out, losses, Checkerboard{static_cast<double>(period), low, high});
}

void make_ball(AnyView out, BallField const& field, Losses& losses, Execution const& execution) {
    map_at<double>(execution, out, losses, Ball{field});
}

void make_marschner_lobb(AnyView out, MarschnerLobbField const& field, Execution const& execution) {
    Losses losses;
    map_at<double>(execution, out, losses, MarschnerLobb{field});
}

void make_noise(AnyView out, NoiseField const& field, Execution const& execution) {
    Losses losses;
    Int128 low = 0, count = 0;
    with_type(out.type, [&]<class T>(T) {
        if constexpr (std::is_integral_v<T>) {
            low = static_cast<Int128>(round_to<T>(field.low));
            count = static_cast<Int128>(round_to<T>(field.high)) - low + 1;
        }
    });
    double const width = field.high - field.low;
    if (size_of(out.type) < 8)
        map_at<double>(execution, out, losses,
                       Noise<double, false>{field.dims, field.seed, field.low, width, low, count});
    else if (count == 0)
        map_at<double>(execution, out, losses,
                       Noise<double, true>{field.dims, field.seed, field.low, width, low, count});
    else
        map_at<Int128>(execution, out, losses,
                       Noise<Int128, true>{field.dims, field.seed, field.low, width, low, count});
}

} // namespace VKT_BACKEND

} // namespace vkt
