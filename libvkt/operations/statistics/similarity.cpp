// Similarity: blocks for the windows, rows for the joint histogram.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/similarity.h"

#include "libvkt/core/buffer.h"
#include "libvkt/engine/cut.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/statistics/kernels/similarity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace vkt {
namespace {

constexpr std::int64_t window_radius = 5;
constexpr Index3 block{32, 32, 32}; // on the volume's own lattice, so that the order of sums depends on nothing else

ConstView voxels_of(Source& source, Box const& box, Buffer& buffer) {
    if (auto const lent = source.borrow(box); lent && lent->space == Space::host) return *lent;
    buffer.reserve(static_cast<std::size_t>(box.voxels()) * size_of(source.header().dtype));
    AnyView const view = dense_view(buffer.write(Space::host), source.header().dtype, box);
    source.read(view);
    return view;
}

/// Physical values of a row of voxels.
void load_values(ConstView view, Index3 at, std::int64_t n, ValueMap const& map, double* to) {
    for (std::int64_t i = 0; i < n; i += baseline::row_piece) {
        std::int64_t const piece = std::min(baseline::row_piece, n - i);
        baseline::load_row(view.type, view.at(at.x + i, at.y, at.z), to + i, piece);
    }
    if (map == ValueMap{}) return;
    for (std::int64_t i = 0; i < n; ++i) to[i] = map.physical(to[i]);
}

/// The values of a region that may reach outside of the volume, where it is mirrored.
void load_block(Source& source, Box const& region, double offset, Buffer& buffer, std::vector<double>& to) {
    Header const& header = source.header();
    Index3 const n = header.dims, dims = region.dims();
    Box inside = intersect(region, box_of(n));
    for (int axis = 0; axis < 3; ++axis) { // what is mirrored may lie farther inside
        inside.lower[axis] = region.upper[axis] > n[axis] ? 0 : inside.lower[axis];
        inside.upper[axis] = region.lower[axis] < 0 ? n[axis] : inside.upper[axis];
    }
    ConstView const view = voxels_of(source, inside, buffer);
    to.resize(static_cast<std::size_t>(region.voxels()));
    std::vector<double> row(static_cast<std::size_t>(inside.dims().x));
    double* out = to.data();
    for (std::int64_t z = region.lower.z; z < region.upper.z; ++z)
        for (std::int64_t y = region.lower.y; y < region.upper.y; ++y) {
            Index3 const at{inside.lower.x, fold(y, n.y, Boundary::mirror), fold(z, n.z, Boundary::mirror)};
            load_values(view, at, inside.dims().x, header.values, row.data());
            for (std::int64_t x = 0; x < dims.x; ++x) {
                std::int64_t const from = fold(region.lower.x + x, n.x, Boundary::mirror) - inside.lower.x;
                *out++ = row[static_cast<std::size_t>(from)] - offset;
            }
        }
}

/// Calls f(values of a, values of b, n) for rows of both volumes.
template <class F> void for_each_row(Source& a, Source& b, Execution const& execution, F const& f) {
    Header const& header = size_of(a.header().dtype) > size_of(b.header().dtype) ? a.header() : b.header();
    Buffer buffer_a, buffer_b;
    auto const n = static_cast<std::size_t>(header.dims.x);
    std::vector<double> row_a(n), row_b(n);
    for_each_piece(box_of(header.dims), cut_of(header, 0, execution), [&](Box const& box) {
        ProgressPart const share = part_of(execution.monitor, box_of(header.dims), box);
        ConstView const view_a = voxels_of(a, box, buffer_a), view_b = voxels_of(b, box, buffer_b);
        for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
            for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
                load_values(view_a, {0, y, z}, header.dims.x, a.header().values, row_a.data());
                load_values(view_b, {0, y, z}, header.dims.x, b.header().values, row_b.data());
                f(row_a.data(), row_b.data(), n);
            }
    });
}

