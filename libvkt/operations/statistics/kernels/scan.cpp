// Prefix sums: along z, x and then y, row by row in the same order for any slab and thread.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/scan.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/kernel/rows.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// The parts of n sums, each its own array: the sum, and for pairs what its additions lost.
template <class A, int parts> struct Sums {
    std::array<A*, parts> part;
    Sums(std::byte* memory, std::int64_t n, std::int64_t at) {
        for (std::size_t p = 0; p < parts; ++p) part[p] = reinterpret_cast<A*>(memory) + p * n + at;
    }
    Sums at(std::int64_t i) const {
        Sums result = *this;
        for (std::size_t p = 0; p < parts; ++p) result.part[p] += i;
        return result;
    }
};

/// What a + b loses, without looking which is larger (Knuth).
VKT_HD double lost(double a, double b, double sum) {
    double const of_b = sum - a;
    return (a - (sum - of_b)) + (b - of_b);
}

/// to += from for n sums; `from` has no second part where it is voxels.
template <class A, int parts, class V> void add_values(std::int64_t n, A* to, A* rest, V const* from) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        A const v = static_cast<A>(from[i]);
        if constexpr (parts == 2) {
            A const sum = to[i] + v;
            rest[i] += lost(to[i], v, sum);
            to[i] = sum;
        } else {
            to[i] += v;
        }
    }
}

/// As many rows of as many sums as fit into a register.
template <class A> using Block = Lanes<A>[static_cast<std::size_t>(lane_count<A>)];

template <class V, std::size_t... lane>
VKT_HD void interleave(V a, V b, V& low, V& high, std::index_sequence<lane...>) {
    constexpr std::size_t n = sizeof...(lane);
    low = __builtin_shufflevector(a, b, (lane % 2 * n + lane / 2)...);
    high = __builtin_shufflevector(a, b, (lane % 2 * n + n / 2 + lane / 2)...);
}

/// Rows become columns, in the rounds of transpose_block().
template <class A> VKT_HD void transpose(Block<A>& a) {
    constexpr auto n = static_cast<std::size_t>(lane_count<A>);
#pragma GCC unroll 4
    for (std::size_t round = 1; round < n; round *= 2) {
        Block<A> b;
#pragma GCC unroll 8
        for (std::size_t i = 0; i < n / 2; ++i)
            interleave(a[i], a[i + n / 2], b[2 * i], b[2 * i + 1], std::make_index_sequence<n>{});
#pragma GCC unroll 8
        for (std::size_t i = 0; i < n; ++i) a[i] = b[i];
    }
}

/// Sums along x of the first columns of as many rows as a register has lanes, `step` from one another, in whole blocks:
/// each lane adds up its row, voxel by voxel. Through memory the whole scan took more than three
/// times as long. Returns the columns done; `sums` are those of the rows.
template <class A>
std::int64_t add_blocks(std::int64_t n, bool exclusive, A const* from, A* to, std::int64_t step, Lanes<A>& sums) {
    constexpr std::int64_t lanes = lane_count<A>;
    std::int64_t x = 0;
    for (; x + lanes <= n; x += lanes) {
        Block<A> block;
#pragma GCC unroll 8
        for (std::int64_t r = 0; r < lanes; ++r) block[r] = load_lanes(from + r * step + x);
        transpose<A>(block);
#pragma GCC unroll 8
        for (std::int64_t i = 0; i < lanes; ++i) {
            Lanes<A> const next = sums + block[i];
            block[i] = exclusive ? sums : next;
            sums = next;
        }
        transpose<A>(block);
#pragma GCC unroll 8
        for (std::int64_t r = 0; r < lanes; ++r) store_lanes(to + r * step + x, block[r]);
    }
    return x;
}

/// Sums along x of `rows` rows, `step` from one another, in the same order as add_along() takes them.
template <class A>
void add_along_blocks(std::int64_t n, bool exclusive, A const* from, A* to, std::int64_t step, std::int64_t rows) {
    constexpr std::int64_t lanes = lane_count<A>;
    for (std::int64_t first = 0; first < rows; first += lanes) {
        Lanes<A> sums{};
        A const* const row = from + first * step;
        A* const result = to + first * step;
        std::int64_t const done = add_blocks(n, exclusive, row, result, step, sums);
        for (std::int64_t r = 0; r < lanes; ++r) {
            A sum = sums[r];
            for (std::int64_t x = done; x < n; ++x) {
                A const next = sum + row[r * step + x];
                result[r * step + x] = exclusive ? sum : next;
                sum = next;
            }
        }
    }
}

