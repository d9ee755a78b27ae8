// The drivers on a CPU: OpenMP over segments of rows, vectors within them. Compiled per instruction set.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/shared_loop.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/stream.h"

#include <omp.h>

#include <type_traits>
#include <utility>
#include <vector>

namespace vkt::VKT_BACKEND {

/// Rows are cut into pieces of this many voxels, so that long rows spread over threads and pieces stay in the L1 cache.
inline constexpr std::int64_t segment_voxels = 8192;

/// Threads worth starting for a number of voxels.
inline int threads_for(Execution const& execution, std::int64_t voxels) {
    return static_cast<int>(std::clamp<std::int64_t>(voxels / 32768, 1, std::max(1, execution.threads)));
}

/// Calls f(begin, end) once per thread, on contiguous ranges that cover 0 <= item < count. Throws what f throws first.
template <class F> void for_each_item(int threads, std::int64_t count, F const& f, ProgressMonitor* monitor = nullptr) {
    auto const call = [](void const* body, std::int64_t begin, std::int64_t end) {
        (*static_cast<F const*>(body))(begin, end);
    };
    run_shared_loop(threads, count, {&f, call}, monitor);
}

/// Tells how many of its items a thread has done, if anybody wants to know. Throws Error{cancelled}.
inline void tell_progress(Execution const& execution, std::int64_t begin, std::int64_t item, std::int64_t end) {
    if (execution.monitor != nullptr) execution.monitor->poll(item - begin, end - begin);
}

/// The same where somebody may watch: then in parts, between which is told how far it is. f must not care how its items
/// are cut.
template <class F> void for_each_item(Execution const& execution, int threads, std::int64_t count, F const& f) {
    for_each_item(threads, count, f, execution.monitor);
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
                      std::int64_t untold = segment_voxels; // short rows would take longer to tell of than to make
                      for (std::int64_t item = begin; item < end; ++item) {
                          if (untold >= segment_voxels) {
                              tell_progress(execution, begin, item, end);
                              untold = 0;
                          }
                          std::int64_t const x = piece * segment_voxels, n = std::min(segment_voxels, dims.x - x);
                          untold += n;
                          f(box.lower.x + x, y, z, n);
                          if (++piece < pieces) continue;
                          piece = 0;
                          if (++y < box.upper.y) continue;
                          y = box.lower.y;
                          ++z;
                      }
                      stream_fence(); // once a thread: after every row it would cost as much as the row
                  });
}

namespace driver {

/// Rows that follow one another without gaps in all views may be treated as one.
template <class... V> bool dense(Box const& box, V const&... views) {
    Index3 const dims = box.dims();
    return ((views.row == dims.x && views.slice == dims.x * dims.y) && ...);
}
inline Box as_one_row(Box const& box) {
    return {box.lower, {box.lower.x + box.voxels(), box.lower.y + 1, box.lower.z + 1}};
}

inline void add(Losses& total, Losses const& part) {
    if (part.clipped != 0) {
#pragma omp atomic
        total.clipped += part.clipped;
    }
    if (part.nan != 0) {
#pragma omp atomic
        total.nan += part.nan;
    }
    if (part.undefined != 0) {
#pragma omp atomic
        total.undefined += part.undefined;
    }
}

} // namespace driver

