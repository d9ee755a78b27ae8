// Affine maps and the search for voxels inside a turned box.
// SPDX-License-Identifier: MIT
#include "libvkt/core/affine.h"

#include "libvkt/core/error.h"
#include "libvkt/core/products.h"

#include <cmath>
#include <limits>

namespace vkt {
namespace {

Vec3 corner(Vec3 low, Vec3 high, int i) {
    return {(i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y, (i & 4) != 0 ? high.z : low.z};
}

/// Smallest and largest coordinates of the images of a box's corners.
std::array<Vec3, 2> bounds_of(Affine const& map, Vec3 low, Vec3 high) {
    double const inf = std::numeric_limits<double>::infinity();
    std::array<Vec3, 2> bounds{{{inf, inf, inf}, {-inf, -inf, -inf}}};
    for (int i = 0; i < 8; ++i) {
        Vec3 const image = map(corner(low, high, i));
        for (int axis = 0; axis < 3; ++axis) {
            bounds[0][axis] = std::min(bounds[0][axis], image[axis]);
            bounds[1][axis] = std::max(bounds[1][axis], image[axis]);
        }
    }
    return bounds;
}

/// Searches the layers of a box for voxels with images between two corners.
class LayerSearch {
public:
    LayerSearch(Affine const& map, Vec3 lower, Vec3 upper) : map_(map), lower_(lower), upper_(upper) {}

    /// Whether the layer of `box` at this index of the axis holds such a voxel; true as well when the search has become
    /// too long.
    bool meets(Box const& box, int axis, std::int64_t index) {
        int along = (axis + 1) % 3, across = (axis + 2) % 3; // rows run along the longer side
        if (box.dims()[along] < box.dims()[across]) std::swap(along, across);
        Vec3 start{};
        start[axis] = static_cast<double>(index);
        for (std::int64_t i = box.lower[across]; i < box.upper[across]; ++i) {
            if (rows_left_-- <= 0) return true;
            start[across] = static_cast<double>(i);
            if (row_meets(map_(start), map_.column[static_cast<std::size_t>(along)],
                          static_cast<double>(box.lower[along]), static_cast<double>(box.upper[along] - 1)))
                return true;
        }
        return false;
    }

private:
    bool row_meets(Vec3 start, Vec3 step, double first, double last) const {
        for (int axis = 0; axis < 3; ++axis) {
            if (step[axis] == 0) {
                if (start[axis] < lower_[axis] || start[axis] > upper_[axis]) return false;
                continue;
            }
            double const a = (lower_[axis] - start[axis]) / step[axis], b = (upper_[axis] - start[axis]) / step[axis];
            first = std::max(first, std::ceil(std::min(a, b)));
            last = std::min(last, std::floor(std::max(a, b)));
        }
        return first <= last;
    }

    Affine map_;
    Vec3 lower_, upper_;
    std::int64_t rows_left_ = std::int64_t{1} << 28;
};

} // namespace

Affine composed(Affine const& outer, Affine const& inner) {
    Affine result;
    result.offset = outer(inner.offset);
    for (std::size_t a = 0; a < 3; ++a) {
        Vec3 const c = inner.column[a];
        result.column[a] = outer.column[0] * c.x + outer.column[1] * c.y + outer.column[2] * c.z;
    }
    return result;
}

Affine index_to_world(Geometry const& g) {
    return {{g.direction[0] * g.spacing.x, g.direction[1] * g.spacing.y, g.direction[2] * g.spacing.z}, g.origin};
}

Affine index_to_index(Geometry const& from, Geometry const& to) {
    Affine map;
    map.offset = world_to_index(to, from.origin);
    Geometry linear = to;
    linear.origin = {};
    for (int axis = 0; axis < 3; ++axis) {
        auto const a = static_cast<std::size_t>(axis);
        map.column[a] = world_to_index(linear, from.direction[a] * from.spacing[axis]);
    }
    return map;
}

Affine inverse(Affine const& map) {
    auto const& [a, b, c] = map.column;
    double const volume = dot(a, cross(b, c));
    if (!(std::abs(volume) > 0) || !std::isfinite(volume))
        throw Error(ErrorKind::data, "the direction vectors are linearly dependent");
    std::array<Vec3, 3> const rows{cross(b, c) * (1 / volume), cross(c, a) * (1 / volume), cross(a, b) * (1 / volume)};
    Affine result;
    for (int i = 0; i < 3; ++i) {
        Vec3 const row = rows[static_cast<std::size_t>(i)];
        for (int j = 0; j < 3; ++j) result.column[static_cast<std::size_t>(j)][i] = row[j];
        result.offset[i] = -dot(row, map.offset);
    }
    return result;
}

Box voxels_within(Affine const& map, Vec3 lower, Vec3 upper, Index3 dims) {
    Vec3 const last{static_cast<double>(dims.x - 1), static_cast<double>(dims.y - 1), static_cast<double>(dims.z - 1)};
    auto const whole = bounds_of(map, {}, last);
    Vec3 low = lower, high = upper;
    for (int axis = 0; axis < 3; ++axis) { // a little beyond every voxel is as good as infinity
        double const margin = 1 + std::abs(whole[1][axis] - whole[0][axis]) * 1e-6;
        low[axis] = std::max(lower[axis], whole[0][axis] - margin);
        high[axis] = std::min(upper[axis], whole[1][axis] + margin);
        if (!(low[axis] <= high[axis])) return {};
    }
    auto const bounds = bounds_of(inverse(map), low, high);
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        // Rounding in the inverse must not cost a layer: the search takes back what is too much.
        double const slack = 1e-6 + 1e-12 * last[axis];
        box.lower[axis] =
            static_cast<std::int64_t>(std::clamp(std::ceil(bounds[0][axis] - slack), 0.0, last[axis] + 1));
        box.upper[axis] =
            static_cast<std::int64_t>(std::clamp(std::floor(bounds[1][axis] + slack) + 1, 0.0, last[axis] + 1));
    }
    LayerSearch search(map, lower, upper);
    for (int axis = 0; axis < 3; ++axis) {
        while (!box.empty() && !search.meets(box, axis, box.lower[axis])) ++box.lower[axis];
        while (!box.empty() && !search.meets(box, axis, box.upper[axis] - 1)) --box.upper[axis];
    }
    return box.empty() ? Box{} : box;
}

} // namespace vkt
