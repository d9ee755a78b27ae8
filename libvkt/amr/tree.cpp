// Brick trees: geometry of bricks, validation and statistics.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/tree.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <utility>

namespace vkt {

Index3 cell_width(Index3 logical_dims, int level) {
    std::int64_t const width = std::int64_t{1} << level;
    return {logical_dims.x == 1 ? 1 : width, logical_dims.y == 1 ? 1 : width, logical_dims.z == 1 ? 1 : width};
}

Box cells_centred_in(Box const& region, Index3 width) {
    Box cells;
    for (int a = 0; a < 3; ++a) {
        // Cell i has its centre at (i + 1/2) width: the first one that is not below the bound.
        auto const first = [&](std::int64_t bound) { return (bound + (width[a] - 1) / 2) / width[a]; };
        cells.lower[a] = first(region.lower[a]);
        cells.upper[a] = first(region.upper[a]);
    }
    return cells;
}

Box bounds_of(Brick const& brick, Index3 logical_dims) {
    Index3 const w = cell_width(logical_dims, brick.level);
    return {brick.lower, brick.lower + Index3{brick.dims.x * w.x, brick.dims.y * w.y, brick.dims.z * w.z}};
}

Box domain_of(Brick const& brick, Index3 logical_dims) {
    Box const b = bounds_of(brick, logical_dims);
    Index3 const w = cell_width(logical_dims, brick.level);
    return {{2 * b.lower.x - w.x, 2 * b.lower.y - w.y, 2 * b.lower.z - w.z},
            {2 * b.upper.x + w.x, 2 * b.upper.y + w.y, 2 * b.upper.z + w.z}};
}

bool domain_meets(Brick const& brick, Index3 logical_dims, Vec3 lower, Vec3 upper) {
    Box const domain = domain_of(brick, logical_dims);
    for (int a = 0; a < 3; ++a)
        if (static_cast<double>(domain.lower[a]) >= 2 * upper[a] ||
            static_cast<double>(domain.upper[a]) <= 2 * lower[a])
            return false;
    return true;
}

double volume_of(Index3 dims) {
    return static_cast<double>(dims.x) * static_cast<double>(dims.y) * static_cast<double>(dims.z);
}

namespace {

[[noreturn]] void refuse(std::size_t i, Brick const& brick, std::string const& why) {
    throw Error(ErrorKind::data, text("brick ", static_cast<std::int64_t>(i), " (lower ", brick.lower, ", dims ",
                                      brick.dims, ", level ", brick.level, ") ", why));
}

void check_brick(std::size_t i, Brick const& brick, Index3 logical_dims) {
    if (brick.level < 0 || brick.level > max_level) refuse(i, brick, text("has no level in 0…", max_level));
    Index3 const w = cell_width(logical_dims, brick.level);
    for (int a = 0; a < 3; ++a) {
        if (brick.dims[a] < 1) refuse(i, brick, "is empty");
        if (brick.lower[a] < 0 || brick.lower[a] >= logical_dims[a] ||
            brick.dims[a] > (logical_dims[a] - brick.lower[a]) / w[a])
            refuse(i, brick, text("leaves the logical grid of ", logical_dims));
    }
}

/// Bricks of one level must agree on where the cells of that level begin.
void check_lattices(Index3 logical_dims, BrickTable const& bricks) {
    std::array<std::int64_t, max_level + 1> first;
    first.fill(-1);
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        auto& reference = first[static_cast<std::size_t>(bricks[i].level)];
        if (reference < 0) reference = static_cast<std::int64_t>(i);
        Index3 const w = cell_width(logical_dims, bricks[i].level);
        Index3 const shift = bricks[i].lower - bricks[static_cast<std::size_t>(reference)].lower;
        if (shift.x % w.x != 0 || shift.y % w.y != 0 || shift.z % w.z != 0)
            refuse(i, bricks[i], text("does not lie on the lattice of brick ", reference));
    }
}

/// Spreads 21 bits so that two zeros follow each.
std::uint64_t spread(std::uint64_t v) {
    v = (v | v << 32) & 0x1f00000000ffffULL;
    v = (v | v << 16) & 0x1f0000ff0000ffULL;
    v = (v | v << 8) & 0x100f00f00f00f00fULL;
    v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
    return (v | v << 2) & 0x1249249249249249ULL;
}

/// An interval of the Morton curve through finest blocks.
struct CurveInterval {
    std::uint64_t begin, end;
    std::size_t brick;
};

/// Intervals of equal blocks, but for short ones at the end of the grid, on the octree's block lattice; empty if the
/// bricks are not of that kind.
std::vector<CurveInterval> curve_intervals(Index3 logical_dims, BrickTable const& bricks) {
    std::vector<CurveInterval> intervals;
    intervals.reserve(bricks.size());
    Index3 n = bricks[0].dims;
    for (Brick const& b : bricks)
        for (int a = 0; a < 3; ++a) n[a] = std::max(n[a], b.dims[a]);
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        Brick const& b = bricks[i];
        Index3 const w = cell_width(logical_dims, b.level);
        if (b.level > 20) return {};
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) {
            std::int64_t const extent = n[a] * w[a];
            // Finest ones may be short where the grid ends: nothing else is in their block.
            bool const ends = b.level == 0 && b.lower[a] + b.dims[a] == logical_dims[a];
            if (b.lower[a] % extent != 0 || (b.dims[a] != n[a] && !ends)) return {};
            // A flat axis has one block at every level; the curve then runs through the other axes at block 0.
            std::int64_t const block = b.lower[a] / extent << (logical_dims[a] == 1 ? 0 : b.level);
            if (block >= std::int64_t{1} << 21) return {};
            key |= spread(static_cast<std::uint64_t>(block)) << a;
        }
        intervals.push_back({key, key + (std::uint64_t{1} << 3 * b.level), i});
    }
    return intervals;
}