namespace driver {

/// A piece of a row to compute with: the voxels themselves where they are of type C, else loaded into `buffer`.
template <class C>
C const* row_of(ConstView in, std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, C* buffer) {
    std::byte const* const from = in.at(x, y, z);
    if (is_stored_as<C>(in.type)) return reinterpret_cast<C const*>(from);
    load_row(in.type, from, buffer, n);
    return buffer;
}

/// Where a piece of a row of results goes: past the caches if the output is large, and rounded if it is of another
/// type.
template <class C> class RowResult {
public:
    RowResult(AnyView out, std::byte* to, bool stream)
        : type_(out.type), to_(to), stream_(stream), direct_(is_stored_as<C>(out.type) && !stream) {}
    C* data() { return direct_ ? reinterpret_cast<C*>(to_) : values_; }
    Losses store(std::int64_t n) { return store(data(), n); }
    /// Call one of the two once: if data() is filled, or with other values.
    Losses store(C const* from, std::int64_t n) {
        if (from == reinterpret_cast<C*>(to_)) return {};
        std::size_t const bytes = static_cast<std::size_t>(n) * size_of(type_);
        if (stream_ && is_stored_as<C>(type_)) {
            stream_bytes(to_, reinterpret_cast<std::byte const*>(from), bytes);
            return {};
        }
        if (!stream_) return store_row(type_, from, to_, n);
        alignas(64) std::byte stored[row_piece * 8];
        Losses const losses = store_row(type_, from, stored, n);
        stream_bytes(to_, stored, bytes);
        return losses;
    }

private:
    DataType type_;
    std::byte* to_;
    bool stream_, direct_;
    alignas(64) C values_[row_piece];
};

inline bool is_large(AnyView out) { return out.bytes() >= stream_threshold; }

/// Voxels of a row worked on at a time. On the way around the caches a processor looks far enough ahead to read the
/// next piece while it writes this one, if both are short: 1024 floats at a time took half as long again as 256.
template <class... In> std::int64_t piece_for(AnyView out, In const&... in) {
    if (!is_large(out)) return row_piece;
    std::size_t const largest = std::max({size_of(out.type), size_of(in.type)...});
    return std::max<std::int64_t>(row_piece / 4, row_piece / static_cast<std::int64_t>(largest));
}

// The functor arrives by value: its copy's address never escapes, so that stores through `out` cannot alias what it
// captured, and the loop vectorises.
template <class R, class F, class... In> void apply(std::int64_t n, R* out, F const f, In const*... in) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) out[i] = f(in[i]...);
}
template <class R, class F, class... In>
void apply_at(std::int64_t n, double x, double y, double z, R* out, F const f, In const*... in) {
#pragma omp simd
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i)
        out[i] = f(x + static_cast<double>(i), y, z, in[i]...);
}
template <class C, class F, class... In> std::int64_t count_undefined(std::int64_t n, F const f, In const*... in) {
    if constexpr (requires { f.undefined_in_row(n, in...); }) return f.undefined_in_row(n, in...);
    std::int32_t count = 0;
#pragma omp simd reduction(+ : count)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) count += f.undefined(in[i]...) ? 1 : 0;
    return count;
}
template <class F> bool may_be_undefined(F const& f) {
    if constexpr (requires { f.may_be_undefined(); }) return f.may_be_undefined();
    return true;
}
template <class F, class... C>
concept CountsUndefined = requires(F const& f, C... values) {
    f.undefined(values...);
};

/// What the functor returns, which is what is rounded.
template <bool At, class C, class F, class... In> struct ResultOf {
    template <class> using Each = C;
    using type = typename std::conditional_t<At, std::invoke_result<F const&, double, double, double, Each<In>...>,
                                             std::invoke_result<F const&, Each<In>...>>::type;
};

template <class C, bool At, class F, std::size_t... k, class... In>
void map_rows(Execution const& execution, AnyView out, Losses& losses, F const& f, std::index_sequence<k...>,
              In const&... in) {
    using Result = typename ResultOf<At, C, F, In...>::type;
    std::int64_t const piece = At ? row_piece : piece_for(out, in...);
    bool const stream = is_large(out), one_row = !At && dense(out.box, out, in...) && !out.box.empty();
    for_each_segment(
        execution, one_row ? as_one_row(out.box) : out.box,
        [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
            [[maybe_unused]] alignas(64) C buffer[sizeof...(In) + 1][row_piece]; // one more, lest there is none
            Losses mine;
            for (std::int64_t begin = x; begin < x + n; begin += piece) {
                std::int64_t const m = std::min(piece, x + n - begin);
                RowResult<Result> result(out, out.at(begin, y, z), stream);
                auto const compute = [&](auto const*... values) -> Result const* {
                    if constexpr (requires { F::is_identity; })
                        return (values, ...);
                    else if constexpr (At && requires { f.row_at(m, begin, y, z, result.data(), values...); })
                        f.row_at(m, begin, y, z, result.data(), values...);
                    else if constexpr (At)
                        apply_at(m, static_cast<double>(begin), static_cast<double>(y), static_cast<double>(z),
                                 result.data(), f, values...);
                    else if constexpr (requires { f.row(m, result.data(), values...); })
                        f.row(m, result.data(), values...);
                    else
                        apply(m, result.data(), f, values...);
                    if constexpr (CountsUndefined<F, decltype(*values)...>)
                        if (may_be_undefined(f)) mine.undefined += count_undefined<C>(m, f, values...);
                    return result.data();
                };
                mine += result.store(compute(row_of<C>(in, begin, y, z, m, buffer[k])...), m);
            }
            add(losses, mine);
        });
}

} // namespace driver

template <class C, class F, class... In>
void map(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_rows<C, false>(execution, out, losses, f, std::index_sequence_for<In...>{}, in...);
}

template <class C, class F, class... In>
void map_at(Execution const& execution, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::map_rows<C, true>(execution, out, losses, f, std::index_sequence_for<In...>{}, in...);
}