/// Equal bins between two values, with edges as numpy.linspace has them.
class EqualBins {
public:
    EqualBins(double low, double high, int bins) : edges_(static_cast<std::size_t>(bins) + 1) {
        if (!(low < high)) { // a single value
            low -= 0.5;
            high += 0.5;
        }
        double const step = (high - low) / bins;
        for (int k = 0; k < bins; ++k) edges_[static_cast<std::size_t>(k)] = k * step + low;
        edges_.back() = high;
        scale_ = bins / (high - low);
    }
    std::size_t of(double value) const {
        std::size_t const last = edges_.size() - 2;
        double const guess = (value - edges_.front()) * scale_;
        std::size_t k = guess > 0 ? std::min(last, static_cast<std::size_t>(guess)) : 0;
        while (k > 0 && value < edges_[k]) --k;
        while (k < last && value >= edges_[k + 1]) ++k;
        return k;
    }

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
    Index3 const n = a.header().dims;
    double weights[window_radius + 1], sum = 0;
    for (std::int64_t k = 0; k <= window_radius; ++k) {
        weights[k] = std::exp(-static_cast<double>(k * k) / (2 * 1.5 * 1.5));
        sum += k == 0 ? weights[k] : 2 * weights[k];
    }
    for (double& weight : weights) weight /= sum;
    Index3 radius;
    Box inner = box_of(n);
    for (int axis = 0; axis < 3; ++axis) {
        radius[axis] = n[axis] > 1 ? window_radius : 0;
        bool const cut = n[axis] > 2 * window_radius;
        inner.lower[axis] += cut ? window_radius : 0;
        inner.upper[axis] -= cut ? window_radius : 0;
    }
    // Squares of values less one of their own lose nothing to a large offset.
    std::vector<double> values_a, values_b, planes, rows;
    Buffer buffer_a, buffer_b;
    load_block(a, {inner.lower, inner.lower + Index3{1, 1, 1}}, 0, buffer_a, values_a);
    double const offset = values_a.front();
    long double total = 0;
    std::int64_t done = 0;
    for (std::int64_t z = inner.lower.z; z < inner.upper.z; z += block.z)
        for (std::int64_t y = inner.lower.y; y < inner.upper.y; y += block.y)
            for (std::int64_t x = inner.lower.x; x < inner.upper.x; x += block.x) {
                Index3 const lower{x, y, z};
                Box const part = intersect({lower, lower + block}, inner);
                ProgressPart const share(execution.monitor, done, part.voxels(), inner.voxels());
                done += part.voxels();
                Index3 const dims = part.dims();
                load_block(a, grow(part, radius), offset, buffer_a, values_a);
                load_block(b, grow(part, radius), offset, buffer_b, values_b);
                planes.resize(static_cast<std::size_t>(5 * dims.x * dims.y * (dims.z + 2 * radius.z)));
                rows.resize(static_cast<std::size_t>(dims.y * dims.z));
                double const c1 = 0.01 * range * 0.01 * range, c2 = 0.03 * range * 0.03 * range;
                similarity_rows(
                    {values_a.data(), values_b.data(), dims, radius, weights, offset, c1, c2, planes.data()},
                    rows.data(), execution);
                for (double const row : rows) total += row;
            }
    return static_cast<double>(total / static_cast<long double>(inner.voxels()));
}

MutualInformation mutual_information(Source& a, Source& b, int bins, Execution const& execution) {
    double const infinity = std::numeric_limits<double>::infinity();
    double low[2] = {infinity, infinity}, high[2] = {-infinity, -infinity};
    for_each_row(a, b, execution, [&](double const* u, double const* v, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i) {
            if (!std::isfinite(u[i]) || !std::isfinite(v[i])) continue;
            low[0] = std::min(low[0], u[i]);
            high[0] = std::max(high[0], u[i]);
            low[1] = std::min(low[1], v[i]);
            high[1] = std::max(high[1], v[i]);
        }
    });
    double const undefined = std::numeric_limits<double>::quiet_NaN();
    if (!(low[0] <= high[0])) return {undefined, undefined};
    EqualBins const bins_a(low[0], high[0], bins), bins_b(low[1], high[1], bins);
    auto const count = static_cast<std::size_t>(bins);
    std::vector<std::uint64_t> joint(count * count), of_a(count), of_b(count);
    for_each_row(a, b, execution, [&](double const* u, double const* v, std::size_t n) {
        for (std::size_t i = 0; i < n; ++i)
            if (std::isfinite(u[i]) && std::isfinite(v[i])) ++joint[bins_a.of(u[i]) * count + bins_b.of(v[i])];
    });
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
