// Test fields: each is a function that fills a piece of a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/make.h"

#include "libvkt/kernel/rows.h"

#include <cmath>
#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Calls f(x, y, z, n, to) for pieces of rows and stores the doubles it leaves in to; returns what did not fit.
template <class F> Losses fill_rows(AnyView out, Execution const& execution, F const& f) {
    Losses losses;
    for_each_segment(execution, out.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) double row[row_piece];
        for (std::int64_t i = 0; i < n; i += row_piece) {
            std::int64_t const m = std::min(row_piece, n - i);
            f(x + i, y, z, m, row);
            driver::add(losses, store_row(out.type, static_cast<double const*>(row), out.at(x + i, y, z), m));
        }
    });
    return losses;
}

/// cos(2 pi u) from its Taylor series on a quarter turn: the same bits wherever IEEE arithmetic holds, to 1e-15.
double cos_turns(double u) {
    u -= std::nearbyint(u);
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

/// Philox4x32-10: blocks [first, first + n) of four words each.
void philox(std::uint64_t first, std::int64_t n, std::uint64_t seed, std::uint32_t* words) {
#pragma omp simd
    for (std::int64_t b = 0; b < n; ++b) {
        std::uint64_t const block = first + static_cast<std::uint64_t>(b);
        auto c0 = static_cast<std::uint32_t>(block), c1 = static_cast<std::uint32_t>(block >> 32);
        std::uint32_t c2 = 0, c3 = 0;
        auto k0 = static_cast<std::uint32_t>(seed), k1 = static_cast<std::uint32_t>(seed >> 32);
        for (int round = 0; round < 10; ++round) {
            std::uint64_t const p0 = std::uint64_t{0xD2511F53u} * c0, p1 = std::uint64_t{0xCD9E8D57u} * c2;
            c0 = static_cast<std::uint32_t>(p1 >> 32) ^ c1 ^ k0;
            c2 = static_cast<std::uint32_t>(p0 >> 32) ^ c3 ^ k1;
            c1 = static_cast<std::uint32_t>(p1);
            c3 = static_cast<std::uint32_t>(p0);
            k0 += 0x9E3779B9u;
            k1 += 0xBB67AE85u;
        }
        words[4 * b] = c0;
        words[4 * b + 1] = c1;
        words[4 * b + 2] = c2;
        words[4 * b + 3] = c3;
    }
}

template <class T> void noise(View<T> out, Box const& box, NoiseField const& field, Execution const& execution) {
    constexpr std::int64_t words_per_voxel = sizeof(T) == 8 ? 2 : 1;
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) std::uint32_t words[2 * row_piece + 8];
        for (std::int64_t i = 0; i < n; i += row_piece) {
            std::int64_t const m = std::min(row_piece, n - i);
            std::int64_t const word = (x + i + field.dims.x * (y + field.dims.y * z)) * words_per_voxel;
            std::int64_t const last = word + m * words_per_voxel - 1;
            philox(static_cast<std::uint64_t>(word / 4), last / 4 - word / 4 + 1, field.seed, words);
            std::uint32_t const* const w = words + word % 4;
            T* const to = &out(x + i, y, z);
            double const low = field.low, width = field.high - field.low;
            for (std::int64_t j = 0; j < m; ++j) {
                std::uint64_t bits = w[j * words_per_voxel];
                if constexpr (words_per_voxel == 2) bits |= static_cast<std::uint64_t>(w[2 * j + 1]) << 32;
                if constexpr (std::is_integral_v<T>) {
                    // bits / 2^k of the number of integers, rounded down: no integer is more than 2^-k likelier
                    Int128 const from = round_to<T>(field.low),
                                 count = static_cast<Int128>(round_to<T>(field.high)) - from + 1;
                    to[j] = static_cast<T>(
                        from + static_cast<Int128>((static_cast<Unsigned128>(bits) * static_cast<Unsigned128>(count)) >>
                                                   (32 * words_per_voxel)));
                } else if constexpr (sizeof(T) == 8) {
                    to[j] = low + width * (static_cast<double>(bits >> 11) * 0x1p-53);
                } else {
                    to[j] = round_to<T>(low + width * (static_cast<double>(bits) * 0x1p-32));
                }
            }
        }
    });
}

} // namespace

void make_ramp(AnyView out, Axis axis, double first, double last, std::int64_t n, Execution const& execution) {
    auto const steps = static_cast<double>(std::max<std::int64_t>(n - 1, 1));
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        for (std::int64_t i = 0; i < m; ++i) {
            std::int64_t const at = axis == Axis::x ? x + i : axis == Axis::y ? y : z;
            to[i] = first + (last - first) * static_cast<double>(at) / steps;
        }
    });
}

void make_checkerboard(AnyView out, std::int64_t period, double low, double high, Execution const& execution) {
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        std::int64_t const rest = y / period + z / period;
        for (std::int64_t i = 0; i < m; ++i) to[i] = (((x + i) / period + rest) & 1) == 0 ? low : high;
    });
}

void make_ball(AnyView out, BallField const& field, Losses& losses, Execution const& execution) {
    losses +=
        fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
            Vec3 p{0, static_cast<double>(y) - field.center.y, static_cast<double>(z) - field.center.z};
            for (std::int64_t i = 0; i < m; ++i) {
                p.x = static_cast<double>(x + i) - field.center.x;
                double const square = p.x * p.x + p.y * p.y + p.z * p.z;
                if (field.edge == SphereEdge::distance)
                    to[i] = std::sqrt(square) - field.radius;
                else if (field.edge == SphereEdge::hard)
                    to[i] = square <= field.radius * field.radius ? field.inside : field.outside;
                else
                    to[i] = field.outside + (field.inside - field.outside) * ball_coverage(p, field.radius);
            }
        });
}

void make_marschner_lobb(AnyView out, MarschnerLobbField const& field, Execution const& execution) {
    auto const position = [](std::int64_t i, std::int64_t n) {
        return static_cast<double>(2 * i + 1 - n) / static_cast<double>(n);
    };
    fill_rows(out, execution, [=](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t m, double* to) {
        double const v = position(y, field.dims.y), w = position(z, field.dims.z);
        double const depth = 1 - cos_turns(w / 4 - 0.25); // 1 - sin(pi z / 2)
        for (std::int64_t i = 0; i < m; ++i) {
            double const u = position(x + i, field.dims.x);
            double const wave = cos_turns(field.frequency * cos_turns(std::sqrt(u * u + v * v) / 4));
            double const value = (depth + field.amplitude * (1 + wave)) / (2 * (1 + field.amplitude));
            to[i] = field.low + (field.high - field.low) * value;
        }
    });
}

void make_noise(AnyView out, NoiseField const& field, Execution const& execution) {
    for_each_type(out.type, [&]<class T>(T) { noise<T>(out.as<T>(), out.box, field, execution); });
}

} // namespace VKT_BACKEND

} // namespace vkt
