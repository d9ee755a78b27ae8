// Synthetic hierarchical volumes: the trees.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/make_amr.h"

#include "libvkt/amr/analytic.h"
#include "libvkt/amr/tree.h"
#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <queue>
#include <unordered_set>

namespace vkt {

namespace {

constexpr int coordinate_bits = 19;
constexpr std::int64_t most_blocks = std::int64_t{1} << 26;

/// A block by refinement level (1-based) and position among the blocks of that level.
struct BlockKey {
    int level;
    Index3 at;

    std::uint64_t code() const {
        return static_cast<std::uint64_t>(level) << 3 * coordinate_bits |
               static_cast<std::uint64_t>(at.z) << 2 * coordinate_bits |
               static_cast<std::uint64_t>(at.y) << coordinate_bits | static_cast<std::uint64_t>(at.x);
    }
};

class Forest {
public:
    explicit Forest(AmrRecipe const& recipe) : recipe_(recipe) {
        for (int a = 0; a < 3; ++a) {
            flat_[a] = recipe.roots[a] * recipe.block[a] == 1;
            finest_[a] = blocks_at(recipe.finest)[a];
        }
        Index3 const n = blocks_at(recipe.coarsest);
        if (volume_of(n) > static_cast<double>(most_blocks))
            throw Error(ErrorKind::resources, text("a tree of more than ", most_blocks, " blocks is too large"));
        for (std::int64_t z = 0; z < n.z; ++z)
            for (std::int64_t y = 0; y < n.y; ++y)
                for (std::int64_t x = 0; x < n.x; ++x) insert({recipe.coarsest, {x, y, z}});
        refine();
    }

    /// Leaves in Morton order within each root, roots with x fastest: the order of a FLASH file.
    std::vector<Brick> bricks() const {
        std::vector<Brick> list;
        list.reserve(leaves_.size());
        for (std::int64_t z = 0; z < recipe_.roots.z; ++z)
            for (std::int64_t y = 0; y < recipe_.roots.y; ++y)
                for (std::int64_t x = 0; x < recipe_.roots.x; ++x) collect({1, {x, y, z}}, list);
        return list;
    }

private:
    Index3 blocks_at(int level) const {
        Index3 n;
        for (int a = 0; a < 3; ++a) n[a] = flat_[a] ? 1 : recipe_.roots[a] << (level - 1);
        return n;
    }

    bool is_leaf(BlockKey const& key) const { return leaves_.contains(key.code()); }
    BlockKey parent(BlockKey const& key) const {
        return {key.level - 1, {key.at.x >> 1, key.at.y >> 1, key.at.z >> 1}};
    }

    void insert(BlockKey const& key) {
        leaves_.insert(key.code());
        if (key.level < recipe_.finest) queue_.push({score(key), key.level, key.at});
    }

    /// How far the block is from the nearest feature that still refines at its level, in units of its own size.
    double score(BlockKey const& key) const {
        Vec3 low, high;
        double size = 0;
        for (int a = 0; a < 3; ++a) {
            double const scale = 1.0 / static_cast<double>(finest_.x);
            auto const width = static_cast<double>(flat_[a] ? 1 : std::int64_t{1} << (recipe_.finest - key.level));
            low[a] = static_cast<double>(key.at[a]) * width * scale;
            high[a] = low[a] + width * scale;
            if (!flat_[a]) size = width * scale;
        }
        Vec3 const extent{1, static_cast<double>(finest_.y) / static_cast<double>(finest_.x),
                          static_cast<double>(finest_.z) / static_cast<double>(finest_.x)};
        return analytic::feature_distance(low, high, extent, recipe_.finest - key.level) / size;
    }

