// Gaussian, CPU: x, y and z in one sweep over tiles of the xy plane, with rings of filtered planes that stay in L2.
// SPDX-License-Identifier: MIT

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/gaussian_kernel.h"

#ifdef __CUDACC__
#include "libvkt/operations/gaussian_device.h"
#else
#include "libvkt/kernel/lanes.h"
#endif

namespace vkt::VKT_BACKEND {

void gaussian_run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out,
                  Execution const& execution);

#ifndef __CUDACC__
namespace {

// Half of each value is what the passes add up, so that a pair of the largest floats does not overflow.
constexpr std::int64_t block_bytes = 256; ///< rows are worked in blocks of this many bytes, whole registers
// Measured on a core with 1 MiB of L2: 1 KiB rows and rings of 1.25 MiB are best; less saves L2 misses but filters more
// rows twice along x (39 ms against 43 at 0.6 MiB and 47 with rows of 512 bytes, 256^3 float32, radius 8, one thread).
constexpr std::int64_t ring_bytes = 1280 << 10;
constexpr std::int64_t tile_blocks = 4; ///< blocks per row of a tile
constexpr std::int64_t batch = 4;       ///< output slices filtered along z together while their sources are in L1
constexpr std::int64_t row_group = 8;   ///< rows loaded before the first of them is filtered along x
template <class C> constexpr std::int64_t block = block_bytes / static_cast<std::int64_t>(sizeof(C));

constexpr std::int64_t round_up(std::int64_t n, std::int64_t unit) { return (n + unit - 1) / unit * unit; }

template <class C> struct Taps {
    std::int64_t radius;
    C const* shares;
};

/// out[i] = factor * nested average of rows[0…2r][i] (see GaussianTaps); n is a multiple of the block.
template <class C> void average(C const* const* rows, Taps<C> taps, C factor, C* out, std::int64_t n) {
    constexpr std::int64_t registers = block<C> / lane_count<C>;
    std::int64_t const r = taps.radius;
    Lanes<C> const scale = Lanes<C>{} + factor;
    for (std::int64_t i = 0; i < n; i += block<C>) {
        Lanes<C> sum[static_cast<std::size_t>(registers)];
        C const* low = rows[0] + i;
        C const* high = rows[2 * r] + i;
        for (std::int64_t j = 0; j < registers; ++j)
            sum[j] = load_lanes(low + j * lane_count<C>) + load_lanes(high + j * lane_count<C>);
        for (std::int64_t k = r - 1; k >= 0; --k) {
            low = rows[r - k] + i;
            high = rows[r + k] + i;
            Lanes<C> const share = Lanes<C>{} + taps.shares[k];
#pragma GCC unroll 8
            for (std::int64_t j = 0; j < registers; ++j) {
                Lanes<C> const pair = load_lanes(low + j * lane_count<C>) + load_lanes(high + j * lane_count<C>);
                sum[j] = madd(share, pair - sum[j], sum[j]);
            }
        }
        for (std::int64_t j = 0; j < registers; ++j) store_lanes(out + i + j * lane_count<C>, scale * sum[j]);
    }
}

template <class T, class C> void load_halves(T const* from, C* to, std::int64_t n) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = C(0.5) * static_cast<C>(from[i]);
}

template <class T, class C> void store_row(C const* from, T* to, std::int64_t n, bool stream) {
    if constexpr (std::is_same_v<T, C>) {
        std::size_t const bytes = static_cast<std::size_t>(n) * sizeof(T);
        if (stream)
            stream_bytes(reinterpret_cast<std::byte*>(to), reinterpret_cast<std::byte const*>(from), bytes);
        else
            std::memcpy(to, from, bytes);
    } else {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) to[i] = round_to<T>(from[i]);
    }
}

