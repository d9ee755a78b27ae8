// Windows along x by doubling, along y and z by running through blocks from both ends (van Herk, Gil and Werman), a row
// of voxels at a time. Blocks lie at multiples of the window's length, so that sums do not depend on how the output is
// cut.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/box_window.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/kernel/stencil.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/filter/kernels/large_rows.h"
#include "libvkt/operations/filter/kernels/window_parts.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// to[i] = a[i] op b[i]; `to` may be one of them.
template <class Op, class S> void combine(S* to, S const* a, S const* b, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = Op::of(a[i], b[i]);
}

/// to[i] = values[i] op … op values[i + w - 1] for n voxels; spoils values[0 … n + w - 2].
template <class Op, class S> void window_along_row(S* values, S* to, std::int64_t n, std::int64_t w) {
    std::int64_t length = n + w - 1, offset = 0;
    bool any = false;
    for (std::int64_t span = 1; span <= w; span *= 2) {
        // values[i] holds `span` voxels from i on.
        if ((w & span) != 0) {
            if (any)
                combine<Op>(to, to, values + offset, n);
            else
                std::memcpy(to, values + offset, static_cast<std::size_t>(n) * sizeof(S));
            any = true;
            offset += span;
        }
        length -= span;
        if (2 * span > w) continue;
#pragma omp simd // in place: every value is read before it is written
        for (std::int64_t i = 0; i < length; ++i) values[i] = Op::of(values[i], values[i + span]);
    }
}

/// Windows of w rows of n values: row(s) op … op row(s + w - 1) goes to place(s), then done(s) is called, for
/// begin <= s < end. `scratch` has room for w + 1 rows.
template <class Op, class S, class Row, class Place, class Done>
void window_across_rows(std::int64_t begin, std::int64_t end, std::int64_t w, std::int64_t n, S* scratch,
                        Row const& row, Place const& place, Done const& done) {
    S* const ahead = scratch + w * n;
    auto const suffix = [&](std::int64_t s, std::int64_t block) { return scratch + (s - block) * n; };
    std::int64_t const first = begin >= 0 ? begin / w : -((-begin + w - 1) / w);
    for (std::int64_t block = first * w; block < end; block += w) {
        std::int64_t const from = std::max(block, begin), to = std::min(block + w, end);
        // What follows from each row to the end of the block, then what the next block adds.
        std::int64_t s = block + w - 1;
        std::memcpy(suffix(s, block), row(s), static_cast<std::size_t>(n) * sizeof(S));
        while (--s >= from) combine<Op>(suffix(s, block), row(s), static_cast<S const*>(suffix(s + 1, block)), n);
        for (s = from; s < to; ++s) {
            if (s == block) {
                std::memcpy(place(s), suffix(s, block), static_cast<std::size_t>(n) * sizeof(S));
                done(s);
                continue;
            }
            // Rows of the next block up to s + w - 1.
            if (s == from) {
                std::memcpy(ahead, row(block + w), static_cast<std::size_t>(n) * sizeof(S));
                for (std::int64_t next = block + w + 1; next < s + w; ++next)
                    combine<Op>(ahead, static_cast<S const*>(ahead), row(next), n);
            } else if (s == block + 1) {
                std::memcpy(ahead, row(block + w), static_cast<std::size_t>(n) * sizeof(S));
            } else {
                combine<Op>(ahead, static_cast<S const*>(ahead), row(s + w - 1), n);
            }
            combine<Op>(place(s), static_cast<S const*>(suffix(s, block)), static_cast<S const*>(ahead), n);
            done(s);
        }
    }
}

