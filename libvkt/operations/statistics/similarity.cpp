// Similarity: blocks for the windows, slabs for the joint histogram.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/similarity.h"

#include "libvkt/engine/cut.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/statistics/kernels/joint_counts.h"
#include "libvkt/operations/statistics/kernels/physical_values.h"
#include "libvkt/operations/statistics/kernels/similarity.h"
#include "libvkt/operations/statistics/slabs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace vkt {
namespace {

/// On the volume's own lattice, so that the order of sums depends on nothing else.
constexpr std::int64_t block = similarity_segment;
/// So many voxels in a row keep a GPU busy; a CPU's cache has room for one block.
constexpr std::int64_t row_of_blocks_on_gpu = 32 * block;

/// The value of one voxel.
double value_at(Source& source, Index3 at) {
    Slabs voxel(source, Execution{});
    double value = 0;
    baseline::load_values(voxel.at({at, at + Index3{1, 1, 1}}), at, 1, source.header().values, &value);
    return value;
}

/// Calls f(SlabPair) for slabs of both volumes.
template <class F> void for_each_slab(Source& a, Source& b, Execution const& on, F const& f) {
    Header const& header = size_of(a.header().dtype) > size_of(b.header().dtype) ? a.header() : b.header();
    Slabs slabs_a(a, on), slabs_b(b, on);
    for_each_piece(box_of(header.dims), cut_of(header, slab_hint_on(on, header, 0), on), [&](Box const& box) {
        ProgressPart const share = part_of(on.monitor, box_of(header.dims), box);
        f(SlabPair{slabs_a.at(box), slabs_b.at(box), a.header().values, b.header().values});
    });
}

/// Edges of equal bins between two values, as numpy.linspace has them.
class EdgesBetween {
public:
    EdgesBetween(double low, double high, int bins) : edges_(static_cast<std::size_t>(bins) + 1) {
        if (!(low < high)) { // a single value
            low -= 0.5;
            high += 0.5;
        }
        double const step = (high - low) / bins;
        for (int k = 0; k < bins; ++k) edges_[static_cast<std::size_t>(k)] = k * step + low;
        edges_.back() = high;
        scale_ = bins / (high - low);
    }
    EqualBins bins() const { return {edges_.data(), static_cast<int>(edges_.size()) - 1, scale_}; }

private:
    std::vector<double> edges_;
    double scale_ = 0;
};

/// Of counts that have this sum.
double entropy(std::vector<std::uint64_t> const& counts, double total) {
    double sum = 0;
    for (std::uint64_t const count : counts)
        if (count > 0) sum -= static_cast<double>(count) / total * std::log(static_cast<double>(count) / total);
    return sum;
}

} // namespace

double structural_similarity(Source& a, Source& b, double range, Execution const& execution) {
    Execution const on = where_looked_at(execution, a.space() == Space::device && b.space() == Space::device);
    Index3 const n = a.header().dims;
    WindowedPair pair{};
    pair.map_a = a.header().values;
    pair.map_b = b.header().values;
    pair.c1 = 0.01 * range * 0.01 * range;
    pair.c2 = 0.03 * range * 0.03 * range;
    double sum = 0;
    for (std::int64_t k = 0; k <= window_radius; ++k) {
        pair.weights[k] = std::exp(-static_cast<double>(k * k) / (2 * 1.5 * 1.5));
        sum += k == 0 ? pair.weights[k] : 2 * pair.weights[k];
    }
    for (double& weight : pair.weights) weight /= sum;
    Box inner = box_of(n);
    for (int axis = 0; axis < 3; ++axis) {
        pair.radius[axis] = n[axis] > 1 ? window_radius : 0;
        bool const cut = n[axis] > 2 * window_radius;
        inner.lower[axis] += cut ? window_radius : 0;
        inner.upper[axis] -= cut ? window_radius : 0;
    }
    // Squares of values less one of their own lose nothing to a large offset.
    pair.offset = value_at(a, inner.lower);
    Slabs slabs_a(a, on, Boundary::mirror), slabs_b(b, on, Boundary::mirror);
    bool const on_gpu = on.device == Device::gpu;
    Index3 const piece{on_gpu ? row_of_blocks_on_gpu : block, block, block};
    std::vector<double> planes, rows;
    long double total = 0;
    std::int64_t done = 0;
    for (std::int64_t z = inner.lower.z; z < inner.upper.z; z += piece.z)
        for (std::int64_t y = inner.lower.y; y < inner.upper.y; y += piece.y)
            for (std::int64_t x = inner.lower.x; x < inner.upper.x; x += piece.x) {
                Index3 const lower{x, y, z};
                pair.inner = intersect({lower, lower + piece}, inner);
                ProgressPart const share(on.monitor, done, pair.inner.voxels(), inner.voxels());
                done += pair.inner.voxels();
                Index3 const dims = pair.inner.dims();
                Box const around = grow(pair.inner, pair.radius);
                pair.a = slabs_a.at(around);
                pair.b = slabs_b.at(around);
                if (!on_gpu) planes.resize(static_cast<std::size_t>(5 * dims.x * dims.y * around.dims().z));
                pair.planes = planes.data();
                std::int64_t const segments = (dims.x + block - 1) / block, count = dims.y * dims.z;
                rows.resize(static_cast<std::size_t>(segments * count));
                similarity_rows(pair, rows.data(), on);
                for (std::int64_t s = 0; s < segments; ++s) // one block after the other
                    for (std::int64_t row = 0; row < count; ++row)
                        total += rows[static_cast<std::size_t>(row * segments + s)];
            }
    return static_cast<double>(total / static_cast<long double>(inner.voxels()));
}

MutualInformation mutual_information(Source& a, Source& b, int bins, Execution const& execution) {
    Execution const on = where_looked_at(execution, a.space() == Space::device && b.space() == Space::device);
    double const infinity = std::numeric_limits<double>::infinity();
    PairRange range{{infinity, infinity}, {-infinity, -infinity}};
    for_each_slab(a, b, on, [&](SlabPair const& pair) { range_of_pairs(pair, range, on); });
    double const undefined = std::numeric_limits<double>::quiet_NaN();
    if (!(range.low[0] <= range.high[0])) return {undefined, undefined};
    EdgesBetween const edges_a(range.low[0], range.high[0], bins), edges_b(range.low[1], range.high[1], bins);
    auto const count = static_cast<std::size_t>(bins);
    std::vector<std::uint64_t> joint(count * count), of_a(count), of_b(count);
    for_each_slab(a, b, on,
                  [&](SlabPair const& pair) { count_pairs(pair, edges_a.bins(), edges_b.bins(), joint.data(), on); });
    double total = 0;
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < count; ++j) {
            of_a[i] += joint[i * count + j];
            of_b[j] += joint[i * count + j];
            total += static_cast<double>(joint[i * count + j]);
        }
    double const ha = entropy(of_a, total), hb = entropy(of_b, total), hab = entropy(joint, total);
    return {std::max(0.0, ha + hb - hab), hab > 0 ? (ha + hb) / hab : 2};
}

} // namespace vkt