/// How the plane is cut, and where things lie in the storage. All counts in elements of C.
template <class C> struct Layout {
    Layout(GaussianPasses const& passes, Box const& area, int threads) {
        Index3 const n = area.dims(), r{passes.taps[0].radius, passes.taps[1].radius, passes.taps[2].radius};
        slots = 2 * r.z + batch;
        if (passes.boundary != Boundary::wrap) slots = std::min(slots, passes.dims.z);
        std::int64_t const budget = ring_bytes / static_cast<std::int64_t>(sizeof(C)) / slots;
        columns = std::min(round_up(n.x, block<C>), tile_blocks * block<C>);
        rows = std::clamp<std::int64_t>(budget / columns, std::max<std::int64_t>(16, 2 * r.y),
                                        std::max<std::int64_t>(16, n.y));
        // At least two tiles a thread, unless they would get too thin for their halo.
        while (rows > std::max<std::int64_t>(16, 2 * r.y) &&
               ((n.x + columns - 1) / columns) * ((n.y + rows - 1) / rows) < 2 * threads)
            rows = std::max<std::int64_t>(16, rows / 2);
        rows = std::min(rows, n.y);
        across = (n.x + columns - 1) / columns;
        tiles = across * ((n.y + rows - 1) / rows);
        // One odd cache line more per row and per plane: no two of the rows that meet in a sum share a cache set.
        pitch = columns + 64 / static_cast<std::int64_t>(sizeof(C));
        std::int64_t const line = 64 / static_cast<std::int64_t>(sizeof(C));
        plane = round_up(rows * pitch, 4096 / static_cast<std::int64_t>(sizeof(C))) + (columns / line + 1) * line;
        ring = plane * slots;
        filtered = (rows + 2 * r.y + 1) * pitch;
        loaded = round_up(columns + 2 * r.x, block<C>) + block<C>;
        pointers = round_up((2 * std::max({r.x, r.y, r.z}) + 1 + rows + 2 * r.y) * 8, 64) /
                   static_cast<std::int64_t>(sizeof(C));
        scratch = round_up(filtered + row_group * loaded + columns + pitch + (2 + row_group) * pointers, 64);
    }
    std::int64_t bytes(int threads) const {
        return (tiles * ring + threads * scratch) * static_cast<std::int64_t>(sizeof(C)) + 64;
    }

    std::int64_t columns, rows, across, tiles; ///< of a tile; tiles per row of tiles and in all
    std::int64_t pitch, plane, slots, ring;
    std::int64_t filtered, loaded, pointers, scratch;
};

