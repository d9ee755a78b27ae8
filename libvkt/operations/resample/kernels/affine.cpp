// Affine sampling: rows of output, in vectors where all that is looked at lies inside, voxel by voxel at the faces.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/affine.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/common/kernels/finite_rows.h"
#include "libvkt/operations/filter/kernels/large_rows.h"
#include "libvkt/operations/resample/kernels/affine_places.h"
#include "libvkt/operations/resample/kernels/affine_single.h"
#include "libvkt/operations/resample/kernels/interpolants.h"
#include "libvkt/operations/resample/kernels/smooth_slices.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

#include <cmath>
#include <cstring>
#include <optional>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Where the samples of a strip look.
struct StripPlaces {
    double fx[strip], fy[strip], fz[strip];
    std::int64_t index[strip];

    void find(Places const places, double first, std::int32_t n) {
#pragma omp simd
        for (std::int32_t i = 0; i < n; ++i) index[i] = places.of(first + i, fx[i], fy[i], fz[i]);
    }
};

/// to[i] becomes the voxel so many voxels from a view's first: loads one by one, since hardware that gathers is rare
/// and not faster.
void gather(ConstView const& in, std::int64_t const* index, std::int64_t offset, std::int32_t n, double* to) {
    with_type(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data) + offset;
        for (std::int32_t i = 0; i < n; ++i) to[i] = static_cast<double>(data[index[i]]);
    });
}

/// with_type for what a kernel looks at: coefficients of splines are floats.
template <class Kernel, class F> void with_sampled_type(DataType type, F&& f) {
    if constexpr (spline_degree(Kernel::kind) > 0)
        type == DataType::float32 ? f(float{}) : f(double{});
    else
        with_type(type, f);
}

/// Samples of a strip by kernels of N^3 voxels, in the order of weighted(): the columns are the lanes of vectors.
template <class Kernel, int N> struct StripConvolution {
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        double wx[N][strip], wy[N][strip], wz[N][strip];
        weights(places.fx, n, wx);
        bool zeros = weights(places.fy, n, wy);
        zeros = weights(places.fz, n, wz) || zeros;
        with_sampled_type<Kernel>(in.type, [&]<class T>(T) {
            constexpr int first = 1 - N / 2;
            T const* const data = reinterpret_cast<T const*>(in.data) + first * (1 + in.row + in.slice);
            for (std::int32_t s = 0; s < n; ++s) {
                T const* const corner = data + places.index[s];
                to[s] = zeros ? sum<true>(corner, in.row, in.slice, s, wx, wy, wz)
                              : sum<false>(corner, in.row, in.slice, s, wx, wy, wz);
            }
        });
    }

    /// One sample of voxels anywhere, in the same order.
    template <class T> static double sample_folded(T const* data, FoldedPlaces<Kernel> const& at, double border) {
        if (at.any_border) return VKT_BACKEND::sample_folded<Kernel>(data, at, border);
        double wx[N], wy[N], wz[N];
        Kernel::weights(at.fraction[0], wx);
        Kernel::weights(at.fraction[1], wy);
        Kernel::weights(at.fraction[2], wz);
        std::int64_t const(&x)[N] = at.place[0];
        Doubles4 total{}, last_total{};
        for (int k = 0; k < N; ++k) {
            if (wz[k] == 0) continue;
            Doubles4 part{}, last_part{};
            for (int j = 0; j < N; ++j) {
                if (wy[j] == 0) continue;
                T const* const from = data + at.place[1][j] + at.place[2][k];
                double values[N];
                for (int i = 0; i < N; ++i) values[i] = static_cast<double>(from[x[i]]);
                Doubles4 v;
                std::memcpy(&v, values, sizeof v);
                part += wy[j] * v;
                if constexpr (N == 4) continue;
                std::memcpy(&v, values + N - 4, sizeof v);
                last_part += wy[j] * v;
            }
            total += wz[k] * part;
            last_total += wz[k] * last_part;
        }
        double result = 0;
        auto const column = [&](int i) { return term_of(wx[i], i < 4 ? total[i] : last_total[i - (N - 4)]); };
        for (int i = 0; i < N; i += 2) result += column(i) + column(i + 1);
        return result;
    }