/// Sums along x of rows next to one another: chains of additions that do not wait for each other. Spelt out for each
/// row, so that the sums are in registers.
template <class A, int parts, std::size_t... r>
void add_along(std::int64_t n, bool exclusive, std::array<Sums<A, parts>, sizeof...(r)> const& from,
               std::array<Sums<A, parts>, sizeof...(r)> const& to, std::index_sequence<r...>) {
    constexpr std::size_t rows = sizeof...(r);
    std::int64_t const shift = exclusive ? 1 : 0;
    A sum[rows] = {}, rest[rows] = {};
    A const* const values[rows] = {from[r].part[0]...};
    [[maybe_unused]] A const* const lost_before[rows] = {from[r].part[parts - 1]...};
    A* const sums[rows] = {to[r].part[0] + shift...};
    [[maybe_unused]] A* const rests[rows] = {to[r].part[parts - 1] + shift...};
    if (exclusive) {
        ((sums[r][-1] = A(0)), ...);
        ((rests[r][-1] = A(0)), ...);
    }
    for (std::int64_t i = 0; i < n - shift; ++i) {
        auto const add = [&]<std::size_t row>() {
            A const v = values[row][i], next = sum[row] + v;
            if constexpr (parts == 2) {
                rest[row] += lost(sum[row], v, next) + lost_before[row][i];
                rests[row][i] = rest[row];
            }
            sums[row][i] = sum[row] = next;
        };
        (add.template operator()<r>(), ...);
    }
}

