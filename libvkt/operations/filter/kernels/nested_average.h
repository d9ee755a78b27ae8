// Nested averages of rows, register by register, and rows between voxels and what the Gaussian's passes compute with.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/operations/filter/kernels/gaussian.h"

namespace vkt::VKT_BACKEND {

/// Rows are worked in blocks of this many bytes, whole registers.
inline constexpr std::int64_t block_bytes = 256;
template <class C> inline constexpr std::int64_t block = block_bytes / static_cast<std::int64_t>(sizeof(C));

constexpr std::int64_t round_up(std::int64_t n, std::int64_t unit) { return (n + unit - 1) / unit * unit; }

/// Taps as C.
template <class C> struct TapView {
    std::int64_t radius;
    C const* shares;

    explicit TapView(GaussianTaps const& taps) : radius(taps.radius) {
        if constexpr (std::is_same_v<C, float>)
            shares = taps.single_shares.data();
        else
            shares = taps.shares.data();
    }
};

/// `registers` registers from i on of: out = factor * nested average of rows[0…2r] (see GaussianTaps).
template <std::int64_t registers, class C>
VKT_HD void average_at(C const* const* rows, TapView<C> taps, Lanes<C> factor, C* out, std::int64_t i) {
    std::int64_t const r = taps.radius;
    Lanes<C> sum[static_cast<std::size_t>(registers)];
    C const* low = rows[0] + i;
    C const* high = rows[2 * r] + i;
    for (std::int64_t j = 0; j < registers; ++j)
        sum[j] = load_lanes(low + j * lane_count<C>) + load_lanes(high + j * lane_count<C>);
    for (std::int64_t k = r - 1; k >= 0; --k) {
        low = rows[r - k] + i;
        high = rows[r + k] + i;
        Lanes<C> const share = Lanes<C>{} + taps.shares[k];
#pragma GCC unroll 16
        for (std::int64_t j = 0; j < registers; ++j) {
            Lanes<C> const pair = load_lanes(low + j * lane_count<C>) + load_lanes(high + j * lane_count<C>);
            sum[j] = madd(share, pair - sum[j], sum[j]);
        }
    }
    for (std::int64_t j = 0; j < registers; ++j) store_lanes(out + i + j * lane_count<C>, factor * sum[j]);
}

/// out[i] = factor * nested average of rows[0…2r][i] for begin <= i < end, up to whole registers.
template <class C>
void average(C const* const* rows, TapView<C> taps, C factor, C* out, std::int64_t begin, std::int64_t end) {
    Lanes<C> const scale = Lanes<C>{} + factor;
    std::int64_t i = begin;
    for (; i + block<C> <= end; i += block<C>) average_at<block<C> / lane_count<C>>(rows, taps, scale, out, i);
    for (; i < end; i += lane_count<C>) average_at<1>(rows, taps, scale, out, i);
}

/// As average_at() of rows[0…2r] and of rows[1…2r+1] from i on, a few registers of each: those of rows between are
/// loaded once for both.
template <std::int64_t registers, class C>
VKT_HD void average_two_at(C const* const* rows, TapView<C> taps, Lanes<C> factor, C* first, C* second,
                           std::int64_t i) {
    std::int64_t const r = taps.radius;
    constexpr auto count = static_cast<std::size_t>(registers);
    Lanes<C> a[count], b[count], low[count], high[count]; // the sums; the lower row of `b` and the higher of `a`
    for (std::int64_t j = 0; j < registers; ++j) {
        std::int64_t const x = i + j * lane_count<C>;
        low[j] = load_lanes(rows[1] + x);
        high[j] = load_lanes(rows[2 * r] + x);
        a[j] = load_lanes(rows[0] + x) + high[j];
        b[j] = low[j] + load_lanes(rows[2 * r + 1] + x);
    }
    for (std::int64_t k = r - 1; k >= 0; --k) {
        C const* const next_low = rows[r - k + 1] + i;
        C const* const next_high = rows[r + k] + i;
        Lanes<C> const share = Lanes<C>{} + taps.shares[k];
#pragma GCC unroll 16
        for (std::int64_t j = 0; j < registers; ++j) {
            Lanes<C> const lower = load_lanes(next_low + j * lane_count<C>),
                           higher = load_lanes(next_high + j * lane_count<C>);
            a[j] = madd(share, (low[j] + higher) - a[j], a[j]);
            b[j] = madd(share, (lower + high[j]) - b[j], b[j]);
            low[j] = lower;
            high[j] = higher;
        }
    }
    for (std::int64_t j = 0; j < registers; ++j) {
        store_lanes(first + i + j * lane_count<C>, factor * a[j]);
        store_lanes(second + i + j * lane_count<C>, factor * b[j]);
    }
}

/// As average(), of rows[n…n+2r] for 0 <= n < count, to rows that are `pitch` apart. Copies where there is but one tap.
template <class C>
void average_each(C const* const* rows, std::int64_t count, TapView<C> taps, C factor, C* out, std::int64_t pitch,
                  std::int64_t begin, std::int64_t end) {
    std::int64_t n = 0;
    for (; taps.radius == 0 && n < count; ++n)
        std::memcpy(out + n * pitch + begin, rows[n] + begin, static_cast<std::size_t>(end - begin) * sizeof(C));
    if constexpr (register_bytes == 64) { // others have too few of them
        Lanes<C> const scale = Lanes<C>{} + factor;
        for (; n + 2 <= count; n += 2) {
            C *const first = out + n * pitch, *const second = first + pitch;
            std::int64_t i = begin;
            for (; i + 2 * lane_count<C> <= end; i += 2 * lane_count<C>)
                average_two_at<2>(rows + n, taps, scale, first, second, i);
            for (; i < end; i += lane_count<C>) average_two_at<1>(rows + n, taps, scale, first, second, i);
        }
    }
    for (; n < count; ++n) average(rows + n, taps, factor, out + n * pitch, begin, end);
}

/// to[i] = voxels as the passes have them. Of any length.
template <class C> void load_scaled(DataType type, std::byte const* from, C* to, std::int64_t n) {
    C const* values = reinterpret_cast<C const*>(from);
    if (!is_stored_as<C>(type)) {
        std::size_t const bytes = size_of(type);
        for (std::int64_t i = 0; i < n; i += row_piece)
            load_row(type, from + static_cast<std::size_t>(i) * bytes, to + i, std::min(row_piece, n - i));
        values = to;
    }
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = C(gaussian_scale) * values[i];
}

/// Voxels of results. Of any length.
template <class C> Losses store_values(C const* from, AnyView out, std::byte* to, std::int64_t n, bool stream) {
    std::size_t const bytes = size_of(out.type);
    Losses losses;
    if (stream && is_stored_as<C>(out.type)) {
        stream_bytes(to, reinterpret_cast<std::byte const*>(from), static_cast<std::size_t>(n) * bytes);
        return losses;
    }
    for (std::int64_t i = 0; i < n; i += row_piece)
        losses += store_row(out.type, from + i, to + static_cast<std::size_t>(i) * bytes, std::min(row_piece, n - i));
    return losses;
}

} // namespace vkt::VKT_BACKEND
