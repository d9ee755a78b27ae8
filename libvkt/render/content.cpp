// The part of a volume that a picture is to show: the furthest visible part in a direction is found best first.
// SPDX-License-Identifier: MIT
#include "libvkt/render/content.h"

#include "libvkt/core/products.h"
#include "libvkt/render/inner/ray.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace vkt::render {

namespace {

constexpr double nothing = -std::numeric_limits<double>::infinity();

} // namespace

/// A row of macrocells from one of them on, or a cube of parts.
struct VisibleContent::Node {
    double bound;             ///< nothing in it reaches further
    Index3 lower;             ///< parts; of a row the macrocell that reaches furthest
    std::int64_t edge, other; ///< parts, 0 of a row; of a row its last macrocell on the other side
    bool whole;               ///< all of it counts as visible

    /// Of what reaches as far, the smallest comes first: it may be the answer.
    bool operator<(Node const& b) const {
        auto const size = [](Node const& n) { return n.edge > 0 ? n.edge : std::numeric_limits<std::int64_t>::max(); };
        return bound < b.bound || (bound == b.bound && size(*this) > size(b));
    }
};

CellParts parts_of(Lattice const& lattice, bool by_voxels) {
    CellGrid const& grid = lattice.cells;
    CellParts parts;
    parts.counts = {grid.nx, grid.ny, grid.nz};
    // Macrocells begin between voxels of the padding and the first ones. Of half voxels two make one such step: the
    // first belongs to the voxel before, the second to the one after.
    std::int64_t const steps = by_voxels ? 2 : 1;
    parts.origin = {-steps, -steps, -steps};
    parts.size = macrocell_size * steps;
    parts.width = 1.0 / static_cast<double>(steps);
    parts.range = [&lattice, by_voxels](Index3 lower, std::int64_t edge) {
        Index3 first = lower, last = lower + Index3{edge, edge, edge};
        for (int axis = 0; axis < 3 && by_voxels; ++axis) first[axis] = (first[axis] + 1) >> 1, last[axis] >>= 1;
        return range_of_voxels(lattice.view, lattice.dims, first, last);
    };
    return parts;
}

CellParts parts_of(Tree const& tree) {
    TreeCells const& cells = tree.cells();
    auto const halves = [](double v) { return static_cast<std::int64_t>(2 * v); };
    CellParts parts;
    parts.counts = {cells.grid.nx, cells.grid.ny, cells.grid.nz};
    parts.origin = {halves(cells.origin.x), halves(cells.origin.y), halves(cells.origin.z)};
    parts.size = halves(cells.size);
    parts.width = 0.5;
    parts.first = -0.5;
    parts.range = [&tree](Index3 lower, std::int64_t edge) { return tree.range_of_part(lower, edge); };
    return parts;
}

VisibleContent::VisibleContent(CellVisibility const& cells, CellParts parts, std::function<bool(float, float)> seen,
                               Geometry const& geometry, Box const& within)
    : cells_(cells), parts_(std::move(parts)), seen_(std::move(seen)), geometry_(geometry) {
    for (int axis = 0; axis < 3; ++axis) {
        lower_[axis] = static_cast<double>(within.lower[axis]) - 0.5;
        upper_[axis] = static_cast<double>(within.upper[axis]) - 0.5;
    }
    Index3 const counts = parts_.counts;
    for (std::int64_t z = 0; z < counts.z; ++z)
        for (std::int64_t y = 0; y < counts.y; ++y) {
            std::int64_t first = 0, last = counts.x - 1;
            while (first <= last && !visible({first, y, z})) ++first;
            while (last >= first && !visible({last, y, z})) --last;
            if (first <= last) rows_.push_back({{first, y, z}, last});
        }
}

bool VisibleContent::visible(Index3 cell) const {
    bool const by_extinction = !cells_.depth.empty(); // of surfaces there is none
    auto const at = static_cast<std::size_t>((cell.z * parts_.counts.y + cell.y) * parts_.counts.x + cell.x);
    return by_extinction ? cells_.majorant[at] > 0 : cells_.distance[at] == 0;
}