/// load(x, y, z, n, S* to) reads voxels; store(x, y, z, n, S const* from) takes results.
template <class Op, class S, class Load, class Store>
void box_windows(Box const& out, Index3 radius, Execution const& execution, Load const& load, Store const& store) {
    if (out.empty()) return;
    Index3 const n = out.dims(), w{2 * radius.x + 1, 2 * radius.y + 1, 2 * radius.z + 1};
    std::int64_t const slice = n.x * n.y, slices = n.z + 2 * radius.z, rows = n.y + 2 * radius.y;
    // In huge pages, and not cleared: what is written is all that is read.
    Buffer memory(static_cast<std::size_t>(slice * slices) * sizeof(S));
    S* const planes = reinterpret_cast<S*>(memory.write(Space::host));
    int const threads = threads_for(execution, out.voxels());
    for_each_item(execution, static_cast<int>(std::min<std::int64_t>(threads, slices)), slices,
                  [&](std::int64_t first, std::int64_t last) {
                      std::vector<S> line(static_cast<std::size_t>(n.x + 2 * radius.x)),
                          lines(static_cast<std::size_t>(rows * n.x)),
                          scratch(static_cast<std::size_t>((w.y + 2) * window_columns(w.y, n.x, sizeof(S))));
                      for (std::int64_t k = first; k < last; ++k) {
                          S* const plane = planes + k * slice;
                          for (std::int64_t j = 0; j < rows; ++j) {
                              load(out.lower.x - radius.x, out.lower.y - radius.y + j, out.lower.z - radius.z + k,
                                   n.x + 2 * radius.x, line.data());
                              window_along_row<Op>(line.data(), lines.data() + j * n.x, n.x, w.x);
                          }
                          std::int64_t const columns = window_columns(w.y, n.x, sizeof(S));
                          for (std::int64_t x = 0; x < n.x; x += columns) {
                              std::int64_t const m = std::min(columns, n.x - x);
                              std::int64_t const y0 = out.lower.y - radius.y;
                              window_across_rows<Op>(
                                  y0, y0 + n.y, w.y, m, scratch.data(),
                                  [&](std::int64_t y) { return lines.data() + (y - y0) * n.x + x; },
                                  [&](std::int64_t y) { return plane + (y - y0) * n.x + x; }, [](std::int64_t) {});
                          }
                      }
                  });
    std::int64_t const columns = window_columns(w.z, n.x, sizeof(S)), pieces = (n.x + columns - 1) / columns;
    for_each_item(execution, static_cast<int>(std::min<std::int64_t>(threads, pieces * n.y)), pieces * n.y,
                  [&](std::int64_t first, std::int64_t last) {
                      std::vector<S> scratch(static_cast<std::size_t>((w.z + 2) * columns));
                      S* const result = scratch.data() + (w.z + 1) * columns;
                      for (std::int64_t item = first; item < last; ++item) {
                          std::int64_t const y = item / pieces, x = item % pieces * columns,
                                             m = std::min(columns, n.x - x), z0 = out.lower.z - radius.z;
                          window_across_rows<Op>(
                              z0, z0 + n.z, w.z, m, scratch.data(),
                              [&](std::int64_t z) { return planes + (z - z0) * slice + y * n.x + x; },
                              [&](std::int64_t) { return result; },
                              [&](std::int64_t z) {
                                  store(out.lower.x + x, out.lower.y + y, z + radius.z, m,
                                        static_cast<S const*>(result));
                              });
                      }
                  });
}

/// Means of float64 that are not finite though their voxels are: of voxels times `scale`.
void mend_means(ConstView in, AnyView out, Index3 radius, double count, double scale, Execution const& execution) {
    auto const load = [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, double* to) {
        auto const* const from = reinterpret_cast<double const*>(in.at(x, y, z));
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = from[i] * scale;
    };
    auto const store = [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, double const* from) {
        auto* const to = reinterpret_cast<double*>(out.at(x, y, z));
        for (std::int64_t i = 0; i < n; ++i)
            if (!is_finite(to[i])) to[i] = mean_of_scaled(from[i], count, scale);
    };
    box_windows<Sum, double>(out.box, radius, execution, load, store);
}

/// Whether voxels of a box are so large that sums of float64 with this scale may overflow without it.
bool large_in(ConstView in, Box const& box, double scale, Execution const& execution) {
    bool large = false;
    for_each_segment(execution, box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        if (!any_large(reinterpret_cast<double const*>(in.at(x, y, z)), n, scale)) return;
#pragma omp atomic write
        large = true;
    });
    return large;
}

template <class S> void mean_in(ConstView in, AnyView out, Index3 radius, Losses& losses, Execution const& execution) {
    using Loaded = std::conditional_t<std::is_same_v<S, double>, double, float>;
    auto const count = static_cast<double>((2 * radius.x + 1) * (2 * radius.y + 1) * (2 * radius.z + 1));
    bool finite = true; // all means of float64
    auto const load = [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, S* to) {
        for (std::int64_t i = 0; i < n; i += row_piece) {
            std::int64_t const m = std::min(row_piece, n - i);
            if constexpr (std::is_same_v<S, double>) {
                load_row(in.type, in.at(x + i, y, z), to + i, m);
            } else {
                alignas(64) Loaded values[row_piece];
                load_row(in.type, in.at(x + i, y, z), static_cast<Loaded*>(values), m);
#pragma omp simd
                for (std::int64_t j = 0; j < m; ++j) to[i + j] = static_cast<S>(values[j]);
            }
        }
    };
    auto const store = [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, S const* from) {
        alignas(64) double means[row_piece];
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) means[i] = static_cast<double>(from[i]) / count;
        if (in.type == DataType::float64 && !all_finite(static_cast<double const*>(means), n)) {
#pragma omp atomic write
            finite = false;
        }
        driver::add(losses, store_row(out.type, static_cast<double const*>(means), out.at(x, y, z), n));
    };
    box_windows<Sum, S>(out.box, radius, execution, load, store);
    if (finite) return;
    double const scale = scale_of_boxes(count);
    if (large_in(in, {out.box.lower - radius, out.box.upper + radius}, scale, execution))
        mend_means(in, out, radius, count, scale, execution);
}

