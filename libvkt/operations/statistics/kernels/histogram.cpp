// Counting: bins are guessed by a multiplication and corrected by the edges; each item of work has counters of its own.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/histogram.h"

#include "libvkt/kernel/closed_range.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Asks for the bytes that follow a piece of a row: counting takes so long that the processor does not look that far.
void read_ahead(std::byte const* from, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; i += 64) __builtin_prefetch(from + bytes + i);
}

/// Slots of a piece of a row.
using Slots = std::int32_t[row_piece];

/// What guessing and correcting needs, without indirections.
struct Rule {
    explicit Rule(Bins const& of)
        : bins(of), edges(of.edges()), count(of.count()), slope(bins.map().slope), intercept(bins.map().intercept),
          scale(bins.scale()), scaled_low(bins.scaled_low()), per_unit(bins.per_unit()),
          doubtful_share(bins.far() ? 1 : 0x1p-16) {}

    Bins const& bins;
    double const* edges;
    std::int32_t count;
    double slope, intercept, scale, scaled_low, per_unit;
    /// Values this near to an edge, in bins, may lie on its other side: guesses and edges are off by a few parts in
    /// 2^53 of the number of bins and of the distance of the range from 0 in bins.
    double doubtful_share;
};

std::int32_t correct(double value, std::int32_t k, double const* edges, std::int32_t count) {
    while (k > 0 && value < edges[k]) --k;
    while (k + 1 < count && value >= edges[k + 1]) ++k;
    return k;
}

void place(Rule const& rule, double const* values, std::int64_t n, std::int32_t* slots) {
    double const* const edges = rule.edges;
    double const slope = rule.slope, intercept = rule.intercept, scale = rule.scale, scaled_low = rule.scaled_low,
                 per_unit = rule.per_unit, low = edges[0], high = edges[rule.count], last = rule.count - 1.0,
                 near = rule.doubtful_share;
    // Many voxels may be the ends, background and what was clipped: those are in no doubt, if they are guessed well.
    auto const unless_doubtful = [&](double value, std::int32_t guess) {
        double const at = (value * scale - scaled_low) * per_unit;
        bool const guessed = guess == 0 ? at < 1 : at >= last;
        return guessed && correct(value, guess, edges, rule.count) == guess ? value
                                                                            : std::numeric_limits<double>::quiet_NaN();
    };
    double const first = unless_doubtful(low, 0), end = unless_doubtful(high, rule.count - 1), far = 1 - near;
    std::int32_t const count = rule.count;
    std::int32_t doubtful = 0;
#pragma omp simd reduction(+ : doubtful)
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
        double const value = slope * values[i] + intercept;
        double at = (value * scale - scaled_low) * per_unit;
        at = at > 0 ? at : 0; // NaN becomes 0
        double const bounded = at < last ? at : last;
        auto const k = static_cast<std::int32_t>(bounded);
        double const rest = at - static_cast<double>(k);
        // `lost`: a product beyond double.
        std::int32_t const above = value >= low ? 1 : 0, below = value <= high ? 1 : 0, inside = above & below,
                           lost = (value - value == 0 ? 0 : 1) & (values[i] - values[i] == 0 ? 1 : 0),
                           within = (value != first ? 1 : 0) & (value != end ? 1 : 0),
                           at_edge = (rest < near ? 1 : 0) | (rest > far ? 1 : 0);
        doubtful += (inside & within & at_edge) | lost;
        std::int32_t const outside = value < low ? count : value > high ? count + 1 : count + 2;
        slots[i] = inside != 0 ? k : outside;
    }
    if (doubtful == 0) return;
    for (std::int64_t i = 0; i < n; ++i) {
        double const value = slope * values[i] + intercept;
        if (slots[i] < count)
            slots[i] = correct(value, slots[i], edges, count);
        else if (!(value - value == 0) && values[i] - values[i] == 0)
            slots[i] = rule.bins.slot_of(values[i]);
    }
}

