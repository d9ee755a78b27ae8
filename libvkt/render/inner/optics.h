// Optics of one ray segment: exponentials without libm, transfer function lookup, segment integration.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/vector.h"

#include <bit>
#include <cstdint>

namespace vkt::render {

/// e^-t and 1 - e^-t for t >= 0, both to about 1e-7 relative. Own polynomials, so that all instruction sets agree bit
/// for bit and loops over arrays vectorise.
struct Attenuation {
    float transmitted, absorbed;
};
VKT_HD Attenuation attenuation(float t) {
    float const limited = t < 87.0F ? t : 87.0F;
    // t = n ln 2 - r with |r| <= ln 2 / 2; then e^-t = 2^-n e^r.
    float const nearest = limited * 1.44269504F + 0.5F;
    int const n = static_cast<int>(nearest); // not negative
    float const whole = static_cast<float>(n);
    float const r = (whole * 0.693359375F - limited) + whole * -2.12194440e-4F;
    // (e^r - 1) by its Taylor series to r^8; the remainder is below 2e-9 of r.
    float p = 1.0F / 40320.0F;
    p = p * r + 1.0F / 5040.0F;
    p = p * r + 1.0F / 720.0F;
    p = p * r + 1.0F / 120.0F;
    p = p * r + 1.0F / 24.0F;
    p = p * r + 1.0F / 6.0F;
    p = p * r + 0.5F;
    p = p * (r * r) + r;
    float const power = std::bit_cast<float>((127 - n) << 23);
    return {power * p + power, (1.0F - power) - power * p};
}

/// A transfer function as a table over the stored values, linear between nodes in extinction s and emission s*c.
/// Node i holds eight floats: integrals I, Jr, Jg, Jb from node 0 (in table units), then densities s, s*r, s*g, s*b,
/// all per world length. x = (value - origin) * scale is the position in the table.
struct TableView {
    Quad const* nodes;
    int count; ///< at least 2
    float origin, scale;
    float hidden; ///< up to this position there is no extinction
};

struct Classified {
    Quad integral, density;
    float beyond; ///< how far the position lies before the first node (below 0) or behind the last (above 0)
};

/// Position in the table; limited so that arithmetic stays finite, so far out that segments keep their length in the
/// table all the same. NaN becomes the lower limit.
inline constexpr float table_limit = 1e30F;
VKT_HD float table_position(TableView const& table, float value) {
    constexpr float limit = table_limit;
    float const x = (value - table.origin) * table.scale;
    float const above = x > -limit ? x : -limit;
    return above < limit ? above : limit;
}

/// Densities at a position, which continue as constants beyond the ends, and the integrals up to it, which do not.
VKT_HD Classified classify(TableView const& table, float x) {
    float const last = static_cast<float>(table.count - 1);
    float const above = x > 0.0F ? x : 0.0F;
    float const inside = above < last ? above : last;
    int const node = static_cast<int>(inside);
    int const i = node < table.count - 2 ? node : table.count - 2;
    float const f = inside - static_cast<float>(i);
    Quad const a = table.nodes[2 * i], b0 = table.nodes[2 * i + 1], b1 = table.nodes[2 * i + 3];
    Quad const b = b0 + (b1 - b0) * f;
    return {a + (b0 + b) * (0.5F * f), b, x - inside};
}

/// Mean extinction and emission over a segment along which the value runs linearly from one end to the other.
/// Exact for the table; within one table interval, or beyond one end of it, the mean of the ends is, and does not
/// cancel.
VKT_HD Quad segment_mean(Classified const& from, Classified const& to, float step_in_table) {
    float const width = step_in_table < 0 ? -step_in_table : step_in_table;
    bool const below = from.beyond < 0 && to.beyond<0, above = from.beyond> 0 && to.beyond > 0;
    if (!(width > 1.0F) || below || above) return (from.density + to.density) * 0.5F;
    float const per = 1.0F / step_in_table;
    return (to.integral - from.integral) * per + to.density * (to.beyond * per) - from.density * (from.beyond * per);
}

} // namespace vkt::render
