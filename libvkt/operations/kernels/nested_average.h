// Nested averages of rows, register by register, and rows between voxels and what the Gaussian's passes compute with.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/operations/kernels/gaussian.h"

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

/// to[i] = voxels as the passes have them. Of any length.
template <class C> void load_scaled(DataType type, std::byte const* from, C* to, std::int64_t n) {
    for_each_type(type, [&]<class T>(T) {
        auto const* const voxels = reinterpret_cast<T const*>(from);
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = C(gaussian_scale) * static_cast<C>(voxels[i]);
    });
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