/// Guesses in float32, in which twice as many fit into a register, for voxels that it holds.
struct SingleRule {
    float scale = 1, offset = 0; ///< a voxel v is guessed to lie in bin v * scale - offset
    float low = 0, high = 0;     ///< the first and the last voxel in the range
    float near = 1;              ///< as doubtful_share
    float last = 0;              ///< bin
    /// The same in parts of a bin, of which it has 2^shift, so that all of them together are less than 2^24: whole
    /// numbers are compared with less effort.
    std::int32_t shift = 8, fine_near = 0;
    float fine_scale = 1, fine_offset = 0, fine_most = 0;
    bool usable = false; ///< few voxels are doubtful, and there is no value map

    SingleRule(Rule const& rule, DataType type) {
        if (type != DataType::float32 || rule.slope != 1 || rule.intercept != 0 || rule.scale != 1) return;
        double const first = rule.edges[0], end = rule.edges[rule.count];
        scale = static_cast<float>(rule.per_unit);
        offset = static_cast<float>(rule.scaled_low * rule.per_unit);
        low = least_from<float>(first);
        high = greatest_to<float>(end);
        // Factor, product and offset are each off by up to 2^-24 of the distance from 0 in bins, the difference by as
        // much of itself; twice all that.
        double const far = std::max(std::abs(first), std::abs(end)) * rule.per_unit;
        double const off = (3 * far + rule.count) * 0x1p-23;
        near = static_cast<float>(off);
        last = static_cast<float>(rule.count - 1);
        while (std::int64_t{rule.count} << (shift + 1) <= 1 << 24) ++shift;
        auto const parts = static_cast<float>(std::int32_t{1} << shift);
        fine_scale = scale * parts;
        fine_offset = offset * parts;
        fine_most = static_cast<float>(rule.count) * parts;
        // The numbers are rounded down.
        fine_near = static_cast<std::int32_t>(std::min(std::ceil(off * static_cast<double>(parts)), 0x1p24)) + 1;
        // Nothing here may get lost below the least normal number, nor beyond the largest.
        usable = off < 0x1p-6 && rule.per_unit > 0x1p-60 && rule.per_unit < 0x1p60 && first > -0x1p60 && end < 0x1p60;
    }
};

/// Slots of values of which some are outside of the range or doubtful; at most as many as are corrected together.
void place_with_care(Rule const& rule, SingleRule const& single, float const* from, std::int32_t m, std::int32_t* to) {
    float const scale = single.scale, offset = single.offset, low = single.low, high = single.high, last = single.last,
                near = single.near, far = 1 - single.near;
    std::int32_t const count = rule.count;
    std::int32_t doubtful = 0;
#pragma omp simd reduction(+ : doubtful)
    for (std::int32_t i = 0; i < m; ++i) {
        float const value = from[i];
        float at = value * scale - offset;
        at = at > 0 ? at : 0; // NaN becomes 0
        float const bounded = at < last ? at : last;
        auto const k = static_cast<std::int32_t>(bounded);
        float const rest = at - static_cast<float>(k);
        std::int32_t const above = value >= low ? 1 : 0, below = value <= high ? 1 : 0;
        doubtful += (above & below) & ((rest < near ? 1 : 0) | (rest > far ? 1 : 0));
        std::int32_t const outside = value < low ? count : value > high ? count + 1 : count + 2;
        to[i] = (above & below) != 0 ? k : outside;
    }
    if (doubtful == 0) return;
    for (std::int32_t i = 0; i < m; ++i)
        if (to[i] < count) to[i] = correct(static_cast<double>(from[i]), to[i], rule.edges, count);
}

constexpr std::int64_t part = 16; ///< floats that are looked at together