private:
    template <bool Zeros, class T>
    static double sum(T const* corner, std::int64_t row, std::int64_t slice, std::int32_t s,
                      double const (&wx)[N][strip], double const (&wy)[N][strip], double const (&wz)[N][strip]) {
        constexpr int last = N - 4; // the last four columns, of six, begin there
        Doubles4 total{}, last_total{};
        for (int k = 0; k < N; ++k) {
            if (Zeros && wz[k][s] == 0) continue;
            Doubles4 part{}, last_part{};
            for (int j = 0; j < N; ++j) {
                double const w = wy[j][s];
                if (Zeros && w == 0) continue;
                T const* const from = corner + j * row + k * slice;
                Doubles4 v;
                load_four(from, v);
                part += w * v;
                if constexpr (last == 0) continue;
                load_four(from + last, v);
                last_part += w * v;
            }
            total += wz[k][s] * part;
            last_total += wz[k][s] * last_part;
        }
        double result = 0;
        auto const column = [&](int i) { return term_of(wx[i][s], i < 4 ? total[i] : last_total[i - last]); };
        for (int i = 0; i < N; i += 2) result += column(i) + column(i + 1);
        return result;
    }

private:
    /// True if one of them is 0.
    static bool weights(double const* fraction, std::int32_t n, double (*w)[strip]) {
#pragma omp simd
        for (std::int32_t s = 0; s < n; ++s) {
            double each[N];
            Kernel::weights(fraction[s], each);
            for (int i = 0; i < N; ++i) w[i][s] = each[i];
        }
        std::int64_t zeros = 0;
        for (int i = 0; i < N; ++i)
#pragma omp simd reduction(+ : zeros)
            for (std::int32_t s = 0; s < n; ++s) zeros += w[i][s] == 0 ? 1 : 0;
        return zeros > 0;
    }
};

struct StripLinear {
    template <class T> static double sample_folded(T const* data, FoldedPlaces<Linear> const& at, double border) {
        return VKT_BACKEND::sample_folded<Linear>(data, at, border);
    }
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        double v[8][strip];
        for (int corner = 0; corner < 8; ++corner)
            gather(in, places.index, (corner & 1) + (corner >> 1 & 1) * in.row + (corner >> 2) * in.slice, n,
                   v[corner]);
        double const *const fx = places.fx, *const fy = places.fy, *const fz = places.fz;
        make_between<double>(static_cast<double const*>(to), n, [&](auto const between) {
#pragma omp simd
            for (std::int32_t i = 0; i < n; ++i)
                to[i] =
                    between(between(between(v[0][i], v[1][i], fx[i]), between(v[2][i], v[3][i], fx[i]), fy[i]),
                            between(between(v[4][i], v[5][i], fx[i]), between(v[6][i], v[7][i], fx[i]), fy[i]), fz[i]);
        });
    }
};

struct StripNearest {
    template <class T> static double sample_folded(T const* data, FoldedPlaces<Nearest> const& at, double border) {
        return VKT_BACKEND::sample_folded<Nearest>(data, at, border);
    }
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        std::int64_t index[strip];
        double const half = 0.5 - face_slack;
        for (std::int32_t i = 0; i < n; ++i)
            index[i] = places.index[i] + (places.fx[i] >= half ? 1 : 0) + (places.fy[i] >= half ? in.row : 0) +
                       (places.fz[i] >= half ? in.slice : 0);
        gather(in, index, 0, n, to);
    }
};

/// Samples whose voxels all lie in the view, in strips: positions in vectors, then the loads, then the sums in vectors.
template <class Strip> void sample_run(ConstView const& in, Places const& at, XRange range, double* to) {
    StripPlaces places;
    for (std::int64_t x = range.begin; x < range.end; x += strip) {
        auto const n = static_cast<std::int32_t>(std::min<std::int64_t>(strip, range.end - x));
        places.find(at, static_cast<double>(x), n);
        Strip::sample(in, places, n, to + (x - range.begin));
    }
}

