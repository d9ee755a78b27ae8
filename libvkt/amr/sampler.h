// Point sampling of hierarchical volumes: value and gradient of the basis reconstruction at any position.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/tree.h"
#include "libvkt/core/view.h"
#include "libvkt/kernel/host_device.h"

#include <vector>

namespace vkt {

/// A brick as samplers see it; positions in finest cells.
struct SampledBrick {
    double lower[3];
    float inverse_width[3]; ///< 1 / cell width: powers of two, exact
    std::int32_t dims[3];
    std::int64_t offset; ///< of its first cell
};

/// Value and weight of a sample: weight 0 means that no brick reaches the position, and value is 0 then.
struct TreeSample {
    float value = 0, weight = 0;
};

/// Gradient per finest cell along the index axes.
struct TreeGradientSample {
    float value = 0, weight = 0;
    float gradient[3] = {0, 0, 0};
};

/// Plain pointers that kernels copy: everything a sample needs, in one memory space.
template <class T> struct SamplerView {
    IndexNode const* nodes = nullptr;
    std::int32_t const* order = nullptr;
    SampledBrick const* bricks = nullptr;
    T const* cells = nullptr;
};

namespace detail {

/// Bricks at a point that one traversal collects; a point in the corner of eight bricks has eight.
inline constexpr int most_bricks_at_once = 24;

VKT_HD bool reaches(SampledBrick const& brick, double const* p, float* q) {
    for (int a = 0; a < 3; ++a) {
        double const local = (p[a] - brick.lower[a]) * static_cast<double>(brick.inverse_width[a]) - 0.5;
        if (!(local > -1.0 && local < static_cast<double>(brick.dims[a]))) return false;
        q[a] = static_cast<float>(local);
    }
    return true;
}

/// The smallest ids above `after` of bricks near p, ascending, so that sums do not depend on the hierarchy.
template <class T>
VKT_HD int collect(SamplerView<T> const& view, double const* p, std::int32_t after, std::int32_t* ids) {
    int count = 0, depth = 0;
    std::int32_t stack[64];
    stack[depth++] = 0;
    while (depth > 0) {
        IndexNode const node = view.nodes[stack[--depth]];
        if (!(p[0] > static_cast<double>(node.lower[0]) && p[0] < static_cast<double>(node.upper[0]) &&
              p[1] > static_cast<double>(node.lower[1]) && p[1] < static_cast<double>(node.upper[1]) &&
              p[2] > static_cast<double>(node.lower[2]) && p[2] < static_cast<double>(node.upper[2])))
            continue;
        if (node.count == 0) {
            stack[depth++] = node.first;
            stack[depth++] = node.first + 1;
            continue;
        }
        for (std::int32_t k = 0; k < node.count; ++k) {
            std::int32_t const id = view.order[node.first + k];
            float q[3];
            if (id <= after || !reaches(view.bricks[id], p, q)) continue;
            if (count == most_bricks_at_once && id > ids[count - 1]) continue;
            int at = count < most_bricks_at_once ? count++ : count - 1;
            for (; at > 0 && ids[at - 1] > id; --at) ids[at] = ids[at - 1];
            ids[at] = id;
        }
    }
    return count;
}

/// Calls visit(weight factors per tap and axis, cell) for the up to eight cells of a brick that reach the point.
template <class T, class Visit>
VKT_HD void visit_cells(SamplerView<T> const& view, SampledBrick const& brick, double const* p, Visit visit) {
    std::int32_t first[3];
    float t[3];
    for (int a = 0; a < 3; ++a) {
        double const q = (p[a] - brick.lower[a]) * static_cast<double>(brick.inverse_width[a]) - 0.5;
        double const floor = __builtin_floor(q);
        first[a] = static_cast<std::int32_t>(floor);
        t[a] = static_cast<float>(q - floor);
    }
    for (int corner = 0; corner < 8; ++corner) {
        float hat[3], slope[3];
        std::int64_t at[3];
        bool inside = true;
        for (int a = 0; a < 3; ++a) {
            int const bit = corner >> a & 1;
            at[a] = first[a] + bit;
            inside = inside && at[a] >= 0 && at[a] < brick.dims[a];
            hat[a] = bit != 0 ? t[a] : 1.0f - t[a];
            slope[a] = bit != 0 ? brick.inverse_width[a] : -brick.inverse_width[a];
        }
        if (!inside) continue;
        visit(hat, slope,
              static_cast<float>(view.cells[brick.offset + (at[2] * brick.dims[1] + at[1]) * brick.dims[0] + at[0]]));
    }
}

} // namespace detail

/// The basis reconstruction at (x, y, z) in finest cells (the centre of the first one is 0.5). Same sums in the same
/// order on every back end, whatever the hierarchy's shape. Expected O(log bricks).
template <class T> VKT_HD TreeSample sample(SamplerView<T> const& view, double x, double y, double z) {
    double const p[3] = {x, y, z};
    float sum = 0, weight = 0;
    std::int32_t ids[detail::most_bricks_at_once], after = -1;
    int count;
    do {
        count = detail::collect(view, p, after, ids);
        for (int i = 0; i < count; ++i)
            detail::visit_cells(view, view.bricks[ids[i]], p, [&](float const* hat, float const*, float cell) {
                float const h = hat[0] * hat[1] * hat[2];
                // A cell without weight must not spread its NaN.
                if (h > 0) {
                    sum += h * cell;
                    weight += h;
                }
            });
        if (count > 0) after = ids[count - 1];
    } while (count == detail::most_bricks_at_once);
    return weight > 0 ? TreeSample{sum / weight, weight} : TreeSample{};
}

/// The same with the gradient by the quotient rule, grad f = (W grad S - S grad W) / W^2; each brick's slopes carry
/// its own 1 / cell width, so normals stay right where levels meet.
template <class T> VKT_HD TreeGradientSample sample_gradient(SamplerView<T> const& view, double x, double y, double z) {
    double const p[3] = {x, y, z};
    float sum = 0, weight = 0, sum_slope[3] = {0, 0, 0}, weight_slope[3] = {0, 0, 0};
    std::int32_t ids[detail::most_bricks_at_once], after = -1;
    int count;
    do {
        count = detail::collect(view, p, after, ids);
        for (int i = 0; i < count; ++i)
            detail::visit_cells(view, view.bricks[ids[i]], p, [&](float const* hat, float const* slope, float cell) {
                float const d[3] = {slope[0] * hat[1] * hat[2], hat[0] * slope[1] * hat[2], hat[0] * hat[1] * slope[2]};
                float const h = hat[0] * hat[1] * hat[2];
                if (h > 0) {
                    sum += h * cell;
                    weight += h;
                }
                for (int a = 0; a < 3; ++a) {
                    if (d[a] == 0) continue;
                    sum_slope[a] += d[a] * cell;
                    weight_slope[a] += d[a];
                }
            });
        if (count > 0) after = ids[count - 1];
    } while (count == detail::most_bricks_at_once);
    TreeGradientSample result;
    if (!(weight > 0)) return result;
    result.value = sum / weight;
    result.weight = weight;
    for (int a = 0; a < 3; ++a)
        result.gradient[a] = (weight * sum_slope[a] - sum * weight_slope[a]) / (weight * weight);
    return result;
}

/// Owns the index and brick records of a hierarchical volume for sampling in host memory; share it between threads.
/// Memory: about 90 bytes a brick. Throws Error{failure} for structured volumes, Error{resources} for bricks of more
/// than 2^31 cells along an axis.
class TreeSampler {
public:
    explicit TreeSampler(Volume volume);

    Volume const& volume() const { return volume_; }
    BrickIndex const& index() const { return index_; }
    std::span<SampledBrick const> bricks() const { return bricks_; }

    /// The view for cells stored as T, which must be the volume's type.
    template <class T> SamplerView<T> view() const {
        return {index_.nodes().data(), index_.order().data(), bricks_.data(), reinterpret_cast<T const*>(cells_)};
    }

    /// Samples whatever the volume's type is; the position in finest cells.
    TreeSample sample(Vec3 position) const;
    TreeGradientSample sample_gradient(Vec3 position) const;

private:
    Volume volume_;
    BrickIndex index_;
    std::vector<SampledBrick> bricks_;
    std::byte const* cells_ = nullptr;
};

} // namespace vkt
