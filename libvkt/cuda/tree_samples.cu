// Grids sampled from hierarchical volumes in device memory: a thread a sample, which looks for its bricks in the index.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/sampler.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

namespace vkt {

namespace cuda {
namespace {

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
    float const low = bounded ? static_cast<float>(rule.range.minimum) : -HUGE_VALF,
                high = bounded ? static_cast<float>(rule.range.maximum) : HUGE_VALF;
    driver::for_each_voxel(out.dims(), BasisSamples<T>{tree, positions, to, low, high, background}, nullptr,
                           "tree_basis");
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