/// Samples of a row for x in `range` that may look beyond the volume; to[0] belongs to the first. A function of its
/// own, for all who have rows: it asks for the type of voxels, and is compiled for each.
template <class Kernel, class Strip>
void sample_at_face(ConstView const& in, PositionRow const& at, XRange range, AffineSampling const& rule, double* to) {
    if (range.begin == range.end) return;
    with_sampled_type<Kernel>(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data);
        for (std::int64_t x = range.begin; x < range.end; ++x) {
            FoldedPlaces<Kernel> const places(in, at, static_cast<double>(x), rule);
            to[x - range.begin] = Strip::sample_folded(data, places, rule.border);
        }
    });
}

/// Samples of a row for x in `range`; to[0] belongs to its first. run(quick, to) gives those of the part that looks at
/// nothing beyond the volume.
template <class Kernel, class Strip, class Run>
void sample_row(ConstView const& in, PositionRow const& at, XRange range, XRange quick, AffineSampling const& rule,
                double* to, Run const& run) {
    sample_at_face<Kernel, Strip>(in, at, {range.begin, quick.begin}, rule, to);
    if (quick.begin < quick.end) run(quick, to + (quick.begin - range.begin));
    sample_at_face<Kernel, Strip>(in, at, {quick.end, range.end}, rule, to + (quick.end - range.begin));
}

/// to becomes the mean of `count` samples, of which `sample` is the last: by steps that neither overflow nor leave the
/// range of the samples.
void join_mean(double const* sample, double* to, std::int64_t n, std::int64_t count) {
    double const share = 1 / static_cast<double>(count);
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = between(to[i], sample[i], share);
}

/// A row of results for x in `all`, of which samples(to) gives those in `in_it`; background beside them.
template <class Samples>
void make_row(AnyView out, AffineSampling const& rule, XRange all, XRange in_it, std::int64_t y, std::int64_t z,
              Tally& tally, Samples const& samples) {
    alignas(64) double values[affine_tile.x];
    std::int64_t const n = all.end - all.begin, m = in_it.end - in_it.begin;
    double* const there = values + (m > 0 ? in_it.begin - all.begin : 0);
    if (m < n) std::fill_n(values, n, rule.background);
    tally.outside += n - m;
    if (m > 0) samples(there);
    if (rule.scale != 1 || rule.offset != 0)
        for (std::int64_t i = 0; i < m; ++i) there[i] = saturated(there[i] * rule.scale + rule.offset, there[i]);
    tally.losses += store_row(out.type, static_cast<double const*>(values), out.at(all.begin, y, z), n);
}

/// Sums of float64 that are not finite: looked for first, since hardly any volume has them, and made again where there
/// are such, of voxels times a power of two.
struct Overflow {
    bool mends = false, found = false;
};
/// Interpolants whose weights are not all positive, and do more than share what there is; coefficients of splines are
/// scaled.
template <class Kernel>
constexpr bool may_overflow = Kernel::kind == Interpolant::cubic || Kernel::kind == Interpolant::lanczos3;

struct ScaledVoxels {
    double const* data;
    double scale;
    double operator[](std::int64_t i) const { return data[i] * scale; }
};

/// Looks for samples of a row that are not finite, or makes them again; to[0] belongs to the first.
template <class Kernel>
void look_after(ConstView const& in, PositionRow const& at, XRange range, AffineSampling const& rule, double* to,
                Overflow& overflow) {
    constexpr double scale = 0x1p-8; // magnitudes of the weights do not add up to that much
    std::int64_t const n = range.end - range.begin;
    if (all_finite(static_cast<double const*>(to), n)) return;
    if (!overflow.mends) {
#pragma omp atomic write
        overflow.found = true;
        return;
    }
    ScaledVoxels const voxels{reinterpret_cast<double const*>(in.data), scale};
    for (std::int64_t i = 0; i < n; ++i) {
        if (is_finite(to[i])) continue;
        FoldedPlaces<Kernel> const places(in, at, static_cast<double>(range.begin + i), rule);
        double const sample = VKT_BACKEND::sample_folded<Kernel>(voxels, places, rule.border * scale);
        to[i] = saturated(sample / scale, sample);
    }
}

