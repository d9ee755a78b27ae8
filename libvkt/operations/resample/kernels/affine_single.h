// Linear interpolation in float32 on CPUs, by the way that suits the map: rows that stay rows, slices that share their
// places, and all else.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/rows.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/resample/kernels/affine_places.h"
#include "libvkt/operations/resample/kernels/interleaved.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

#include <cstring>

namespace vkt::VKT_BACKEND {

/// Calls f(T{}) with the storage type, which float holds.
template <class F> void for_each_single_type(DataType type, F&& f) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) <= 2 || std::is_same_v<T, float>) f(T{});
    });
}

/// Where the samples of a strip look, for samples in float32.
struct SinglePlaces {
    float fx[strip], fy[strip], fz[strip];
    std::int64_t index[strip];

    void find(Places const places, double first, std::int32_t n) {
#pragma omp simd
        for (std::int32_t i = 0; i < n; ++i) {
            double dx, dy, dz;
            index[i] = places.of(first + i, dx, dy, dz);
            fx[i] = static_cast<float>(dx), fy[i] = static_cast<float>(dy), fz[i] = static_cast<float>(dz);
        }
    }
};

/// Calls make(between) with what is quick, and again with what takes every value where something of the n values that
/// it makes of voxels of type T is not finite.
template <class T, class C, class Make> void make_between(C const* values, std::int64_t n, Make const& make) {
    make(QuicklyBetween{});
    if constexpr (!std::is_integral_v<T>)
        if (!all_finite(values, n)) make(AlwaysBetween{});
}

/// Loads one by one, then the sums in vectors; neighbours along x are loaded together. Rows counts those that are
/// looked at: 4, or the 2 of a plane, `across` and `along` voxels from one another; `f` has the fractions across.
template <int Rows, class T>
void sample_strip_single(T const* data, std::int64_t across, std::int64_t along, SinglePlaces const& at, float const* f,
                         std::int32_t n, float* to) {
    T pair[Rows][2 * strip];
    for (std::int32_t i = 0; i < n; ++i) {
        T const* const c = data + at.index[i];
        for (int r = 0; r < Rows; ++r)
            std::memcpy(pair[r] + 2 * i, c + (r & 1) * across + (r >> 1) * along, 2 * sizeof(T));
    }
    make_between<T>(static_cast<float const*>(to), n, [&](auto const between) {
#pragma omp simd
        for (std::int32_t i = 0; i < n; ++i) {
            float along_x[Rows];
            for (int k = 0; k < Rows; ++k)
                along_x[k] =
                    between(static_cast<float>(pair[k][2 * i]), static_cast<float>(pair[k][2 * i + 1]), at.fx[i]);
            float value = between(along_x[0], along_x[1], f[i]);
            if constexpr (Rows == 4) value = between(value, between(along_x[2], along_x[3], f[i]), at.fz[i]);
            to[i] = value;
        }
    });
}

/// Rows that stay rows: weights that all voxels share.
template <class T>
void sample_parallel_single(T const* from, std::int64_t row, std::int64_t slice, std::int64_t n, float fy, float fz,
                            float* to) {
    make_between<T>(static_cast<float const*>(to), n, [&](auto const between) {
#pragma omp simd
        for (std::int64_t i = 0; i < n; ++i) {
            auto const a = static_cast<float>(from[i]), b = static_cast<float>(from[i + row]),
                       c = static_cast<float>(from[i + slice]), d = static_cast<float>(from[i + slice + row]);
            to[i] = between(between(a, b, fy), between(c, d, fy), fz);
        }
    });
}

/// Samples of a row for x in `range` that may look beyond the volume. A function of its own, for all who have rows: it
/// asks for the type of voxels, and is compiled for each.
inline void sample_at_face_single(ConstView const& in, PositionRow const& at, XRange range, AffineSampling const& rule,
                                  float* to) {
    if (range.begin == range.end) return;
    for_each_single_type(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data);
        for (std::int64_t x = range.begin; x < range.end; ++x) {
            FoldedPlaces<Linear> const places(in, at, static_cast<double>(x), rule);
            to[x - range.begin] = static_cast<float>(sample_folded<Linear>(data, places, rule.border));
        }
    });
}

