// The drivers on a CPU: OpenMP over segments of rows, vectors within them. Compiled per instruction set.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/stream.h"

#include <omp.h>

namespace vkt::VKT_BACKEND {

/// Rows are cut into pieces of this many voxels, so that long rows spread over threads and pieces stay in the L1 cache.
inline constexpr std::int64_t segment_voxels = 8192;

/// Threads worth starting for a number of voxels.
inline int threads_for(Execution const& execution, std::int64_t voxels) {
    return static_cast<int>(std::clamp<std::int64_t>(voxels / 32768, 1, std::max(1, execution.threads)));
}

/// Calls f(item) for 0 <= item < count, contiguous ranges per thread; then f.end() once per thread if it exists.
template <class F> void for_each_item(int threads, std::int64_t count, F const& f) {
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        std::int64_t const share = omp_get_num_threads(), me = omp_get_thread_num();
        std::int64_t const each = count / share, more = count % share;
        std::int64_t const begin = me * each + std::min(me, more);
        std::int64_t const end = begin + each + (me < more ? 1 : 0);
        f(begin, end);
    }
}

/// Calls f(x, y, z, n) for pieces of at most segment_voxels voxels of rows that cover the box.
template <class F> void for_each_segment(Execution const& execution, Box const& box, F const& f) {
    if (box.empty()) return;
    Index3 const dims = box.dims();
    std::int64_t const pieces = (dims.x + segment_voxels - 1) / segment_voxels;
    for_each_item(threads_for(execution, box.voxels()), pieces * dims.y * dims.z,
                  [&](std::int64_t begin, std::int64_t end) {
                      std::int64_t piece = begin % pieces;
                      std::int64_t y = box.lower.y + begin / pieces % dims.y;
                      std::int64_t z = box.lower.z + begin / pieces / dims.y;
                      for (std::int64_t item = begin; item < end; ++item) {
                          std::int64_t const x = piece * segment_voxels;
                          f(box.lower.x + x, y, z, std::min(segment_voxels, dims.x - x));
                          if (++piece < pieces) continue;
                          piece = 0;
                          if (++y < box.upper.y) continue;
                          y = box.lower.y;
                          ++z;
                      }
                  });
}

namespace driver {

// The functor arrives by value: its copy's address never escapes, so that stores through `out` cannot alias what it
// captured, and the loop vectorises (measured: six times faster for uint8 stencils).
template <class T, class F, class... In> void map_segment(std::int64_t n, T* out, F const f, In const*... in) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(in[i]...);
}
template <class T, class F, class... In>
void map_at_segment(std::int64_t n, std::int64_t x, std::int64_t y, std::int64_t z, T* out, F const f,
                    In const*... in) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(x + i, y, z, in[i]...);
}

template <class T, class F> Tally round_segment(std::int64_t n, T* out, F const f) {
    std::int32_t clipped = 0, nan = 0;
#pragma omp simd reduction(+ : clipped, nan)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        auto const v = f(i);
        clipped += is_clipped<T>(v) ? 1 : 0;
        nan += is_lost_nan<T>(v) ? 1 : 0;
        out[i] = round_to<T>(v);
    }
    return {clipped, nan};
}

/// Rows that follow one another without gaps in all views may be treated as one.
template <class... V> bool dense(Box const& box, V const&... views) {
    Index3 const dims = box.dims();
    return ((views.row == dims.x && views.slice == dims.x * dims.y) && ...);
}
inline Box as_one_row(Box const& box) {
    return {box.lower, {box.lower.x + box.voxels(), box.lower.y + 1, box.lower.z + 1}};
}

inline void add(Tally& total, Tally const& part) {
    if (part.clipped != 0) {
#pragma omp atomic
        total.clipped += part.clipped;
    }
    if (part.nan != 0) {
#pragma omp atomic
        total.nan += part.nan;
    }
}

} // namespace driver

template <class T, class F, class... In>
void map(Execution const& execution, Box const& box, View<T> out, F const& f, View<In>... in) {
    Box const rows = !box.empty() && driver::dense(box, out, in...) ? driver::as_one_row(box) : box;
    for_each_segment(execution, rows, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        driver::map_segment(n, &out(x, y, z), f, &in(x, y, z)...);
    });
}

template <class T, class F, class... In>
void map_at(Execution const& execution, Box const& box, View<T> out, F const& f, View<In>... in) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        driver::map_at_segment(n, x, y, z, &out(x, y, z), f, &in(x, y, z)...);
    });
}

template <class T, class F> void gather(Execution const& execution, Box const& box, View<T> out, F const& f) {
    map_at(execution, box, out, f);
}