/// The same for cubes of 2^n finest cells on the lattice of their size, the edges of which may differ, and that end
/// with the grid: bricks of mixed sizes. Two such cubes are apart, or one holds the other and its bricks overlap.
std::vector<CurveInterval> cube_intervals(Index3 logical_dims, BrickTable const& bricks) {
    std::vector<CurveInterval> intervals;
    intervals.reserve(bricks.size());
    for (int a = 0; a < 3; ++a)
        if (logical_dims[a] > std::int64_t{1} << 20) return {};
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        Brick const& b = bricks[i];
        Box const box = bounds_of(b, logical_dims);
        auto const longest = static_cast<std::uint64_t>(std::max({box.dims().x, box.dims().y, box.dims().z}));
        std::uint64_t const edge = std::bit_ceil(longest);
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) {
            auto const lower = static_cast<std::uint64_t>(box.lower[a]);
            bool const fills = static_cast<std::uint64_t>(box.dims()[a]) == edge;
            if (lower % edge != 0 || (!fills && box.upper[a] != logical_dims[a])) return {};
            key |= spread(lower) << a;
        }
        intervals.push_back({key, key + edge * edge * edge, i});
    }
    return intervals;
}

void check_overlap_on_curve(BrickTable const& bricks, std::vector<CurveInterval>& intervals) {
    auto const before = [](CurveInterval const& a, CurveInterval const& b) { return a.begin < b.begin; };
    if (!std::is_sorted(intervals.begin(), intervals.end(), before))
        std::sort(intervals.begin(), intervals.end(), before);
    for (std::size_t i = 1; i < intervals.size(); ++i)
        if (intervals[i].begin < intervals[i - 1].end)
            refuse(intervals[i].brick, bricks[intervals[i].brick],
                   text("overlaps brick ", static_cast<std::int64_t>(intervals[i - 1].brick)));
}

void check_overlap_by_index(Index3 logical_dims, BrickTable const& bricks) {
    BrickIndex const index(logical_dims, bricks);
    std::vector<std::int32_t> near;
    for (std::size_t i = 0; i < bricks.size(); ++i) {
        Box const box = bounds_of(bricks[i], logical_dims);
        auto const corner = [](Index3 v) {
            return Vec3{static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
        };
        index.query(corner(box.lower), corner(box.upper), near);
        for (std::int32_t const other : near) {
            auto const o = static_cast<std::size_t>(other);
            if (o < i && !intersect(box, bounds_of(bricks[o], logical_dims)).empty())
                refuse(i, bricks[i], text("overlaps brick ", other));
        }
    }
}

} // namespace

void check_bricks(Index3 logical_dims, BrickTable const& bricks) {
    for (int a = 0; a < 3; ++a)
        if (logical_dims[a] < 1 || logical_dims[a] > max_extent)
            throw Error(ErrorKind::data, text("logical grid of ", logical_dims, " is not one of 1…2^40 cells an axis"));
    if (bricks.empty()) throw Error(ErrorKind::data, "hierarchical volume has no bricks");
    for (std::size_t i = 0; i < bricks.size(); ++i) check_brick(i, bricks[i], logical_dims);
    check_lattices(logical_dims, bricks);
}

void validate_tree(Index3 logical_dims, BrickTable const& bricks, Coverage coverage) {
    check_bricks(logical_dims, bricks);
    double covered = 0;
    for (Brick const& brick : bricks) covered += volume_of(bounds_of(brick, logical_dims).dims());
    auto intervals = curve_intervals(logical_dims, bricks);
    if (intervals.empty()) intervals = cube_intervals(logical_dims, bricks);
    if (!intervals.empty())
        check_overlap_on_curve(bricks, intervals);
    else
        check_overlap_by_index(logical_dims, bricks);
    double const logical = volume_of(logical_dims);
    if (coverage == Coverage::complete && covered != logical)
        throw Error(ErrorKind::data, text("leaf blocks cover ", covered, " finest cells, but the domain has ", logical),
                    "the file lacks blocks or states wrong block positions");
}

BrickTable table_of_numbers(BrickPacking const& packing, std::vector<std::uint32_t> words, Header const& header) {
    BrickTable table(packing, std::move(words), header.cell_count);
    validate_tree(header.dims, table, Coverage::may_have_holes);
    return table;
}

TreeSummary summarise(Index3 logical_dims, BrickTable const& bricks) {
    std::map<int, LevelSummary> levels;
    TreeSummary summary;
    for (Brick const& brick : bricks) {
        LevelSummary& level = levels[brick.level];
        double const volume = volume_of(bounds_of(brick, logical_dims).dims());
        level.level = brick.level;
        level.bricks += 1;
        level.cells += brick.cells();
        level.volume += volume;
        summary.covered += volume;
    }
    for (auto const& entry : levels) summary.levels.push_back(entry.second);
    summary.logical = volume_of(logical_dims);
    summary.table_bytes = bricks.bytes();
    return summary;
}

bool is_uniform(Header const& header) {
    return header.kind == Kind::structured ||
           (header.level_count == 1 && static_cast<double>(header.cell_count) == volume_of(header.dims));
}

std::optional<double> stored_background(Header const& header) {
    auto const attribute = header.attributes.find("background");
    if (attribute == header.attributes.end()) return std::nullopt;
    if (header.kind == Kind::structured && !is_number(attribute->second)) return std::nullopt;
    try {
        return header.values.stored(parse_double(attribute->second));
    } catch (Error const& error) {
        throw Error(ErrorKind::data, text("attribute 'background' of the hierarchical volume: ", error.what()));
    }
}

} // namespace vkt