/// A piece of a row of results in float32; run(to) gives those that look at nothing beyond the volume.
template <class Run>
void sample_row_single(ConstView const& in, AnyView out, AffineSampling const& rule, RowRanges const& ranges,
                       std::int64_t y, std::int64_t z, bool stream, Run const& run, Tally& tally) {
    auto const [all, in_it, quick] = ranges;
    driver::RowResult<float> result(out, out.at(all.begin, y, z), stream);
    float* const values = result.data();
    PositionRow const at = row_of(rule.map, {}, y, z);
    std::int64_t const n = all.end - all.begin, m = in_it.end - in_it.begin, first = all.begin;
    if (m < n) std::fill_n(values, n, static_cast<float>(rule.background));
    tally.outside += n - m;
    sample_at_face_single(in, at, {in_it.begin, quick.begin}, rule, values + (in_it.begin - first));
    if (quick.begin < quick.end) run(values + (quick.begin - first));
    sample_at_face_single(in, at, {quick.end, in_it.end}, rule, values + (quick.end - first));
    tally.losses += result.store(n);
}

/// Rows of a box that lie along those of the volume, on its voxels: only y and z have fractions.
inline bool lies_along_rows(Affine const& map) {
    Vec3 const step = map.column[0];
    return step.x == 1 && step.y == 0 && step.z == 0 && map.offset.x == nearest_whole(map.offset.x) &&
           map.column[1].x == nearest_whole(map.column[1].x) && map.column[2].x == nearest_whole(map.column[2].x);
}

inline void sample_rows_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
                               std::int64_t& outside, Execution const& execution) {
    bool const stream = driver::is_large(out);
    for_each_tile(execution, out.box, {row_piece, 1, 1}, losses, outside, [&](Box const& tile, Tally& tally) {
        std::int64_t const y = tile.lower.y, z = tile.lower.z;
        PositionRow const at = row_of(rule.map, {}, y, z);
        RowRanges const ranges = ranges_of({tile.lower.x, tile.upper.x}, at, rule);
        XRange const quick = ranges.interior;
        auto const run = [&](float* to) {
            double fx, fy, fz;
            std::int64_t const index = Places(in, at).of(static_cast<double>(quick.begin), fx, fy, fz);
            for_each_single_type(in.type, [&]<class T>(T) {
                sample_parallel_single(reinterpret_cast<T const*>(in.data) + index, in.row, in.slice,
                                       quick.end - quick.begin, static_cast<float>(fy), static_cast<float>(fz), to);
            });
        };
        sample_row_single(in, out, rule, ranges, y, z, stream, run, tally);
    });
}

inline void sample_box_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
                              std::int64_t& outside, Execution const& execution) {
    if (lies_along_rows(rule.map)) return sample_rows_single(in, out, rule, losses, outside, execution);
    struct Row {
        std::int64_t y, z;
        RowRanges ranges;
        SinglePlaces places;
        std::int32_t n; ///< places
    };
    bool const stream = driver::is_large(out);
    for_each_single_type(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data);
        for_each_tile(execution, out.box, affine_tile, losses, outside, [&](Box const& tile, Tally& tally) {
            Row rows[2];
            std::int64_t const height = tile.dims().y, count = height * tile.dims().z;
            // Processors do not foresee the loads: those of the next row are asked for, every other voxel's.
            auto const prepare = [&](std::int64_t item) {
                Row& row = rows[item % 2];
                row.y = tile.lower.y + item % height, row.z = tile.lower.z + item / height;
                PositionRow const at = row_of(rule.map, {}, row.y, row.z);
                row.ranges = ranges_of({tile.lower.x, tile.upper.x}, at, rule);
                XRange const quick = row.ranges.interior;
                row.n = static_cast<std::int32_t>(quick.end - quick.begin);
                row.places.find(Places(in, at), static_cast<double>(quick.begin), row.n);
                for (std::int32_t i = 0; i < row.n; i += 2) {
                    __builtin_prefetch(data + row.places.index[i]);
                    __builtin_prefetch(data + row.places.index[i] + in.slice + in.row);
                }
            };
            prepare(0);
            for (std::int64_t item = 0; item < count; ++item) {
                if (item + 1 < count) prepare(item + 1);
                Row const& row = rows[item % 2];
                auto const run = [&](float* to) {
                    sample_strip_single<4>(data, in.row, in.slice, row.places, row.places.fy, row.n, to);
                };
                sample_row_single(in, out, rule, row.ranges, row.y, row.z, stream, run, tally);
            }
        });
    });
}