/// Guesses the slots of parts and calls beside(i) after each. Returns true if all of them are in the range and well
/// within bins: what is below the range or NaN is taken for its lower end, what is above it for the upper one, which
/// are edges. With `ends`, voxels that are one of them, as background and what was clipped are, are well within the
/// first and the last bin. The rule arrives by value: the compiler then knows that slots are no part of it.
template <bool ends, class Beside>
bool place_parts(SingleRule const single, float const* from, std::int64_t n, std::int32_t* to, Beside const& beside) {
    using Whole = Lanes<std::int32_t>;
    std::int32_t const shift = single.shift, up = 32 - shift, half = std::int32_t{1} << (shift - 1),
                       near = single.fine_near + half, least = (2 * single.fine_near - half) << up;
    Lanes<float> const zero{}, most = zero + single.fine_most, low = zero + single.low, high = zero + single.high;
    Whole nearest = Whole{} + std::numeric_limits<std::int32_t>::max();
    for (std::int64_t begin = 0; begin < n; begin += part) {
#pragma GCC unroll 4
        for (std::int64_t i = begin; i < begin + part; i += lane_count<float>) {
            Lanes<float> const value = load_lanes(from + i);
            Lanes<float> at = value * single.fine_scale - single.fine_offset;
            at = at > zero ? at : zero; // NaN becomes 0
            at = at < most ? at : most;
            auto fine = __builtin_convertvector(at, Whole);
            if constexpr (ends) {
                fine = value == low ? fine + half : fine;
                fine = value == high ? fine - half : fine;
            }
            store_lanes<std::int32_t>(to + i, fine >> shift);
            Whole const beyond = (fine + near) << up;
            nearest = beyond < nearest ? beyond : nearest;
        }
        beside(begin);
    }
    std::int32_t lanes[lane_count<std::int32_t>], lowest = least;
    store_lanes<std::int32_t>(lanes, nearest);
    for (std::int32_t const lane : lanes) lowest = std::min(lowest, lane);
    return lowest >= least;
}

/// Calls beside(i) after every part, i voxels having been placed before it.
template <class Beside>
void place(Rule const& rule, SingleRule const& single, float const* values, std::int64_t n, std::int32_t* slots,
           Beside beside) {
    // Most blocks are clear, and no more is looked at then.
    constexpr std::int64_t block = 8 * part;
    for (std::int64_t begin = 0; begin < n; begin += block) {
        std::int64_t const end = std::min(n, begin + block), whole = begin + (end - begin) / part * part;
        bool const clear = place_parts<false>(single, values + begin, whole - begin, slots + begin,
                                              [&](std::int64_t i) { beside(begin + i); }) ||
                           place_parts<true>(single, values + begin, whole - begin, slots + begin, [](std::int64_t) {});
        for (std::int64_t i = begin; i < whole && !clear; i += part)
            place_with_care(rule, single, values + i, part, slots + i);
        if (whole < end)
            place_with_care(rule, single, values + whole, static_cast<std::int32_t>(end - whole), slots + whole);
    }
}

/// 64-bit integers, from the first edge on.
void place(Rule const& rule, Int128 const* values, std::int64_t n, std::int32_t* slots) {
    Int128 const* const edges = rule.bins.whole_edges();
    Int128 const base = edges[0], highest = rule.bins.highest();
    std::int32_t const count = rule.count;
    for (std::int64_t i = 0; i < n; ++i) {
        Int128 const value = values[i];
        if (value < base || value > highest) {
            slots[i] = value < base ? count : count + 1;
            continue;
        }
        double const at = (static_cast<double>(value - base) - rule.scaled_low) * rule.per_unit;
        auto k = static_cast<std::int32_t>(at < count - 1 ? at : count - 1);
        while (k > 0 && value < edges[k]) --k;
        while (k + 1 < count && value >= edges[k + 1]) ++k;
        slots[i] = k;
    }
}

/// One brick's voxels in a slab, or some rows of them.
struct Item {
    Index3 brick;
    Box box;                 ///< voxels of the brick in the slab
    std::int64_t begin, end; ///< rows of the box
    bool shared;             ///< other items count in the same brick
};

/// Equal voxels that follow one another would wait for each other's counter: neighbours have sets of their own.
class Counters {
public:
    explicit Counters(std::size_t slots)
        : slots_(slots), sets_(slots <= 1024 ? 4 : 2), counters_(slots * static_cast<std::size_t>(sets_)) {}

    void clear() {
        std::fill(counters_.begin(), counters_.end(), 0);
        std::fill(ones_.begin(), ones_.end(), 0);
    }

