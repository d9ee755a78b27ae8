// Cutting a brick tree into blocks, and the reconstruction at their cells.
// SPDX-License-Identifier: MIT
#include "libvkt/render/tree_blocks.h"

#include "libvkt/amr/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace vkt::render {

namespace {

constexpr int cell_bits = 3; ///< of block_cells
static_assert(1 << cell_bits == block_cells);

bool domain_meets_box(Brick const& brick, Index3 dims, Box const& box) {
    Box const domain = domain_of(brick, dims); // in half cells
    for (int a = 0; a < 3; ++a)
        if (domain.upper[a] <= 2 * box.lower[a] || domain.lower[a] >= 2 * box.upper[a]) return false;
    return true;
}

/// Up to two cells of a brick along an axis that reach a point, and their weights.
struct Taps {
    std::int32_t cell[2];
    float weight[2];
    int count = 0;

    void add(std::int32_t at, float share) { cell[count] = at, weight[count++] = share; }
};

/// At a position in cells, the first one's centre at 0.
Taps taps_at(double q, std::int32_t cells) {
    Taps taps;
    if (!(q > -1 && q < static_cast<double>(cells))) return taps;
    double const floor = std::floor(q);
    auto const first = static_cast<std::int32_t>(floor);
    auto const t = static_cast<float>(q - floor);
    if (first >= 0) taps.add(first, 1 - t);
    if (t > 0 && first + 1 < cells) taps.add(first + 1, t);
    return taps;
}

/// Whether something can be seen in a leaf, by the values between which others are interpolated.
template <class T> bool shows_something(BlockLeaf const& leaf, T const* block, TransferTable const& table) {
    constexpr int first = block_halo - 1;
    float low = std::numeric_limits<float>::infinity(), high = -low;
    bool missing = false;
    for (int k = first; k <= leaf.thickness[2] + block_halo; ++k)
        for (int j = first; j <= leaf.thickness[1] + block_halo; ++j)
            for (int i = first; i <= leaf.thickness[0] + block_halo; ++i) {
                auto const v = static_cast<float>(block[(k * block_edge + j) * block_edge + i]);
                low = v < low ? v : low;
                high = v > high ? v : high;
                missing = missing || !(v == v);
            }
    if (missing) return true; // beyond missing data the value may jump between two samples
    // Interpolation passes its ends by a few roundings.
    float const slack = 4e-7F * std::max(std::abs(low), std::abs(high));
    return table.greatest_extinction(low - slack, high + slack) > 0;
}

} // namespace

/// A brick and the points of a block that its cells reach.
struct TreeBlocks::Reach {
    SampledBrick const* brick = nullptr;
    Taps taps[3][block_edge];
    int first[3], last[3];
    bool single = true; ///< one cell reaches each point

    std::int64_t count() const {
        std::int64_t n = 1;
        for (int a = 0; a < 3; ++a) n *= last[a] - first[a] + 1;
        return n;
    }
    /// visit(place of the row in the block, its cells, weight) for all rows of cells that reach some of points.
    template <class T, class Visit> void each_row(T const* cells, Visit const& visit) const {
        std::int64_t const row = brick->dims[0], slice = row * brick->dims[1];
        for (int k = first[2]; k <= last[2]; ++k)
            for (int j = first[1]; j <= last[1]; ++j) {
                Taps const &z = taps[2][k], &y = taps[1][j];
                for (int m = 0; m < z.count; ++m)
                    for (int l = 0; l < y.count; ++l)
                        visit((k * block_edge + j) * block_edge,
                              cells + brick->offset + z.cell[m] * slice + y.cell[l] * row, z.weight[m] * y.weight[l]);
            }
    }
};

/// What a thread needs for one block after the other.
struct TreeBlocks::Workspace {
    std::vector<Reach> reaches;
    std::array<float, block_size> sum, weight;
};

template <class T> void TreeBlocks::copy_cells(Reach const& reach, T const* cells, T* block) {
    reach.each_row(cells, [&](int place, T const* from, float) {
        for (int i = reach.first[0]; i <= reach.last[0]; ++i) block[place + i] = from[reach.taps[0][i].cell[0]];
    });
}

/// The sums of sample().
template <class T> void TreeBlocks::add_cells(Reach const& reach, T const* cells, Workspace& work) {
    reach.each_row(cells, [&](int place, T const* from, float weight) {
        float *const sums = work.sum.data() + place, *const weights = work.weight.data() + place;
        for (int i = reach.first[0]; i <= reach.last[0]; ++i) {
            Taps const& x = reach.taps[0][i];
            for (int n = 0; n < x.count; ++n) {
                float const h = x.weight[n] * weight;
                sums[i] += h * static_cast<float>(from[x.cell[n]]);
                weights[i] += h;
            }
        }
    });
}

