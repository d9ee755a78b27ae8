// Flooding: ranks by radix sort, minima by union-find, a queue of first come, first served for each rank.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/flooding.h"

#include "libvkt/core/half.h"
#include "libvkt/kernel/numeric.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

namespace vkt {
namespace {

constexpr std::uint32_t none = 0xffffffff;

template <std::size_t bytes> struct KeyOf { using type = std::uint32_t; };
template <> struct KeyOf<8> { using type = std::uint64_t; };

/// A number that is ordered as values are.
template <class T, class Key> Key key_of(T value, bool descending) {
    constexpr int width = 8 * static_cast<int>(sizeof(T));
    constexpr Key all = std::numeric_limits<Key>::max() >> (8 * sizeof(Key) - width);
    constexpr Key top = Key{1} << (width - 1);
    Key key;
    if constexpr (std::is_integral_v<T>) {
        key = static_cast<Key>(value) & all;
        if (std::is_signed_v<T>) key ^= top;
    } else {
        auto const number = static_cast<double>(value);
        if (number != number) return all;
        if (number == 0) {
            key = top;
        } else {
            std::conditional_t<sizeof(T) == 2, std::uint16_t, Key> bits;
            std::memcpy(&bits, &value, sizeof bits);
            key = bits;
            key = (key & top) != 0 ? ~key & all : key | top;
        }
    }
    return descending ? all - key : key;
}

/// Sorts by key, equal keys staying as they are, a digit of 11 bits at a time; digits that all have alike are left out.
/// between() is called before each.
template <class Entry, class Between> void radix_sort(std::vector<Entry>& entries, Between const& between) {
    constexpr int bits = 11;
    constexpr std::size_t digits = std::size_t{1} << bits;
    std::vector<Entry> sorted(entries.size());
    for (int shift = 0; shift < 8 * static_cast<int>(sizeof(entries[0].key)); shift += bits) {
        between();
        std::array<std::size_t, digits + 1> start{};
        for (Entry const& e : entries) ++start[((e.key >> shift) & (digits - 1)) + 1];
        if (std::find(start.begin(), start.end(), entries.size()) != start.end()) continue;
        for (std::size_t d = 1; d <= digits; ++d) start[d] += start[d - 1];
        for (Entry const& e : entries) sorted[start[(e.key >> shift) & (digits - 1)]++] = e;
        entries.swap(sorted);
    }
}

/// Which of many queues hold something: words of bits, and above them words that tell which words are not 0.
class NotEmpty {
public:
    explicit NotEmpty(std::size_t queues) {
        queues = std::max<std::size_t>(queues, 1); // a volume without a voxel to flood has none
        do {
            queues = (queues + 63) / 64;
            levels_.emplace_back(queues, 0);
        } while (queues > 1);
    }
    void insert(std::size_t queue) {
        for (auto& words : levels_) {
            std::uint64_t& word = words[queue / 64];
            bool const known = word != 0;
            word |= std::uint64_t{1} << (queue % 64);
            if (known) return;
            queue /= 64;
        }
    }
    void erase(std::size_t queue) {
        for (auto& words : levels_) {
            std::uint64_t& word = words[queue / 64];
            word &= ~(std::uint64_t{1} << (queue % 64));
            if (word != 0) return;
            queue /= 64;
        }
    }
    bool any() const { return levels_.back()[0] != 0; }
    /// There is one.
    std::size_t first() const {
        std::size_t at = 0;
        for (std::size_t level = levels_.size(); level-- > 0;)
            at = at * 64 + static_cast<std::size_t>(std::countr_zero(levels_[level][at]));
        return at;
    }

private:
    std::vector<std::vector<std::uint64_t>> levels_;
};

/// For every rank a queue of voxels, each of which is in none or one.
class Queues {
public:
    Queues(std::size_t ranks, std::size_t voxels)
        : first_(ranks, none), last_(ranks, none), next_(voxels, unknown), filled_(ranks) {}
    bool knows(std::size_t voxel) const { return next_[voxel] != unknown; } ///< it is or was in one
    void push(std::size_t rank, std::uint32_t voxel) {
        if (first_[rank] == none) {
            first_[rank] = voxel;
            filled_.insert(rank);
        } else {
            next_[last_[rank]] = voxel;
        }
        last_[rank] = voxel;
        next_[voxel] = none;
    }
    bool empty() const { return !filled_.any(); }
    std::uint32_t pop() {
        std::size_t const rank = filled_.first();
        std::uint32_t const voxel = first_[rank];
        first_[rank] = next_[voxel];
        if (first_[rank] == none) filled_.erase(rank);
        return voxel;
    }

private:
    static constexpr std::uint32_t unknown = none - 1;
    std::vector<std::uint32_t> first_, last_, next_;
    NotEmpty filled_;
};

double padded(Index3 n) {
    return static_cast<double>(n.x + 2) * static_cast<double>(n.y + 2) * static_cast<double>(n.z + 2);
}

} // namespace

bool Flooding::can(Index3 dims) { return padded(dims) < static_cast<double>(none - 1); }

double Flooding::bytes(Index3 dims, DataType type, bool minima) {
    double const inside = static_cast<double>(dims.x) * static_cast<double>(dims.y) * static_cast<double>(dims.z);
    // Ranks, labels and order; then two lists to sort, or queues or parents, and markers; a value and two ends a rank.
    double const ranks = size_of(type) <= 2 ? 65536 : inside, sort = 2 * (size_of(type) == 8 ? 16 : 8);
    double const held = 4 * padded(dims) * 2 + (minima ? 4 * inside : 0);
    return held + std::max(sort * inside, 4 * padded(dims) + 12 * inside + 9 * ranks) + 8 * ranks;
}

template <class T, class Key> void Flooding::rank(ConstView values, bool descending, bool keep_order) {
    struct Entry {
        Key key;
        std::uint32_t voxel;
    };
    std::vector<Entry> entries;
    std::size_t count = 0;
    for (std::uint32_t const label : labels_) count += label == outside ? 0 : 1;
    entries.reserve(count);
    View<T const> const view = values.as<T>();
    for (std::int64_t z = 0; z < dims_.z; ++z)
        for (std::int64_t y = 0; y < dims_.y; ++y)
            for (std::int64_t x = 0; x < dims_.x; ++x) {
                std::size_t const voxel = at({x, y, z});
                if (labels_[voxel] == outside) continue;
                tell(entries.size(), 4 * count);
                T const v = view(values.box.lower.x + x, values.box.lower.y + y, values.box.lower.z + z);
                entries.push_back({key_of<T, Key>(v, descending), static_cast<std::uint32_t>(voxel)});
            }
    radix_sort(entries, [&] { tell(0, 1); });
    std::size_t distinct = 0;
    for (std::size_t i = 0; i < entries.size(); ++i) distinct += i == 0 || entries[i].key != entries[i - 1].key ? 1 : 0;
    values_.reserve(distinct);
    Index3 const n{dims_.x + 2, dims_.y + 2, dims_.z + 2};
    for (std::size_t i = 0; i < entries.size(); ++i) {
        tell(i, entries.size());
        Entry const& e = entries[i];
        if (i == 0 || e.key != entries[i - 1].key) {
            auto const voxel = static_cast<std::int64_t>(e.voxel);
            auto const v = static_cast<double>(view(values.box.lower.x + voxel % n.x - 1,
                                                    values.box.lower.y + voxel / n.x % n.y - 1,
                                                    values.box.lower.z + voxel / n.x / n.y - 1));
            values_.push_back(v != v ? std::numeric_limits<double>::infinity() : descending ? -v : v);
        }
        ranks_[e.voxel] = static_cast<std::uint32_t>(values_.size() - 1);
    }
    if (!keep_order) return;
    order_.reserve(entries.size());
    for (Entry const& e : entries) order_.push_back(e.voxel);
}

Flooding::Flooding(ConstView values, bool descending, std::uint8_t const* mask, int connectivity, bool keep_order,
                   ProgressMonitor* monitor)
    : dims_(values.dims()), monitor_(monitor) {
    std::vector<std::array<int, 4>> neighbours; // distance, then z, y, x
    for (int dz = -1; dz <= 1; ++dz)
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                int const distance = std::abs(dx) + std::abs(dy) + std::abs(dz);
                if (distance > 0 && distance <= (connectivity == 6 ? 1 : connectivity == 18 ? 2 : 3))
                    neighbours.push_back({distance, dz, dy, dx});
            }
    std::sort(neighbours.begin(), neighbours.end());
    for (auto const& n : neighbours) steps_.push_back((n[1] * (dims_.y + 2) + n[2]) * (dims_.x + 2) + n[3]);
    auto const all = static_cast<std::size_t>(padded(dims_));
    ranks_.assign(all, 0);
    labels_.assign(all, outside);
    std::size_t voxel = 0;
    for (std::int64_t z = 0; z < dims_.z; ++z)
        for (std::int64_t y = 0; y < dims_.y; ++y)
            for (std::int64_t x = 0; x < dims_.x; ++x, ++voxel)
                if (mask == nullptr || mask[voxel] != 0) labels_[at({x, y, z})] = 0;
    with_type(values.type,
              [&]<class T>(T) { rank<T, typename KeyOf<sizeof(T)>::type>(values, descending, keep_order); });
}