/// A tile of the result, row by row.
template <class Kernel, class Strip>
void sample_tile(ConstView const& in, AnyView out, Box const& tile, AffineSampling const& rule, Tally& tally,
                 Overflow* overflow = nullptr) {
    Index3 const k = rule.samples;
    auto const aside = [](std::int64_t i, std::int64_t n) {
        return (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 0.5;
    };
    for_each_row(tile, [&](std::int64_t y, std::int64_t z) {
        XRange const all{tile.lower.x, tile.upper.x};
        XRange const in_it = inside(all, row_of(rule.map, {}, y, z), rule);
        make_row(out, rule, all, in_it, y, z, tally, [&](double* there) {
            alignas(64) double sample[affine_tile.x];
            for (std::int64_t sub = 0; sub < k.x * k.y * k.z; ++sub) {
                Vec3 const shift = rule.map.column[0] * aside(sub % k.x, k.x) +
                                   rule.map.column[1] * aside(sub / k.x % k.y, k.y) +
                                   rule.map.column[2] * aside(sub / k.x / k.y, k.z);
                PositionRow const at = row_of(rule.map, shift, y, z);
                auto const run = [&](XRange quick, double* to) { sample_run<Strip>(in, Places(in, at), quick, to); };
                double* const to = sub == 0 ? there : sample;
                sample_row<Kernel, Strip>(in, at, in_it, interior(in_it, at, rule), rule, to, run);
                if constexpr (may_overflow<Kernel>)
                    if (overflow != nullptr) look_after<Kernel>(in, at, in_it, rule, to, *overflow);
                if (sub > 0) join_mean(sample, there, in_it.end - in_it.begin, sub + 1);
            }
        });
    });
}

/// Whether voxels of a view are so large that sums of them may overflow.
bool any_large_in(ConstView const& in, Execution const& execution) {
    bool large = false;
    for_each_segment(execution, in.box, [&](std::int64_t x, std::int64_t y, std::int64_t z, std::int64_t n) {
        if (!any_large(reinterpret_cast<double const*>(in.at(x, y, z)), n, 0x1p-8)) return;
#pragma omp atomic write
        large = true;
    });
    return large;
}

template <class Kernel, class Strip>
void sample_box(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                Execution const& execution) {
    Overflow overflow;
    bool const looks = may_overflow<Kernel> && in.type == DataType::float64;
    auto const sample_all = [&](Losses& lost, std::int64_t& beside) {
        for_each_tile(execution, out.box, affine_tile, lost, beside, [&](Box const& tile, Tally& tally) {
            sample_tile<Kernel, Strip>(in, out, tile, rule, tally, looks ? &overflow : nullptr);
        });
    };
    Losses lost;
    std::int64_t beside = 0;
    sample_all(lost, beside);
    if (overflow.found && any_large_in(in, execution)) {
        overflow.mends = true;
        lost = {};
        beside = 0;
        sample_all(lost, beside);
    }
    losses += lost;
    outside += beside;
}

/// Rows of a tile whose samples inside the volume `smooth` has. Not of the type of voxels: rows ask for it again, at
/// the faces.
template <class Strip, class Kernel, int N>
void store_slices(SmoothSlices<Kernel, N> const& smooth, ConstView const& in, AnyView out, Box const& tile,
                  AffineSampling const& rule, StillAxis still, Tally& tally) {
    for_each_row(tile, [&](std::int64_t y, std::int64_t z) {
        PositionRow const at = row_of(rule.map, {}, y, z);
        RowRanges const ranges = ranges_of({tile.lower.x, tile.upper.x}, at, rule, still.axis);
        double const* const known = smooth.values(tile, y, z);
        auto const run = [&](XRange part, double* to) {
            std::copy_n(known + (part.begin - tile.lower.x), part.end - part.begin, to);
        };
        make_row(out, rule, ranges.all, ranges.inside, y, z, tally, [&](double* there) {
            sample_row<Kernel, Strip>(in, at, ranges.inside, ranges.interior, rule, there, run);
        });
    });
}

/// The same as sample_box where slices share their places: `box` has only such. Tiles that are cut, or look at too
/// much, are sampled one row after another.
template <class Kernel, int N, class Strip>
void sample_slices(ConstView const& in, AnyView out, Box const& box, AffineSampling const& rule, StillAxis still,
                   Losses& losses, std::int64_t& outside, Execution const& execution) {
    using Smooth = SmoothSlices<Kernel, N>;
    with_type(in.type, [&]<class T>(T) {
        if constexpr (Smooth::template takes<T>) {
            struct Scratch {
                std::optional<Smooth> smooth;
                Interleaved<T, Smooth::slices> voxels;
            };
            for_each_tile<Scratch>(
                execution, box, affine_tile, losses, outside, [&](Box const& tile, Tally& tally, Scratch& scratch) {
                    if (!scratch.smooth) scratch.smooth.emplace(in, rule, still);
                    Smooth& smooth = *scratch.smooth;
                    if (tile.dims()[still.axis] < Smooth::together || !smooth.sample(tile, scratch.voxels))
                        sample_tile<Kernel, Strip>(in, out, tile, rule, tally);
                    else
                        store_slices<Strip>(smooth, in, out, tile, rule, still, tally);
                });
        }
    });
}

/// By kernels of N^3 voxels: slices that share their places together, what is beside these row by row.
template <class Kernel, int N>
void sample_smooth(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const& execution) {
    using Strip = StripConvolution<Kernel, N>;
    StillAxis const still = still_axis(rule.map);
    bool const takes = with_type(in.type, []<class T>(T) { return SmoothSlices<Kernel, N>::template takes<T>; });
    bool const once = rule.samples == Index3{1, 1, 1};
    Box part;
    if (still.axis >= 0 && takes && once) {
        XRange const whole = SmoothSlices<Kernel, N>::whole_slices(rule, still);
        part = out.box;
        part.lower[still.axis] = std::clamp(whole.begin, out.box.lower[still.axis], out.box.upper[still.axis]);
        part.upper[still.axis] = std::clamp(whole.end, part.lower[still.axis], out.box.upper[still.axis]);
    }
    if (part.empty()) return sample_box<Kernel, Strip>(in, out, rule, losses, outside, execution);
    sample_slices<Kernel, N, Strip>(in, out, part, rule, still, losses, outside, execution);
    for (bool const above : {false, true}) { // slices that look beyond the volume
        Box beside = out.box;
        (above ? beside.lower : beside.upper)[still.axis] = (above ? part.upper : part.lower)[still.axis];
        if (!beside.empty()) sample_box<Kernel, Strip>(in, part_of(out, beside), rule, losses, outside, execution);
    }
}

/// Where the voxels lie that are nearest to the positions of a strip, all of them in the view.
struct NearestPlaces {
    std::int64_t index[strip];

    void find(Places const places, double first, std::int32_t n) {
        constexpr double half = 0.5 + face_slack;
#pragma omp simd
        for (std::int32_t i = 0; i < n; ++i) {
            double const x = first + i;
            double const wx = floor_of(places.at.x(x) + half), wy = floor_of(places.at.y(x) + half),
                         wz = floor_of(places.at.z(x) + half);
            index[i] = integer_of((wx - places.lower_x) + (wy - places.lower_y) * places.row_length +
                                  (wz - places.lower_z) * places.slice_length);
        }
    }
};

template <class U>
void nearest_bytes(View<U const> const& in, ConstView const& view, View<U> const& out, Box const& box, U background,
                   AffineSampling const& rule, std::int64_t& outside, Execution const& execution) {
    Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
    auto const index = [&](double p, std::int64_t n, std::int64_t first) {
        return place_of(whole_of(std::floor(p + (0.5 + face_slack))), n, boundary, first);
    };
    auto const anywhere = [&](PositionRow const& at, double x) {
        std::int64_t const vx = index(at.x(x), rule.dims.x, in.lower.x), vy = index(at.y(x), rule.dims.y, in.lower.y),
                           vz = index(at.z(x), rule.dims.z, in.lower.z);
        return boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0) ? background : in(vx, vy, vz);
    };
    static_assert(affine_tile.x == strip);
    StillAxis const still = still_axis(rule.map);
    Losses none;
    for_each_tile(execution, box, affine_tile, none, outside, [&](Box const& tile, Tally& tally) {
        XRange const all{tile.lower.x, tile.upper.x};
        for (std::int64_t y = tile.lower.y; y < tile.upper.y; ++y) {
            NearestPlaces places;
            std::int64_t found = -1; // the slice that they were found for, if others share them
            for (std::int64_t z = tile.lower.z; z < tile.upper.z; ++z) {
                PositionRow const at = row_of(rule.map, {}, y, z);
                bool const shared = still.axis == 2 && z + still.shift >= 0 && z + still.shift < rule.dims.z;
                RowRanges const ranges = ranges_of(all, at, rule, shared ? 2 : -1);
                XRange const in_it = ranges.inside, quick = ranges.interior;
                U* const to = &out(all.begin, y, z);
                std::int64_t const n = all.end - all.begin, m = in_it.end - in_it.begin;
                if (m < n) std::fill_n(to, n, background);
                tally.outside += n - m;
                auto const slowly = [&](std::int64_t begin, std::int64_t end) {
                    for (std::int64_t x = begin; x < end; ++x) to[x - all.begin] = anywhere(at, static_cast<double>(x));
                };
                slowly(in_it.begin, quick.begin);
                if (quick.begin < quick.end) {
                    auto const count = static_cast<std::int32_t>(quick.end - quick.begin);
                    if (!shared || found < 0) {
                        places.find(Places(view, at), static_cast<double>(quick.begin), count);
                        found = shared ? z : -1;
                    }
                    U const* const from = in.data + (shared ? (z - found) * in.slice : 0);
                    U* const there = to + (quick.begin - all.begin);
                    for (std::int32_t i = 0; i < count; ++i) there[i] = from[places.index[i]];
                }
                slowly(quick.end, in_it.end);
            }
        }
    });
}

} // namespace