    void refine() {
        while (static_cast<std::int64_t>(leaves_.size()) < recipe_.blocks && !queue_.empty()) {
            Candidate const next = queue_.top();
            queue_.pop();
            BlockKey const key{next.level, next.at};
            if (!is_leaf(key)) continue;
            std::vector<BlockKey> chain;
            demand(key, chain);
            int children = 1;
            for (int a = 0; a < 3; ++a) children *= flat_[a] ? 1 : 2;
            auto const after =
                static_cast<std::int64_t>(leaves_.size() + chain.size() * static_cast<std::size_t>(children - 1));
            // A chain of forced refinements may overshoot; other candidates will do the last steps.
            if (chain.size() > 1 && after >= recipe_.blocks + children - 1) continue;
            if (after > most_blocks)
                throw Error(ErrorKind::resources, text("a tree of more than ", most_blocks, " blocks is too large"));
            for (BlockKey const& each : chain) divide(each);
        }
    }

    /// Blocks that must be divided, coarsest first, so that `key` can be and neighbours differ by one level at most.
    void demand(BlockKey const& key, std::vector<BlockKey>& chain) const {
        for (BlockKey const& other : chain)
            if (other.code() == key.code()) return;
        Index3 const n = blocks_at(key.level);
        for (std::int64_t dz = -1; dz <= 1; ++dz)
            for (std::int64_t dy = -1; dy <= 1; ++dy)
                for (std::int64_t dx = -1; dx <= 1; ++dx) {
                    BlockKey const neighbour{key.level, key.at + Index3{dx, dy, dz}};
                    if (!Box{{0, 0, 0}, n}.contains({neighbour.at, neighbour.at + Index3{1, 1, 1}})) continue;
                    if (key.level > 1 && is_leaf(parent(neighbour))) demand(parent(neighbour), chain);
                }
        chain.push_back(key);
    }

    void divide(BlockKey const& key) {
        leaves_.erase(key.code());
        for_children(key, [&](BlockKey const& child) { insert(child); });
    }

    template <class Visit> void for_children(BlockKey const& key, Visit visit) const {
        for (int c = 0; c < 8; ++c) {
            Index3 at;
            bool exists = true;
            for (int a = 0; a < 3; ++a) {
                int const bit = c >> a & 1;
                exists = exists && !(flat_[a] && bit == 1);
                at[a] = flat_[a] ? 0 : 2 * key.at[a] + bit;
            }
            if (exists) visit(BlockKey{key.level + 1, at});
        }
    }

    void collect(BlockKey const& key, std::vector<Brick>& list) const {
        if (is_leaf(key)) {
            int const level = recipe_.finest - key.level;
            Index3 lower;
            for (int a = 0; a < 3; ++a) lower[a] = key.at[a] * recipe_.block[a] << (flat_[a] ? 0 : level);
            list.push_back({lower, recipe_.block, level});
        } else if (key.level < recipe_.finest) {
            for_children(key, [&](BlockKey const& child) { collect(child, list); });
        }
    }

    struct Candidate {
        double score;
        int level;
        Index3 at;
        /// Orders the queue: nearest first, then coarsest, then by position.
        bool operator<(Candidate const& other) const {
            if (score != other.score) return score > other.score;
            if (level != other.level) return level > other.level;
            return BlockKey{level, at}.code() > BlockKey{other.level, other.at}.code();
        }
    };