    /// at(i): the slot of voxel i. The first and the last voxel have weights of their own.
    template <class At> void add(std::int64_t n, std::uint64_t first, std::uint64_t weight, std::uint64_t last, At at) {
        std::uint64_t* const a = counters_.data();
        a[at(0)] += first;
        if (n > 1) a[at(n - 1)] += last;
        std::int64_t i = 1;
        if (sets_ == 4) {
            std::uint64_t *const b = a + slots_, *const c = b + slots_, *const d = c + slots_;
            for (; i + 4 < n; i += 4) {
                a[at(i)] += weight;
                b[at(i + 1)] += weight;
                c[at(i + 2)] += weight;
                d[at(i + 3)] += weight;
            }
        } else {
            std::uint64_t* const b = a + slots_;
            for (; i + 2 < n; i += 2) {
                a[at(i)] += weight;
                b[at(i + 1)] += weight;
            }
        }
        for (; i + 1 < n; ++i) a[at(i)] += weight;
    }

    // Voxels that count once, of which there may be 2^32. More sets, of smaller counters, whose places the compiler
    // knows, and several voxels in a load: what takes the time then is the one store a cycle that a processor makes.

    /// slot_of(v[i]) is the slot of voxel i.
    template <class V, class SlotOf> void add_ones(std::int64_t n, V const* v, SlotOf slot_of) {
        std::uint32_t* const to = ones();
        std::int64_t i = 0;
        for (; i + 8 <= n; i += 8) add_eight(to, v + i, slot_of);
        for (; i < n; ++i) ++to[slot_of(v[i])];
    }
    std::uint32_t* ones() {
        ones_.resize(8 * apart);
        return ones_.data();
    }
    template <class V, class SlotOf> static void add_eight(std::uint32_t* to, V const* v, SlotOf slot_of) {
        constexpr std::int64_t in_word = 8 / sizeof(V);
#pragma GCC unroll 8
        for (std::int64_t word = 0; word < 8; word += in_word) {
            std::uint64_t bits;
            std::memcpy(&bits, v + word, sizeof bits);
#pragma GCC unroll 8
            for (std::int64_t k = 0; k < in_word; ++k)
                ++to[(word + k) * apart + slot_of(static_cast<V>(bits >> (8 * sizeof(V) * k)))];
        }
    }
    bool takes_ones() const { return slots_ <= most_in_ones; }

    /// A counter, all 0, for each pattern of 16 bits.
    std::uint32_t* words() {
        words_.assign(65536, 0);
        return words_.data();
    }
    /// Adds what was counted of words to the counters of their slots, or of their two bytes where there is no table.
    void add_words(std::int32_t const* slot_of_word) {
        std::uint32_t const* const counts = words_.data();
        for (std::size_t high = 0; high < 256; ++high) {
            std::uint64_t sum = 0;
            for (std::size_t low = 0; low < 256; ++low) {
                std::uint32_t const count = counts[256 * high + low];
                if (slot_of_word == nullptr)
                    counters_[low] += count;
                else if (count != 0)
                    counters_[static_cast<std::size_t>(slot_of_word[256 * high + low])] += count;
                sum += count;
            }
            if (slot_of_word == nullptr) counters_[high] += sum;
        }
    }

    /// `place` is the slot of each counter, or null where they are the slots.
    void add_to(std::uint64_t* counts, bool shared, std::int32_t const* place) const {
        for (std::size_t s = 0; s < slots_; ++s) {
            std::uint64_t sum = 0;
            for (std::size_t i = s; i < counters_.size(); i += slots_) sum += counters_[i];
            for (std::size_t i = s; i < ones_.size(); i += apart) sum += ones_[i];
            if (sum == 0) continue;
            std::uint64_t& count = counts[place != nullptr ? static_cast<std::size_t>(place[s]) : s];
            if (shared) {
#pragma omp atomic
                count += sum;
            } else {
                count += sum;
            }
        }
    }

private:
    static constexpr std::size_t most_in_ones = 264;
    static constexpr std::int64_t apart = 264;

    std::size_t slots_;
    int sets_;
    std::vector<std::uint64_t> counters_;
    std::vector<std::uint32_t> ones_, words_;
};

/// Voxels of one byte have a counter for each of their patterns.
bool by_byte(Bins const& bins, DataType type) { return !bins.table().empty() && size_of(type) == 1; }