/// Linear where an axis stays: between the four voxels of the plane. Tiles of several slices, which share the places.
class SlicesTogether {
public:
    SlicesTogether(ConstView const& in, AnyView out, AffineSampling const& rule, StillAxis still)
        : in_(in), out_(out), rule_(rule), still_(still), planes_(rule.map, in.box, still.axis),
          across_(still.axis == 2 ? in.row : in.slice), along_(still.axis == 2 ? in.slice : in.row),
          stream_(driver::is_large(out)) {}

    void run(Losses& losses, std::int64_t& outside, Execution const& execution) const {
        for_each_single_type(in_.type, [&]<class T>(T) {
            using Voxels = Interleaved<T, slices_at_once>;
            for_each_tile<Voxels>(execution, out_.box, affine_tile, losses, outside,
                                  [&](Box const& tile, Tally& tally, Voxels& voxels) { sample(tile, tally, voxels); });
        });
    }

private:
    static_assert(affine_tile.x == strip && affine_tile.y == affine_tile.z);
    static constexpr std::int64_t rows_at_once = affine_tile.y, slices_at_once = affine_tile.z;

    /// What the slices of a tile share, by rows.
    struct Shared {
        SinglePlaces places[rows_at_once];
        RowRanges ranges[rows_at_once];
        std::int32_t count(std::int64_t row) const {
            return static_cast<std::int32_t>(ranges[row].interior.end - ranges[row].interior.begin);
        }
    };
    float const* fractions(SinglePlaces const& places) const { return planes_.plane == 1 ? places.fy : places.fz; }

    template <class T> void sample(Box const& tile, Tally& tally, Interleaved<T, slices_at_once>& voxels) const {
        Shared shared;
        std::int64_t const first = tile.lower[still_.axis];
        for (std::int64_t row = 0; row < tile.dims()[planes_.plane]; ++row) {
            PositionRow const at = planes_.positions(tile.lower[planes_.plane] + row, first);
            shared.ranges[row] = ranges_of({tile.lower.x, tile.upper.x}, at, rule_, still_.axis);
            shared.places[row].find(Places(in_, at), static_cast<double>(shared.ranges[row].interior.begin),
                                    shared.count(row));
        }
        if (tile.dims()[still_.axis] == slices_at_once &&
            voxels.prepare(planes_.outline(tile, reach_of(Interpolant::linear)), in_.box.dims().x,
                           in_.box.dims()[planes_.plane]))
            return sample_interleaved(tile, shared, voxels, tally);
        sample_gathered<T>(tile, shared, tally);
    }
    /// run(to) gives what looks at nothing beyond the volume.
    template <class Run>
    void sample_row(Box const& tile, Shared const& shared, std::int64_t row, std::int64_t slice, Run const& run,
                    Tally& tally) const {
        std::int64_t const y = tile.lower[planes_.plane] + row, z = tile.lower[still_.axis] + slice;
        sample_row_single(in_, out_, rule_, shared.ranges[row], planes_.plane == 1 ? y : z, planes_.plane == 1 ? z : y,
                          stream_, run, tally);
    }

