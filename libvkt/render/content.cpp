// The part of a volume that a picture is to show: by branch and bound.
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
    parts.range = [&lattice, by_voxels](Box const& part) {
        Index3 first = part.lower, last = part.upper;
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
    parts.range = [&tree](Box const& part) { return tree.range_of_part(part); };
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

/// The furthest visible part in a direction: rows of macrocells in the order of how far they may reach, and each of
/// their macrocells divided, as far as it may reach further than what was found.
class VisibleContent::Search {
public:
    Search(VisibleContent const& content, Vec3 direction)
        : content_(content), parts_(content.parts_), direction_(direction) {}

    double run() {
        heap_.reserve(content_.rows_.size());
        for (Row const& row : content_.rows_) {
            Index3 near = row.first;
            std::int64_t far = row.last;
            if (direction_.x > 0) std::swap(near.x, far);
            heap_.push_back(rest_of_row(near, far));
        }
        std::make_heap(heap_.begin(), heap_.end());
        while (!heap_.empty() && heap_.front().bound > best_) {
            std::pop_heap(heap_.begin(), heap_.end());
            Rest const rest = heap_.back();
            heap_.pop_back();
            Index3 next = rest.near;
            look_into(part_of(next), parts_.size);
            if (next.x == rest.far) continue;
            std::int64_t const way = rest.far > next.x ? 1 : -1;
            do next.x += way;
            while (!content_.visible(next));
            heap_.push_back(rest_of_row(next, rest.far));
            std::push_heap(heap_.begin(), heap_.end());
        }
        return best_;
    }

private:
    /// Of a row of macrocells, from the one that may reach furthest to the last one on the other side; both are
    /// visible.
    struct Rest {
        double bound;
        Index3 near;
        std::int64_t far;
        bool operator<(Rest const& b) const { return bound < b.bound; }
    };

    Index3 part_of(Index3 cell) const {
        Index3 part;
        for (int axis = 0; axis < 3; ++axis) part[axis] = parts_.origin[axis] + parts_.size * cell[axis];
        return part;
    }
    double place(std::int64_t part) const { return parts_.first + parts_.width * static_cast<double>(part); }

    /// How far parts reach along each axis, and altogether; lowest if they lie outside of what is shown.
    double bound_of(Box const& parts, Vec3& along) const {
        double sum = 0;
        for (int axis = 0; axis < 3; ++axis) {
            double const from = std::max(content_.lower_[axis], place(parts.lower[axis])),
                         to = std::min(content_.upper_[axis], place(parts.upper[axis]));
            if (!(from < to)) return nothing;
            along[axis] = std::max(direction_[axis] * from, direction_[axis] * to);
            sum += along[axis];
        }
        return sum;
    }
    Rest rest_of_row(Index3 near, std::int64_t far) const {
        Index3 first = near, last = near;
        first.x = std::min(near.x, far), last.x = std::max(near.x, far);
        Vec3 along;
        return {bound_of({part_of(first), part_of(last + Index3{1, 1, 1})}, along), near, far};
    }

    /// Those of a cube's parts that may reach further than what was found.
    Box further(Box part, Vec3 along, double bound) const {
        for (int axis = 0; axis < 3; ++axis) {
            if (direction_[axis] == 0) continue;
            // The others give what they can; this one has to reach here.
            double const least = (best_ - (bound - along[axis])) / direction_[axis];
            double const at = (least - parts_.first) / parts_.width;
            if (direction_[axis] > 0 && at > static_cast<double>(part.lower[axis]))
                part.lower[axis] = std::min(static_cast<std::int64_t>(std::floor(at)), part.upper[axis] - 1);
            if (direction_[axis] < 0 && at < static_cast<double>(part.upper[axis]))
                part.upper[axis] = std::max(static_cast<std::int64_t>(std::ceil(at)), part.lower[axis] + 1);
        }
        return part;
    }

    void look_into(Index3 lower, std::int64_t edge) {
        Box const cube{lower, lower + Index3{edge, edge, edge}};
        Vec3 along;
        double const bound = bound_of(cube, along);
        if (!(bound > best_)) return;
        PartRange const range = parts_.range(best_ > nothing ? further(cube, along, bound) : cube);
        if (!(range.lowest <= range.highest) || !content_.seen_(range.lowest, range.highest)) return;
        if (edge <= std::max<std::int64_t>(1, range.resolution)) {
            best_ = bound;
            return;
        }
        std::int64_t const half = edge / 2;
        for (int i = 0; i < 8; ++i) { // the one that may reach furthest comes first
            int const k = i ^ (direction_.x > 0 ? 1 : 0) ^ (direction_.y > 0 ? 2 : 0) ^ (direction_.z > 0 ? 4 : 0);
            look_into(lower + Index3{(k & 1) * half, (k >> 1 & 1) * half, (k >> 2 & 1) * half}, half);
        }
    }

    VisibleContent const& content_;
    CellParts const& parts_;
    Vec3 direction_;
    std::vector<Rest> heap_;
    double best_ = nothing;
};

double VisibleContent::reach_in_voxels(Vec3 direction) const { return Search(*this, direction).run(); }

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