/// A cube that is to be cut, and the bricks that reach it.
struct TreeBlocks::Part {
    Index3 lower;
    int bits; ///< its edge is 2^bits
    std::vector<Brick> bricks;
};

TreeBlocks::TreeBlocks(BrickTable const& bricks, Index3 dims, Box const& region) : dims_(dims), region_(region) {
    constexpr std::int64_t longest = std::int64_t{1} << 29; // positions are 32-bit integers
    for (Brick const& brick : bricks) {
        coarsest_ = std::max(coarsest_, brick.level);
        for (int a = 0; a < 3; ++a) // as in trees that were turned around: cells lie otherwise than those of blocks
            if (brick.lower[a] % cell_width(dims, brick.level)[a] != 0) return;
    }
    root_bits_ = coarsest_ + cell_bits;
    if (root_bits_ > 28) return;
    double roots = 1;
    for (int a = 0; a < 3; ++a) {
        if (dims[a] > longest) return;
        origin_[a] = region.lower[a] >> root_bits_ << root_bits_;
        count_[a] = ((region.upper[a] - origin_[a] - 1) >> root_bits_) + 1;
        roots *= static_cast<double>(count_[a]);
    }
    // A volume of almost nothing but fine cells has few roots, but not the other way around.
    if (roots > std::max(4096.0, static_cast<double>(8 * bricks.size()))) return;
    auto const n = static_cast<std::size_t>(count_.x * count_.y * count_.z);
    std::vector<Part> parts(n);
    auto const each_root = [&](auto const& visit) {
        for (std::int64_t z = 0; z < count_.z; ++z)
            for (std::int64_t y = 0; y < count_.y; ++y)
                for (std::int64_t x = 0; x < count_.x; ++x) visit(Index3{x, y, z});
    };
    each_root([&](Index3 at) {
        Part& part = parts[static_cast<std::size_t>((at.z * count_.y + at.y) * count_.x + at.x)];
        for (int a = 0; a < 3; ++a) part.lower[a] = origin_[a] + (at[a] << root_bits_);
        part.bits = root_bits_;
    });
    for (Brick const& brick : bricks) {
        Box const domain = domain_of(brick, dims);
        Index3 first, last;
        for (int a = 0; a < 3; ++a) {
            auto const root = [&](std::int64_t half) {
                return std::clamp<std::int64_t>(((half >> 1) - origin_[a]) >> root_bits_, 0, count_[a] - 1);
            };
            first[a] = root(domain.lower[a] - 1), last[a] = root(domain.upper[a] + 1);
        }
        for (std::int64_t z = first.z; z <= last.z; ++z)
            for (std::int64_t y = first.y; y <= last.y; ++y)
                for (std::int64_t x = first.x; x <= last.x; ++x)
                    parts[static_cast<std::size_t>((z * count_.y + y) * count_.x + x)].bricks.push_back(brick);
    }
    nodes_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
        split(i, parts[i]);
        parts[i].bricks = {};
    }
}

void TreeBlocks::split(std::size_t node, Part const& part) {
    std::int64_t const edge = std::int64_t{1} << part.bits;
    Box const cube = intersect({part.lower, part.lower + Index3{edge, edge, edge}}, region_);
    Part child;
    int finest = max_level;
    if (!cube.empty())
        for (Brick const& brick : part.bricks) {
            if (!domain_meets_box(brick, dims_, cube)) continue;
            finest = std::min(finest, brick.level);
            child.bricks.push_back(brick);
        }
    if (child.bricks.empty() || part.bits <= finest + cell_bits) {
        BlockLeaf leaf{};
        for (int a = 0; a < 3; ++a) leaf.lower[a] = static_cast<std::int32_t>(part.lower[a]);
        leaf.edge = static_cast<std::int32_t>(edge);
        leaf.level = child.bricks.empty() ? 0 : std::min(finest, part.bits);
        leaf.block = -1;
        for (int a = 0; a < 3; ++a) {
            std::int64_t const width = cell_width(dims_, leaf.level)[a];
            std::int64_t const held = cube.empty() ? 0 : cube.upper[a] - part.lower[a];
            leaf.thickness[a] =
                static_cast<std::uint8_t>(std::clamp<std::int64_t>((held + width - 1) / width, 1, block_cells));
        }
        nodes_[node] = static_cast<std::int32_t>(leaves_.size());
        leaves_.push_back(leaf);
        return;
    }
    child.bits = part.bits - 1;
    std::size_t const first = nodes_.size();
    nodes_[node] = ~static_cast<std::int32_t>(first);
    nodes_.resize(first + 8);
    for (std::size_t i = 0; i < 8; ++i) {
        for (int a = 0; a < 3; ++a) child.lower[a] = part.lower[a] + (i >> a & 1 ? edge / 2 : 0);
        split(first + i, child);
    }
}

