// Gaussian, CPU: out of a ring of input slices along z, then each slice along y and x, a row at a time.
// SPDX-License-Identifier: MIT

#include "libvkt/operations/kernels/gaussian.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/kernels/nested_average.h"

namespace vkt::VKT_BACKEND {

namespace {

constexpr std::int64_t strips_bytes = 24 << 10; ///< pieces of rows that are summed together fit into L1 …
constexpr std::int64_t strip_bytes = 1024;      ///< … and are not longer than this, a multiple of blocks
constexpr std::int64_t most_slices = 8;         ///< filtered along z together, while their sources are in L1
constexpr std::int64_t row_group = 8;           ///< rows filtered along y before the first of them is filtered along x

/// Where things lie. Counts of what the ring holds in the ring, of C elsewhere.
template <class C> struct Layout {
    Layout(GaussianPasses const& passes, Box const& area, DataType type)
        : raw(size_of(type) < sizeof(C)), held_bytes(raw ? size_of(type) : sizeof(C)) {
        std::int64_t const line_r = 64 / static_cast<std::int64_t>(held_bytes);
        constexpr std::int64_t line_c = 64 / static_cast<std::int64_t>(sizeof(C));
        Index3 const n = area.dims(), r{passes.taps[0].radius, passes.taps[1].radius, passes.taps[2].radius};
        std::int64_t const rows = gaussian_input(passes, area).dims().y;
        slots = 2 * r.z + passes.run_height;
        if (passes.boundary != Boundary::wrap) slots = std::min(slots, passes.dims.z);
        // One odd cache line more per row: no two of the rows that meet in a sum share a cache set.
        width = n.x + 2 * r.x;
        ring_pitch = round_up(width + lane_count<C>, 2 * line_r) + line_r;
        slot = rows * ring_pitch + 5 * line_r;
        pitch = round_up(width + 2 * lane_count<C>, 2 * line_c) + line_c;
        plane = rows * pitch + 3 * line_c;
        batch = std::clamp<std::int64_t>(passes.plane_bytes / (plane * static_cast<std::int64_t>(sizeof(C))), 1,
                                         most_slices);
        strip = std::clamp(strips_bytes / (2 * std::max(r.y, r.z) + most_slices) / block_bytes * block_bytes,
                           block_bytes, strip_bytes) /
                static_cast<std::int64_t>(sizeof(C));
        taken = !raw ? 0 : (2 * r.z + batch) * (strip + line_c);
        pointers = (2 * r.z + batch) + (2 * r.y + row_group) + (2 * r.x + 1) * row_group;
        scratch = round_up(taken + (row_group + 2) * pitch + pointers * 8 / static_cast<std::int64_t>(sizeof(C)), 64);
    }
    std::size_t ring_bytes() const { return static_cast<std::size_t>(slots * slot + 64) * held_bytes; }

    bool raw; ///< the ring holds input voxels as they are, which is smaller; else scaled in the compute type
    std::size_t held_bytes;
    std::int64_t slots, slot, ring_pitch; ///< the ring of input slices
    std::int64_t width;                   ///< of a row with its halo
    std::int64_t batch, plane, pitch;     ///< slices filtered along z
    std::int64_t strip, taken, pointers, scratch;
};

/// Input slices as the passes need them: halo along x folded in, no row twice. Slices stay over from run to run.
template <class C> class Ring {
public:
    Ring(GaussianPasses const& passes, Layout<C> const& layout, Box const& area, ConstView in, std::byte* memory)
        : passes_(passes), layout_(layout), in_(in), memory_(memory) {
        first_x_ = area.lower.x - passes.taps[0].radius;
        end_x_ = area.upper.x + passes.taps[0].radius;
        Box const rows = gaussian_input(passes, area);
        first_y_ = rows.lower.y;
        end_y_ = rows.upper.y;
    }
    std::int64_t first_y() const { return first_y_; }
    /// Columns of a row that lie in the volume along x, from the first one of the halo on.
    std::int64_t inner_x() const { return std::clamp<std::int64_t>(0, first_x_, end_x_) - first_x_; }
    std::int64_t outer_x() const { return std::min(end_x_, passes_.dims.x) - first_x_; }
    /// True if row y is there, perhaps as one that wraps around; others are to be folded.
    bool holds_row(std::int64_t y) const { return y >= first_y_ && y < end_y_; }

    void load(std::int64_t y, std::int64_t z) {
        std::int64_t const n = passes_.dims.x;
        std::int64_t const inner = std::clamp<std::int64_t>(0, first_x_, end_x_), outer = std::min(end_x_, n);
        put(inner, y, z, inner, outer - inner);
        for (std::int64_t x = first_x_; x < inner; ++x) put_outside(x, y, z);
        for (std::int64_t x = outer; x < end_x_; ++x) put_outside(x, y, z);
    }

    /// Column x, from the first one of the halo on, of a row.
    std::byte* at(std::int64_t y, std::int64_t z, std::int64_t x) const {
        std::int64_t const slot = (z % layout_.slots + layout_.slots) % layout_.slots;
        std::int64_t const place = slot * layout_.slot + (y - first_y_) * layout_.ring_pitch + x;
        return memory_ + static_cast<std::size_t>(place) * layout_.held_bytes;
    }
    /// n voxels from there on, scaled.
    void scaled(std::byte const* from, C* to, std::int64_t n) const { load_scaled(in_.type, from, to, n); }

private:
    /// n voxels of the input from x on, in the columns from `column` on.
    void put(std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t column, std::int64_t n) {
        std::byte* const to = at(y, z, column - first_x_);
        if (layout_.raw)
            std::memcpy(to, in_.at(x, y, z), static_cast<std::size_t>(n) * layout_.held_bytes);
        else
            load_scaled(in_.type, in_.at(x, y, z), reinterpret_cast<C*>(to), n);
    }
    void put_outside(std::int64_t x, std::int64_t y, std::int64_t z) {
        std::int64_t const from = fold(x, passes_.dims.x, passes_.boundary);
        if (from >= 0) return put(from, y, z, x, 1);
        std::byte* const to = at(y, z, x - first_x_);
        C const border = C(gaussian_scale) * static_cast<C>(passes_.border_value);
        if (layout_.raw)
            std::memset(to, 0, layout_.held_bytes); // source() puts the border value there
        else
            std::memcpy(to, &border, sizeof border);
    }

    GaussianPasses const& passes_;
    Layout<C> const& layout_;
    ConstView in_;
    std::byte* memory_;
    std::int64_t first_x_, end_x_, first_y_, end_y_;
};

/// One thread's hands: filters rows out of the ring along z into planes, and out of the planes along y and x.
template <class C> class Worker {
public:
    Worker(GaussianPasses const& passes, Layout<C> const& layout, Ring<C> const& ring, C* planes, C* scratch)
        : passes_(passes), layout_(layout), ring_(ring), planes_(planes),
          taken_(scratch), taps_{TapView<C>(passes.taps[0]), TapView<C>(passes.taps[1]), TapView<C>(passes.taps[2])} {
        along_y_ = taken_ + layout.taken;
        result_ = along_y_ + row_group * layout.pitch;
        border_ = result_ + layout.pitch;
        slices_ = reinterpret_cast<C const**>(border_ + layout.pitch);
        rows_ = slices_ + 2 * taps_[2].radius + layout.batch;
        shifted_ = rows_ + 2 * taps_[1].radius + row_group;
        C const scaled_border = C(gaussian_scale) * static_cast<C>(passes.border_value);
        for (std::int64_t i = 0; i < layout.pitch; ++i) border_[i] = scaled_border;
        std::int64_t const taps_x = 2 * taps_[0].radius + 1;
        for (std::int64_t i = 0; i < row_group; ++i)
            for (std::int64_t k = 0; k < taps_x; ++k) shifted_[i * taps_x + k] = along_y_ + i * layout.pitch + k;
    }

    /// Row y of the planes of the slices z…end.
    void filter_along_z(std::int64_t y, std::int64_t z, std::int64_t end) {
        std::int64_t const r = taps_[2].radius;
        for (std::int64_t x = 0; x < layout_.width; x += layout_.strip) {
            std::int64_t const n = std::min(layout_.strip, layout_.width - x);
            for (std::int64_t k = z - r; k < end + r; ++k) slices_[k - z + r] = source(y, k, x, n, k - z + r);
            for (std::int64_t s = z; s < end; ++s) {
                C* const to = plane_row(y, s - z) + x;
                if (r == 0)
                    std::memcpy(to, slices_[s - z], static_cast<std::size_t>(n) * sizeof(C));
                else
                    average(slices_ + (s - z), taps_[2], C(0.5), to, 0, n);
            }
        }
    }

    /// Some rows of the output slice z from plane `at`. All are filtered along y before the first of them is filtered
    /// along x, because reading across what has just been stored would stall.
    void filter_rows(std::int64_t y, std::int64_t count, std::int64_t at, AnyView out, std::int64_t z, bool stream) {
        std::int64_t const rx = taps_[0].radius, ry = taps_[1].radius, n = out.dims().x;
        for (std::int64_t k = -ry; k < count + ry; ++k) {
            std::int64_t const from = ring_.holds_row(y + k) ? y + k : fold(y + k, passes_.dims.y, passes_.boundary);
            rows_[k + ry] = ring_.holds_row(from) ? plane_row(from, at) : border_;
        }
        for (std::int64_t x = 0; x < layout_.width; x += layout_.strip) {
            std::int64_t const end = std::min(x + layout_.strip, layout_.width);
            for (std::int64_t i = 0; i < count; ++i) {
                C* const to = along_y_ + i * layout_.pitch;
                if (ry == 0)
                    std::memcpy(to + x, rows_[i] + x, static_cast<std::size_t>(end - x) * sizeof(C));
                else
                    average(rows_ + i, taps_[1], C(0.5), to, x, end);
            }
        }
        for (std::int64_t i = 0; i < count; ++i) {
            if (rx == 0)
                for (std::int64_t x = 0; x < n; ++x) result_[x] = C(4) * along_y_[i * layout_.pitch + x];
            else
                average<C>(shifted_ + i * (2 * rx + 1), taps_[0], C(2), result_, 0, n);
            tally_ += store_values(static_cast<C const*>(result_), out, out.at(out.box.lower.x, y + i, z), n, stream);
        }
    }

    Losses const& losses() const { return tally_; }

private:
    C* plane_row(std::int64_t y, std::int64_t plane) const {
        return planes_ + plane * layout_.plane + (y - ring_.first_y()) * layout_.pitch;
    }

    /// n voxels, scaled, of a row of slice z from column x of the ring on.
    C const* source(std::int64_t y, std::int64_t z, std::int64_t x, std::int64_t n, std::int64_t place) {
        bool const wraps = passes_.boundary == Boundary::wrap;
        std::int64_t const from = wraps ? z : fold(z, passes_.dims.z, passes_.boundary);
        if (from < 0 && !wraps) return border_;
        std::byte const* const row = ring_.at(y, from, x);
        if (!layout_.raw) return reinterpret_cast<C const*>(row);
        C* const to = taken_ + place * (layout_.strip + 64 / static_cast<std::int64_t>(sizeof(C)));
        ring_.scaled(row, to, round_up(n, lane_count<C>));
        if (passes_.boundary == Boundary::border) {
            for (std::int64_t i = x; i < std::min(ring_.inner_x(), x + n); ++i) to[i - x] = border_[0];
            for (std::int64_t i = std::max(ring_.outer_x(), x); i < x + n; ++i) to[i - x] = border_[0];
        }
        return to;
    }

    GaussianPasses const& passes_;
    Layout<C> const& layout_;
    Ring<C> const& ring_;
    C *planes_, *taken_, *along_y_, *result_, *border_;
    C const **slices_, **rows_, **shifted_;
    TapView<C> taps_[3];
    Losses tally_;
};

template <class C>
void run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
         Execution const& execution) {
    int const threads = threads_for(execution, out.box.voxels());
    Layout<C> const layout(passes, out.box, in.type);
    if (!planes.continues(out.box)) planes.forget();
    planes.storage.reserve(layout.ring_bytes());
    planes.scratch.reserve(static_cast<std::size_t>(layout.batch * layout.plane + threads * layout.scratch) *
                           sizeof(C));
    Ring<C> ring(passes, layout, out.box, in, planes.storage.update(Space::host));
    C* const filtered = reinterpret_cast<C*>(planes.scratch.update(Space::host));
    bool const stream = out.bytes() >= stream_threshold;
    Box const input = gaussian_input(passes, out.box);
    std::int64_t const batch = std::min(layout.batch, passes.run_height), rows = input.dims().y;
    std::int64_t const groups = (out.dims().y + row_group - 1) / row_group;
    std::int64_t held = planes.held() ? planes.input_end : input.lower.z;
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        C* const own = filtered + layout.batch * layout.plane + omp_get_thread_num() * layout.scratch;
        Worker<C> worker(passes, layout, ring, filtered, own);
        std::int64_t have = held;
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; z += batch) {
            std::int64_t const end = std::min(z + batch, out.box.upper.z);
            Box part = out.box;
            part.lower.z = z;
            part.upper.z = end;
            std::int64_t const need = std::max(have, gaussian_input(passes, part).upper.z);
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t i = 0; i < (need - have) * rows; ++i)
                ring.load(input.lower.y + i % rows, have + i / rows);
            have = need;
#pragma omp for schedule(dynamic, 16)
            for (std::int64_t y = input.lower.y; y < input.upper.y; ++y) worker.filter_along_z(y, z, end);
#pragma omp for schedule(dynamic, 2)
            for (std::int64_t g = 0; g < groups; ++g) {
                std::int64_t const y = out.box.lower.y + g * row_group,
                                   count = std::min(row_group, out.box.upper.y - y);
                for (std::int64_t s = z; s < end; ++s) worker.filter_rows(y, count, s - z, out, s, stream);
            }
        }
        if (stream) stream_fence();
        driver::add(losses, worker.losses());
#pragma omp single
        held = have;
    }
    planes.area = out.box;
    planes.input_end = held;
    planes.end = out.box.upper.z;
}

} // namespace

void gaussian_run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
                  Execution const& execution) {
    if (out.box.empty()) return;
    if (passes.wide || !float_suffices(out.type))
        run<double>(passes, planes, in, out, losses, execution);
    else
        run<float>(passes, planes, in, out, losses, execution);
}

} // namespace vkt::VKT_BACKEND
