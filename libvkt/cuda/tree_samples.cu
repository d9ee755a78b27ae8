// Grids sampled from hierarchical volumes in device memory: a thread a sample, which looks for its bricks in the index.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/sampler.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace cuda {
namespace {

/// By how much shares of a voxel that add up to one may miss it.
constexpr double weight_rounding = 1e-9;

/// Sample i of an axis lies at lower + (i + 1/2) * step.
struct Positions {
    double lower[3], step[3];
    std::int64_t first[3];

    __device__ __forceinline__ double at(int axis, std::int64_t i) const {
        return lower[axis] + (static_cast<double>(first[axis] + i) + 0.5) * step[axis];
    }
};

template <class T> struct BasisSamples {
    SamplerView<T> tree;
    Positions positions;
    View<T> out;
    float low, high;
    T background;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        TreeSample const sample = vkt::sample(tree, positions.at(0, x), positions.at(1, y), positions.at(2, z));
        float const value = sample.value < low ? low : sample.value > high ? high : sample.value; // NaN stays
        out(x, y, z) = sample.weight > 0 ? round_to<T>(value) : background;
    }
};

/// The cell that holds a sample; where bricks overlap, that of the last one.
template <class T> struct NearestSamples {
    SamplerView<T> tree;
    Positions positions;
    View<T> out;
    T background;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        double const p[3] = {positions.at(0, x), positions.at(1, y), positions.at(2, z)};
        T value = background;
        std::int32_t ids[detail::most_bricks_at_once], after = -1;
        int count = 0;
        do {
            count = detail::collect(tree, p, after, ids);
            for (int i = 0; i < count; ++i) {
                SampledBrick const& brick = tree.bricks[ids[i]];
                std::int64_t cell[3];
                bool inside = true;
                for (int a = 0; a < 3; ++a) {
                    double const local = (p[a] - brick.lower[a]) * static_cast<double>(brick.inverse_width[a]);
                    inside = inside && local >= 0 && local < static_cast<double>(brick.dims[a]);
                    cell[a] = static_cast<std::int64_t>(local);
                }
                if (inside)
                    value = tree.cells[brick.offset + (cell[2] * brick.dims[1] + cell[1]) * brick.dims[0] + cell[0]];
            }
            if (count > 0) after = ids[count - 1];
        } while (count == detail::most_bricks_at_once);
        out(x, y, z) = value;
    }
};

/// Of a brick along an axis: where it begins, its cells, and how wide they are, in finest cells.
struct BrickAxis {
    double lower, width;
    std::int64_t dims;

    __device__ __forceinline__ BrickAxis(SampledBrick const& brick, int a)
        : lower(brick.lower[a]), width(1 / static_cast<double>(brick.inverse_width[a])), dims(brick.dims[a]) {}
    __device__ __forceinline__ double upper() const { return lower + static_cast<double>(dims) * width; }
};

/// A voxel of the grid: from face to face.
struct VoxelBox {
    double low[3], high[3];

    __device__ __forceinline__ VoxelBox(Positions const& positions, std::int64_t x, std::int64_t y, std::int64_t z) {
        std::int64_t const at[3] = {x, y, z};
        for (int a = 0; a < 3; ++a) {
            std::int64_t const i = positions.first[a] + at[a];
            low[a] = positions.lower[a] + static_cast<double>(i) * positions.step[a];
            high[a] = positions.lower[a] + static_cast<double>(i + 1) * positions.step[a];
        }
    }
    __device__ __forceinline__ bool meets(SampledBrick const& brick) const {
        for (int a = 0; a < 3; ++a) {
            BrickAxis const axis(brick, a);
            if (!(high[a] > axis.lower && low[a] < axis.upper())) return false;
        }
        return true;
    }
    __device__ __forceinline__ bool meets(IndexNode const& node) const {
        for (int a = 0; a < 3; ++a)
            if (!(high[a] > static_cast<double>(node.lower[a]) && low[a] < static_cast<double>(node.upper[a])))
                return false;
        return true;
    }
    /// Calls visit(brick) for the bricks that it overlaps, in the order of the index.
    template <class T, class Visit>
    __device__ void for_each_brick(SamplerView<T> const& tree, Visit const& visit) const {
        std::int32_t stack[64];
        int depth = 0;
        stack[depth++] = 0;
        while (depth > 0) {
            IndexNode const node = tree.nodes[stack[--depth]];
            if (!meets(node)) continue;
            if (node.count == 0) {
                stack[depth++] = node.first;
                stack[depth++] = node.first + 1;
                continue;
            }
            for (std::int32_t k = 0; k < node.count; ++k) {
                SampledBrick const& brick = tree.bricks[tree.order[node.first + k]];
                if (meets(brick)) visit(brick);
            }
        }
    }
};

/// Cells of a brick that reach into a voxel along an axis, and their shares of it.
struct AxisOverlap {
    double low, high, per_step;
    BrickAxis brick;
    std::int64_t first, end;

    __device__ __forceinline__ AxisOverlap(VoxelBox const& voxel, double step, SampledBrick const& of, int a)
        : low(voxel.low[a]), high(voxel.high[a]), per_step(1 / step), brick(of, a) {
        double const per_width = static_cast<double>(of.inverse_width[a]);
        auto const from = static_cast<std::int64_t>(floor((low - brick.lower) * per_width)),
                   to = static_cast<std::int64_t>(ceil((high - brick.lower) * per_width));
        first = min(max(from, std::int64_t{0}), brick.dims - 1);
        end = min(max(to, std::int64_t{1}), brick.dims);
    }
    __device__ __forceinline__ double share(std::int64_t c) const {
        double const cell = brick.lower + static_cast<double>(c) * brick.width, begin = fmax(cell, low),
                     stop = fmin(cell + brick.width, high);
        return stop > begin ? (stop - begin) * per_step : 0.0;
    }
};