template <class T, class F, class... In>
void map_rounded(Execution const& execution, Box const& box, View<T> out, Tally& tally, F const& f, View<In>... in) {
    Box const rows = !box.empty() && driver::dense(box, out, in...) ? driver::as_one_row(box) : box;
    for_each_segment(execution, rows, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        driver::add(tally, [n](T* to, F const local, In*... from) {
            return driver::round_segment(n, to, [=](std::int32_t i) { return local(from[i]...); });
        }(&out(x, y, z), f, &in(x, y, z)...));
    });
}

template <class T, class F, class... In>
void map_at_rounded(Execution const& execution, Box const& box, View<T> out, Tally& tally, F const& f, View<In>... in) {
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        driver::add(tally, [n, x, y, z](T* to, F const local, In*... from) {
            return driver::round_segment(n, to, [=](std::int32_t i) { return local(x + i, y, z, from[i]...); });
        }(&out(x, y, z), f, &in(x, y, z)...));
    });
}

template <class T, class F>
void gather_rounded(Execution const& execution, Box const& box, View<T> out, Tally& tally, F const& f) {
    map_at_rounded(execution, box, out, tally, f);
}

template <class T> void fill(Execution const& execution, Box const& box, View<T> out, T value) {
    if (box.empty()) return;
    bool const stream = static_cast<std::size_t>(box.voxels()) * sizeof(T) >= stream_threshold;
    Box const rows = driver::dense(box, out) ? driver::as_one_row(box) : box;
    for_each_segment(execution, rows, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        T* const to = &out(x, y, z);
        if (stream) {
            constexpr std::int64_t pattern = 4096 / static_cast<std::int64_t>(sizeof(T));
            alignas(64) T values[pattern];
            for (T& v : values) v = value;
            for (std::int64_t i = 0; i < n; i += pattern)
                stream_bytes(reinterpret_cast<std::byte*>(to + i), reinterpret_cast<std::byte const*>(values),
                             static_cast<std::size_t>(std::min(pattern, n - i)) * sizeof(T));
            stream_fence();
        } else {
            T const local = value;
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) to[i] = local;
        }
    });
}

namespace driver {

template <class U> void copy_forward(U* to, U const* from, std::int64_t n, bool stream) {
    std::size_t const bytes = static_cast<std::size_t>(n) * sizeof(U);
    if (stream)
        stream_bytes(reinterpret_cast<std::byte*>(to), reinterpret_cast<std::byte const*>(from), bytes);
    else
        std::memcpy(to, from, bytes);
}

/// to[i] = last[-i]
template <class U> void copy_reversed(U* to, U const* last, std::int64_t n, bool stream) {
    if (!stream) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = last[-i];
        return;
    }
    constexpr std::int64_t block = 4096 / static_cast<std::int64_t>(sizeof(U));
    alignas(64) U reversed[block];
    for (std::int64_t begin = 0; begin < n; begin += block) {
        std::int64_t const count = std::min(block, n - begin);
        U const* const source = last - begin;
#pragma omp simd
        for (std::int64_t i = 0; i < count; ++i) reversed[i] = source[-i];
        copy_forward(to + begin, static_cast<U const*>(reversed), count, true);
    }
}

} // namespace driver

/// Copies between boxes of equal dims and voxel size, reversing the order along the mirrored axes. No overlap.
inline void copy_box(Execution const& execution, ConstView from, AnyView to, Mirror mirror = {}) {
    for_each_size(size_of(to.type), [&]<class U>(U) {
        View<U const> const in = from.as<U>();
        View<U> const out = to.as<U>();
        bool const stream = to.bytes() >= stream_threshold;
        bool const one_row =
            !mirror.x && !mirror.y && !mirror.z && !to.box.empty() && from.contiguous() && to.contiguous();
        for_each_segment(execution, one_row ? driver::as_one_row(to.box) : to.box,
                         [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
                             std::int64_t const v = y - to.box.lower.y, w = z - to.box.lower.z;
                             U const* const row =
                                 &in(from.box.lower.x, mirror.y ? from.box.upper.y - 1 - v : from.box.lower.y + v,
                                     mirror.z ? from.box.upper.z - 1 - w : from.box.lower.z + w);
                             std::int64_t const u = x - to.box.lower.x;
                             if (mirror.x)
                                 driver::copy_reversed(&out(x, y, z), row + (from.dims().x - 1 - u), n, stream);
                             else
                                 driver::copy_forward(&out(x, y, z), row + u, n, stream);
                             if (stream) stream_fence();
                         });
    });
}

} // namespace vkt::VKT_BACKEND