bool Flooding::mark(Index3 voxel, std::uint32_t label) {
    std::uint32_t& l = labels_[at(voxel)];
    if (l == outside) return false;
    if (l == 0) markers_.push_back(static_cast<std::uint32_t>(at(voxel)));
    l = label;
    highest_ = std::max(highest_, label);
    return true;
}

std::int64_t Flooding::mark_minima(double depth) {
    // Voxels as they are flooded; a basin is named by the first voxel of its minimum.
    std::vector<std::uint32_t> parent(labels_.size(), none), kept;
    auto const root_of = [&](std::uint32_t v) {
        while (parent[v] != v) {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        return v;
    };
    auto const step_to = [](std::uint32_t v, std::int64_t step) {
        return static_cast<std::uint32_t>(static_cast<std::int64_t>(v) + step);
    };
    std::size_t done = 0;
    for (std::uint32_t const v : order_) {
        tell(done++, order_.size());
        std::uint32_t basin = v;
        parent[v] = v;
        for (std::int64_t const step : steps_) {
            std::uint32_t const neighbour = step_to(v, step);
            if (parent[neighbour] == none) continue;
            std::uint32_t other = root_of(neighbour);
            if (other == basin) continue;
            // The lower one goes on, of equal ones the first.
            if (ranks_[basin] != ranks_[other] ? ranks_[other] < ranks_[basin] : other < basin) std::swap(basin, other);
            parent[other] = basin;
            if (ranks_[v] == ranks_[other]) continue; // no minimum of its own
            double const deep = values_[ranks_[v]] - values_[ranks_[other]];
            if (!(deep < depth)) kept.push_back(other);
        }
    }
    for (std::uint32_t const v : order_)
        if (parent[v] == v) kept.push_back(v);
    order_ = {};
    parent = {};
    std::sort(kept.begin(), kept.end());
    std::vector<std::uint32_t> rest;
    for (std::size_t i = 0; i < kept.size(); ++i) {
        auto const label = static_cast<std::uint32_t>(i + 1);
        labels_[kept[i]] = label;
        rest.assign(1, kept[i]);
        while (!rest.empty()) {
            std::uint32_t const v = rest.back();
            rest.pop_back();
            markers_.push_back(v);
            for (std::int64_t const step : steps_) {
                std::uint32_t const neighbour = step_to(v, step);
                if (labels_[neighbour] != 0 || ranks_[neighbour] != ranks_[v]) continue;
                labels_[neighbour] = label;
                rest.push_back(neighbour);
            }
        }
    }
    highest_ = static_cast<std::uint32_t>(kept.size());
    return static_cast<std::int64_t>(kept.size());
}

Flooding::Result Flooding::flood(bool line) {
    order_ = {};
    std::sort(markers_.begin(), markers_.end());
    Queues queues(values_.size(), labels_.size());
    for (std::uint32_t const v : markers_) queues.push(ranks_[v], v);
    auto const all = static_cast<std::size_t>(dims_.x * dims_.y * dims_.z);
    for (std::size_t done = 0; !queues.empty(); ++done) {
        tell(done, all);
        std::uint32_t const v = queues.pop();
        if (line && labels_[v] == 0) {
            std::uint32_t found = 0;
            bool between = false;
            for (std::int64_t const step : steps_) {
                std::uint32_t const l = labels_[static_cast<std::size_t>(static_cast<std::int64_t>(v) + step)];
                if (l == 0 || l == outside) continue;
                between = between || (found != 0 && l != found);
                found = l;
            }
            if (between) continue;
            labels_[v] = found;
        }
        for (std::int64_t const step : steps_) {
            auto const neighbour = static_cast<std::uint32_t>(static_cast<std::int64_t>(v) + step);
            if (labels_[neighbour] != 0 || queues.knows(neighbour)) continue;
            if (!line) labels_[neighbour] = labels_[v];
            queues.push(ranks_[neighbour], neighbour);
        }
    }
    ranks_ = {};
    markers_ = {};
    Result result;
    for (std::size_t v = 0; v < labels_.size(); ++v) {
        if (labels_[v] == outside) continue;
        (labels_[v] != 0 ? result.flooded : queues.knows(v) ? result.line : result.left) += 1;
    }
    return result;
}

} // namespace vkt
