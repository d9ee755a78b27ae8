// Windows along x by doubling, along y and z by running through blocks from both ends (van Herk, Gil and Werman), a row
// of voxels at a time. Blocks lie at multiples of the window's length, so that sums do not depend on how the output is
// cut.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/box_window.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cpu_tiles.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/order.h"
#include "libvkt/kernel/stencil.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/filter/kernels/large_rows.h"
#include "libvkt/operations/filter/kernels/window_parts.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// to[i] = a[i] op b[i]; `to` may be one of them. Whole registers: rows have room for them. Not inlined: callers are
/// many, and compilers make much of it.
template <class Op, class S> [[gnu::noinline]] void combine(S* to, S const* a, S const* b, std::int64_t n) {
    for (std::int64_t i = 0; i < n; i += lane_count<S>)
        store_lanes(to + i, Op::of(load_lanes(a + i), load_lanes(b + i)));
}

/// to[i] = (a[i] op a[i + span]) op (a[i + 2 span] op a[i + 3 span]); `to` may be a.
template <class Op, class S> [[gnu::noinline]] void combine_four(S* to, S const* a, std::int64_t span, std::int64_t n) {
    for (std::int64_t i = 0; i < n; i += lane_count<S>) {
        Lanes<S> const low = Op::of(load_lanes(a + i), load_lanes(a + i + span));
        store_lanes(to + i, Op::of(low, Op::of(load_lanes(a + i + 2 * span), load_lanes(a + i + 3 * span))));
    }
}

/// to[i] = values[i] op … op values[i + w - 1] for n voxels; w is odd, `sums` has room for as many as `values` has.
template <class Op, class S> void window_along_row(S const* values, S* sums, S* to, std::int64_t n, std::int64_t w) {
    if (w == 1) std::memcpy(to, values, static_cast<std::size_t>(n) * sizeof(S));
    S const *from = values, *part = values;
    for (std::int64_t span = 1, length = n + w - 1, offset = 1; 2 * span <= w; from = sums) {
        // from[i] holds `span` voxels from i on, part[i] the first of the window.
        if (4 * span <= w && (w & (2 * span)) == 0) {
            combine_four<Op>(sums, from, span, length -= 3 * span);
            span *= 4;
        } else {
            combine<Op>(sums, from, from + span, length -= span);
            span *= 2;
        }
        if ((w & span) == 0) continue;
        combine<Op>(to, part, static_cast<S const*>(sums + offset), n);
        part = to;
        offset += span;
    }
}

/// Where the block of w that i is in begins.
std::int64_t block_of(std::int64_t i, std::int64_t w) { return (i >= 0 ? i / w : -((-i + w - 1) / w)) * w; }