/// Means of the cells that voxels overlap, by volume, as average_tile() makes them.
template <class T> struct AverageSamples {
    SamplerView<T> tree;
    Positions positions;
    View<T> out;
    double low, high, background;
    double extent[3];

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        out(x, y, z) = at(VoxelBox(positions, x, y, z));
    }
    __device__ T at(VoxelBox const& voxel) const {
        double sum = 0, weight = 0;
        voxel.for_each_brick(tree, [&](SampledBrick const& brick) {
            AxisOverlap const overlap[3] = {{voxel, positions.step[0], brick, 0},
                                            {voxel, positions.step[1], brick, 1},
                                            {voxel, positions.step[2], brick, 2}};
            double along_x = 0, across = 0;
            for (std::int64_t c = overlap[0].first; c < overlap[0].end; ++c) along_x += overlap[0].share(c);
            for (std::int64_t k = overlap[2].first; k < overlap[2].end; ++k)
                for (std::int64_t j = overlap[1].first; j < overlap[1].end; ++j) {
                    double const share = overlap[2].share(k) * overlap[1].share(j);
                    if (share == 0) continue;
                    across += share;
                    T const* const row = tree.cells + brick.offset + (k * brick.dims[1] + j) * brick.dims[0];
                    for (std::int64_t c = overlap[0].first; c < overlap[0].end; ++c) {
                        double const own = overlap[0].share(c); // what has no share must not spread its NaN
                        if (own > 0) sum += share * own * static_cast<double>(row[c]);
                    }
                }
            weight += along_x * across;
        });
        if (!(weight > 0)) return round_to<T>(background);
        double value = sum / weight;
        value = value < low ? low : value > high ? high : value; // NaN stays
        return round_to<T>(weight < 1 - weight_rounding ? with_background(value, weight, voxel) : value);
    }

private:
    __device__ double with_background(double mean, double covered, VoxelBox const& voxel) const {
        double inside = 1;
        for (int a = 0; a < 3; ++a) {
            double const share =
                (fmin(voxel.low[a] + positions.step[a], extent[a]) - fmax(voxel.low[a], 0.0)) / positions.step[a];
            inside *= fmin(fmax(share, 0.0), 1.0);
        }
        if (!(background - background == 0) || covered >= inside * (1 - weight_rounding)) return mean;
        double const share = covered / inside, mixed = mean * share + background * (1 - share);
        return fmin(fmax(mixed, fmin(mean, background)), fmax(mean, background));
    }
};

/// The one or the other, as the cells at a voxel are narrow or wide.
template <class T> struct AutomaticSamples {
    AverageSamples<T> average;
    BasisSamples<T> basis;
    bool holes;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        Positions const& positions = average.positions;
        VoxelBox const voxel(positions, x, y, z);
        double const p[3] = {positions.at(0, x), positions.at(1, y), positions.at(2, z)};
        bool narrow = false, covered = false;
        voxel.for_each_brick(average.tree, [&](SampledBrick const& brick) {
            bool inside = true;
            for (int a = 0; a < 3; ++a) {
                BrickAxis const axis(brick, a);
                narrow = narrow || positions.step[a] >= 2 * axis.width;
                inside = inside && p[a] >= axis.lower && p[a] < axis.upper();
            }
            covered = covered || inside;
        });
        if (narrow || (holes && !covered))
            average.out(x, y, z) = average.at(voxel);
        else
            basis(x, y, z, counts);
    }
};

template <class T>
void sample_all(SamplerView<std::byte> const& any, Positions const& positions, TileRule const& rule, AnyView out) {
    SamplerView<T> const tree{any.nodes, any.order, any.bricks, reinterpret_cast<T const*>(any.cells)};
    View<T> to = out.template as<T>();
    to.lower = {};
    T const background = round_to<T>(rule.background);
    if (rule.method == Reconstruction::nearest)
        return driver::for_each_voxel(out.dims(), NearestSamples<T>{tree, positions, to, background}, nullptr,
                                      "tree_nearest");
    bool const bounded = !rule.range.empty();
    double const low = bounded ? rule.range.minimum : -HUGE_VAL, high = bounded ? rule.range.maximum : HUGE_VAL;
    AverageSamples<T> const average{
        tree, positions, to, low, high, rule.background, {rule.extent.x, rule.extent.y, rule.extent.z}};
    if (rule.method == Reconstruction::average)
        return driver::for_each_voxel(out.dims(), average, nullptr, "tree_average");
    BasisSamples<T> const basis{tree, positions, to, static_cast<float>(low), static_cast<float>(high), background};
    if (rule.method == Reconstruction::basis) return driver::for_each_voxel(out.dims(), basis, nullptr, "tree_basis");
    driver::for_each_voxel(out.dims(), AutomaticSamples<T>{average, basis, rule.holes}, nullptr, "tree_automatic");
}

} // namespace
} // namespace cuda

void sample_tree_on_device(SamplerView<std::byte> const& tree, SampleGrid const& grid, TileRule const& rule,
                           AnyView out) {
    cuda::Positions positions{};
    for (int a = 0; a < 3; ++a) {
        positions.lower[a] = grid.lower[a];
        positions.step[a] = grid.step[a];
        positions.first[a] = out.box.lower[a];
    }
    with_type(out.type, [&]<class T>(T) { cuda::sample_all<T>(tree, positions, rule, out); });
}

} // namespace vkt
