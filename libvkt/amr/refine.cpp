// Structured to hierarchical.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/refine.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/progress_monitor.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cmath>

namespace vkt {

namespace {

/// Means of 2^level voxels an axis, where they fit whole.
struct MeanLevel {
    Index3 dims, width;
    std::vector<double> cells;

    double at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return cells[static_cast<std::size_t>((z * dims.y + y) * dims.x + x)];
    }
};

template <class T> class Refiner {
public:
    Refiner(Volume const& volume, RefineOptions const& options, Execution const& execution)
        : volume_(volume), options_(options), execution_(execution), n_(volume.header().dims),
          voxels_(reinterpret_cast<T const*>(volume.buffer().read(Space::host))), base_(is_wide ? voxels_[0] : T{}) {
        for (int a = 0; a < 3; ++a) {
            block_[a] = n_[a] == 1 ? 1 : options.block;
            blocks_[a] = (n_[a] + block_[a] - 1) / block_[a];
        }
        leaf_level_.assign(static_cast<std::size_t>(blocks_.x * blocks_.y * blocks_.z), 0);
        build_means();
        grow();
    }

    Volume run() {
        drop_background();
        for (;;) {
            Volume result = build(options_.largest >= 2 * options_.block ? merged() : bricks());
            if (!split_failures(result)) return result;
        }
    }

private:
    static constexpr signed char dropped = -1;

    /// What is computed of 64-bit integers is their difference from the base.
    static constexpr bool is_wide = is_wide_cell<T>;

    T cell_of(std::int64_t x, std::int64_t y, std::int64_t z) const { return voxels_[(z * n_.y + y) * n_.x + x]; }
    double voxel(std::int64_t x, std::int64_t y, std::int64_t z) const { return difference(cell_of(x, y, z), base_); }

    /// a - b; of floats and smaller integers, where b is 0, a.
    static double difference(T a, T b) {
        if constexpr (is_wide)
            return cell_difference(a, b);
        else
            return static_cast<double>(a);
    }
    static double difference_of(T a, T b) {
        if constexpr (is_wide)
            return cell_difference(a, b);
        else
            return static_cast<double>(a) - static_cast<double>(b);
    }
    /// The cell that holds a computed value.
    T cell_at(double value) const {
        if constexpr (is_wide)
            return cell_beyond(base_, value);
        else
            return store_cell<T>(value);
    }
    bool same_within(T a, T b) const {
        if (options_.scale) {
            double const one = static_cast<double>(a), other = static_cast<double>(b);
            return one == other || std::abs((*options_.scale)(one) - (*options_.scale)(other)) <= options_.tolerance;
        }
        if constexpr (is_wide)
            return std::abs(difference(a, b)) <= options_.tolerance;
        else
            return within(static_cast<double>(a), static_cast<double>(b));
    }

    signed char& leaf(Index3 b) { return leaf_level_[index_of(b)]; }
    std::size_t index_of(Index3 b) const { return static_cast<std::size_t>((b.z * blocks_.y + b.y) * blocks_.x + b.x); }
    /// The first of the finest blocks that a brick spans.
    Index3 first_block(Brick const& brick) const {
        return {brick.lower.x / block_.x, brick.lower.y / block_.y, brick.lower.z / block_.z};
    }

    void build_means() {
        for (int level = 1; level < options_.levels; ++level) {
            MeanLevel next;
            next.width = cell_width(n_, level);
            for (int a = 0; a < 3; ++a) next.dims[a] = n_[a] / next.width[a];
            // A level is of use only if one of its blocks fits.
            if (next.dims.x < block_.x || next.dims.y < block_.y || next.dims.z < block_.z || n_ == Index3{1, 1, 1})
                break;
            next.cells.resize(static_cast<std::size_t>(next.dims.x * next.dims.y * next.dims.z));
            Index3 const step = cell_width(n_, 1);
            double const share = 1.0 / static_cast<double>(step.x * step.y * step.z);
            tell();
#pragma omp parallel for num_threads(execution_.threads) schedule(static)
            for (std::int64_t z = 0; z < next.dims.z; ++z)
                for (std::int64_t y = 0; y < next.dims.y; ++y)
                    for (std::int64_t x = 0; x < next.dims.x; ++x) {
                        double sum = 0;
                        for (std::int64_t k = 0; k < step.z; ++k)
                            for (std::int64_t j = 0; j < step.y; ++j)
                                for (std::int64_t i = 0; i < step.x; ++i) {
                                    Index3 const c{x * step.x + i, y * step.y + j, z * step.z + k};
                                    sum += level == 1 ? voxel(c.x, c.y, c.z) : means_.back().at(c.x, c.y, c.z);
                                }
                        next.cells[static_cast<std::size_t>((z * next.dims.y + y) * next.dims.x + x)] = sum * share;
                    }
            means_.push_back(std::move(next));
        }
    }

    /// A coarse cell as it will be stored.
    double stored(MeanLevel const& mean, std::int64_t x, std::int64_t y, std::int64_t z) const {
        return difference(cell_at(mean.at(x, y, z)), base_);
    }

    double predicted(MeanLevel const& mean, Index3 voxel_at) const {
        std::int64_t low[3], high[3];
        double t[3];
        for (int a = 0; a < 3; ++a) {
            double const q = (static_cast<double>(voxel_at[a]) + 0.5) / static_cast<double>(mean.width[a]) - 0.5;
            if (options_.method == Reconstruction::nearest) {
                low[a] = high[a] = std::min(voxel_at[a] / mean.width[a], mean.dims[a] - 1);
                t[a] = 0;
                continue;
            }
            auto const floor = static_cast<std::int64_t>(std::floor(q));
            t[a] = q - static_cast<double>(floor);
            low[a] = std::clamp<std::int64_t>(floor, 0, mean.dims[a] - 1);
            high[a] = std::clamp<std::int64_t>(floor + 1, 0, mean.dims[a] - 1);
        }
        double sum = 0;
        for (int corner = 0; corner < 8; ++corner) {
            double weight = 1;
            std::int64_t at[3];
            for (int a = 0; a < 3; ++a) {
                bool const upper = (corner >> a & 1) != 0;
                weight *= upper ? t[a] : 1 - t[a];
                at[a] = upper ? high[a] : low[a];
            }
            if (weight > 0) sum += weight * stored(mean, at[0], at[1], at[2]);
        }
        return sum;
    }

    bool within(double prediction, double value) const {
        if (options_.scale) {
            double const base = is_wide ? static_cast<double>(base_) : 0;
            return std::abs((*options_.scale)(base + prediction) - (*options_.scale)(base + value)) <=
                       options_.tolerance ||
                   prediction == value;
        }
        return std::abs(prediction - value) <= options_.tolerance || prediction == value;
    }

    /// Whether gradients differ by no more than the tolerance; difference(p) is the reconstruction less the voxel.
    template <class Difference> bool same_gradient(Index3 p, Difference const& off) const {
        for (int axis = 0; axis < 3; ++axis) {
            Index3 low = p, high = p;
            low[axis] = std::max<std::int64_t>(p[axis] - 1, 0);
            high[axis] = std::min(p[axis] + 1, n_[axis] - 1);
            if (low[axis] == high[axis]) continue;
            double const length = static_cast<double>(high[axis] - low[axis]) * (*options_.gradient_spacing)[axis];
            double const apart = off(high) - off(low);
            if (!(std::abs(apart) <= options_.tolerance * length) && apart == apart) return false;
        }
        return true;
    }

    bool reproduces_gradient(MeanLevel const& mean, Box const& box) const {
        Box const around = intersect(vkt::grow(box, {1, 1, 1}), box_of(n_));
        Index3 const d = around.dims();
        std::vector<double> off(static_cast<std::size_t>(around.voxels()));
        std::size_t i = 0;
        for (std::int64_t z = around.lower.z; z < around.upper.z; ++z)
            for (std::int64_t y = around.lower.y; y < around.upper.y; ++y)
                for (std::int64_t x = around.lower.x; x < around.upper.x; ++x)
                    off[i++] = predicted(mean, {x, y, z}) - voxel(x, y, z);
        auto const at = [&](Index3 p) {
            Index3 const q = p - around.lower;
            return off[static_cast<std::size_t>((q.z * d.y + q.y) * d.x + q.x)];
        };
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                    if (!same_gradient({x, y, z}, at)) return false;
        return true;
    }

    bool reproduces(MeanLevel const& mean, Box const& box) const {
        if (options_.gradient_spacing) return reproduces_gradient(mean, box);
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                for (std::int64_t x = box.lower.x; x < box.upper.x; ++x)
                    if (!within(predicted(mean, {x, y, z}), voxel(x, y, z))) return false;
        return true;
    }

    /// Level by level: eight leaves become one where the level's means reproduce the voxels.
    void grow() {
        for (std::size_t m = 0; m < means_.size(); ++m) {
            int const level = static_cast<int>(m) + 1;
            Index3 const fine = cell_width(n_, level); // finest blocks a coarse block spans
            Index3 extent, count;
            for (int a = 0; a < 3; ++a) {
                extent[a] = block_[a] * means_[m].width[a];
                count[a] = n_[a] / extent[a];
            }
            FirstFailure failure;
#pragma omp parallel for num_threads(execution_.threads) schedule(dynamic, 1)
            for (std::int64_t bz = 0; bz < count.z; ++bz)
                failure.catch_from([&] {
                    for (std::int64_t by = 0; by < count.y; ++by) {
                        tell();
                        for (std::int64_t bx = 0; bx < count.x; ++bx) {
                            Index3 const first{bx * fine.x, by * fine.y, bz * fine.z};
                            if (!all_leaves(first, fine, level - 1)) continue;
                            Index3 const lower{bx * extent.x, by * extent.y, bz * extent.z};
                            if (reproduces(means_[m], {lower, lower + extent}))
                                set_leaves(first, fine, static_cast<signed char>(level));
                        }
                    }
                });
            failure.rethrow();
        }
    }

    bool all_leaves(Index3 first, Index3 size, int level) {
        for (std::int64_t z = 0; z < size.z; ++z)
            for (std::int64_t y = 0; y < size.y; ++y)
                for (std::int64_t x = 0; x < size.x; ++x)
                    if (leaf(first + Index3{x, y, z}) != level) return false;
        return true;
    }

    void set_leaves(Index3 first, Index3 size, signed char level) {
        for (std::int64_t z = 0; z < size.z; ++z)
            for (std::int64_t y = 0; y < size.y; ++y)
                for (std::int64_t x = 0; x < size.x; ++x) leaf(first + Index3{x, y, z}) = level;
    }

    /// Leaves of any level whose voxels are all background vanish.
    void drop_background() {
        if (!options_.background) return;
        T const background = store_cell<T>(*options_.background);
        for_each_leaf([&](Brick const& brick) {
            Box const box = bounds_of(brick, n_);
            bool all = true;
            for (std::int64_t z = box.lower.z; all && z < box.upper.z; ++z)
                for (std::int64_t y = box.lower.y; all && y < box.upper.y; ++y)
                    for (std::int64_t x = box.lower.x; all && x < box.upper.x; ++x)
                        all = same_within(background, cell_of(x, y, z));
            if (all) mark(brick, dropped);
        });
    }

    void mark(Brick const& brick, signed char level) {
        set_leaves(first_block(brick), cell_width(n_, brick.level), level);
    }

    /// Every leaf that is not background, in x-fastest order.
    template <class F> void for_each_leaf(F const& f) {
        Index3 b;
        for (b.z = 0; b.z < blocks_.z; ++b.z)
            for (b.y = 0; b.y < blocks_.y; ++b.y)
                for (b.x = 0; b.x < blocks_.x; ++b.x) {
                    int const level = leaf(b);
                    if (level == dropped) continue;
                    Index3 const fine = cell_width(n_, level);
                    if (b.x % fine.x != 0 || b.y % fine.y != 0 || b.z % fine.z != 0) continue; // not the block's first
                    Brick brick{{b.x * block_.x, b.y * block_.y, b.z * block_.z}, block_, level};
                    for (int a = 0; a < 3 && level == 0; ++a)
                        brick.dims[a] = std::min(block_[a], n_[a] - brick.lower[a]);
                    f(brick);
                }
    }

    std::vector<Brick> bricks() {
        std::vector<Brick> list;
        for_each_leaf([&](Brick const& brick) { list.push_back(brick); });
        return list;
    }

    /// Blocks of cells of which eight are one at the next scale if they have the same level; others have the level
    /// none.
    struct Scale {
        Index3 dims;
        std::vector<signed char> level;

        signed char at(Index3 b) const { return level[static_cast<std::size_t>((b.z * dims.y + b.y) * dims.x + b.x)]; }
    };
    static constexpr signed char none = -2;

    /// Scale 0 are the finest blocks; blocks that end with the volume before they are whole have no level above it.
    std::vector<Scale> scales() const {
        std::vector<Scale> all{{blocks_, leaf_level_}};
        Index3 const step = cell_width(n_, 1);
        for (Index3 size = block_; all.back().dims != Index3{1, 1, 1};) {
            Scale const& fine = all.back();
            Scale next;
            for (int a = 0; a < 3; ++a) {
                size[a] *= step[a];
                next.dims[a] = n_[a] / size[a];
            }
            if (next.dims.x * next.dims.y * next.dims.z == 0) break;
            Index3 b;
            for (b.z = 0; b.z < next.dims.z; ++b.z)
                for (b.y = 0; b.y < next.dims.y; ++b.y)
                    for (b.x = 0; b.x < next.dims.x; ++b.x) {
                        Index3 const first{b.x * step.x, b.y * step.y, b.z * step.z};
                        signed char level = fine.at(first);
                        for (int corner = 1; corner < 8; ++corner) {
                            Index3 at = first;
                            for (int a = 0; a < 3; ++a)
                                if (step[a] > 1) at[a] += corner >> a & 1;
                            if (fine.at(at) != level) level = none;
                        }
                        next.level.push_back(level);
                    }
            all.push_back(std::move(next));
        }
        return all;
    }

    /// bricks() of mixed sizes.
    std::vector<Brick> merged() {
        std::vector<Scale> const all = scales();
        std::vector<Brick> list;
        for_each_leaf([&](Brick brick) {
            bool first = true; // of those that it becomes one with
            for (int times = 2, scale = brick.level + 1; times * options_.block <= options_.largest;
                 times *= 2, ++scale) {
                if (static_cast<std::size_t>(scale) >= all.size()) break;
                Index3 const width = cell_width(n_, scale);
                Index3 block;
                bool inside = true;
                for (int a = 0; a < 3; ++a) {
                    block[a] = brick.lower[a] / (block_[a] * width[a]);
                    inside = inside && block[a] < all[static_cast<std::size_t>(scale)].dims[a];
                }
                if (!inside || all[static_cast<std::size_t>(scale)].at(block) != brick.level) break;
                first = true;
                for (int a = 0; a < 3; ++a) {
                    first = first && brick.lower[a] == block[a] * block_[a] * width[a];
                    brick.dims[a] = n_[a] == 1 ? 1 : block_[a] * times;
                }
            }
            if (first) list.push_back(brick);
        });
        return list;
    }

    Volume build(std::vector<Brick> list) {
        if (list.empty()) { // everything is background: one block keeps the volume a volume
            leaf({0, 0, 0}) = 0;
            list = bricks();
        }
        Header header = volume_.header();
        header.kind = Kind::hierarchical;
        if (options_.background)
            header.attributes["background"] = to_text(header.values.physical(*options_.background));
        Volume result(header, std::move(list));
        T* cell = reinterpret_cast<T*>(result.buffer().write(Space::host));
        for (Brick const& brick : result.bricks()) {
            Index3 const w = cell_width(n_, brick.level);
            for (std::int64_t z = 0; z < brick.dims.z; ++z)
                for (std::int64_t y = 0; y < brick.dims.y; ++y)
                    for (std::int64_t x = 0; x < brick.dims.x; ++x) {
                        Index3 const at{brick.lower.x / w.x + x, brick.lower.y / w.y + y, brick.lower.z / w.z + z};
                        *cell++ = brick.level == 0
                                      ? cell_of(at.x, at.y, at.z)
                                      : cell_at(means_[static_cast<std::size_t>(brick.level - 1)].at(at.x, at.y, at.z));
                    }
        }
        return result;
    }

    /// Compares the reconstruction with the voxels; coarse blocks that had a part in a failure are split. False if all
    /// is well. Fine bricks return their voxels wherever no coarse brick reaches, so this ends.
    bool split_failures(Volume const& tree) {
        double const background = options_.background.value_or(0);
        SampleGrid grid;
        grid.dims = n_;
        Reconstructor const reconstructor(tree, grid, options_.method, background);
        BrickIndex const index(n_, tree.bricks());
        std::vector<std::uint8_t> failed(leaf_level_.size(), 0); // by the first of their finest blocks
        std::vector<std::int32_t> near;
        bool const gradient = options_.gradient_spacing.has_value();
        std::int64_t const beyond = gradient ? 1 : 0; // slices
        std::vector<T> slab(static_cast<std::size_t>(n_.x * n_.y * std::min<std::int64_t>(n_.z, 16 + 2 * beyond)));
        bool any = false;
        for (std::int64_t z0 = 0; z0 < n_.z; z0 += 16) {
            tell();
            Box const box{{0, 0, std::max<std::int64_t>(z0 - beyond, 0)},
                          {n_.x, n_.y, std::min(z0 + 16 + beyond, n_.z)}};
            reconstructor.run(dense_view(reinterpret_cast<std::byte*>(slab.data()), volume_.header().dtype, box),
                              execution_);
            auto const value = [&](Index3 p) {
                return slab[static_cast<std::size_t>(((p.z - box.lower.z) * n_.y + p.y) * n_.x + p.x)];
            };
            auto const off = [&](Index3 p) { return difference_of(value(p), cell_of(p.x, p.y, p.z)); };
            for (std::int64_t z = z0; z < std::min(z0 + 16, n_.z); ++z)
                for (std::int64_t y = 0; y < n_.y; ++y)
                    for (std::int64_t x = 0; x < n_.x; ++x) {
                        Index3 const at{x, y, z};
                        if (gradient ? same_gradient(at, off) : same_within(value(at), cell_of(x, y, z))) continue;
                        double const reach = gradient ? 1 : 0;
                        Vec3 const p{static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                                     static_cast<double>(z) + 0.5};
                        Vec3 const from{p.x - reach, p.y - reach, p.z - reach};
                        Vec3 const to{p.x + reach, p.y + reach, p.z + reach};
                        index.query(from, to, near);
                        for (std::int32_t const id : near) {
                            Brick const& brick = tree.bricks()[static_cast<std::size_t>(id)];
                            if (brick.level == 0 || !domain_meets(brick, n_, from, to)) continue;
                            for_each_block(brick, [&](Brick const& block) {
                                std::uint8_t& has_failed = failed[index_of(first_block(block))];
                                if (has_failed != 0 || !domain_meets(block, n_, from, to)) return;
                                has_failed = 1;
                                any = true;
                            });
                        }
                    }
        }
        for (Brick const& brick : tree.bricks())
            for_each_block(brick, [&](Brick const& block) {
                if (failed[index_of(first_block(block))] != 0) mark(block, static_cast<signed char>(block.level - 1));
            });
        return any;
    }

    /// How long it takes depends on the voxels: that it goes on is all that is told.
    void tell() const {
        if (execution_.monitor != nullptr) execution_.monitor->poll(0, 1);
    }

    /// The blocks that a brick was joined of.
    template <class F> void for_each_block(Brick const& brick, F const& f) const {
        Index3 const width = cell_width(n_, brick.level);
        Brick block = brick;
        Index3 at;
        for (at.z = 0; at.z < brick.dims.z; at.z += block_.z)
            for (at.y = 0; at.y < brick.dims.y; at.y += block_.y)
                for (at.x = 0; at.x < brick.dims.x; at.x += block_.x) {
                    for (int a = 0; a < 3; ++a) {
                        block.lower[a] = brick.lower[a] + at[a] * width[a];
                        block.dims[a] = std::min(block_[a], brick.dims[a] - at[a]);
                    }
                    f(block);
                }
    }

    Volume const& volume_;
    RefineOptions options_;
    Execution const& execution_;
    Index3 n_, block_, blocks_;
    T const* voxels_;
    T base_; ///< 0 for all but 64-bit integers
    std::vector<MeanLevel> means_;
    std::vector<signed char> leaf_level_; ///< of every finest block
};

} // namespace

Volume refine(Volume const& volume, RefineOptions const& options, Execution const& execution) {
    if (volume.header().kind != Kind::structured) throw Error(ErrorKind::usage, "refine takes a structured volume");
    if (!(options.tolerance >= 0)) throw Error(ErrorKind::usage, text("tolerance ", options.tolerance, " is negative"));
    if (options.block < 1 || options.block > 64)
        throw Error(ErrorKind::usage, text("blocks of ", options.block, " cells are not in 1…64"));
    if (options.levels < 1 || options.levels > 16)
        throw Error(ErrorKind::usage, text(options.levels, " levels are not in 1…16"));
    if (options.scale && options.gradient_spacing)
        throw Error(ErrorKind::usage, "differences are of a scale or of the gradient, not of both");
    if (options.method != Reconstruction::basis && options.method != Reconstruction::nearest)
        throw Error(ErrorKind::usage, "the tolerance can be promised for basis or nearest reconstruction");
    return with_type(volume.header().dtype, [&]<class T>(T) { return Refiner<T>(volume, options, execution).run(); });
}

} // namespace vkt