/// Windows of w rows of n values: row(s) op … op row(s + w - 1) goes to place(s), then done(s) is called, for
/// begin <= s < end. `scratch` has room for w + 1 rows.
template <class Op, class S, class Row, class Place, class Done>
void window_across_rows(std::int64_t begin, std::int64_t end, std::int64_t w, std::int64_t n, S* scratch,
                        Row const& row, Place const& place, Done const& done) {
    S* const ahead = scratch + w * n;
    auto const suffix = [&](std::int64_t s, std::int64_t block) { return scratch + (s - block) * n; };
    for (std::int64_t block = block_of(begin, w); block < end; block += w) {
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

/// A tile of the output, one slice of windows along x and y after the other. Along z only as many are held as a window
/// has: the sums that end with the block before, each of which gives way to a slice once it has been used.
template <class Op, class S, class Convert, class Store> class BoxTile {
public:
    /// convert(bytes, S* to, n) makes values of voxels; store(x, y, z, n, S const* from) takes results.
    BoxTile(ConstView in, Box const& tile, Index3 radius, Continuation const& beyond, Convert const& convert,
            Store const& store)
        : in_(in), tile_(tile), radius_(radius), w_(Index3{1, 1, 1} + radius + radius), width_(tile.dims().x),
          beyond_(beyond), convert_(convert), store_(store) {
        voxels_ = {std::max(tile.lower.x - radius.x, in.box.lower.x),
                   std::min(tile.upper.x + radius.x, in.box.upper.x)};
        find_outside(tile.lower.x - radius.x, voxels_.lower);
        find_outside(voxels_.upper, tile.upper.x + radius.x);
        for (std::int64_t y = tile.lower.y - radius.y; y < tile.upper.y + radius.y; ++y) {
            lines_of_.push_back(source(1, y));
            if (lines_of_.back() != border) rows_.push_back(lines_of_.back());
        }
        // Mostly they are in order. Compiled for one instruction set, std::sort() would stand in for the others.
        for (std::size_t i = 1; i < rows_.size(); ++i)
            for (std::size_t k = i; k > 0 && rows_[k] < rows_[k - 1]; --k) std::swap(rows_[k], rows_[k - 1]);
        rows_.erase(std::unique(rows_.begin(), rows_.end()), rows_.end());
        for (std::int64_t& line : lines_of_)
            if (line != border) line = std::ranges::lower_bound(rows_, line) - rows_.begin();
    }

    void run(BoxLayout const& layout, S* memory, Execution const& execution) {
        auto const take = [&](std::int64_t values) {
            constexpr std::int64_t lanes = lane_count<S>;
            return std::exchange(memory, memory + (values + lanes - 1) / lanes * lanes);
        };
        pitch_ = layout.pitch;
        columns_ = layout.columns;
        slice_ = layout.slice;
        if (radius_.z > 0) { // else nothing is held
            slices_ = take(w_.z * slice_);
            ahead_ = take(slice_);
            kept_ = take(layout.kept * slice_);
        }
        result_ = take(columns_);
        stride_ = layout.line;
        together_ = layout.together;
        voxels_around_ = take(together_ * stride_ + 2 * lane_count<S>);
        sums_ = take(together_ * stride_ + 2 * lane_count<S>);
        scratch_ = take((w_.y + 1) * columns_);
        border_row_ = take(stride_);
        lines_ = memory;
        if (beyond_.boundary == Boundary::border) {
            VoxelBytes const voxel = voxel_bytes(in_.type, beyond_.border_value);
            convert(voxel.data(), &border_value_, 1);
            std::fill_n(voxels_around_, stride_, border_value_);
            window_along_row<Op>(static_cast<S const*>(voxels_around_), sums_, border_row_, width_, w_.x);
        }
        std::int64_t const begin = tile_.lower.z - radius_.z, end = tile_.upper.z + radius_.z,
                           first = block_of(begin, w_.z);
        find_repeated(begin, end, layout.kept);
        for (std::int64_t z = begin, block = first; z < end; ++z) {
            tell_progress(execution, begin, z, end);
            if (z == block + w_.z) block = z;
            SliceWindows const& windows = sliced_[static_cast<std::size_t>(z - begin)];
            add_slice(z, block, block > first, z - w_.z + 1 >= begin && z < block + w_.z - 1, windows);
            if (radius_.z > 0 && z == block + w_.z - 1) finish_block(std::max(begin, block), z, block >= begin);
        }
    }

private:
    /// In place of an index; far from all of them.
    static constexpr std::int64_t border = std::numeric_limits<std::int64_t>::min() / 2;
    struct Span {
        std::int64_t lower, upper;
    };
    /// Columns that follow one another, and those that stand there: one after the other, in reverse, or one for all.
    struct Run {
        std::int64_t to, from, count, step;
    };
    struct Place {
        std::int64_t index;
    };
    /// Where the windows along x and y of a slice come from: those of this slice of the input, or those that were kept
    /// of another one, `place` slices into kept_.
    struct SliceWindows {
        std::int64_t source, place = -1;
        bool known = false, wanted = false; ///< kept before, and once more
    };

    /// What the input has in place of i along an axis.
    std::int64_t source(int axis, std::int64_t i) const {
        if (i >= in_.box.lower[axis] && i < in_.box.upper[axis]) return i;
        std::int64_t const from = fold(i, beyond_.dims[axis], beyond_.boundary);
        return from < 0 ? border : from;
    }
    [[gnu::noinline]] void convert(std::byte const* from, S* to, std::int64_t n) const { convert_(from, to, n); }
    [[gnu::noinline]] void store(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, S const* from) const {
        store_(x, y, z, n, from);
    }
    S* slice(std::int64_t z) const { return slices_ + (z - block_of(z, w_.z)) * slice_; }

    void find_outside(std::int64_t begin, std::int64_t end) {
        for (std::int64_t x = begin; x < end; ++x) {
            std::int64_t const from = source(0, x);
            if (x > begin) {
                Run& run = outside_.back();
                std::int64_t const step = from - (run.from + (run.count - 1) * run.step);
                bool const there = from >= voxels_.lower && from < voxels_.upper,
                           same = there == (run.from >= voxels_.lower && run.from < voxels_.upper);
                if (same && std::abs(step) <= 1 && (run.count == 1 || step == run.step)) {
                    run.step = step;
                    ++run.count;
                    continue;
                }
            }
            outside_.push_back({x, from, 1, 0});
        }
    }

    /// What lies outside of the volume repeats slices of it: their windows are kept in between, as far as there is
    /// room.
    void find_repeated(std::int64_t begin, std::int64_t end, std::int64_t room) {
        for (std::int64_t z = begin; z < end; ++z) sliced_.push_back({source(2, z)});
        if (radius_.z == 0) return;
        auto const inside = [&](std::size_t i) { return sliced_[i].source == begin + static_cast<std::int64_t>(i); };
        std::size_t const count = sliced_.size();
        std::size_t lower = 0, upper = count; // slices inside, which only those above repeat
        while (lower < count && !inside(lower)) ++lower;
        while (upper > lower && !inside(upper - 1)) --upper;
        std::vector<Place> free;
        for (std::int64_t place = 0; place < room; ++place) free.push_back({place});
        for (std::size_t i = 0; i < count; ++i) {
            SliceWindows& slice = sliced_[i];
            std::size_t next = inside(i) ? std::max(i + 1, upper) : i + 1;
            while (next < count && sliced_[next].source != slice.source) ++next;
            slice.wanted = next < count;
            if (slice.wanted && !slice.known && !free.empty()) {
                slice.place = free.back().index;
                free.pop_back();
            }
            if (slice.place < 0) continue;
            if (slice.wanted)
                sliced_[next].place = slice.place, sliced_[next].known = true;
            else
                free.push_back({slice.place});
        }
    }

    /// A row with what is around it.
    void load(std::int64_t y, std::int64_t z, S* to) const {
        S* const line = to - (tile_.lower.x - radius_.x);
        convert(in_.at(voxels_.lower, y, z), line + voxels_.lower, voxels_.upper - voxels_.lower);
        for (Run const& run : outside_) {
            if (run.from == border)
                std::fill_n(line + run.to, run.count, border_value_);
            else if (run.from < voxels_.lower || run.from >= voxels_.upper) // around the volume
                convert(in_.at(run.from, y, z), line + run.to, run.count);
            else if (run.step == 0)
                std::fill_n(line + run.to, run.count, line[run.from]);
            else if (run.step == 1)
                std::memcpy(line + run.to, line + run.from, static_cast<std::size_t>(run.count) * sizeof(S));
            else
                driver::copy_reversed(line + run.to, line + run.from, run.count, false);
        }
    }

    /// Windows along x of all rows, some of them at a time as if they were one: work that follows on what has just been
    /// stored waits for it in short ones.
    void load_slice(std::int64_t z) const {
        auto const rows = static_cast<std::int64_t>(rows_.size());
        for (std::int64_t i = 0; i < rows; i += together_) {
            std::int64_t const count = std::min(together_, rows - i);
            for (std::int64_t j = 0; j < count; ++j)
                load(rows_[static_cast<std::size_t>(i + j)], z, voxels_around_ + j * stride_);
            window_along_row<Op>(static_cast<S const*>(voxels_around_), sums_, lines_ + i * stride_,
                                 (count - 1) * stride_ + width_, w_.x);
        }
    }

    /// Slice z, in the block that begins there; `follows` another one, whose windows with it are `complete`.
    void add_slice(std::int64_t z, std::int64_t block, bool follows, bool complete, SliceWindows const& windows) const {
        std::int64_t const y0 = tile_.lower.y - radius_.y, s = z - w_.z + 1;
        bool const alone = radius_.z == 0;
        S *const to = alone ? nullptr : slice(z), *const suffix = alone ? nullptr : slice(s);
        auto const add_row = [&](std::int64_t y, std::int64_t x, std::int64_t m) {
            std::int64_t const i = (y - y0) * pitch_ + x, n = std::min(m, width_ - x);
            if (alone) store(tile_.lower.x + x, y + radius_.y, z, n, static_cast<S const*>(result_));
            if (alone || !follows) return;
            if (z == block)
                std::memcpy(ahead_ + i, to + i, static_cast<std::size_t>(m) * sizeof(S));
            else
                combine<Op>(ahead_ + i, static_cast<S const*>(ahead_ + i), static_cast<S const*>(to + i), m);
            if (!complete) return;
            combine<Op>(result_, static_cast<S const*>(suffix + i), static_cast<S const*>(ahead_ + i), m);
            store(tile_.lower.x + x, y + radius_.y, s + radius_.z, n, static_cast<S const*>(result_));
        };
        auto const bytes = static_cast<std::size_t>(tile_.dims().y * pitch_) * sizeof(S);
        if (windows.known) {
            std::memcpy(to, kept_ + windows.place * slice_, bytes);
            for (std::int64_t y = y0; y < y0 + tile_.dims().y; ++y)
                for (std::int64_t x = 0; x < pitch_; x += columns_) add_row(y, x, std::min(columns_, pitch_ - x));
            return;
        }
        std::int64_t const from = windows.source;
        if (from != border) load_slice(from);
        for (std::int64_t x = 0; x < pitch_; x += columns_) {
            std::int64_t const m = std::min(columns_, pitch_ - x);
            window_across_rows<Op>(
                y0, y0 + tile_.dims().y, w_.y, m, scratch_,
                [&](std::int64_t y) -> S const* {
                    std::int64_t const line = lines_of_[static_cast<std::size_t>(y - y0)];
                    return (from == border || line == border ? border_row_ : lines_ + line * stride_) + x;
                },
                [&](std::int64_t y) { return alone ? result_ : to + (y - y0) * pitch_ + x; },
                [&](std::int64_t y) { add_row(y, x, m); });
        }
        if (windows.wanted && windows.place >= 0) std::memcpy(kept_ + windows.place * slice_, to, bytes);
    }

    /// Of the block that ends with a slice what follows from each to its end, down to the first; which may be all of a
    /// window.
    void finish_block(std::int64_t first, std::int64_t last, bool whole) const {
        for (std::int64_t z = last - 1; z >= first; --z)
            combine<Op>(slice(z), static_cast<S const*>(slice(z)), static_cast<S const*>(slice(z + 1)),
                        tile_.dims().y * pitch_);
        if (!whole) return;
        for (std::int64_t y = 0; y < tile_.dims().y; ++y)
            for (std::int64_t x = 0; x < width_; x += columns_)
                store(tile_.lower.x + x, tile_.lower.y + y, first + radius_.z, std::min(columns_, width_ - x),
                      static_cast<S const*>(slice(first) + y * pitch_ + x));
    }

    ConstView in_;
    Box tile_;
    Index3 radius_, w_;
    std::int64_t width_;
    Continuation const& beyond_;
    Convert const& convert_;
    Store const& store_;
    Span voxels_{};                      ///< columns of the input that are loaded
    std::vector<Run> outside_;           ///< columns that are not
    std::vector<std::int64_t> rows_;     ///< of the input, each once
    std::vector<std::int64_t> lines_of_; ///< which of these stands at each row of the tile and around it
    S border_value_{};
    std::int64_t pitch_ = 0, columns_ = 0, slice_ = 0, stride_ = 0, together_ = 1;
    std::vector<SliceWindows> sliced_; ///< of the tile and around it
    S *slices_ = nullptr, *ahead_ = nullptr, *kept_ = nullptr, *result_ = nullptr, *voxels_around_ = nullptr,
      *sums_ = nullptr, *scratch_ = nullptr, *border_row_ = nullptr, *lines_ = nullptr;
};

template <class Op, class S, class Convert, class Store>
void box_windows(ConstView in, Box const& out, Index3 radius, Continuation const& beyond, Execution const& execution,
                 Convert const& convert, Store const& store) {
    if (out.empty()) return;
    int const threads = threads_for(execution, out.voxels());
    BoxLayout const layout(out.dims(), radius, sizeof(S), threads);
    Buffer buffer(static_cast<std::size_t>(layout.tiles() * layout.values) * sizeof(S)); // not cleared
    S* const memory = reinterpret_cast<S*>(buffer.write(Space::host));
    for_each_item(threads, layout.tiles(), [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t i = first; i < last; ++i)
            BoxTile<Op, S, Convert, Store>(in, layout.tile(out, i), radius, beyond, convert, store)
                .run(layout, memory + i * layout.values, execution);
    });
}

/// Means of float64 that are not finite though their voxels are: of voxels times `scale`.
void mend_means(ConstView in, AnyView out, Index3 radius, Continuation const& beyond, double count, double scale,
                Execution const& execution) {
    auto const convert = [&](std::byte const* bytes, double* to, std::int64_t n) {
        auto const* const from = reinterpret_cast<double const*>(bytes);
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = from[i] * scale;
    };
    auto const store = [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n, double const* from) {
        auto* const to = reinterpret_cast<double*>(out.at(x, y, z));
        for (std::int64_t i = 0; i < n; ++i)
            if (!is_finite(to[i])) to[i] = mean_of_scaled(from[i], count, scale);
    };
    box_windows<Sum, double>(in, out.box, radius, beyond, execution, convert, store);
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

template <class S>
void mean_in(ConstView in, AnyView out, Index3 radius, Continuation const& beyond, Losses& losses,
             Execution const& execution) {
    using Loaded = std::conditional_t<std::is_same_v<S, double>, double, float>;
    auto const count = static_cast<double>((2 * radius.x + 1) * (2 * radius.y + 1) * (2 * radius.z + 1));
    bool finite = true; // all means of float64
    auto const convert = [&](std::byte const* bytes, S* to, std::int64_t n) {
        for (std::int64_t i = 0; i < n;
             i += row_piece, bytes += static_cast<std::size_t>(row_piece) * size_of(in.type)) {
            std::int64_t const m = std::min(row_piece, n - i);
            if constexpr (std::is_same_v<S, double>) {
                load_row(in.type, bytes, to + i, m);
            } else {
                alignas(64) Loaded values[row_piece];
                load_row(in.type, bytes, static_cast<Loaded*>(values), m);
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
    box_windows<Sum, S>(in, out.box, radius, beyond, execution, convert, store);
    if (finite) return;
    double const scale = scale_of_boxes(count);
    bool const large_border = beyond.boundary == Boundary::border && any_large(&beyond.border_value, 1, scale);
    if (large_border || large_in(in, in.box, scale, execution))
        mend_means(in, out, radius, beyond, count, scale, execution);
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
        values_.resize(static_cast<std::size_t>((radius.x + 1) * deep_ * rows_ * pitch_ + lane_count<K>));
        result_.resize(static_cast<std::size_t>(tile_.x + lane_count<K>));
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

void mean_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const& beyond, Losses& losses,
                   Execution const& execution) {
    if (box_sum_bytes(in.type, radius) == 4)
        mean_in<std::int32_t>(in, out, radius, beyond, losses, execution);
    else
        mean_in<double>(in, out, radius, beyond, losses, execution);
}

void extreme_of_boxes(ConstView in, AnyView out, Index3 radius, Continuation const& beyond, WindowExtreme extreme,
                      Execution const& execution) {
    with_extreme(extreme, in.type, [&]<class Op, class K>(Op, K) {
        box_windows<Op, K>(
            in, out.box, radius, beyond, execution,
            [&](std::byte const* from, K* to, std::int64_t n) { load_keys(in.type, from, to, n); },
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
