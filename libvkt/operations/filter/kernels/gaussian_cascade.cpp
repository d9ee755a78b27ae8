// Gaussian by way of a coarser lattice: thinned along y, x and z, smoothed there, refined along z, x and y.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/gaussian_cascade.h"
#include "libvkt/operations/filter/kernels/nested_average.h"

#include <vector>

namespace vkt::VKT_BACKEND {
namespace {

/// Refined rows: out = factor * nested average of `taps` rows in the order of the shares.
template <std::int64_t registers, class C>
VKT_HD void refine_at(C const* const* rows, C const* shares, std::int64_t taps, Lanes<C> factor, C* out,
                      std::int64_t i) {
    Lanes<C> sum[static_cast<std::size_t>(registers)];
    for (std::int64_t j = 0; j < registers; ++j) sum[j] = load_lanes(rows[0] + i + j * lane_count<C>);
    for (std::int64_t k = 1; k < taps; ++k) {
        Lanes<C> const share = Lanes<C>{} + shares[k - 1];
        C const* const row = rows[k] + i;
        for (std::int64_t j = 0; j < registers; ++j)
            sum[j] = madd(share, load_lanes(row + j * lane_count<C>) - sum[j], sum[j]);
    }
    for (std::int64_t j = 0; j < registers; ++j) store_lanes(out + i + j * lane_count<C>, factor * sum[j]);
}

/// For 0 <= i < n, up to whole registers.
template <class C>
void refine(C const* const* rows, C const* shares, std::int64_t taps, C factor, C* out, std::int64_t n) {
    Lanes<C> const scale = Lanes<C>{} + factor;
    std::int64_t i = 0;
    for (; i + 4 * lane_count<C> <= n; i += 4 * lane_count<C>) refine_at<4>(rows, shares, taps, scale, out, i);
    for (; i < n; i += lane_count<C>) refine_at<1>(rows, shares, taps, scale, out, i);
}

/// A nested average that keeps the scale, or a copy.
template <class C> void smooth(C const* const* rows, TapView<C> taps, C* to, std::int64_t n) {
    if (taps.radius == 0)
        std::memcpy(to, rows[0], static_cast<std::size_t>(n) * sizeof(C));
    else
        average(rows, taps, C(0.5), to, 0, n);
}

/// The three axes of a region: voxels and nodes.
struct Spans {
    Span out, nodes, wide;
};

Spans spans_of(CascadeAxis const& axis, Span out) { return {out, nodes_under(axis, out), wide_nodes_under(axis, out)}; }

std::int64_t slot_of(std::int64_t i, std::int64_t slots) { return (i % slots + slots) % slots; }

/// One thread's hands, and the rings that all share.
template <class C> class Worker {
public:
    Worker(CascadePasses const& passes, CascadeLayout const& layout, ConstView in, AnyView out, C* rings, C* scratch)
        : passes_(passes), direct_(*passes.direct), layout_(layout), in_(in), out_(out),
          border_(C(gaussian_scale) * static_cast<C>(direct_.border_value)), thin_(rings),
          raw_(thin_ + layout.thin_values()), wide_(raw_ + layout.raw_values()), nodes_(wide_ + layout.wide_values()),
          scratch_(scratch) {
        Box const box = out.box;
        x_ = spans_of(axis(0), {box.lower.x, box.upper.x});
        y_ = spans_of(axis(1), {box.lower.y, box.upper.y});
        Box const input = cascade_input(passes, box);
        columns_ = {input.lower.x, input.upper.x};
        rows_ = {in.box.lower.y, in.box.upper.y}; // all, where a part of what surrounds the region would wrap around
        std::int64_t most = 1;
        for (int i = 0; i < 3; ++i)
            most = std::max({most, 2 * axis(i).before.radius + 1, 2 * axis(i).coarse.radius + 1, axis(i).taps});
        pointers_.resize(static_cast<std::size_t>(most));
    }

    /// Slice z, thinned along y and x: nodes first…last-1 along y.
    void thin(std::int64_t z, std::int64_t first, std::int64_t last) {
        CascadeAxis const& along = axis(1);
        std::int64_t const r = along.before.radius, n = columns_.size(), deep = 2 * r + 1;
        TapView<C> const taps(along.before);
        C* const ring = scratch_;
        C* const thinned = ring + deep * layout_.strip;
        for (std::int64_t x = 0; x < n; x += layout_.strip - cascade_margin) {
            std::int64_t const m = std::min(layout_.strip - cascade_margin, n - x);
            std::int64_t have = first * along.step - r;
            for (std::int64_t node = first; node < last; ++node) {
                std::int64_t const middle = node * along.step;
                for (have = std::max(have, middle - r); have <= middle + r; ++have)
                    load(z, have, x, m, ring + slot_of(have, deep) * layout_.strip);
                C* const to = thinned + (node - first) * layout_.row_pitch + x;
                for (std::int64_t k = -r; k <= r; ++k)
                    pointer(k + r) = ring + slot_of(middle + k, deep) * layout_.strip;
                smooth(pointers(), taps, to, m);
            }
        }
        for (std::int64_t node = first; node < last; ++node)
            thin_row(thinned + (node - first) * layout_.row_pitch, thin_row_at(z, node));
    }

    /// Row `node` of plane `plane`, thinned along z. Where slices are planes nothing is to do.
    void thin_along_z(std::int64_t plane, std::int64_t node) {
        CascadeAxis const& along = axis(2);
        if (along.step == 1) return;
        std::int64_t const r = along.before.radius;
        for (std::int64_t k = -r; k <= r; ++k) pointer(k + r) = slice_row(plane * along.step + k, node);
        smooth(pointers(), TapView<C>(along.before), raw_row_at(plane, node), layout_.wide_x);
    }

    /// Row `node` of a plane, smoothed along y and x.
    void smooth_row(std::int64_t plane, std::int64_t node) {
        std::int64_t const ry = axis(1).coarse.radius, rx = axis(0).coarse.radius;
        C* const row = scratch_;
        for (std::int64_t k = -ry; k <= ry; ++k)
            pointer(k + ry) = axis(2).step == 1 ? slice_row(plane, node + k) : raw_row_at(plane, node + k);
        smooth(pointers(), TapView<C>(axis(1).coarse), row, layout_.wide_x);
        for (std::int64_t k = 0; k <= 2 * rx; ++k) pointer(k) = row + k;
        smooth(pointers(), TapView<C>(axis(0).coarse), wide_row_at(plane, node), layout_.x);
    }

    /// Row `node` of a plane, smoothed along z.
    void smooth_along_z(std::int64_t plane, std::int64_t node) {
        std::int64_t const r = axis(2).coarse.radius;
        for (std::int64_t k = -r; k <= r; ++k) pointer(k + r) = wide_row_at(plane + k, node);
        smooth(pointers(), TapView<C>(axis(2).coarse), node_row_at(plane, node), layout_.x);
    }

    /// Rows first…last-1 of the output slice z.
    void refine_rows(std::int64_t z, std::int64_t first, std::int64_t last, bool stream) {
        CascadeAxis const& along = axis(1);
        std::int64_t const n = x_.out.size();
        Span const nodes = nodes_under(along, {first, last});
        C* const ring = scratch_;
        C* const result = ring + along.taps * layout_.row_pitch;
        C* const own = result + layout_.row_pitch;
        std::int64_t have = nodes.lower;
        for (std::int64_t y = first; y < last; ++y) {
            std::int64_t const node = nodes_under(along, {y, y + 1}).lower;
            for (; have < node + along.taps; ++have)
                refine_row(z, have, ring + slot_of(have, along.taps) * layout_.row_pitch, own);
            for (std::int64_t k = 0; k < along.taps; ++k)
                pointer(k) = ring + slot_of(node + along.tap(k), along.taps) * layout_.row_pitch;
            refine(pointers(), shares(along, y), along.taps, C(4), result, n);
            tally_ += store_values(static_cast<C const*>(result), out_, out_.at(x_.out.lower, y, z), n, stream);
        }
    }

    Span wide_y() const { return y_.wide; }
    Span nodes_y() const { return y_.nodes; }
    Losses const& losses() const { return tally_; }

private:
    CascadeAxis const& axis(int i) const { return passes_.cascade->axes[static_cast<std::size_t>(i)]; }
    C const*& pointer(std::int64_t k) { return pointers_[static_cast<std::size_t>(k)]; }
    C const* const* pointers() const { return pointers_.data(); }
    C const* shares(CascadeAxis const& along, std::int64_t voxel) const {
        std::int64_t const at = slot_of(voxel, along.step) * (along.taps - 1);
        if constexpr (std::is_same_v<C, float>)
            return along.single_shares.data() + at;
        else
            return along.shares.data() + at;
    }

    C* thin_row_at(std::int64_t z, std::int64_t node) const {
        return thin_ + (slot_of(z, layout_.thin_slots) * layout_.wide_y + node - y_.wide.lower) * layout_.wide_pitch;
    }
    C* raw_row_at(std::int64_t plane, std::int64_t node) const {
        return raw_ + (slot_of(plane, layout_.raw_slots) * layout_.wide_y + node - y_.wide.lower) * layout_.wide_pitch;
    }
    C* wide_row_at(std::int64_t plane, std::int64_t node) const {
        return wide_ + (slot_of(plane, layout_.wide_slots) * layout_.y + node - y_.nodes.lower) * layout_.pitch;
    }
    C* node_row_at(std::int64_t plane, std::int64_t node) const {
        return nodes_ + (slot_of(plane, layout_.slots) * layout_.y + node - y_.nodes.lower) * layout_.pitch;
    }
    /// A thinned row of a slice that may lie outside the volume.
    C const* slice_row(std::int64_t z, std::int64_t node) {
        if (direct_.boundary == Boundary::wrap) return thin_row_at(z, node);
        std::int64_t const from = fold(z, direct_.dims.z, direct_.boundary);
        if (from >= 0) return thin_row_at(from, node);
        if (outside_.empty()) outside_.assign(static_cast<std::size_t>(layout_.wide_pitch), border_);
        return outside_.data();
    }

    /// Scaled voxels of columns x…x+n-1 of the input, of a row that may lie outside the volume.
    void load(std::int64_t z, std::int64_t y, std::int64_t x, std::int64_t n, C* to) const {
        bool const there = y >= rows_.lower && y < rows_.upper;
        std::int64_t const from = there ? y : fold(y, direct_.dims.y, direct_.boundary);
        if (!there && from < 0)
            std::fill(to, to + n, border_);
        else
            load_scaled(in_.type, in_.at(columns_.lower + x, from, z), to, n);
    }

    /// Nodes along x of a row of voxels, which begins with the first column of the input.
    void thin_row(C const* row, C* to) {
        CascadeAxis const& along = axis(0);
        std::int64_t const r = along.before.radius, d = along.step, n = layout_.wide_x;
        std::int64_t const first = x_.wide.lower * d - r, count = (n - 1) * d + 2 * r + 1;
        C* const line = scratch_ + (2 * axis(1).before.radius + 1) * layout_.strip + layout_.rows * layout_.row_pitch;
        C* const phases = line + layout_.phase_pitch * d;
        C* const voxels = d == 1 ? to : line;
        std::int64_t const begin = std::clamp<std::int64_t>(columns_.lower - first, 0, count),
                           end = std::clamp<std::int64_t>(columns_.upper - first, begin, count);
        std::memcpy(voxels + begin, row + (first + begin - columns_.lower),
                    static_cast<std::size_t>(end - begin) * sizeof(C));
        for (std::int64_t i = 0; i < begin; ++i) voxels[i] = outside(row, first + i);
        for (std::int64_t i = end; i < count; ++i) voxels[i] = outside(row, first + i);
        if (d == 1) return;
        std::fill(voxels + count, voxels + layout_.phase_pitch * d, C(0));
        for (std::int64_t q = 0, i = 0; q < layout_.phase_pitch; ++q)
            for (std::int64_t p = 0; p < d; ++p, ++i) phases[p * layout_.phase_pitch + q] = voxels[i];
        for (std::int64_t k = 0; k <= 2 * r; ++k) pointer(k) = phases + k % d * layout_.phase_pitch + k / d;
        smooth(pointers(), TapView<C>(along.before), to, n);
    }
    C outside(C const* row, std::int64_t x) const {
        std::int64_t const from = fold(x, direct_.dims.x, direct_.boundary);
        return from < 0 ? border_ : row[from - columns_.lower];
    }

    /// Row `node` of the nodes, refined along z and x.
    void refine_row(std::int64_t z, std::int64_t node, C* to, C* own) {
        CascadeAxis const &deep = axis(2), &along = axis(0);
        std::int64_t const plane = nodes_under(deep, {z, z + 1}).lower;
        for (std::int64_t k = 0; k < deep.taps; ++k) pointer(k) = node_row_at(plane + deep.tap(k), node);
        std::int64_t const d = along.step, count = x_.nodes.size() - along.taps + 1;
        C* const row = d == 1 ? to : own;
        refine(pointers(), shares(deep, z), deep.taps, C(1), row, x_.nodes.size());
        if (d == 1) return;
        C* const phase = own + layout_.pitch;
        C* const line = phase + d * layout_.pitch;
        for (std::int64_t k = 0; k < along.taps; ++k) pointer(k) = row + along.tap(k);
        for (std::int64_t p = 0; p < d; ++p)
            refine(pointers(), shares(along, p), along.taps, C(1), phase + p * layout_.pitch, count);
        for (std::int64_t q = 0, i = 0; q < count; ++q)
            for (std::int64_t p = 0; p < d; ++p, ++i) line[i] = phase[p * layout_.pitch + q];
        std::memcpy(to, line + slot_of(x_.out.lower, d), static_cast<std::size_t>(x_.out.size()) * sizeof(C));
    }

    CascadePasses const& passes_;
    GaussianPasses const& direct_;
    CascadeLayout const& layout_;
    ConstView in_;
    AnyView out_;
    C border_;
    C *thin_, *raw_, *wide_, *nodes_, *scratch_;
    Spans x_, y_;
    Span columns_, rows_; ///< of the input
    std::vector<C const*> pointers_;
    std::vector<C> outside_;
    Losses tally_;
};

template <class C>
void run(CascadePasses const& passes, CascadePlanes& planes, ConstView in, AnyView out, Losses& losses,
         Execution const& execution) {
    GaussianPasses const& direct = *passes.direct;
    CascadeAxis const& deep = passes.cascade->axes[2];
    CascadeLayout const layout(passes, out.dims());
    int const threads = threads_for(execution, out.box.voxels());
    planes.held = planes.continues(out.box);
    planes.storage.reserve(static_cast<std::size_t>(layout.ring_values()) * sizeof(C));
    planes.scratch.reserve(static_cast<std::size_t>(threads * layout.scratch) * sizeof(C));
    C* const rings = reinterpret_cast<C*>(planes.storage.update(Space::host));
    C* const scratch = reinterpret_cast<C*>(planes.scratch.update(Space::host));
    bool const stream = out.bytes() >= stream_threshold;
    auto const parts = [](std::int64_t n, std::int64_t each) { return (n + each - 1) / each; };
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; z += direct.run_height) {
        std::int64_t const end = std::min(z + direct.run_height, out.box.upper.z);
        Spans const spans = spans_of(deep, {z, end});
        Box part = out.box;
        part.lower.z = z;
        part.upper.z = end;
        Box const input = cascade_input(passes, part);
        if (!planes.held) {
            planes.thin_end = input.lower.z;
            planes.wide_end = spans.wide.lower;
            planes.node_end = spans.nodes.lower;
        }
        // Each is cut finely enough for all threads; what comes out does not depend on that.
        std::int64_t const slice = std::max(planes.thin_end, input.lower.z), slices = input.upper.z - slice,
                           plane = std::max(planes.wide_end, spans.wide.lower), wide = spans.wide.upper - plane,
                           node = std::max(planes.node_end, spans.nodes.lower), nodes = spans.nodes.upper - node;
        std::int64_t const thin_rows = std::clamp<std::int64_t>(
            parts(std::max<std::int64_t>(slices, 1) * layout.wide_y, 4 * threads), 4, layout.rows);
        std::vector<Worker<C>> workers; // made here, where it may be said that there is no memory
        workers.reserve(static_cast<std::size_t>(threads));
        for (int t = 0; t < threads; ++t)
            workers.emplace_back(passes, layout, in, out, rings, scratch + t * layout.scratch);
#pragma omp parallel num_threads(threads) if (threads > 1)
        {
            Worker<C> worker = std::move(workers[static_cast<std::size_t>(omp_get_thread_num())]);
            Span const wide_y = worker.wide_y(), nodes_y = worker.nodes_y();
            std::int64_t const thin_parts = parts(wide_y.size(), thin_rows);
#pragma omp for schedule(dynamic, 1)
            for (std::int64_t i = 0; i < slices * thin_parts; ++i) {
                std::int64_t const first = wide_y.lower + i % thin_parts * thin_rows;
                worker.thin(slice + i / thin_parts, first, std::min(first + thin_rows, wide_y.upper));
            }
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t i = 0; i < wide * wide_y.size(); ++i)
                worker.thin_along_z(plane + i / wide_y.size(), wide_y.lower + i % wide_y.size());
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t i = 0; i < wide * nodes_y.size(); ++i)
                worker.smooth_row(plane + i / nodes_y.size(), nodes_y.lower + i % nodes_y.size());
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t i = 0; i < nodes * nodes_y.size(); ++i)
                worker.smooth_along_z(node + i / nodes_y.size(), nodes_y.lower + i % nodes_y.size());
            std::int64_t const rows = std::clamp<std::int64_t>(parts((end - z) * part.dims().y, 8 * threads), 8, 64),
                               pieces = parts(part.dims().y, rows);
#pragma omp for schedule(dynamic, 1)
            for (std::int64_t i = 0; i < (end - z) * pieces; ++i) {
                std::int64_t const first = part.lower.y + i % pieces * rows;
                worker.refine_rows(z + i / pieces, first, std::min(first + rows, part.upper.y), stream);
            }
            if (stream) stream_fence();
            driver::add(losses, worker.losses());
        }
        planes.held = true;
        planes.thin_end = std::max(input.upper.z, slice);
        planes.wide_end = plane + std::max<std::int64_t>(wide, 0);
        planes.node_end = node + std::max<std::int64_t>(nodes, 0);
        planes.end = end;
    }
    planes.area = out.box;
}

} // namespace

void gaussian_cascade_run(CascadePasses const& passes, CascadePlanes& planes, ConstView in, AnyView out, Losses& losses,
                          Execution const& execution) {
    if (out.box.empty()) return;
    if (passes.direct->wide || !float_suffices(out.type))
        run<double>(passes, planes, in, out, losses, execution);
    else
        run<float>(passes, planes, in, out, losses, execution);
}

} // namespace vkt::VKT_BACKEND