/// Calls f(from, m, x, y, z) for pieces of the item's rows.
template <class F> void for_each_piece(ConstView in, Item const& item, F const& f) {
    std::int64_t const x0 = item.box.lower.x, n = item.box.dims().x, rows = item.box.dims().y;
    for (std::int64_t row = item.begin; row < item.end; ++row) {
        std::int64_t const y = item.box.lower.y + row % rows, z = item.box.lower.z + row / rows;
        for (std::int64_t begin = 0; begin < n; begin += row_piece) {
            std::int64_t const m = std::min(row_piece, n - begin);
            std::byte const* const from = in.at(x0 + begin, y, z);
            f(from, m, x0 + begin, y, z);
        }
    }
}

/// Voxels of two bytes that count once, or pairs of voxels of one, by their patterns: neither is looked up, and a pair
/// takes one store. Those of a volume are few, so that most of their counters stay in the nearest cache.
void count_words(ConstView in, Bins const& bins, Item const& item, Counters& counters) {
    std::uint32_t* const counts = counters.words();
    bool const bytes = size_of(in.type) == 1;
    for_each_piece(in, item, [&](std::byte const* from, std::int64_t m, auto...) {
        read_ahead(from, static_cast<std::size_t>(m) * size_of(in.type));
        std::int64_t const words = bytes ? m / 2 : m;
        std::int64_t i = 0;
        for (; i + 4 <= words; i += 4) {
            std::uint64_t bits;
            std::memcpy(&bits, from + 2 * i, sizeof bits);
#pragma GCC unroll 4
            for (int k = 0; k < 4; ++k) ++counts[static_cast<std::uint16_t>(bits >> (16 * k))];
        }
        for (; i < words; ++i) {
            std::uint16_t word;
            std::memcpy(&word, from + 2 * i, sizeof word);
            ++counts[word];
        }
        if (bytes && m % 2 != 0) counters.add(1, 1, 1, 1, [&](std::int64_t) { return static_cast<int>(from[m - 1]); });
    });
    counters.add_words(bytes ? nullptr : bins.table().data());
}
/// From how many voxels on that is worth while.
constexpr std::int64_t worth_words = std::int64_t{1} << 18;

/// Voxels of float32 that count once. A piece is counted while the next one is placed, part by part: the one waits for
/// stores, the other for arithmetic.
void count_floats(ConstView in, Rule const& rule, SingleRule const& single, Item const& item, Counters& counters) {
    alignas(64) Slots slots[2];
    std::uint32_t* const ones = counters.ones();
    std::int64_t placed = 0;
    int now = 0;
    auto const slot = [](std::int32_t s) { return s; };
    for_each_piece(in, item, [&](std::byte const* from, std::int64_t m, auto...) {
        std::int32_t const* const before = slots[1 - now];
        std::int64_t counted = 0;
        place(rule, single, reinterpret_cast<float const*>(from), m, slots[now], [&](std::int64_t i) {
            __builtin_prefetch(reinterpret_cast<float const*>(from) + row_piece + i);
            if (i + part > placed) return;
            Counters::add_eight(ones, before + i, slot);
            Counters::add_eight(ones, before + i + 8, slot);
            counted = i + part;
        });
        counters.add_ones(placed - counted, before + counted, slot);
        placed = m;
        now = 1 - now;
    });
    counters.add_ones(placed, static_cast<std::int32_t const*>(slots[1 - now]), slot);
}