/// Unless the parts [lower, upper) that it takes lie outside of what is shown.
void VisibleContent::add(std::vector<Node>& heap, Node node, Index3 lower, Index3 upper, Vec3 direction) const {
    auto const place = [&](std::int64_t part) { return parts_.first + parts_.width * static_cast<double>(part); };
    node.bound = 0;
    for (int axis = 0; axis < 3; ++axis) {
        double const from = std::max(lower_[axis], place(lower[axis])), to = std::min(upper_[axis], place(upper[axis]));
        if (!(from < to)) return;
        node.bound += std::max(direction[axis] * from, direction[axis] * to);
    }
    heap.push_back(node);
    std::push_heap(heap.begin(), heap.end());
}

/// A row of macrocells from the nearest one in the direction to the last one on the other side; both are visible.
void VisibleContent::add_row(std::vector<Node>& heap, Index3 near, std::int64_t other, Vec3 direction) const {
    Index3 lower, upper;
    for (int axis = 0; axis < 3; ++axis) {
        std::int64_t const least = axis == 0 ? std::min(near.x, other) : near[axis],
                           most = axis == 0 ? std::max(near.x, other) : near[axis];
        lower[axis] = parts_.origin[axis] + parts_.size * least;
        upper[axis] = parts_.origin[axis] + parts_.size * (most + 1);
    }
    add(heap, {0, near, 0, other, false}, lower, upper, direction);
}

/// Adds what a node consists of.
void VisibleContent::divide(std::vector<Node>& heap, Node const& node, Vec3 direction) const {
    auto const add_cube = [&](Index3 lower, std::int64_t edge, bool whole) {
        add(heap, {0, lower, edge, 0, whole}, lower, lower + Index3{edge, edge, edge}, direction);
    };
    if (node.edge == 0) {
        Index3 lower, next = node.lower;
        for (int axis = 0; axis < 3; ++axis) lower[axis] = parts_.origin[axis] + parts_.size * next[axis];
        add_cube(lower, parts_.size, false);
        if (next.x == node.other) return;
        std::int64_t const way = node.other > next.x ? 1 : -1;
        do next.x += way;
        while (!visible(next));
        add_row(heap, next, node.other, direction);
        return;
    }
    std::int64_t const half = node.edge / 2;
    for (int i = 0; i < 8; ++i) {
        Index3 const lower = node.lower + Index3{(i & 1) * half, (i >> 1 & 1) * half, (i >> 2 & 1) * half};
        PartRange const range = parts_.range(lower, half);
        if (range.lowest <= range.highest && seen_(range.lowest, range.highest))
            add_cube(lower, half, half == 1 || range.final);
    }
}

double VisibleContent::reach_in_voxels(Vec3 direction) const {
    std::vector<Node> heap;
    heap.reserve(rows_.size());
    for (Row const& row : rows_) {
        Index3 near = row.cell;
        std::int64_t other = row.last;
        if (direction.x > 0) std::swap(near.x, other);
        add_row(heap, near, other, direction);
    }
    while (!heap.empty()) {
        std::pop_heap(heap.begin(), heap.end());
        Node const node = heap.back();
        heap.pop_back();
        if (node.whole) return node.bound;
        divide(heap, node, direction);
    }
    return nothing;
}

bool VisibleContent::any() const { return reach_in_voxels({1, 0, 0}) > nothing; }

double VisibleContent::reach(Vec3 direction) const {
    Matrix3 const to_world = lattice_to_world(geometry_);
    Double3 const d{direction.x, direction.y, direction.z};
    Vec3 const along{dot(to_world.x, d), dot(to_world.y, d), dot(to_world.z, d)};
    return dot(geometry_.origin, direction) + reach_in_voxels(along);
}

std::vector<Vec3> VisibleContent::corners() const {
    Vec3 ends[2];
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 step{0, 0, 0};
        step[axis] = 1;
        ends[1][axis] = reach_in_voxels(step);
        ends[0][axis] = -reach_in_voxels(step * -1.0);
    }
    std::vector<Vec3> corners;
    for (std::size_t i = 0; i < 8; ++i)
        corners.push_back(index_to_world(geometry_, {ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z}));
    return corners;
}

double VisibleContent::radius(Vec3 from) const { return ShownPoints(corners()).radius(from); }

} // namespace vkt::render
