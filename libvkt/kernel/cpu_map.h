// The pointwise driver on a CPU: pieces of rows in the compute type, converted with registers, while in the L1 cache.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cpu_drivers.h"
#include "libvkt/kernel/rows.h"

#include <concepts>
#include <type_traits>

namespace vkt::VKT_BACKEND {

namespace driver {

/// The storage type whose voxels are values of C as they lie.
template <class C> inline constexpr DataType stored_as = DataType::float64;
template <> inline constexpr DataType stored_as<float> = DataType::float32;

/// True if the functor knows inputs without a result: `bool undefined(C...) const`.
template <class F, class... C>
concept SaysUndefined = requires(F const& f, C... v) {
    { f.undefined(v...) } -> std::same_as<bool>;
};

// Functors arrive by value: the copy's address never escapes, so that stores cannot alias what it captured.
template <class C, class F, class... In> void map_piece(std::int64_t n, C* out, F const f, In const*... in) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(in[i]...);
}
template <class C, class F, class... In>
void map_piece_at(std::int64_t n, Index3 first, C* out, F const f, In const*... in) {
    std::int64_t const x = first.x, y = first.y, z = first.z;
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(x + i, y, z, in[i]...);
}
/// Replaces what has no result by 0, which nothing counts.
template <class C, class F, class... In> std::int64_t settle(std::int64_t n, C* out, F const f, In const*... in) {
    std::int64_t count = 0;
    for (std::int64_t i = 0; i < n; ++i) count += f.undefined(in[i]...) ? 1 : 0;
    if (count > 0)
        for (std::int64_t i = 0; i < n; ++i)
            if (f.undefined(in[i]...)) out[i] = f.instead(in[i]...);
    return count;
}

inline void add(Losses& total, Losses const& part) {
    if (part.none()) return;
#pragma omp critical(vkt_losses)
    total += part;
}

/// Voxels [x, x + n) of row (y, z) as values of C: where they lie if they can be taken so, else in `buffer`.
template <class C>
C const* values_of(ConstView in, std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, C* buffer) {
    std::byte const* const from = in.at(x, y, z);
    if (in.type == stored_as<C>) return reinterpret_cast<C const*>(from);
    load_row(in.type, from, buffer, n);
    return buffer;
}

} // namespace driver

namespace driver {

/// Computes pieces of rows with `piece(n, first voxel, C* out, C const*... in)` and stores them as out's type.
template <class C, class Piece, class... In>
void map_rows(Execution const& execution, AnyView out, Losses& losses, bool join_rows, Piece const& piece,
              In const&... in) {
    if (out.box.empty()) return;
    bool const one_row = join_rows && dense(out.box, out, in...);
    bool const stream = out.bytes() >= stream_threshold; // as the copies do, see stream.h
    bool const direct = out.type == stored_as<C>;        // nothing to convert, to clip or to count
    auto const size = static_cast<std::int64_t>(size_of(out.type));
    for_each_segment(execution, one_row ? as_one_row(out.box) : out.box,
                     [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
                         alignas(64) C buffers[sizeof...(In) + 1][row_piece];
                         alignas(64) C result[row_piece];
                         alignas(64) std::byte staged[row_piece * sizeof(double)];
                         Losses mine;
                         for (std::int64_t i = 0; i < n; i += row_piece) {
                             std::int64_t const m = std::min(row_piece, n - i);
                             std::byte* const to = out.at(x + i, y, z);
                             C* const computed = direct && !stream ? reinterpret_cast<C*>(to) : result;
                             std::size_t next = 0;
                             [&](auto const*... values) {
                                 mine.undefined += piece(m, Index3{x + i, y, z}, computed, values...);
                             }(values_of(in, x + i, y, z, m, buffers[next++])...);
                             if (!direct)
                                 mine += store_row(out.type, static_cast<C const*>(result), stream ? staged : to, m);
                             if (stream)
                                 stream_bytes(to, direct ? reinterpret_cast<std::byte const*>(result) : staged,
                                              static_cast<std::size_t>(m * size));
                         }
                         add(losses, mine);
                     });
}

} // namespace driver

/// See kernel.h.
template <class C, class F, class... In>
void map(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_rows<C>(
        execution, out, losses, true,
        [f](std::int64_t n, Index3, C* to, auto const*... values) {
            driver::map_piece(n, to, f, values...);
            if constexpr (driver::SaysUndefined<F, std::remove_cvref_t<decltype(*values)>...>)
                return driver::settle(n, to, f, values...);
            else
                return std::int64_t{0};
        },
        in...);
}

template <class C, class F, class... In>
void map_at(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_rows<C>(
        execution, out, losses, false,
        [f](std::int64_t n, Index3 first, C* to, auto const*... values) {
            driver::map_piece_at(n, first, to, f, values...);
            return std::int64_t{0};
        },
        in...);
}

} // namespace vkt::VKT_BACKEND