template <class C, class R> R reduce(Execution const& execution, ConstView in, R const& zero) {
    std::vector<R> parts(static_cast<std::size_t>(std::max(1, execution.threads)), zero);
    Box const rows = driver::dense(in.box, in) && !in.box.empty() ? driver::as_one_row(in.box) : in.box;
    for_each_segment(execution, rows, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        alignas(64) C buffer[row_piece];
        R mine = zero;
        for (std::int64_t begin = x; begin < x + n; begin += row_piece) {
            std::int64_t const m = std::min(row_piece, x + n - begin);
            mine.add_row(driver::row_of<C>(in, begin, y, z, m, buffer), m);
        }
        parts[static_cast<std::size_t>(omp_get_thread_num())].merge(mine);
    });
    R result = zero;
    for (R const& part : parts) result.merge(part);
    return result;
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
    if (stream) {
        stream_bytes(reinterpret_cast<std::byte*>(to), reinterpret_cast<std::byte const*>(from), bytes);
        return;
    }
    // Calls of memcpy for rows of a few hundred bytes were measured to cost three times the copy.
    std::int64_t i = 0;
    if (bytes <= 2048) {
        for (; i + Register<U>::lanes <= n; i += Register<U>::lanes) {
            typename Register<U>::type v;
            std::memcpy(&v, from + i, sizeof v);
            std::memcpy(to + i, &v, sizeof v);
        }
    }
    std::memcpy(to + i, from + i, static_cast<std::size_t>(n - i) * sizeof(U));
}

template <class V, std::size_t... lane> V reversed_lanes(V v, std::index_sequence<lane...>) {
    return __builtin_shufflevector(v, v, (sizeof...(lane) - 1 - lane)...);
}

/// to[i] = last[-i], taken from the far end, so that reads ascend.
template <class U> void copy_reversed(U* to, U const* last, std::int64_t n, bool stream) {
#if defined(__AVX2__)
    constexpr std::int64_t lanes = Register<U>::lanes;
    using V = typename Register<U>::type;
    auto const skew = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(to) % register_bytes / sizeof(U));
    std::int64_t const head = std::min(n, (lanes - skew) % lanes), end = head + (n - head) / lanes * lanes;
    for (std::int64_t i = n - 1; i >= end; --i) to[i] = last[-i];
    for (std::int64_t i = end - lanes; i >= head; i -= lanes) {
        V v;
        std::memcpy(&v, last - i - (lanes - 1), sizeof v);
        v = reversed_lanes(v, std::make_index_sequence<static_cast<std::size_t>(lanes)>{});
        if (stream)
            stream_register(to + i, v);
        else
            std::memcpy(to + i, &v, sizeof v);
    }
    for (std::int64_t i = head - 1; i >= 0; --i) to[i] = last[-i];
#else
    static_cast<void>(stream); // without byte shuffles the compiler's own sequence is better
    U const* const first = last - (n - 1);
    U* const back = to + (n - 1);
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) back[-i] = first[i];
#endif
}

} // namespace driver

namespace driver {

/// Rows of a copy whose source may lie in another order than they are written. Strides in voxels, negative if mirrored.
template <class U> struct RowCopy {
    U const* from; ///< first voxel of the first row; the last one if rows are reversed
    U* to;
    std::int64_t from_row, from_slice, to_row, to_slice;

    /// The same copy with its rows taken from the last to the first: reads that ascend are foreseen by the processor.
    RowCopy from_below(Index3 dims) const {
        return {from + (dims.y - 1) * from_row, to + (dims.y - 1) * to_row, -from_row, from_slice, -to_row, to_slice};
    }
};

template <bool Reverse, class U> void copy_rows(Execution const& execution, Index3 dims, RowCopy<U> const& copy) {
    bool const stream = static_cast<std::size_t>(dims.x * dims.y * dims.z) * sizeof(U) >= stream_threshold;
    for_each_segment(execution, box_of(dims), [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        U* const to = copy.to + x + y * copy.to_row + z * copy.to_slice;
        U const* const row = copy.from + y * copy.from_row + z * copy.from_slice;
        if constexpr (Reverse)
            copy_reversed(to, row - x, n, stream);
        else
            copy_forward(to, row + x, n, stream);
    });
}

} // namespace driver

/// Copies between boxes of equal dims and voxel size, reversing the order along the mirrored axes. No overlap.
inline void copy_box(Execution const& execution, ConstView from, AnyView to, Mirror mirror = {}) {
    if (to.box.empty()) return;
    for_each_size(size_of(to.type), [&]<class U>(U) {
        Index3 dims = to.dims();
        driver::RowCopy<U> const copy{&from.as<U>()(mirror.x ? from.box.upper.x - 1 : from.box.lower.x,
                                                    mirror.y ? from.box.upper.y - 1 : from.box.lower.y,
                                                    mirror.z ? from.box.upper.z - 1 : from.box.lower.z),
                                      to.as<U>().data,
                                      mirror.y ? -from.row : from.row,
                                      mirror.z ? -from.slice : from.slice,
                                      to.row,
                                      to.slice};
        if (mirror.x) return driver::copy_rows<true>(execution, dims, copy);
        // Rows, and then slices, that follow one another in both are one.
        if (!mirror.y && from.row == dims.x && to.row == dims.x) {
            dims = {dims.x * dims.y, 1, dims.z};
            if (!mirror.z && from.slice == dims.x && to.slice == dims.x) dims = {dims.x * dims.z, 1, 1};
        }
        driver::copy_rows<false>(execution, dims, mirror.y ? copy.from_below(dims) : copy);
    });
}

} // namespace vkt::VKT_BACKEND