template <class A, int parts> class Scanner {
public:
    using S = Sums<A, parts>;

    Scanner(ScanState& state, ConstView in, AnyView out) : state_(state), in_(in), out_(out), n_(in.dims()) {
        std::size_t const each = sizeof(A) * parts;
        columns_ = state.dims.x * state.dims.y;
        voxels_ = in.box.voxels();
        bool const first = in.box.lower == Index3{};
        state.along_z.reserve(static_cast<std::size_t>(columns_) * each);
        state.above.reserve(static_cast<std::size_t>(state.dims.x) * each);
        along_z_ = state.along_z.update(Space::host);
        above_ = state.above.update(Space::host);
        if (first) std::fill_n(reinterpret_cast<A*>(along_z_), columns_ * parts, A(0));
    }

    void run(Losses& losses, Execution const& execution) {
        int const threads = threads_for(execution, voxels_);
        if (n_.z >= std::int64_t{2} * threads)
            run_staggered(threads, losses);
        else
            run_in_two_steps(threads, losses);
    }

private:
    static constexpr std::int64_t most_columns = 512;
    static constexpr int together = sizeof(A) * parts > 8 ? 4 : 8;

    /// Calls f(y, rows) for the rows of so many times `together` of them, `rows` being a constant.
    template <class F> void for_each_rows(std::int64_t begin, std::int64_t end, F const& f) const {
        for (std::int64_t y = together * begin; y < std::min(together * end, n_.y); y += together) {
            if (y + together <= n_.y)
                f(y, std::integral_constant<int, together>{});
            else
                for (std::int64_t last = y; last < n_.y; ++last) f(last, std::integral_constant<int, 1>{});
        }
    }
    /// Room for n sums along x.
    std::byte* take_rows(std::int64_t n) {
        state_.rows.reserve(static_cast<std::size_t>(n) * sizeof(A) * parts);
        return state_.rows.write(Space::host);
    }
    std::int64_t groups() const { return (n_.y + together - 1) / together; }

    /// Each thread has rows of all slices, and a slice behind the one that has the rows before: the sums along y go on
    /// from there. So nothing but the sums along z leaves the nearest caches.
    void run_staggered(int threads, Losses& losses) {
        threads = static_cast<int>(std::min<std::int64_t>(threads, groups()));
        std::vector<std::atomic<std::int64_t>> done(static_cast<std::size_t>(threads));
        // Rows on their way, and sums along y after the last of a thread's rows in each slice.
        std::int64_t const own = std::int64_t{threads} * together * n_.x, handed = threads * n_.z * n_.x;
        std::byte* const rows = take_rows(own + handed);
        for_each_item(threads, groups(), [&](std::int64_t begin, std::int64_t end) {
            auto const me = static_cast<std::size_t>(omp_get_thread_num());
            auto const columns = [&](std::size_t thread, std::int64_t z) {
                return S(rows, own + handed, own + (static_cast<std::int64_t>(thread) * n_.z + z) * n_.x);
            };
            alignas(64) std::uint64_t stored[most_columns] = {};
            Losses mine;
            for (std::int64_t z = 0; z < n_.z; ++z) {
                // The slice before takes as long as this one: there is hardly anything to wait for.
                while (me > 0 && done[me - 1].load(std::memory_order_acquire) <= z) sched_yield();
                S const sums = columns(me, z);
                for (std::size_t p = 0; p < parts; ++p)
                    me == 0 ? std::fill_n(sums.part[p], n_.x, A(0))
                            : std::copy_n(columns(me - 1, z).part[p], n_.x, sums.part[p]);
                for_each_rows(begin, end, [&]<int count>(std::int64_t y, std::integral_constant<int, count>) {
                    S const along_x(rows, own + handed, static_cast<std::int64_t>(me) * together * n_.x);
                    add_rows<count>(y, z, along_x);
                    for (std::int64_t x = 0; x < n_.x; x += most_columns)
                        mine +=
                            add_columns(x, std::min(most_columns, n_.x - x), z, y, count, along_x, sums.at(x), stored);
                });
                done[me].store(z + 1, std::memory_order_release);
            }
            driver::add(losses, mine);
            stream_fence();
        });
    }

    /// Of few slices: each thread has some of the rows, and then some of the columns.
    void run_in_two_steps(int threads, Losses& losses) {
        std::byte* const all = take_rows(voxels_);
        for_each_item(threads, groups(), [&](std::int64_t begin, std::int64_t end) {
            for_each_rows(begin, end, [&]<int rows>(std::int64_t y, std::integral_constant<int, rows>) {
                for (std::int64_t z = 0; z < n_.z; ++z) add_rows<rows>(y, z, S(all, voxels_, (z * n_.y + y) * n_.x));
            });
        });
        // As wide as leaves every thread some.
        std::int64_t const wanted = (threads + n_.z - 1) / n_.z;
        std::int64_t const across = std::min(most_columns, ((n_.x + wanted - 1) / wanted + 63) / 64 * 64);
        std::int64_t const pieces = (n_.x + across - 1) / across;
        bool const first = in_.box.lower.y == 0, last = in_.box.upper.y == state_.dims.y; // of the slice
        for_each_item(threads, pieces * n_.z, [&](std::int64_t begin, std::int64_t end) {
            alignas(64) A sum[most_columns * parts];
            alignas(64) std::uint64_t stored[most_columns] = {};
            Losses mine;
            for (std::int64_t item = begin; item < end; ++item) {
                std::int64_t const x = item % pieces * across, n = std::min(across, n_.x - x), z = item / pieces;
                S const sums(reinterpret_cast<std::byte*>(sum), most_columns, 0), kept(above_, n_.x, x);
                for (std::size_t p = 0; p < parts; ++p)
                    first ? std::fill_n(sums.part[p], n, A(0)) : std::copy_n(kept.part[p], n, sums.part[p]);
                mine += add_columns(x, n, z, 0, n_.y, S(all, voxels_, z * n_.y * n_.x), sums, stored);
                for (std::size_t p = 0; p < parts && !last; ++p) std::copy_n(sums.part[p], n, kept.part[p]);
            }
            driver::add(losses, mine);
            stream_fence();
        });
    }

    /// Sums along z and x of rows from y on, of a slice.
    template <int rows> void add_rows(std::int64_t y, std::int64_t z, S const& to) {
        std::array<S, rows> z_sums = each_row<rows>(S(along_z_, columns_, (in_.box.lower.y + y) * n_.x), n_.x);
        auto const x_sums = each_row<rows>(to, n_.x);
        auto const add_x = [&] {
            if constexpr (parts == 1 && sizeof(A) == 8 && rows % lane_count<A> == 0)
                add_along_blocks<A>(n_.x, state_.exclusive, z_sums[0].part[0], x_sums[0].part[0], n_.x, rows);
            else
                add_along<A, parts>(n_.x, state_.exclusive, z_sums, x_sums, std::make_index_sequence<rows>{});
        };
        if (state_.exclusive) add_x();
        for (int r = 0; r < rows; ++r)
            add_voxels(in_.at(in_.box.lower.x, in_.box.lower.y + y + r, in_.box.lower.z + z), z_sums[r]);
        if (!state_.exclusive) add_x();
    }
    template <int rows> static std::array<S, rows> each_row(S const& first, std::int64_t step) {
        return [&]<std::size_t... r>(std::index_sequence<r...>) {
            return std::array<S, rows>{first.at(static_cast<std::int64_t>(r) * step)...};
        }
        (std::make_index_sequence<rows>{});
    }

    /// Adds a row of voxels. Here alone it counts which type they have.
    void add_voxels(std::byte const* from, S const& sums) {
        with_type(in_.type, [&]<class T>(T) {
            constexpr bool reals = std::is_same_v<A, double>;
            if constexpr (std::is_integral_v<T> != reals)
                if (!reals || state_.map == ValueMap{})
                    return add_values<A, parts>(n_.x, sums.part[0], sums.part[parts - 1],
                                                reinterpret_cast<T const*>(from));
            if constexpr (reals) add_mapped(from, sums);
        });
    }
    /// The same of values that are not what is stored.
    void add_mapped(std::byte const* from, S const& sums) {
        for (std::int64_t x = 0; x < n_.x; x += row_piece) {
            alignas(64) double values[row_piece];
            std::int64_t const m = std::min(row_piece, n_.x - x);
            load_row(in_.type, from + static_cast<std::size_t>(x) * size_of(in_.type), values, m);
            if (!(state_.map == ValueMap{})) {
                double const slope = state_.map.slope, intercept = state_.map.intercept;
#pragma omp simd
                for (std::int64_t i = 0; i < m; ++i) values[i] = slope * values[i] + intercept;
            }
            add_values<A, parts>(m, sums.part[0] + x, sums.part[parts - 1] + x, static_cast<double const*>(values));
        }
    }

    /// Sums along y of the columns [x, x + n) of some rows of a slice, whose sums along x are `from`; `sums` are those
    /// of the rows before, `stored` room for as many.
    Losses add_columns(std::int64_t x, std::int64_t n, std::int64_t z, std::int64_t first, std::int64_t rows,
                       S const& from, S const& sums, std::uint64_t* stored) {
        A *const sum = sums.part[0], *const rest = sums.part[parts - 1];
        std::int64_t clipped = 0, undefined = 0;
        for (std::int64_t r = 0; r < rows; ++r) {
            S const row = from.at(r * n_.x + x);
            std::byte* const to = out_.at(out_.box.lower.x + x, out_.box.lower.y + first + r, out_.box.lower.z + z);
            std::size_t const bytes = static_cast<std::size_t>(n) * 8;
            if (state_.exclusive) stream_bytes(to, results(n, sum, rest, stored, clipped, undefined), bytes);
            A const *const values = row.part[0], *const lost_before = row.part[parts - 1];
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) {
                A const v = values[i], next = sum[i] + v;
                if constexpr (parts == 2) rest[i] += lost(sum[i], v, next) + lost_before[i];
                sum[i] = next;
            }
            if (!state_.exclusive) stream_bytes(to, results(n, sum, rest, stored, clipped, undefined), bytes);
        }
        Losses losses;
        losses.clipped = clipped;
        losses.undefined = undefined;
        return losses;
    }

    /// What is stored: the sums themselves, or `stored`.
    std::byte const* results(std::int64_t n, A const* sum, A const* rest, std::uint64_t* stored, std::int64_t& clipped,
                             std::int64_t& undefined) const {
        if constexpr (std::is_same_v<A, double>) {
            auto* const to = reinterpret_cast<double*>(stored);
            std::int64_t nan = 0;
#pragma omp simd reduction(+ : nan)
            for (std::int64_t i = 0; i < n; ++i) {
                double const s = sum[i];
                bool const finite = s - s == 0;
                // The sign of NaN would tell which of two was the first operand, and with it how slabs were cut.
                to[i] = !(s == s) ? std::numeric_limits<double>::quiet_NaN() : parts == 2 && finite ? s + rest[i] : s;
                nan += finite ? 0 : 1;
            }
            undefined += nan;
            return reinterpret_cast<std::byte const*>(stored);
        } else if constexpr (sizeof(A) == 8) {
            return reinterpret_cast<std::byte const*>(sum);
        } else {
            bool const is_signed = out_.type == DataType::int64;
            for (std::int64_t i = 0; i < n; ++i) {
                stored[i] = is_signed ? static_cast<std::uint64_t>(round_to<std::int64_t>(sum[i]))
                                      : round_to<std::uint64_t>(sum[i]);
                clipped += (is_signed ? is_clipped<std::int64_t>(sum[i]) : is_clipped<std::uint64_t>(sum[i])) ? 1 : 0;
            }
            return reinterpret_cast<std::byte const*>(stored);
        }
    }

    ScanState& state_;
    ConstView in_;
    AnyView out_;
    Index3 n_;
    std::int64_t columns_ = 0, voxels_ = 0;
    std::byte *along_z_ = nullptr, *above_ = nullptr;
};

} // namespace

void scan_slab(ScanState& state, ConstView in, AnyView out, Losses& losses, Execution const& execution) {
    switch (state.sums) {
    case ScanSums::whole:
        return Scanner<std::uint64_t, 1>(state, in, out).run(losses, execution);
    case ScanSums::wide:
        return Scanner<Int128, 1>(state, in, out).run(losses, execution);
    case ScanSums::real:
        return Scanner<double, 1>(state, in, out).run(losses, execution);
    case ScanSums::pairs:
        return Scanner<double, 2>(state, in, out).run(losses, execution);
    }
}

} // namespace VKT_BACKEND
} // namespace vkt
