// Distances along lines: 16 neighbouring lines at a time search outwards until nothing nearer can come. Where that
// takes long, the lower envelope of parabolas (Felzenszwalb and Huttenlocher 2012) bounds it.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/kernels/distance.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/voxels/kernels/bits.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr std::int64_t lanes = distance_lanes;
constexpr std::int64_t most_steps = 20; ///< of a search; farther sites are found by the envelope

/// `lanes` numbers, in as many registers as they take.
template <class V> struct Lines {
    static constexpr std::int64_t in_register = static_cast<std::int64_t>(register_bytes / sizeof(V));
    static constexpr std::int64_t registers = lanes / in_register;
    typedef V type __attribute__((vector_size(register_bytes)));
    type part[registers];

    static Lines load(V const* p) {
        Lines result;
        std::memcpy(result.part, p, sizeof result.part);
        return result;
    }
    void store(V* p) const { std::memcpy(p, part, sizeof part); }
    /// Takes over what is smaller: min(a, b) + add.
    void improve(V const* a, V const* b, V add) {
        Lines const u = load(a), v = load(b);
        for (std::int64_t i = 0; i < registers; ++i) {
            type const nearer = (u.part[i] < v.part[i] ? u.part[i] : v.part[i]) + add;
            part[i] = nearer < part[i] ? nearer : part[i];
        }
    }
    bool any_above(V limit) const {
        auto over = part[0] > limit;
        for (std::int64_t i = 1; i < registers; ++i) over |= part[i] > limit;
        return any_bit(over);
    }
};

template <class V> constexpr V none_yet() {
    if constexpr (std::is_same_v<V, std::int32_t>)
        return no_site;
    else
        return std::numeric_limits<V>::infinity();
}

/// The lines of a tile, with `steps` rows of none_yet before the first voxel and after the last.
template <class V> struct Tile {
    V* rows;
    std::int64_t n, steps;

    V* row(std::int64_t i) const { return rows + (i + steps) * lanes; }
    void clear_ends() const {
        for (std::int64_t i = 0; i < steps * lanes; ++i) {
            rows[i] = none_yet<V>();
            row(n)[i] = none_yet<V>();
        }
    }
    /// Distances of row i; false if they may lie beyond the steps.
    bool search(std::int64_t i, V weight, Lines<V>& best) const {
        best = Lines<V>::load(row(i));
        for (std::int64_t d = 1; d <= steps; ++d) {
            V const add = weight * static_cast<V>(d * d);
            if (!best.any_above(add)) return true;
            best.improve(row(i - d), row(i + d), add);
        }
        return steps == n - 1 || !best.any_above(weight * static_cast<V>((steps + 1) * (steps + 1)));
    }
};

/// Room for the envelope of one line.
struct Envelope {
    double* from;       ///< where a parabola becomes the lowest
    std::int64_t* site; ///< its vertex

    /// to[i * lanes] = least of line[j * lanes] + weight (i - j)^2.
    template <class V> void compute(V const* line, std::int64_t n, double weight, V* to) const {
        std::int64_t last = -1;
        auto const height = [&](std::int64_t j) { return static_cast<double>(line[j * lanes]); };
        for (std::int64_t j = 0; j < n; ++j) {
            if (!(line[j * lanes] < none_yet<V>())) continue;
            double begin = -std::numeric_limits<double>::infinity();
            for (; last >= 0; --last) {
                std::int64_t const k = site[last];
                begin = (height(j) - height(k)) / (2 * weight * static_cast<double>(j - k)) +
                        static_cast<double>(j + k) / 2;
                if (begin > from[last]) break;
                begin = -std::numeric_limits<double>::infinity();
            }
            ++last;
            site[last] = j;
            from[last] = begin;
        }
        if (last < 0) {
            for (std::int64_t i = 0; i < n; ++i) to[i * lanes] = none_yet<V>();
            return;
        }
        V const step = static_cast<V>(weight);
        for (std::int64_t i = 0, k = 0; i < n; ++i) {
            while (k < last && from[k + 1] < static_cast<double>(i)) ++k;
            std::int64_t const d = i - site[k];
            to[i * lanes] = line[site[k] * lanes] + step * static_cast<V>(d * d);
        }
    }
};

template <class V> using Stored = std::conditional_t<std::is_same_v<V, std::int32_t>, std::int32_t, float>;