void count_item(ConstView in, Rule const& rule, SingleRule const& single, BrickGrid const& grid, Item const& item,
                Counters& counters) {
    std::int64_t const x0 = item.box.lower.x, n = item.box.dims().x;
    auto const weight = [](std::int64_t w) { return static_cast<std::uint64_t>(w); };
    std::int64_t const first = grid.share(0, x0, item.brick.x), last = grid.share(0, x0 + n - 1, item.brick.x),
                       whole = grid.bricks.x;
    std::int32_t const* const table = rule.bins.table().data();
    bool const by_table = !rule.bins.table().empty(), wide = rule.bins.wide();
    bool const bytes = by_byte(rule.bins, in.type), in_single = single.usable && in.type == DataType::float32;
    bool const once = grid.count() == 1 && item.box.voxels() >> 32 == 0, ones = once && counters.takes_ones();
    if (once && by_table && (item.end - item.begin) * n >= worth_words)
        return count_words(in, rule.bins, item, counters);
    if (ones && in_single) return count_floats(in, rule, single, item, counters);
    auto const add = [&](std::int64_t m, std::uint64_t left, std::uint64_t full, std::uint64_t right, auto const* v,
                         auto slot_of) {
        if (ones)
            counters.add_ones(m, v, slot_of);
        else
            counters.add(m, left, full, right, [=](std::int64_t i) { return slot_of(v[i]); });
    };
    for_each_piece(
        in, item, [&](std::byte const* from, std::int64_t m, std::int64_t x, std::int64_t y, std::int64_t z) {
            read_ahead(from, static_cast<std::size_t>(m) * size_of(in.type));
            std::int64_t const share = grid.share(1, y, item.brick.y) * grid.share(2, z, item.brick.z);
            // Pieces within a row end in voxels of full weight.
            std::uint64_t const left = weight(share * (x == x0 ? first : whole)),
                                right = weight(share * (x + m == x0 + n ? last : whole)), full = weight(share * whole);
            if (bytes) {
                auto const* const voxels = reinterpret_cast<std::uint8_t const*>(from);
                add(m, left, full, right, voxels, [](std::uint8_t v) { return v; });
            } else if (by_table) {
                auto const* const voxels = reinterpret_cast<std::uint16_t const*>(from);
                add(m, left, full, right, voxels, [=](std::uint16_t v) { return table[v]; });
            } else {
                alignas(64) Slots slots;
                if (in_single) {
                    place(rule, single, reinterpret_cast<float const*>(from), m, slots, [](std::int64_t) {});
                } else if (wide) {
                    alignas(64) Int128 values[row_piece];
                    load_row(in.type, from, values, m);
                    place(rule, values, m, slots);
                } else {
                    alignas(64) double values[row_piece];
                    place(rule, driver::row_of<double>(in, x, y, z, m, values), m, slots);
                }
                add(m, left, full, right, static_cast<std::int32_t const*>(slots),
                    [](std::int32_t slot) { return slot; });
            }
        });
}

/// The parts of bricks in a slab; those with more rows than a thread's share are cut.
std::vector<Item> items_of(Box const& slab, BrickGrid const& grid, std::size_t slots, int threads) {
    std::vector<Item> items;
    std::int64_t bricks = 0;
    for_each_brick(slab, grid, [&](Index3, Box const&) { ++bricks; });
    // Bricks end where they do; a single one is cut as threads share it.
    std::int64_t const wanted = grid.count() == 1 ? threads : std::int64_t{4} * threads;
    for_each_brick(slab, grid, [&](Index3 brick, Box const& box) {
        std::int64_t const rows = box.dims().y * box.dims().z;
        // Adding up counters must not cost more than counting.
        std::int64_t const worth = box.voxels() / (8 * static_cast<std::int64_t>(slots));
        std::int64_t const pieces =
            threads == 1 ? 1 : std::clamp<std::int64_t>(std::min((wanted + bricks - 1) / bricks, worth), 1, rows);
        for (std::int64_t i = 0; i < pieces; ++i)
            items.push_back({brick, box, i * rows / pieces, (i + 1) * rows / pieces, pieces > 1});
    });
    return items;
}

} // namespace

void count_in_bins(ConstView in, Bins const& bins, BrickGrid const& grid, std::uint64_t* counts,
                   Execution const& execution) {
    Box const slab = intersect(in.box, grid.box);
    if (slab.empty()) return;
    int const threads = threads_for(execution, slab.voxels());
    std::vector<Item> const items = items_of(slab, grid, bins.slots(), threads);
    Rule const rule(bins);
    SingleRule const single(rule, in.type);
    bool const bytes = by_byte(bins, in.type);
    for_each_item(threads, static_cast<std::int64_t>(items.size()), [&](std::int64_t begin, std::int64_t end) {
        Counters counters(bytes ? 256 : bins.slots());
        for (std::int64_t i = begin; i < end; ++i) {
            Item const& item = items[static_cast<std::size_t>(i)];
            counters.clear();
            count_item(in, rule, single, grid, item, counters);
            std::int64_t const brick = item.brick.x + grid.bricks.x * (item.brick.y + grid.bricks.y * item.brick.z);
            counters.add_to(counts + static_cast<std::size_t>(brick) * bins.slots(), item.shared,
                            bytes ? bins.table().data() : nullptr);
        }
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