/// One tile: filters slices along x and y into its ring, and out of the ring along z.
template <class T, class C> class Tile {
public:
    Tile(GaussianPasses const& passes, Layout<C> const& layout, View<T const> in, Box const& in_box, View<T> out,
         Box const& out_box, std::int64_t index, C* ring, C* scratch, bool stream)
        : passes_(passes), layout_(layout), in_(in), in_box_(in_box), out_(out), ring_(ring), stream_(stream) {
        box_ = out_box;
        box_.lower.x += index % layout.across * layout.columns;
        box_.lower.y += index / layout.across * layout.rows;
        box_.upper.x = std::min(box_.lower.x + layout.columns, out_box.upper.x);
        box_.upper.y = std::min(box_.lower.y + layout.rows, out_box.upper.y);
        width_ = round_up(box_.dims().x, block<C>);
        filtered_ = scratch;
        loaded_ = filtered_ + layout.filtered;
        result_ = loaded_ + row_group * layout.loaded;
        border_ = result_ + layout.columns;
        pointers_ = reinterpret_cast<C const**>(border_ + layout.pitch);
        rows_ = reinterpret_cast<C**>(border_ + layout.pitch + layout.pointers);
        x_pointers_ = reinterpret_cast<C const**>(border_ + layout.pitch + 2 * layout.pointers);
        std::int64_t const taps_x = 2 * passes.taps[0].radius + 1;
        for (std::int64_t i = 0; i < row_group; ++i)
            for (std::int64_t k = 0; k < taps_x; ++k) x_pointers_[i * taps_x + k] = loaded_ + i * layout.loaded + k;
        half_border_ = C(0.5) * static_cast<C>(round_to<T>(passes.border_value));
        for (std::int64_t i = 0; i < layout.pitch; ++i) border_[i] = half_border_;
        for (int axis = 0; axis < 3; ++axis) {
            GaussianTaps const& t = passes.taps[static_cast<std::size_t>(axis)];
            if constexpr (std::is_same_v<C, float>)
                taps_[axis] = {t.radius, t.single_shares.data()};
            else
                taps_[axis] = {t.radius, t.shares.data()};
        }
    }

    /// Output slices of the box; the ring already holds the slices up to have_end that the first one needs.
    void run(std::int64_t have_end) {
        for (std::int64_t z = box_.lower.z; z < box_.upper.z; z += batch) {
            std::int64_t const last = std::min(z + batch, box_.upper.z);
            for (; have_end < last_slice(last); ++have_end) filter_slice(have_end);
            for (std::int64_t y = box_.lower.y; y < box_.upper.y; ++y)
                for (std::int64_t s = z; s < last; ++s) filter_along_z(y, s);
        }
    }

    std::int64_t first_slice(std::int64_t z) const {
        return passes_.boundary == Boundary::wrap ? z - taps_[2].radius
                                                  : std::max<std::int64_t>(0, z - taps_[2].radius);
    }
    std::int64_t last_slice(std::int64_t end) const {
        return passes_.boundary == Boundary::wrap ? end + taps_[2].radius
                                                  : std::min(passes_.dims.z, end + taps_[2].radius);
    }

private:
    C* plane(std::int64_t z) const {
        return ring_ + ((z % layout_.slots + layout_.slots) % layout_.slots) * layout_.plane;
    }

    /// One input row: halves, with the halo along x folded in.
    void load_row(std::int64_t y, std::int64_t z, C* row) {
        std::int64_t const n = passes_.dims.x;
        std::int64_t const begin = box_.lower.x - taps_[0].radius, end = box_.upper.x + taps_[0].radius;
        std::int64_t const inner = std::max<std::int64_t>(begin, 0), outer = std::min(end, n);
        T const* const from = &in_(inner, y, z);
        auto const ahead =
            reinterpret_cast<std::uintptr_t>(from) + static_cast<std::uintptr_t>(row_group * in_.row) * sizeof(T);
        for (std::size_t i = 0; i < static_cast<std::size_t>(outer - inner) * sizeof(T); i += 64)
            __builtin_prefetch(reinterpret_cast<void const*>(ahead + i), 0, 2);
        load_halves(from, row + (inner - begin), outer - inner);
        for (std::int64_t x = begin; x < inner; ++x) row[x - begin] = outside(x, y, z);
        for (std::int64_t x = outer; x < end; ++x) row[x - begin] = outside(x, y, z);
    }

    /// Filters `count` rows along x. Several are loaded before the first is filtered, because reading across what has
    /// just been stored would stall.
    void filter_rows(std::int64_t const* y, C* const* to, std::int64_t count, std::int64_t z) {
        if (taps_[0].radius == 0) {
            for (std::int64_t i = 0; i < count; ++i) load_row(y[i], z, to[i]);
            return;
        }
        for (std::int64_t i = 0; i < count; ++i) load_row(y[i], z, loaded_ + i * layout_.loaded);
        for (std::int64_t i = 0; i < count; ++i)
            average<C>(x_pointers_ + i * (2 * taps_[0].radius + 1), taps_[0], C(0.5), to[i], width_);
    }
    C outside(std::int64_t x, std::int64_t y, std::int64_t z) const {
        std::int64_t const from = fold(x, passes_.dims.x, passes_.boundary);
        return from < 0 ? half_border_ : C(0.5) * static_cast<C>(in_(from, y, z));
    }

    void filter_slice(std::int64_t z) {
        std::int64_t const r = taps_[1].radius, n = box_.dims().y, first = box_.lower.y - r;
        C* const to = plane(z);
        std::int64_t y_of[row_group];
        C* row_of[row_group];
        std::int64_t count = 0;
        // Rows outside the volume are twins of rows inside, filtered once, unless they come from its other end.
        for (std::int64_t j = 0; j < n + 2 * r; ++j) {
            std::int64_t const from = fold(first + j, passes_.dims.y, passes_.boundary), twin = from - first;
            rows_[j] = (r == 0 ? to : filtered_) + j * layout_.pitch;
            if (from < 0) {
                rows_[j] = border_;
            } else if (twin != j && twin >= 0 && twin < n + 2 * r) {
                rows_[j] = filtered_ + twin * layout_.pitch;
            } else {
                y_of[count] = from;
                row_of[count] = rows_[j];
                if (++count == row_group) {
                    filter_rows(y_of, row_of, count, z);
                    count = 0;
                }
            }
        }
        filter_rows(y_of, row_of, count, z);
        if (r == 0) return;
        for (std::int64_t y = 0; y < n; ++y) average<C>(rows_ + y, taps_[1], C(0.5), to + y * layout_.pitch, width_);
    }

    void filter_along_z(std::int64_t y, std::int64_t z) {
        std::int64_t const r = taps_[2].radius, row = (y - box_.lower.y) * layout_.pitch, n = box_.dims().x;
        if (r == 0) {
            C const* const from = plane(z) + row;
            for (std::int64_t i = 0; i < n; ++i) result_[i] = C(2) * from[i];
        } else {
            for (std::int64_t k = -r; k <= r; ++k) {
                std::int64_t const from =
                    passes_.boundary == Boundary::wrap ? z + k : fold(z + k, passes_.dims.z, passes_.boundary);
                pointers_[k + r] = from < 0 && passes_.boundary != Boundary::wrap ? border_ : plane(from) + row;
            }
            average(pointers_, taps_[2], C(1), result_, width_);
        }
        store_row(result_, &out_(box_.lower.x, y, z), n, stream_);
    }

    GaussianPasses const& passes_;
    Layout<C> const& layout_;
    View<T const> in_;
    Box in_box_;
    View<T> out_;
    Box box_;
    C* ring_;
    bool stream_;
    std::int64_t width_;
    C *filtered_, *loaded_, *result_, *border_;
    C const** pointers_;
    C** rows_;
    C const** x_pointers_;
    C half_border_;
    Taps<C> taps_[3];
};

