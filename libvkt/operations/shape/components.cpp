// Components: threads join the runs of rows of their own, then the rows between them are joined.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/components.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <span>

namespace vkt {
namespace {

constexpr std::int64_t rows_at_once = 16; ///< their bits stay in the first cache

std::uint32_t root_of(LargeVector<std::uint32_t>& parent, std::uint32_t i) {
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

/// The smaller root wins: roots are first in x-fastest order.
void unite(LargeVector<std::uint32_t>& parent, std::uint32_t a, std::uint32_t b) {
    if (parent[a] == parent[b]) return;
    a = root_of(parent, a);
    b = root_of(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

void merge(Components::Component& into, Components::Component const& from) {
    into.size += from.size;
    into.sum_x += from.sum_x;
    into.sum_y += from.sum_y;
    into.sum_z += from.sum_z;
    into.lower_x = std::min(into.lower_x, from.lower_x);
    into.lower_y = std::min(into.lower_y, from.lower_y);
    into.lower_z = std::min(into.lower_z, from.lower_z);
    into.upper_x = std::max(into.upper_x, from.upper_x);
    into.upper_y = std::max(into.upper_y, from.upper_y);
    into.upper_z = std::max(into.upper_z, from.upper_z);
}

Components::Component of_run(std::int32_t first, std::int32_t beyond, std::int32_t y, std::int32_t z) {
    Components::Component c;
    auto const n = static_cast<std::uint64_t>(beyond - first);
    c.size = n;
    c.sum_x = n * static_cast<std::uint64_t>(first) + n * (n - 1) / 2;
    c.sum_y = n * static_cast<std::uint64_t>(y);
    c.sum_z = n * static_cast<std::uint64_t>(z);
    c.lower_x = first;
    c.upper_x = beyond;
    c.lower_y = y;
    c.upper_y = y + 1;
    c.lower_z = z;
    c.upper_z = z + 1;
    return c;
}

/// A voxel's value, such that equal values have equal keys.
std::uint64_t key_of(std::byte const* voxel, DataType type) {
    std::uint64_t key = 0;
    with_type(type, [&]<class T>(T) {
        T v;
        std::memcpy(&v, voxel, sizeof v);
        if constexpr (std::is_integral_v<T>)
            key = static_cast<std::uint64_t>(v);
        else
            key = std::bit_cast<std::uint64_t>(static_cast<double>(v) + 0.0); // -0 is 0
    });
    return key;
}

[[noreturn]] void too_many(std::string const& what) {
    throw Error(ErrorKind::resources, what, "raise --memory, or smooth the volume so that it has fewer components");
}

} // namespace

void Components::Runs::clear(std::int64_t row) {
    edges.clear();
    bits.clear();
    values.clear();
    component.clear();
    begin.assign(1, 0);
    first_row = row;
}

/// `words`: of the bits of a row.
void Components::Runs::drop_before(std::int64_t row, std::int64_t words) {
    auto const rows_gone = static_cast<std::ptrdiff_t>(std::clamp<std::int64_t>(row - first_row, 0, rows()));
    std::size_t const runs = begin[static_cast<std::size_t>(rows_gone)];
    auto const gone = static_cast<std::ptrdiff_t>(runs);
    edges.erase(edges.begin(), edges.begin() + 2 * gone);
    if (!bits.empty()) bits.erase(bits.begin(), bits.begin() + rows_gone * words);
    if (!values.empty()) values.erase(values.begin(), values.begin() + gone);
    component.erase(component.begin(), component.begin() + gone);
    begin.erase(begin.begin(), begin.begin() + rows_gone);
    for (std::size_t& b : begin) b -= runs;
    first_row += rows_gone;
}

std::size_t Components::Runs::bytes() const {
    return edges.size() * sizeof edges[0] + bits.size() * sizeof bits[0] + values.size() * sizeof values[0] +
           component.size() * sizeof component[0];
}

void Components::Runs::append(Runs const& next, std::uint32_t components) {
    std::size_t const runs = component.size();
    edges.insert(edges.end(), next.edges.begin(), next.edges.end());
    bits.insert(bits.end(), next.bits.begin(), next.bits.end());
    values.insert(values.end(), next.values.begin(), next.values.end());
    for (std::uint32_t const c : next.component) component.push_back(components + c);
    for (std::size_t i = 1; i < next.begin.size(); ++i) begin.push_back(runs + next.begin[i]);
}

std::size_t Components::table_bytes(Index3 dims) {
    return static_cast<std::size_t>(dims.y * dims.z) * 4 + static_cast<std::size_t>(dims.z) * 8;
}

void Components::begin(Index3 dims, Rules const& rules) {
    std::int64_t const longest = std::max({dims.x, dims.y, dims.z});
    if (longest > std::numeric_limits<std::int32_t>::max() ||
        static_cast<double>(dims.x * dims.y * dims.z) * static_cast<double>(longest) >= 0x1p63)
        throw Error(ErrorKind::resources, "components are found in volumes of less than 2^31 voxels along each axis",
                    "crop the volume: vkt crop");
    dims_ = dims;
    rules_ = rules;
    kept_.clear(0);
    parent_.clear();
    components_.clear();
    run_names_.clear();
    row_begin_.clear();
    slice_begin_.clear();
    row_begin_.reserve(static_cast<std::size_t>(dims.y * dims.z));
}

/// A run begins where bits begin or values change, and ends where bits end or the next run begins. The edges have room
/// for two a voxel. Returns how many there are.
std::size_t Components::edges_of(std::uint64_t const* bits, std::uint64_t const* changed, std::int32_t* edges) const {
    std::int64_t const words = bit_words(dims_.x);
    std::int32_t* to = edges;
    std::uint64_t before = 0; // the last bit of the word before
    for (std::int64_t w = 0; w < words; ++w) {
        std::uint64_t const m = bits[w], left = m << 1 | before;
        before = m >> 63;
        auto const x = static_cast<std::int32_t>(w * 64);
        std::uint64_t const inner = changed != nullptr ? changed[w] & m & left : 0; // one ends where the next begins
        for (std::uint64_t t = (m ^ left) | inner; t != 0; t &= t - 1) {
            int const bit = std::countr_zero(t);
            *to++ = x + bit;
            if (changed != nullptr && (inner >> bit & 1) != 0) *to++ = x + bit;
        }
    }
    // A row whose words are full ends without a bit that says so.
    if ((to - edges) % 2 != 0) *to++ = static_cast<std::int32_t>(dims_.x);
    return static_cast<std::size_t>(to - edges);
}

void Components::find_runs(ConstView rows, std::int64_t begin, std::int64_t end, Execution const& execution,
                           Chunk& chunk) const {
    Index3 const n = rows.dims();
    std::int64_t const words = bit_words(n.x);
    auto const block = static_cast<std::size_t>(words * rows_at_once);
    chunk.bits.resize(rules_.by_value ? 2 * block : block);
    chunk.row.resize(2 * static_cast<std::size_t>(n.x) + 2);
    Runs& runs = chunk.runs;
    runs.clear(rows.box.lower.y + rows.box.lower.z * dims_.y + begin);
    for (std::int64_t r = begin; r < end;) {
        std::int64_t const y = rows.box.lower.y + r % n.y, z = rows.box.lower.z + r / n.y;
        std::int64_t const count = std::min({rows_at_once, end - r, rows.box.upper.y - y});
        ConstView const some = rows.part({{rows.box.lower.x, y, z}, {rows.box.upper.x, y + count, z + 1}});
        std::uint64_t* const changed = rules_.by_value ? chunk.bits.data() + block : nullptr;
        pack_bits(some, rules_.members, rules_.zero, chunk.bits.data(), execution);
        if (changed != nullptr)
            pack_bits(some, BitRule::changed, {}, changed, execution);
        else
            runs.bits.insert(runs.bits.end(), chunk.bits.data(), chunk.bits.data() + count * words);
        for (std::int64_t i = 0; i < count; ++i) {
            std::size_t const first = runs.edges.size();
            std::size_t const count_here = edges_of(
                chunk.bits.data() + i * words, changed != nullptr ? changed + i * words : nullptr, chunk.row.data());
            runs.edges.insert(runs.edges.end(), chunk.row.data(), chunk.row.data() + count_here);
            if (rules_.by_value)
                for (std::size_t e = first; e < runs.edges.size(); e += 2)
                    runs.values.push_back(key_of(some.at(some.box.lower.x + runs.edges[e], y + i, z), some.type));
            runs.begin.push_back(runs.edges.size() / 2);
        }
        r += count;
    }
}

/// Calls join(a, b) for runs of two rows that touch and have one value, b being in the other row. They may reach
/// diagonally.
template <class Join>
void Components::join_values(Runs const& runs, std::int64_t row, std::int64_t other, std::int32_t reach,
                             Join const& join) const {
    auto const r = static_cast<std::size_t>(row - runs.first_row), o = static_cast<std::size_t>(other - runs.first_row);
    std::size_t a = runs.begin[r], b = runs.begin[o];
    std::size_t const a_end = runs.begin[r + 1], b_end = runs.begin[o + 1];
    std::int32_t const* const edges = runs.edges.data();
    auto const touch = [&](std::size_t i, std::size_t j) {
        if (runs.values[i] == runs.values[j]) join(i, j);
    };
    while (a < a_end && b < b_end) {
        std::int32_t const a_last = edges[2 * a + 1], b_last = edges[2 * b + 1];
        if (edges[2 * a] < b_last + reach && edges[2 * b] < a_last + reach) {
            touch(a, b);
            // Runs of other values may follow at once.
            if (a_last == b_last && a + 1 < a_end && edges[2 * a + 2] < b_last + reach) touch(a + 1, b);
        }
        // Without a branch: nobody can foretell it.
        std::size_t const first_ends = a_last < b_last ? 1 : 0;
        a += first_ends;
        b += 1 - first_ends;
    }
}

/// Joins the runs of a row with those of the rows before it that are in [least, beyond).
template <class Join>
void Components::join_rows(Runs const& runs, std::int64_t row, std::int64_t least, std::int64_t beyond,
                           std::vector<RunPair>& pairs, Execution const& execution, Join const& join) const {
    pairs.resize(static_cast<std::size_t>(dims_.x) + 2);
    std::int64_t const y = row % dims_.y, z = row / dims_.y;
    std::int32_t const edge = rules_.connectivity >= 18 ? 1 : 0, corner = rules_.connectivity >= 26 ? 1 : 0;
    auto const with = [&](std::int64_t other, std::int32_t reach) {
        if (other < least || other >= beyond) return;
        if (rules_.by_value) return join_values(runs, row, other, reach, join);
        auto const r = static_cast<std::size_t>(row - runs.first_row),
                   o = static_cast<std::size_t>(other - runs.first_row);
        auto const words = static_cast<std::size_t>(bit_words(dims_.x));
        std::int64_t count = 0;
        touching_runs(runs.bits.data() + r * words, runs.bits.data() + o * words, static_cast<std::int64_t>(words),
                      reach > 0, pairs.data(), count, execution);
        for (RunPair const& pair : std::span(pairs).first(static_cast<std::size_t>(count)))
            join(runs.begin[r] + pair.a, runs.begin[o] + pair.b);
    };
    if (y > 0) with(row - 1, edge);
    if (z == 0) return;
    with(row - dims_.y, edge);
    if (rules_.connectivity == 6) return;
    if (y > 0) with(row - dims_.y - 1, corner);
    if (y + 1 < dims_.y) with(row - dims_.y + 1, corner);
}

void Components::join_within(ConstView rows, Chunk& chunk, Execution const& execution) const {
    Runs& runs = chunk.runs;
    std::size_t const count = runs.edges.size() / 2;
    LargeVector<std::uint32_t>& parent = chunk.parent;
    parent.resize(count);
    for (std::size_t i = 0; i < count; ++i) parent[i] = static_cast<std::uint32_t>(i);
    std::int64_t const first = runs.first_row, last = first + runs.rows();
    for (std::int64_t row = first; row < last; ++row)
        join_rows(runs, row, first, last, chunk.pairs, execution, [&](std::size_t a, std::size_t b) {
            unite(parent, static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
        });

    runs.component.resize(count);
    chunk.components.clear();
    for (std::int64_t row = first; row < last; ++row) {
        auto const r = static_cast<std::size_t>(row - first);
        std::int64_t const y = row % dims_.y, z = row / dims_.y;
        for (std::size_t i = runs.begin[r]; i < runs.begin[r + 1]; ++i) {
            std::int32_t const begin = runs.edges[2 * i], end = runs.edges[2 * i + 1];
            Component const run = of_run(begin, end, static_cast<std::int32_t>(y), static_cast<std::int32_t>(z));
            if (parent[i] != i) {
                // The parent comes earlier and has its component.
                runs.component[i] = runs.component[parent[i]];
                merge(chunk.components[runs.component[i]], run);
                continue;
            }
            runs.component[i] = static_cast<std::uint32_t>(chunk.components.size());
            chunk.components.push_back(run);
            if (rules_.keeps_value_before) chunk.components.back().value_before = voxel_before(rows, begin, y, z);
        }
    }
}

/// The stored voxel before this one in x-fastest order, in the same row or in one of a single voxel.
VoxelBytes Components::voxel_before(ConstView rows, std::int64_t x, std::int64_t y, std::int64_t z) const {
    VoxelBytes voxel{};
    Index3 const first = rows.box.lower;
    if (x == 0 && (dims_.x > 1 || Index3{x, y, z} == Index3{})) return voxel;
    if (Index3{x, y, z} == first) return last_voxel_;
    std::byte const* const from = x > 0         ? rows.at(x - 1, y, z)
                                  : y > first.y ? rows.at(x, y - 1, z)
                                                : rows.at(x, rows.box.upper.y - 1, z - 1);
    std::memcpy(voxel.data(), from, size_of(rows.type));
    return voxel;
}

/// Joins the first rows of a chunk, as far as they touch what is before `row`, with that.
void Components::join_across(std::int64_t row, std::int64_t beyond, Execution const& execution) {
    std::int64_t const end = std::min(beyond, row + dims_.y + 1);
    for (std::int64_t r = row; r < end; ++r)
        join_rows(kept_, r, kept_.first_row, row, pairs_, execution,
                  [&](std::size_t a, std::size_t b) { unite(parent_, kept_.component[a], kept_.component[b]); });
}

void Components::add(ConstView rows, Execution const& execution) {
    // Where every voxel is a component of its own, tables take many times what the voxels do: pieces are so small that
    // what they add to is looked at before the budget is passed by much.
    Index3 const n = rows.dims();
    auto const most =
        static_cast<std::int64_t>(execution.memory / 16 / (sizeof(Component) + 2 * sizeof(std::uint32_t)));
    std::int64_t const slices = std::max<std::int64_t>(1, most / (n.x * n.y));
    for_each_piece(rows.box, {slices, n.y}, [&](Box const& piece) { add_piece(rows.part(piece), execution); });
}

void Components::add_piece(ConstView rows, Execution const& execution) {
    Index3 const n = rows.dims();
    std::int64_t const count = n.y * n.z, first = rows.box.lower.y + rows.box.lower.z * dims_.y;
    int const threads = VKT_BACKEND::threads_for(execution, rows.box.voxels());
    chunks_.resize(static_cast<std::size_t>(threads));
    for (Chunk& chunk : chunks_) chunk.runs.clear(first);
    Execution alone = execution;
    alone.threads = 1;
    VKT_BACKEND::for_each_item(threads, count, [&](std::int64_t begin, std::int64_t end) {
        if (begin == end) return;
        Chunk& chunk = chunks_[static_cast<std::size_t>(omp_get_thread_num())];
        find_runs(rows, begin, end, alone, chunk);
        join_within(rows, chunk, alone);
    });
    for (Chunk const& chunk : chunks_) {
        Runs const& runs = chunk.runs;
        if (runs.rows() == 0) continue;
        std::size_t const before = components_.size(), all = before + chunk.components.size();
        std::size_t const bytes = (run_names_.size() + runs.component.size()) * sizeof(std::uint32_t) +
                                  all * (sizeof(Component) + sizeof(std::uint32_t)) + kept_.bytes() + runs.bytes();
        if (bytes > execution.memory)
            too_many(text("tables of ", run_names_.size() + runs.component.size(), " runs of voxels and ", all,
                          " components take more than ", bytes_text(static_cast<double>(execution.memory)),
                          ", the budget"));
        if (all > std::numeric_limits<std::uint32_t>::max()) too_many("there are 2^32 components or more");
        std::size_t const runs_before = run_names_.size();
        for (std::int64_t r = 0; r < runs.rows(); ++r) {
            std::uint64_t const at = runs_before + runs.begin[static_cast<std::size_t>(r)];
            if ((runs.first_row + r) % dims_.y == 0) slice_begin_.push_back(at);
            std::uint64_t const offset = at - slice_begin_.back();
            if (offset > std::numeric_limits<std::uint32_t>::max()) too_many("a slice has 2^32 runs of voxels or more");
            row_begin_.push_back(static_cast<std::uint32_t>(offset));
        }
        for (std::size_t i = before; i < all; ++i) parent_.push_back(static_cast<std::uint32_t>(i));
        components_.insert(components_.end(), chunk.components.begin(), chunk.components.end());
        if (kept_.rows() == 0) kept_.clear(runs.first_row);
        std::size_t const kept_before = kept_.component.size();
        kept_.append(runs, static_cast<std::uint32_t>(before));
        run_names_.insert(run_names_.end(), kept_.component.begin() + static_cast<std::ptrdiff_t>(kept_before),
                          kept_.component.end());
        join_across(runs.first_row, runs.first_row + runs.rows(), alone);
    }
    kept_.drop_before(first + count - dims_.y - 1, bit_words(n.x));
    std::memcpy(last_voxel_.data(), rows.at(rows.box.upper.x - 1, rows.box.upper.y - 1, rows.box.upper.z - 1),
                size_of(rows.type));
}

void Components::end() {
    kept_.clear(0);
    chunks_.clear();
    std::size_t count = 0;
    for (std::size_t i = 0; i < parent_.size(); ++i) {
        if (parent_[i] == i) {
            components_[count] = components_[i];
            parent_[i] = static_cast<std::uint32_t>(count++);
        } else {
            parent_[i] = parent_[parent_[i]]; // the parent comes earlier and has its number
            merge(components_[parent_[i]], components_[i]);
        }
    }
    components_.resize(count);
}

void Components::rename(std::vector<std::uint32_t> const& names, int threads) {
    for (std::uint32_t& p : parent_) p = names[p];
    VKT_BACKEND::for_each_item(threads, static_cast<std::int64_t>(run_names_.size()),
                               [&](std::int64_t begin, std::int64_t end) {
                                   for (std::int64_t i = begin; i < end; ++i) {
                                       std::uint32_t& name = run_names_[static_cast<std::size_t>(i)];
                                       name = parent_[name];
                                   }
                               });
    parent_ = {};
}

} // namespace vkt