Box TreeBlocks::cube_of(BlockLeaf const& leaf) const {
    Index3 const lower{leaf.lower[0], leaf.lower[1], leaf.lower[2]};
    return {lower, lower + Index3{leaf.edge, leaf.edge, leaf.edge}};
}

/// Those that meet a box.
void TreeBlocks::mark(std::int32_t node, Box const& cube, Box const& box, std::vector<std::uint8_t>& wanted) const {
    if (intersect(cube, box).empty()) return;
    if (node >= 0) {
        wanted[static_cast<std::size_t>(node)] = 1;
        return;
    }
    std::int64_t const half = (cube.upper.x - cube.lower.x) / 2;
    for (int i = 0; i < 8; ++i) {
        Index3 lower = cube.lower;
        for (int a = 0; a < 3; ++a) lower[a] += i >> a & 1 ? half : 0;
        mark(nodes_[static_cast<std::size_t>(std::int64_t{~node} + i)], {lower, lower + Index3{half, half, half}}, box,
             wanted);
    }
}

StoredBlocks TreeBlocks::store(TreeSampler const& sampler, LatticeType type, TreeCells const& cells,
                               CellVisibility const& visibility, TransferTable const& table, bool all,
                               std::size_t most_bytes, int threads) const {
    StoredBlocks stored;
    if (empty()) return stored;
    stored.leaves = leaves_;
    std::vector<std::uint8_t> wanted(leaves_.size(), 0);
    Index3 const counts{cells.grid.nx, cells.grid.ny, cells.grid.nz};
    double const origin[3] = {cells.origin.x, cells.origin.y, cells.origin.z};
    for (BlockLeaf& leaf : stored.leaves) {
        Box const cube = cube_of(leaf);
        if (intersect(cube, region_).empty()) continue;
        // Values between cells come from one that may lie outside.
        std::int64_t const around = std::int64_t{1} << leaf.level;
        Index3 first, last;
        for (int a = 0; a < 3; ++a) {
            auto const cell = [&](std::int64_t at) {
                return static_cast<std::int64_t>(
                    std::clamp(std::floor((static_cast<double>(at) - origin[a]) / cells.size), 0.0,
                               static_cast<double>(counts[a] - 1)));
            };
            first[a] = cell(cube.lower[a] - around), last[a] = cell(cube.upper[a] + around);
        }
        bool seen = false;
        for (std::int64_t z = first.z; z <= last.z && !seen; ++z)
            for (std::int64_t y = first.y; y <= last.y && !seen; ++y)
                for (std::int64_t x = first.x; x <= last.x && !seen; ++x)
                    seen = visibility.distance[static_cast<std::size_t>((z * counts.y + y) * counts.x + x)] == 0;
        if (!seen && !all) continue;
        // Segments begin and end in those next to it.
        Box box = cube;
        for (int a = 0; a < 3; ++a) box.lower[a] -= 1, box.upper[a] += 1;
        box = intersect(box, region_);
        Index3 root_first, root_last;
        for (int a = 0; a < 3; ++a) {
            root_first[a] = (box.lower[a] - origin_[a]) >> root_bits_;
            root_last[a] = (box.upper[a] - 1 - origin_[a]) >> root_bits_;
        }
        std::int64_t const edge = std::int64_t{1} << root_bits_;
        for (std::int64_t z = root_first.z; z <= root_last.z; ++z)
            for (std::int64_t y = root_first.y; y <= root_last.y; ++y)
                for (std::int64_t x = root_first.x; x <= root_last.x; ++x) {
                    Index3 const lower = origin_ + Index3{x * edge, y * edge, z * edge};
                    mark(nodes_[static_cast<std::size_t>((z * count_.y + y) * count_.x + x)],
                         {lower, lower + Index3{edge, edge, edge}}, box, wanted);
                }
    }
    std::vector<std::size_t> which;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        if (wanted[i] == 0) continue;
        stored.leaves[i].block = static_cast<std::int32_t>(which.size());
        which.push_back(i);
    }
    constexpr std::size_t behind = 64; // lanes fetch four words at a time
    std::size_t const cell_bytes = size_of(sampler.volume().header().dtype), each = block_size * cell_bytes;
    std::size_t const most = std::min(most_bytes, std::size_t{std::numeric_limits<std::int32_t>::max()} - behind);
    if (which.empty() || which.size() > most / each) return {};
    stored.cells.resize(which.size() * each + behind);
    std::fill(stored.cells.end() - static_cast<std::ptrdiff_t>(behind), stored.cells.end(), std::byte{0});
    auto const count = static_cast<std::int64_t>(which.size());
    auto const fill_all = [&]<class T>(T) {
        auto* const blocks = reinterpret_cast<T*>(stored.cells.data());
#pragma omp parallel num_threads(threads)
        {
            Workspace work;
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t i = 0; i < count; ++i) {
                BlockLeaf& leaf = stored.leaves[which[static_cast<std::size_t>(i)]];
                T* const block = blocks + i * block_size;
                fill(sampler, leaf, work, block);
                leaf.visible = shows_something(leaf, block, table) ? 1 : 0;
            }
        }
    };
    with_lattice_type(type, fill_all);
    return stored;
}