template <class V> class Pass {
public:
    Pass(AnyView out, DistancePass const& pass)
        : out_(out), pass_(pass), n_(pass.axis == Axis::y ? out.dims().y : out.dims().z),
          stride_(pass.axis == Axis::y ? out.row : out.slice), steps_(std::min(most_steps, n_ - 1)) {}

    /// Numbers of V for the scratch of a thread: tiles, results and the envelope.
    std::size_t scratch() const {
        std::size_t const tile = static_cast<std::size_t>((n_ + 2 * steps_) * lanes);
        std::size_t const result = static_cast<std::size_t>(n_ * lanes);
        std::size_t const sides = pass_.both_sides ? 2 : 1;
        return sides * (tile + result) * sizeof(V) + static_cast<std::size_t>(n_ + 1) * 16 + 64;
    }

    void run(Execution const& execution) const {
        Index3 const n = out_.dims();
        std::int64_t const across = (n.x + lanes - 1) / lanes, others = pass_.axis == Axis::y ? n.z : n.y;
        std::int64_t const other_stride = pass_.axis == Axis::y ? out_.slice : out_.row;
        int const threads = threads_for(execution, out_.box.voxels());
        std::size_t const each = (scratch() + 127) / 64 * 64;
        Buffer buffer(each * static_cast<std::size_t>(threads));
        std::byte* const memory = buffer.write(Space::host);
        for_each_item(threads, across * others, [&](std::int64_t begin, std::int64_t end) {
            std::byte* const mine = memory + each * static_cast<std::size_t>(omp_get_thread_num());
            for (std::int64_t item = begin; item < end; ++item) {
                tell_progress(execution, begin, item, end);
                std::int64_t const x = item % across * lanes;
                tile(out_.data + 4 * (x + item / across * other_stride), std::min(lanes, n.x - x), mine);
            }
        });
    }

private:
    using S = Stored<V>;

    void tile(std::byte* data, std::int64_t width, std::byte* memory) const {
        std::int64_t const padded = (n_ + 2 * steps_) * lanes;
        Tile<V> const inside{reinterpret_cast<V*>(memory), n_, steps_};
        Tile<V> const outside{inside.rows + (pass_.both_sides ? padded : 0), n_, steps_}; // used if there is such
        V* const result = outside.rows + padded;
        load(data, width, inside, outside);
        compute(inside, result, memory);
        V* const other = result + n_ * lanes;
        if (pass_.both_sides) compute(outside, other, memory);
        store(data, width, result, pass_.both_sides ? other : nullptr);
    }

    /// `width` numbers of four bytes; most rows of a tile are full, which the compiler should know.
    static void copy_row(void* to, void const* from, std::int64_t width) {
        if (width == lanes)
            std::memcpy(to, from, lanes * 4);
        else
            std::memcpy(to, from, static_cast<std::size_t>(width) * 4);
    }

    void load(std::byte const* data, std::int64_t width, Tile<V> const& inside, Tile<V> const& outside) const {
        inside.clear_ends();
        if (pass_.both_sides) outside.clear_ends();
        for (std::int64_t i = 0; i < n_; ++i) {
            S values[lanes] = {};
            std::byte const* const from = data + 4 * i * stride_;
            copy_row(values, from, width);
            __builtin_prefetch(from + sizeof values, 1); // for the next tile, while this one is computed
            V* const in = inside.row(i);
            V* const out = outside.row(i);
            V const before = static_cast<V>(pass_.weight_before);
            for (std::int64_t k = 0; k < lanes; ++k) {
                V const v = static_cast<V>(values[k]);
                V const square = pass_.weight_before != 0 ? v * v * before : v;
                in[k] = v > V(0) ? square : V(0);
            }
            if (!pass_.both_sides) continue;
            for (std::int64_t k = 0; k < lanes; ++k) {
                V const v = static_cast<V>(values[k]);
                V const square = pass_.weight_before != 0 ? v * v * before : -v;
                out[k] = v < V(0) ? square : V(0);
            }
        }
    }

    void compute(Tile<V> const& lines, V* result, std::byte* memory) const {
        V const weight = static_cast<V>(pass_.weight);
        for (std::int64_t i = 0; i < n_; ++i) {
            Lines<V> best;
            if (!lines.search(i, weight, best)) return by_envelope(lines, result, memory);
            best.store(result + i * lanes);
        }
    }

    void by_envelope(Tile<V> const& lines, V* result, std::byte* memory) const {
        std::byte* const room = memory + (scratch() - static_cast<std::size_t>(n_ + 1) * 16) / 16 * 16;
        auto* const from = reinterpret_cast<double*>(room);
        Envelope const envelope{from, reinterpret_cast<std::int64_t*>(from + n_)};
        for (std::int64_t k = 0; k < lanes; ++k) envelope.compute(lines.row(0) + k, n_, pass_.weight, result + k);
    }

    void store(std::byte* data, std::int64_t width, V const* inside, V const* outside) const {
        for (std::int64_t i = 0; i < n_; ++i) {
            std::byte* const to = data + 4 * i * stride_;
            V const* const in = inside + i * lanes;
            if (pass_.unit == 0) {
                S values[lanes];
                for (std::int64_t k = 0; k < lanes; ++k)
                    values[k] = static_cast<S>(outside != nullptr ? in[k] - outside[i * lanes + k] : in[k]);
                copy_row(to, values, width);
                continue;
            }
            float values[lanes];
            roots(in, pass_.unit, values);
            if (outside != nullptr) {
                float others[lanes];
                roots(outside + i * lanes, pass_.unit, others);
                for (std::int64_t k = 0; k < lanes; ++k) values[k] -= others[k];
            }
            copy_row(to, values, width);
        }
    }

    static void roots(V const* squares, double unit, float* to) {
#pragma omp simd
        for (std::int64_t k = 0; k < lanes; ++k) {
            auto const length = static_cast<float>(std::sqrt(static_cast<double>(squares[k])) * unit);
            to[k] = squares[k] < none_yet<V>() ? length : std::numeric_limits<float>::infinity();
        }
    }

    AnyView out_;
    DistancePass pass_;
    std::int64_t n_, stride_, steps_;
};