    template <class T>
    void sample_interleaved(Box const& tile, Shared const& shared, Interleaved<T, slices_at_once>& voxels,
                            Tally& tally) const {
        std::int64_t const first = tile.lower[still_.axis] + still_.shift - in_.box.lower[still_.axis];
        voxels.fill(reinterpret_cast<T const*>(in_.data) + first * along_, in_.box.dims().x, across_, along_);
        alignas(64) float samples[strip * slices_at_once] = {}, by_slice[slices_at_once * strip];
        for (std::int64_t row = 0; row < tile.dims()[planes_.plane]; ++row) {
            SinglePlaces const& at = shared.places[row];
            std::int32_t const n = shared.count(row);
            float const* const f = fractions(at);
            make_between<T>(static_cast<float const*>(samples), n * slices_at_once, [&](auto const between) {
                for (std::int32_t i = 0; i < n; ++i) {
                    std::int64_t const in_plane = at.index[i] - first * along_, y = in_plane / across_;
                    voxels.sample(voxels.place(in_plane - y * across_, y), at.fx[i], f[i], samples + i * slices_at_once,
                                  between);
                }
            });
            constexpr std::int64_t edge = block_edge<float>;
            for (std::int64_t i = 0; i < n; i += edge)
                for (std::int64_t slice = 0; slice < slices_at_once; slice += edge)
                    transpose_block(samples + i * slices_at_once + slice, slices_at_once, by_slice + slice * strip + i,
                                    strip);
            for (std::int64_t slice = 0; slice < slices_at_once; ++slice)
                sample_row(
                    tile, shared, row, slice,
                    [&](float* to) { std::copy_n(by_slice + slice * strip, static_cast<std::size_t>(n), to); }, tally);
        }
    }

    template <class T> void sample_gathered(Box const& tile, Shared const& shared, Tally& tally) const {
        std::int64_t const slices = tile.dims()[still_.axis];
        for (std::int64_t slice = 0; slice < slices; ++slice) {
            T const* const data = reinterpret_cast<T const*>(in_.data) + slice * along_;
            for (std::int64_t row = 0; row < tile.dims()[planes_.plane]; ++row) {
                auto const run = [&](float* to) {
                    SinglePlaces const& at = shared.places[row];
                    std::int32_t const n = shared.count(row);
                    // Processors do not foresee these loads: those of the next slice are asked for, every other one.
                    for (std::int32_t i = 0; i < n && slice + 1 < slices; i += 2)
                        __builtin_prefetch(data + along_ + at.index[i]);
                    sample_strip_single<2>(data, across_, 0, at, fractions(at), n, to);
                };
                sample_row(tile, shared, row, slice, run, tally);
            }
        }
    }

    ConstView in_;
    AnyView out_;
    AffineSampling const& rule_;
    StillAxis still_;
    SharedPlanes planes_;
    std::int64_t across_, along_;
    bool stream_;
};

/// Linear in float32, each part of the box in the way that suits it; which one that is depends on no cut.
inline void sample_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
                          std::int64_t& outside, Execution const& execution) {
    StillAxis const still = still_axis(rule.map);
    Box part = out.box;
    if (still.axis >= 0) {
        part.lower[still.axis] = std::clamp(-still.shift, out.box.lower[still.axis], out.box.upper[still.axis]);
        part.upper[still.axis] =
            std::clamp(rule.dims[still.axis] - still.shift, part.lower[still.axis], out.box.upper[still.axis]);
    }
    if (still.axis < 0 || part.empty()) return sample_box_single(in, out, rule, losses, outside, execution);
    SlicesTogether(in, part_of(out, part), rule, still).run(losses, outside, execution);
    for (bool const above : {false, true}) { // slices beside the volume
        Box beside = out.box;
        (above ? beside.lower : beside.upper)[still.axis] = (above ? part.upper : part.lower)[still.axis];
        if (!beside.empty()) sample_box_single(in, part_of(out, beside), rule, losses, outside, execution);
    }
}

} // namespace vkt::VKT_BACKEND
