// Lookups and means of many segments of a ray at once, with the bits of one by one.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/optics.h"

#include <limits>
#include <type_traits>
#ifndef __CUDACC__
#include "libvkt/render/inner/wide.h"
#endif

namespace vkt::render {

/// A point of a ray in the table.
struct TablePoint {
    Classified at{};
    float position = 0;
    bool missing = false; ///< it has no data
};

/// What is seen of n segments in a row, by the values at their ends; the first begins at `last`, which becomes the last
/// end. Means, their first numbers by themselves, and optical depths: 0 of what has no data, no extinction or no
/// length. Only the first `lanes` are looked at. False if all their depths are 0.
template <int n>
VKT_HD bool look_up_segments(TableView const& table, float const* value, float const* length,
                             [[maybe_unused]] int lanes, TablePoint& last, Quad* mean, float* extinction,
                             float* depth) {
#ifdef __CUDACC__
    bool seen = false;
    for (int k = 0; k < n; ++k) {
        float const position = table_position(table, value[k]);
        Classified const here = classify(table, position);
        bool const missing = !(value[k] == value[k]);
        mean[k] = segment_mean(last.at, here, position - last.position);
        extinction[k] = mean[k][0];
        bool const shown = !missing && !last.missing && extinction[k] > 0 && length[k] > 0;
        depth[k] = shown ? extinction[k] * length[k] : 0.0F;
        seen = seen || depth[k] > 0;
        last = {here, position, missing};
    }
    return seen;
#else
    // The same a register full of segments at a time, and then four numbers of each.
    constexpr int quads = wide / 4; // in a register
    Floats const zero{}, end = all_of(static_cast<float>(table.count - 1)), limit = all_of(table_limit),
                         hidden = all_of(table.hidden);
    Ints const last_row = all_of(table.count - 2);
    Floats value_before = all_of(last.missing ? std::numeric_limits<float>::quiet_NaN() : 0.0F);
    Floats position_before = all_of(last.position), beyond_before = all_of(last.at.beyond);
    Floats integral_before = spread_of(last.at.integral), density_before = spread_of(last.at.density);
    Ints seen{};
    for (int k = 0; k < lanes; k += wide) {
        Floats const v = floats_at(value + k), v_from = behind(value_before, v);
        Floats const far = (v - table.origin) * table.scale, high = far > -limit ? far : -limit;
        Floats const x = high < limit ? high : limit;
        Floats const above = x > zero ? x : zero, inside = above < end ? above : end;
        Ints const node = whole(inside), first = node < last_row ? node : last_row;
        Floats const share = inside - real(first), half = 0.5F * share, over = x - inside;
        Floats const x_from = behind(position_before, x), over_from = behind(beyond_before, over);
        value_before = v, position_before = x, beyond_before = over;
        if (!any_of((x > hidden) | (x_from > hidden))) { // as it would be, with all integrals and densities 0
            integral_before = density_before = zero;
            for (int i = 0; i < wide; ++i) mean[k + i] = Quad{};
            store(extinction + k, zero);
            store(depth + k, zero);
            continue;
        }
        Floats const step = x - x_from, width = step < zero ? -step : step, per = 1.0F / step;
        Ints const below = (over < zero) & (over_from < zero), top = (over > zero) & (over_from > zero);
        Floats const spans = (width > 1.0F) & ~below & ~top ? zero + 1.0F : zero;
        bool const passes = any_of((over != zero) | (over_from != zero)); // an end of the table
        alignas(64) std::int32_t row[wide];
        store(row, first * 2);
        keep_in_memory(row);
        Floats m[4];
        auto const quarter = [&]<int q>(std::integral_constant<int, q>) __attribute__((always_inline)) {
            std::int32_t const* const at = row + q * quads;
            Floats const a = quads_at(table.nodes, at), b0 = quads_at(table.nodes + 1, at),
                         b1 = quads_at(table.nodes + 3, at);
            Floats const b = b0 + (b1 - b0) * spread<q>(share), i = a + (b0 + b) * spread<q>(half);
            Floats const i_from = quad_behind(integral_before, i), b_from = quad_behind(density_before, b);
            integral_before = i, density_before = b;
            Floats all = (i - i_from) * spread<q>(per);
            if (passes) all = all + b * spread<q>(over * per) - b_from * spread<q>(over_from * per);
            m[q] = spread<q>(spans) > zero ? all : (b_from + b) * 0.5F;
            std::memcpy(mean + k + q * quads, &m[q], sizeof m[q]);
        };
        quarter(std::integral_constant<int, 0>{});
        quarter(std::integral_constant<int, 1>{});
        quarter(std::integral_constant<int, 2>{});
        quarter(std::integral_constant<int, 3>{});
        Floats const e = firsts(m[0], m[1], m[2], m[3]), l = floats_at(length + k);
        Ints const numbers = (v == v) & (v_from == v_from); // NOLINT(misc-redundant-expression): NaN
        Ints const shown = (e > zero) & (l > zero) & numbers;
        Floats const d = shown ? e * l : zero;
        store(extinction + k, e);
        store(depth + k, d);
        seen |= d > zero;
    }
    Classified from{last_quad(integral_before), last_quad(density_before), beyond_before[wide - 1]};
    last = {from, position_before[wide - 1], !(value[lanes - 1] == value[lanes - 1])};
    return any_of(seen);
#endif
}

} // namespace vkt::render