/// Least or greatest keys of ellipsoids: rows with chords of each length, combined.
template <class Op, class K> class BallTile {
public:
    BallTile(ConstView in, AnyView out, Index3 radius) : in_(in), out_(out), radius_(radius), tile_(ball_tile(radius)) {
        deep_ = 2 * radius.z + 1;
        rows_ = tile_.y + 2 * radius.y;
        pitch_ = tile_.x + 2 * radius.x;
        std::vector<int> const halves = halves_of(radius);
        for (std::int64_t dz = -radius.z, i = 0; dz <= radius.z; ++dz)
            for (std::int64_t dy = -radius.y; dy <= radius.y; ++dy, ++i)
                if (int const half = halves[static_cast<std::size_t>(i)]; half >= 0) chords_.push_back({dy, dz, half});
        values_.resize(static_cast<std::size_t>((radius.x + 1) * deep_ * rows_ * pitch_));
        result_.resize(static_cast<std::size_t>(tile_.x));
    }

    void run(Box const& tile) {
        box_ = tile;
        Index3 const n = tile.dims();
        for (std::int64_t z = tile.lower.z - radius_.z; z < tile.upper.z + radius_.z; ++z) {
            for (std::int64_t j = 0; j < n.y + 2 * radius_.y; ++j) {
                load_keys(in_.type, in_.at(tile.lower.x - radius_.x, tile.lower.y - radius_.y + j, z), row(0, z, j),
                          n.x + 2 * radius_.x);
                for (std::int64_t half = 1; half <= radius_.x; ++half) {
                    // row(half)[i] is of the voxels i - half … i + half
                    K const* const shorter = row(half - 1, z, j);
                    K* const to = row(half, z, j);
                    std::int64_t const end = n.x + 2 * radius_.x - half;
#pragma omp simd
                    for (std::int64_t i = half; i < end; ++i)
                        to[i] = Op::of(Op::of(shorter[i - 1], shorter[i + 1]), shorter[i]);
                }
            }
            if (z < tile.lower.z + radius_.z) continue;
            for (std::int64_t j = 0; j < n.y; ++j) {
                bool any = false;
                for (Chord const& chord : chords_) {
                    K const* const from =
                        row(chord.half, z - radius_.z + chord.dz, j + radius_.y + chord.dy) + radius_.x;
                    if (any)
                        combine<Op>(result_.data(), static_cast<K const*>(result_.data()), from, n.x);
                    else
                        std::memcpy(result_.data(), from, static_cast<std::size_t>(n.x) * sizeof(K));
                    any = true;
                }
                store_keys(out_.type, static_cast<K const*>(result_.data()),
                           out_.at(tile.lower.x, tile.lower.y + j, z - radius_.z), n.x);
            }
        }
    }

private:
    struct Chord {
        std::int64_t dy, dz, half;
    };
    K* row(std::int64_t half, std::int64_t z, std::int64_t j) {
        std::int64_t const slot = (z - box_.lower.z + radius_.z) % deep_;
        return values_.data() + ((half * deep_ + slot) * rows_ + j) * pitch_;
    }

    ConstView in_;
    AnyView out_;
    Index3 radius_, tile_;
    Box box_;
    std::int64_t deep_, rows_, pitch_;
    std::vector<Chord> chords_;
    std::vector<K> values_, result_;
};

} // namespace

void mean_of_boxes(ConstView in, AnyView out, Index3 radius, Losses& losses, Execution const& execution) {
    if (box_sum_bytes(in.type, radius) == 4)
        mean_in<std::int32_t>(in, out, radius, losses, execution);
    else
        mean_in<double>(in, out, radius, losses, execution);
}

void extreme_of_boxes(ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const& execution) {
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) {
        box_windows<Op, K>(
            out.box, radius, execution,
            [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, K* to) {
                load_keys(in.type, in.at(x, y, z), to, n);
            },
            [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, K const* from) {
                store_keys(out.type, from, out.at(x, y, z), n);
            });
    });
}

void extreme_of_balls(ConstView in, AnyView out, Index3 radius, WindowExtreme extreme, Execution const& execution) {
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) {
        for_each_tile(execution, execution.threads, out.box, ball_tile(radius), [&](auto const& each) {
            BallTile<Op, K> ball(in, out, radius);
            each([&](Box const& tile) { ball.run(tile); });
        });
    });
}

void difference_of(ConstView a, ConstView b, AnyView out, Losses& losses, Execution const& execution) {
    if (is_integer(a.type) && size_of(a.type) == 8)
        return map<Int128>(execution, out, losses, Subtract<Int128>{}, a, b);
    with_compute_type(a.type, [&]<class C>(C) { map<C>(execution, out, losses, Subtract<C>{}, a, b); });
}

} // namespace VKT_BACKEND

} // namespace vkt