/// The bricks that reach the centres of the cells of a block and of those around it, or the nearest positions within a
/// box.
void TreeBlocks::find_reaches(TreeSampler const& sampler, BlockLeaf const& leaf, Box const& within,
                              std::vector<Reach>& reaches) const {
    double place[3][block_edge];
    int points[3];
    Vec3 lower, upper;
    for (int a = 0; a < 3; ++a) {
        auto const width = static_cast<double>(cell_width(dims_, leaf.level)[a]);
        points[a] = leaf.thickness[a] + 2 * block_halo;
        for (int i = 0; i < points[a]; ++i) {
            double const p = static_cast<double>(leaf.lower[a]) + (i - block_halo + 0.5) * width;
            place[a][i] = std::clamp(p, static_cast<double>(within.lower[a]), static_cast<double>(within.upper[a]));
        }
        lower[a] = place[a][0], upper[a] = place[a][points[a] - 1];
    }
    std::vector<std::int32_t> ids;
    sampler.index().query(lower, upper, ids);
    reaches.clear();
    for (std::int32_t const id : ids) {
        Reach& reach = reaches.emplace_back();
        reach.brick = &sampler.bricks()[static_cast<std::size_t>(id)];
        for (int a = 0; a < 3 && reach.brick != nullptr; ++a) {
            reach.first[a] = points[a], reach.last[a] = -1;
            auto const per = static_cast<double>(reach.brick->inverse_width[a]);
            for (int i = 0; i < points[a]; ++i) {
                Taps& taps = reach.taps[a][i];
                taps = taps_at((place[a][i] - reach.brick->lower[a]) * per - 0.5, reach.brick->dims[a]);
                if (taps.count == 0) continue;
                reach.single = reach.single && taps.count == 1;
                reach.first[a] = std::min(reach.first[a], i), reach.last[a] = i;
            }
            if (reach.last[a] < reach.first[a]) reach.brick = nullptr;
        }
        if (reach.brick == nullptr) reaches.pop_back();
    }
}

/// The basis reconstruction there. Beyond the region there need be no bricks: what is on its border goes on.
template <class T>
void TreeBlocks::fill(TreeSampler const& sampler, BlockLeaf const& leaf, Workspace& work, T* block) const {
    auto const* const cells = reinterpret_cast<T const*>(sampler.volume().buffer().read(Space::host));
    find_reaches(sampler, leaf, box_of(dims_), work.reaches);
    std::int64_t wanted = 1, held = 0;
    for (std::uint8_t const n : leaf.thickness) wanted *= n + 2 * block_halo;
    for (Reach const& reach : work.reaches) held += reach.single ? reach.count() : 2 * wanted;
    if (held == wanted) { // every point is a cell, or on the border next to one
        for (Reach const& reach : work.reaches) copy_cells(reach, cells, block);
        return;
    }
    work.sum.fill(0), work.weight.fill(0);
    for (Reach const& reach : work.reaches) add_cells(reach, cells, work);
    if (std::find(work.weight.begin(), work.weight.end(), 0.0F) != work.weight.end()) {
        std::array<float, block_size> const sum = work.sum, weight = work.weight;
        work.sum.fill(0), work.weight.fill(0);
        find_reaches(sampler, leaf, region_, work.reaches);
        for (Reach const& reach : work.reaches) add_cells(reach, cells, work);
        for (std::size_t i = 0; i < block_size; ++i)
            if (weight[i] > 0) work.sum[i] = sum[i], work.weight[i] = weight[i];
    }
    for (std::size_t i = 0; i < block_size; ++i)
        block[i] = work.weight[i] > 0            ? store_cell<T>(work.sum[i] / work.weight[i])
                   : std::is_floating_point_v<T> ? std::numeric_limits<T>::quiet_NaN()
                                                 : T{0};
}

BlocksView TreeBlocks::view(StoredBlocks const& stored) const {
    if (stored.cells.empty()) return {};
    BlocksView view{};
    view.cells = stored.cells.data();
    view.leaves = stored.leaves.data();
    view.nodes = nodes_.data();
    for (int a = 0; a < 3; ++a) {
        view.origin[a] = static_cast<std::int32_t>(origin_[a]);
        view.count[a] = static_cast<std::int32_t>(count_[a]);
        view.thin[a] = dims_[a] == 1;
    }
    view.root_bits = root_bits_;
    return view;
}

} // namespace vkt::render