    AmrRecipe recipe_;
    bool flat_[3] = {};
    Index3 finest_;
    std::unordered_set<std::uint64_t> leaves_;
    std::priority_queue<Candidate> queue_;
};

void check(AmrRecipe const& recipe) {
    if (recipe.coarsest < 1 || recipe.finest < recipe.coarsest || recipe.finest > coordinate_bits)
        throw Error(ErrorKind::usage, text("refinement levels ", recipe.coarsest, "…", recipe.finest,
                                           " are not an ascending part of 1…", coordinate_bits));
    if (recipe.dtype != DataType::float32 && recipe.dtype != DataType::float64)
        throw Error(ErrorKind::usage, text("synthetic trees hold float32 or float64, not ", recipe.dtype));
    for (int a = 0; a < 3; ++a) {
        if (recipe.roots[a] < 1 || recipe.block[a] < 1 || recipe.block[a] > 1024 ||
            recipe.roots[a] > (std::int64_t{1} << coordinate_bits) >> (recipe.finest - 1))
            throw Error(ErrorKind::usage, text("roots ", recipe.roots, " of blocks ", recipe.block, " at ",
                                               recipe.finest, " levels make no logical grid that can be handled"));
    }
    if (recipe.blocks < 0 || recipe.blocks > most_blocks)
        throw Error(ErrorKind::usage, text(recipe.blocks, " blocks are not in 0…", most_blocks));
}

template <class T>
void fill_brick(Brick const& brick, Index3 logical, std::vector<analytic::Term> const& terms, T* out) {
    std::int64_t const n = brick.cells();
    std::vector<double> sums(static_cast<std::size_t>(n), 0.0);
    for (auto const& term : terms) {
        std::vector<double> axis[3];
        Index3 const w = cell_width(logical, brick.level);
        for (int a = 0; a < 3; ++a)
            for (std::int64_t i = 0; i < brick.dims[a]; ++i) {
                auto const low = static_cast<double>(brick.lower[a] + i * w[a]);
                axis[a].push_back(term.factor[a].average(low, low + static_cast<double>(w[a])));
            }
        std::size_t at = 0;
        for (double const z : axis[2])
            for (double const y : axis[1]) {
                double const yz = term.amplitude * z * y;
                for (double const x : axis[0]) sums[at++] += yz * x;
            }
    }
    for (std::int64_t i = 0; i < n; ++i) out[i] = static_cast<T>(sums[static_cast<std::size_t>(i)]);
}

/// The cells of some bricks, one brick after another.
template <class T>
void fill(BrickTable const& bricks, Index3 logical, AmrField field, T* cells, Execution const& execution) {
    std::vector<std::int64_t> offsets;
    offsets.reserve(bricks.size());
    std::int64_t offset = 0;
    for (Brick const& brick : bricks) offsets.push_back(std::exchange(offset, offset + brick.cells()));
    auto const count = static_cast<std::int64_t>(bricks.size());
    auto const terms = analytic::terms_of(field, logical);
    FirstFailure failure;
#pragma omp parallel for num_threads(execution.threads) schedule(dynamic, 64)
    for (std::int64_t b = 0; b < count; ++b) {
        auto const brick = static_cast<std::size_t>(b);
        failure.catch_from([&] { fill_brick(bricks[brick], logical, terms, cells + offsets[brick]); });
    }
    failure.rethrow();
}

} // namespace

AmrRecipe silcc_like() {
    AmrRecipe recipe;
    recipe.roots = {1, 1, 20};
    recipe.coarsest = 4;
    recipe.finest = 10;
    recipe.blocks = 142188;
    return recipe;
}

BrickSequence amr_bricks(AmrRecipe const& recipe, Execution const& execution) {
    check(recipe);
    Header header;
    header.kind = Kind::hierarchical;
    header.dtype = recipe.dtype;
    for (int a = 0; a < 3; ++a)
        header.dims[a] =
            recipe.roots[a] * recipe.block[a] == 1 ? 1 : recipe.roots[a] * recipe.block[a] << (recipe.finest - 1);
    header.attributes["content"] = text("synthetic ", enum_name(recipe.field), " field");
    std::vector<Brick> bricks = Forest(recipe).bricks();
    double bytes = 0;
    for (Brick const& brick : bricks)
        bytes += static_cast<double>(brick.cells()) * static_cast<double>(size_of(recipe.dtype));
    if (bytes > 0x1p40) throw Error(ErrorKind::resources, text("a tree of ", bytes_text(bytes), " is too large"));
    BrickTable const table(header.dims, std::move(bricks));
    Index3 const dims = header.dims;
    return {std::move(header), table,
            [table, dims, field = recipe.field, dtype = recipe.dtype, execution](std::size_t first, std::size_t count,
                                                                                 std::byte* to) {
                BrickTable const wanted = table.part(first, count);
                if (dtype == DataType::float32)
                    fill(wanted, dims, field, reinterpret_cast<float*>(to), execution);
                else
                    fill(wanted, dims, field, reinterpret_cast<double*>(to), execution);
            }};
}

Volume make_amr(AmrRecipe const& recipe, Execution const& execution) { return amr_bricks(recipe, execution).whole(); }

} // namespace vkt
