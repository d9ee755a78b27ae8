// Gaussian, CPU: tiles of some slices, whose rows are filtered along z, y and x while they are in the second cache.
// SPDX-License-Identifier: MIT

#include "libvkt/operations/filter/kernels/gaussian.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/nested_average.h"

#include <vector>

namespace vkt::VKT_BACKEND {

namespace {

/// One thread's hands. Going up the rows of a tile, it filters each row of the input along z, for all slices of the
/// tile, into rings of rows, and out of these each slice along y and x.
template <class C> class Worker {
public:
    Worker(GaussianPasses const& passes, GaussianLayout const& layout, ConstView in, AnyView out, C* memory)
        : passes_(passes), layout_(layout), in_(in), out_(out), loaded_(memory),
          rings_(loaded_ + 2 * layout.slices * layout.pitch), along_y_(rings_ + layout.tile.z * layout.slice),
          result_(along_y_ + GaussianLayout::group * layout.pitch),
          border_(result_ + layout.pitch), taps_{TapView<C>(passes.taps[0]), TapView<C>(passes.taps[1]),
                                                 TapView<C>(passes.taps[2])} {
        std::fill(border_, border_ + layout.pitch, C(gaussian_scale) * static_cast<C>(passes.border_value));
        slices_.resize(static_cast<std::size_t>(2 * taps_[2].radius + layout.tile.z));
        rows_.resize(static_cast<std::size_t>(2 * taps_[1].radius + GaussianLayout::group));
        for (std::int64_t i = 0; i < GaussianLayout::group; ++i)
            for (std::int64_t k = 0; k <= 2 * taps_[0].radius; ++k) shifted_.push_back(along_y_ + i * layout.pitch + k);
    }

    void run(Box const& tile, bool stream) {
        tile_ = tile;
        columns_ = {tile.lower.x - taps_[0].radius, tile.upper.x + taps_[0].radius};
        loaded_columns_ = {std::clamp(in_.box.lower.x, columns_.lower, columns_.upper),
                           std::clamp(in_.box.upper.x, columns_.lower, columns_.upper)};
        outside_.clear();
        for (std::int64_t x = columns_.lower; x < columns_.upper; ++x)
            if (!loaded_columns_.contains(x)) outside_.push_back({x, fold(x, passes_.dims.x, passes_.boundary)});
        Span const rows = held(1);
        std::int64_t next = rows.lower;
        for (std::int64_t z = held(2).lower; z < held(2).upper; ++z) load(next, z);
        for (std::int64_t y = tile.lower.y; y < tile.upper.y; y += GaussianLayout::group) {
            std::int64_t const count = std::min(GaussianLayout::group, tile.upper.y - y);
            for (; next < std::min(y + count + taps_[1].radius, rows.upper); ++next) filter_along_z(next, rows.upper);
            for (std::int64_t z = tile.lower.z; z < tile.upper.z; ++z) filter_rows(y, count, z, stream);
        }
    }

    Losses const& losses() const { return tally_; }

private:
    /// Slices that are expected before they are loaded: rows that lie a power of two apart drive one another out of
    /// the second cache if they are more.
    static constexpr std::int64_t ahead = 3;

    struct Span {
        std::int64_t lower = 0, upper = 0;
        std::int64_t size() const { return upper - lower; }
        bool contains(std::int64_t i) const { return i >= lower && i < upper; }
    };

    /// A column beside the input, and the one that stands there; -1 for the border.
    struct Outside {
        std::int64_t x, from;
    };

    /// What the passes read along an axis for the tile; of what lies outside of the volume only what wraps around,
    /// because the rest is folded onto what is there.
    Span held(int axis) const {
        std::int64_t const r = taps_[axis].radius;
        Span const all{tile_.lower[axis] - r, tile_.upper[axis] + r};
        if (passes_.boundary == Boundary::wrap) return all;
        return {std::max<std::int64_t>(all.lower, 0), std::min(all.upper, passes_.dims[axis])};
    }
    /// Where the input has it; -1 for the border.
    std::int64_t source(int axis, std::int64_t i) const {
        bool const there = i >= in_.box.lower[axis] && i < in_.box.upper[axis];
        return there ? i : fold(i, passes_.dims[axis], passes_.boundary);
    }
    C* ring_row(std::int64_t y, std::int64_t z) const {
        std::int64_t const slot = (y % layout_.rows + layout_.rows) % layout_.rows;
        return rings_ + (z - tile_.lower.z) * layout_.slice + slot * layout_.pitch;
    }

    /// Where the scaled voxels of slice z lie for the pass along z, in one of two places: for row y, or the next.
    C* loaded_row(std::int64_t y, std::int64_t z) const {
        std::int64_t const which = (y % 2 + 2) % 2;
        return loaded_ + (which * layout_.slices + z - held(2).lower) * layout_.pitch;
    }
    /// Row y of the input in slice z, with what lies beside the volume.
    void load(std::int64_t y, std::int64_t z) const {
        std::int64_t const from_y = source(1, y), from_z = source(2, z);
        C* const to = loaded_row(y, z) - columns_.lower;
        load_scaled(in_.type, in_.at(loaded_columns_.lower, from_y, from_z), to + loaded_columns_.lower,
                    loaded_columns_.size());
        for (Outside const& column : outside_)
            if (column.from < 0)
                to[column.x] = border_[0];
            else if (loaded_columns_.contains(column.from))
                to[column.x] = to[column.from];
            else
                load_scaled(in_.type, in_.at(column.from, from_y, from_z), to + column.x, 1);
    }
    /// Asks for it ahead of time. Inlined, because compilers leave out calls of what does nothing else.
    VKT_HD void expect(std::int64_t y, std::int64_t z) const {
        std::byte const* const from = in_.at(loaded_columns_.lower, source(1, y), source(2, z));
        std::int64_t const bytes = static_cast<std::int64_t>(size_of(in_.type)) * loaded_columns_.size();
        for (std::int64_t i = 0; i < bytes; i += 64) __builtin_prefetch(from + i, 0, 2);
        __builtin_prefetch(from + bytes - 1, 0, 2);
    }

    /// Row y of the rings, of rows up to `end`. Meanwhile the next row is loaded, slice by slice: so memory works while
    /// the processor computes.
    void filter_along_z(std::int64_t y, std::int64_t end) {
        std::int64_t const r = taps_[2].radius, first = tile_.lower.z - r;
        Span const slices = held(2);
        for (std::int64_t z = first; z < tile_.upper.z + r; ++z) {
            std::int64_t const at = slices.contains(z) ? z : fold(z, passes_.dims.z, passes_.boundary);
            slices_[static_cast<std::size_t>(z - first)] = slices.contains(at) ? loaded_row(y, at) : border_;
        }
        std::int64_t next = y + 1 < end ? slices.lower : slices.upper, expected = next;
        std::int64_t const width = columns_.size(), deep = tile_.dims().z,
                           steps = (width + layout_.strip_z - 1) / layout_.strip_z * deep;
        C* const to = ring_row(y, tile_.lower.z);
        for (std::int64_t x = 0, done = 0; x < width; x += layout_.strip_z)
            for (std::int64_t s = 0; s < deep; s += 2) {
                std::int64_t const count = std::min<std::int64_t>(2, deep - s);
                std::int64_t const until = slices.lower + slices.size() * (done += count) / steps;
                for (; expected < std::min(until + ahead, slices.upper); ++expected) expect(y + 1, expected);
                average_each(slices_.data() + s, count, taps_[2], C(0.5), to + s * layout_.slice, layout_.slice, x,
                             std::min(x + layout_.strip_z, width));
                for (; next < until; ++next) load(y + 1, next);
            }
    }

    /// Some rows of an output slice: pieces of them along y, and along x as far as there is what that reads. All are
    /// filtered along y before the first of them is filtered along x, because reading across what has just been stored
    /// would stall.
    void filter_rows(std::int64_t y, std::int64_t count, std::int64_t z, bool stream) {
        std::int64_t const rx = taps_[0].radius, ry = taps_[1].radius, n = tile_.dims().x, width = columns_.size();
        Span const rows = held(1);
        for (std::int64_t k = -ry; k < count + ry; ++k) {
            std::int64_t const from = rows.contains(y + k) ? y + k : fold(y + k, passes_.dims.y, passes_.boundary);
            rows_[static_cast<std::size_t>(k + ry)] = rows.contains(from) ? ring_row(from, z) : border_;
        }
        std::int64_t done = 0; // columns of the output
        for (std::int64_t x = 0; x < width; x += layout_.strip_y) {
            std::int64_t const end = std::min(x + layout_.strip_y, width);
            average_each(rows_.data(), count, taps_[1], C(0.5), along_y_, layout_.pitch, x, end);
            std::int64_t const last = end == width ? n : std::max(done, (end - 2 * rx) / block<C> * block<C>);
            for (std::int64_t i = 0; i < count; ++i) finish(i, y, z, done, last, stream);
            done = last;
        }
    }

    /// Columns begin…end of the i-th of the output rows from y on, along x.
    void finish(std::int64_t i, std::int64_t y, std::int64_t z, std::int64_t begin, std::int64_t end, bool stream) {
        if (begin == end) return;
        C const* const* const around = shifted_.data() + i * (2 * taps_[0].radius + 1);
        if (taps_[0].radius == 0)
            for (std::int64_t x = begin; x < end; ++x) result_[x] = C(4) * (*around)[x];
        else
            average(around, taps_[0], C(2), result_, begin, end);
        tally_ += store_values(static_cast<C const*>(result_ + begin), out_, out_.at(tile_.lower.x + begin, y + i, z),
                               end - begin, stream);
    }

    GaussianPasses const& passes_;
    GaussianLayout const& layout_;
    ConstView in_;
    AnyView out_;
    C *loaded_, *rings_, *along_y_, *result_, *border_;
    TapView<C> taps_[3];
    std::vector<C const*> slices_, rows_, shifted_;
    Box tile_;
    Span columns_, loaded_columns_; ///< of the tile, with those around that the pass along x reads; of the input
    std::vector<Outside> outside_;
    Losses tally_;
};

template <class C>
void run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
         Execution const& execution) {
    GaussianLayout const layout(passes, out.dims());
    Index3 const n = out.dims();
    auto const parts = [](std::int64_t a, std::int64_t b) { return (a + b - 1) / b; };
    int const threads = threads_for(execution, out.box.voxels());
    Index3 tile = layout.tile;
    // Rows are divided so that every thread has some, but not further than what tiles filter twice is worth.
    std::int64_t const others = parts(n.x, tile.x) * parts(n.z, tile.z);
    std::int64_t const bands = std::clamp<std::int64_t>(
        parts(2 * threads, others), 1, parts(n.y, std::max<std::int64_t>(8 * passes.taps[1].radius, 16)));
    tile.y = parts(n.y, bands);
    planes.scratch.reserve(static_cast<std::size_t>(threads * layout.values) * sizeof(C));
    C* const scratch = reinterpret_cast<C*>(planes.scratch.update(Space::host));
    std::vector<Worker<C>> workers; // made here, where it may be said that there is no memory
    workers.reserve(static_cast<std::size_t>(threads));
    for (int t = 0; t < threads; ++t) workers.emplace_back(passes, layout, in, out, scratch + t * layout.values);
    bool const stream = out.bytes() >= stream_threshold;
    std::int64_t const across = parts(n.x, tile.x), along = parts(n.y, tile.y), deep = parts(n.z, tile.z);
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        Worker<C>& worker = workers[static_cast<std::size_t>(omp_get_thread_num())];
#pragma omp for schedule(dynamic, 1)
        for (std::int64_t i = 0; i < across * along * deep; ++i) {
            Index3 const at{i % across, i / across % along, i / across / along};
            Index3 const lower = out.box.lower + Index3{at.x * tile.x, at.y * tile.y, at.z * tile.z};
            worker.run(intersect({lower, lower + tile}, out.box), stream);
        }
        if (stream) stream_fence();
        driver::add(losses, worker.losses());
    }
}

} // namespace

void gaussian_run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Losses& losses,
                  Execution const& execution) {
    if (out.box.empty()) return;
    if (passes.wide)
        run<double>(passes, planes, in, out, losses, execution);
    else
        run<float>(passes, planes, in, out, losses, execution);
}

} // namespace vkt::VKT_BACKEND