void affine_sample(ConstView in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const& execution) {
    auto const sample = [&]<class Kernel, class Strip>() {
        sample_box<Kernel, Strip>(in, out, rule, losses, outside, execution);
    };
    auto const smooth = [&]<class Kernel, int N>() {
        sample_smooth<Kernel, N>(in, out, rule, losses, outside, execution);
    };
    if (rule.single) return sample_single(in, out, rule, losses, outside, execution);
    switch (rule.interpolant) {
    case Interpolant::nearest:
        return sample.template operator()<Nearest, StripNearest>();
    case Interpolant::linear:
        return sample.template operator()<Linear, StripLinear>();
    case Interpolant::cubic:
        return smooth.template operator()<Cubic, 4>();
    case Interpolant::lanczos3:
        return smooth.template operator()<Lanczos3, 6>();
    case Interpolant::bspline3:
        return smooth.template operator()<BSpline3, 4>();
    case Interpolant::bspline5:
        return smooth.template operator()<BSpline5, 6>();
    }
}

void affine_nearest(ConstView in, AnyView out, AffineSampling const& rule, std::int64_t& outside,
                    Execution const& execution) {
    VoxelBytes const voxel = voxel_bytes(out.type, rule.boundary ? rule.border : rule.background);
    for_each_size(size_of(in.type), [&]<class U>(U) {
        U background;
        std::memcpy(&background, voxel.data(), sizeof background);
        nearest_bytes<U>(in.as<U>(), in, out.as<U>(), out.box, background, rule, outside, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