/// The first voxel from x on whose bit differs from those of `same`, which is all 0 or all 1; n if there is none.
std::int64_t next(std::uint64_t const* bits, std::int64_t x, std::int64_t n, std::uint64_t same) {
    while (x < n) {
        std::uint64_t const rest = (bits[x / 64] ^ same) >> (x % 64);
        if (rest != 0) return std::min(n, x + std::countr_zero(rest));
        x = (x / 64 + 1) * 64;
    }
    return n;
}

/// Distances in steps for the voxels [begin, end) of a row of n, all of one side; those beyond are of the other.
template <class S, class F>
void fill_run(S* row, std::int64_t begin, std::int64_t end, std::int64_t n, S none, F const& value) {
    std::int64_t const far = std::int64_t{1} << 40;
    std::int64_t const left = begin > 0 ? begin - 1 : -far, right = end < n ? end : far;
    if (begin == 0 && end == n) {
        std::fill(row, row + n, none);
        return;
    }
    std::int64_t const middle = std::clamp((left + right) / 2 + 1, begin, end);
    for (std::int64_t x = begin; x < middle; ++x) row[x] = value(x - left);
    for (std::int64_t x = middle; x < end; ++x) row[x] = value(right - x);
}

} // namespace

void distance_rows(ConstView in, AnyView out, DistanceRows& rows, Execution const& execution) {
    Index3 const n = in.dims();
    Execution alone = execution;
    alone.threads = 1;
    std::int64_t const words = bit_words(n.x);
    int const threads = threads_for(execution, in.box.voxels());
    std::size_t const each = (static_cast<std::size_t>(words) * 8 + 63) / 64 * 64;
    Buffer buffer(each * static_cast<std::size_t>(threads));
    std::byte* const memory = buffer.write(Space::host);
    for_each_item(threads, n.y * n.z, [&](std::int64_t begin, std::int64_t end) {
        auto* const bits =
            reinterpret_cast<std::uint64_t*>(memory + each * static_cast<std::size_t>(omp_get_thread_num()));
        std::int64_t objects = 0, nan = 0;
        for (std::int64_t r = begin; r < end; ++r) {
            tell_progress(execution, begin, r, end);
            std::int64_t const y = in.box.lower.y + r % n.y, z = in.box.lower.z + r / n.y;
            ConstView const row = in.part({{in.box.lower.x, y, z}, {in.box.upper.x, y + 1, z + 1}});
            if (!is_integer(in.type)) {
                pack_bits(row, BitRule::number, {}, bits, alone);
                nan += n.x;
                for (std::int64_t w = 0; w < words; ++w) nan -= std::popcount(bits[w]);
            }
            pack_bits(row, BitRule::object, rows.zero, bits, alone);
            auto const fill_row = [&]<class S>(S* to, S none, auto const& value) {
                auto const outside = [&](std::int64_t first, std::int64_t last) {
                    if (first == last) return;
                    if (rows.both_sides)
                        fill_run(to, first, last, n.x, static_cast<S>(-none),
                                 [&](std::int64_t d) { return static_cast<S>(-value(d)); });
                    else
                        std::fill(to + first, to + last, S(0));
                };
                std::int64_t x = 0;
                while (x < n.x) {
                    // The next voxel of an object, and the next beyond it.
                    std::int64_t const first = next(bits, x, n.x, 0), last = next(bits, first, n.x, ~std::uint64_t{0});
                    outside(x, first);
                    if (first < last) fill_run(to, first, last, n.x, none, value);
                    objects += last - first;
                    x = last;
                }
            };
            std::byte* const to = out.at(out.box.lower.x, y, z);
            if (rows.whole) {
                auto const weight = static_cast<std::int32_t>(rows.weight);
                fill_row(reinterpret_cast<std::int32_t*>(to), no_site,
                         [&](std::int64_t d) { return static_cast<std::int32_t>(d * d) * weight; });
            } else {
                fill_row(reinterpret_cast<float*>(to), std::numeric_limits<float>::infinity(),
                         [](std::int64_t d) { return static_cast<float>(d); });
            }
        }
#pragma omp atomic
        rows.objects += objects;
#pragma omp atomic
        rows.nan += nan;
    });
}

void distance_pass(AnyView out, DistancePass const& pass, Execution const& execution) {
    if (out.box.empty()) return;
    if (pass.whole)
        Pass<std::int32_t>(out, pass).run(execution);
    else
        Pass<double>(out, pass).run(execution);
}

} // namespace VKT_BACKEND

} // namespace vkt