template <class T, class C>
void run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Execution const& execution) {
    int const threads = threads_for(execution, out.box.voxels());
    Layout<C> const layout(passes, out.box, std::max(1, execution.threads));
    std::int64_t const r = passes.taps[2].radius;
    // Rings hold over from the last run if this one goes on where it ended.
    bool const same = planes.area.lower.x == out.box.lower.x && planes.area.upper.x == out.box.upper.x &&
                      planes.area.lower.y == out.box.lower.y && planes.area.upper.y == out.box.upper.y &&
                      planes.layout == layout.tiles * 65536 + execution.threads;
    if (!same || out.box.lower.z != planes.end) planes.begin = planes.end = out.box.lower.z;
    planes.storage.reserve(static_cast<std::size_t>(layout.bytes(std::max(1, execution.threads))));
    C* const memory = reinterpret_cast<C*>(planes.storage.update(Space::host));
    bool const stream = out.bytes() >= stream_threshold;
    bool const fresh = planes.begin == planes.end;
#pragma omp parallel num_threads(threads) if (threads > 1)
    {
        C* const scratch = memory + layout.tiles * layout.ring + omp_get_thread_num() * layout.scratch;
#pragma omp for schedule(dynamic, 1)
        for (std::int64_t i = 0; i < layout.tiles; ++i) {
            Tile<T, C> tile(passes, layout, in.as<T>(), in.box, out.as<T>(), out.box, i, memory + i * layout.ring,
                            scratch, stream);
            std::int64_t const z = out.box.lower.z;
            tile.run(fresh ? tile.first_slice(z) : tile.last_slice(z));
        }
        if (stream) stream_fence();
    }
    planes.area = out.box;
    planes.layout = layout.tiles * 65536 + execution.threads;
    planes.begin = out.box.lower.z - r;
    planes.end = out.box.upper.z;
}

} // namespace
#else
namespace {

template <class T, class C>
void run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out, Execution const&) {
    gaussian::Launcher<T, C>(passes, planes, in, out).run();
}

} // namespace
#endif

void gaussian_run(GaussianPasses const& passes, GaussianPlanes& planes, ConstView in, AnyView out,
                  Execution const& execution) {
    if (out.box.empty()) return;
    for_each_type(out.type, [&]<class T>(T) {
        if constexpr (std::is_same_v<compute_t<T>, double>)
            run<T, double>(passes, planes, in, out, execution);
        else if (passes.wide)
            run<T, double>(passes, planes, in, out, execution);
        else
            run<T, float>(passes, planes, in, out, execution);
    });
}

} // namespace vkt::VKT_BACKEND
