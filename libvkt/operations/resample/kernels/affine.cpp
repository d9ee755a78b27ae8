// Affine sampling: rows of output, in vectors where all that is looked at lies inside, voxel by voxel at the faces.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/resample/kernels/affine.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/kernel/shuffle.h"
#include "libvkt/operations/resample/kernels/interleaved.h"
#include "libvkt/operations/resample/kernels/interpolants.h"
#include "libvkt/operations/resample/kernels/still_axis.h"

#include <cmath>
#include <cstring>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

struct XRange {
    std::int64_t begin, end;
};

/// The first x of a range for which `true_from_there_on` says so.
template <class F> std::int64_t first_x(XRange range, F const& true_from_there_on) {
    while (range.begin < range.end) {
        std::int64_t const middle = range.begin + (range.end - range.begin) / 2;
        if (true_from_there_on(middle))
            range.end = middle;
        else
            range.begin = middle + 1;
    }
    return range.begin;
}

/// The part of a range in which low <= position < high.
XRange narrowed(XRange range, PositionLine const& line, double low, double high) {
    auto const at = [&](std::int64_t x) { return line(static_cast<double>(x)); };
    auto const holds = [&](std::int64_t x) { return at(x) >= low && at(x) < high; };
    if (range.begin >= range.end || (holds(range.begin) && holds(range.end - 1))) return range;
    if (line.step >= 0) {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) >= low; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) >= high; });
    } else {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) < high; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) < low; });
    }
    return range;
}

/// The part of a piece of a row that is samples, not background. `still`: an axis along which positions are whole and
/// lie in the volume, or none.
XRange inside(XRange range, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    for (int axis = 0; axis < 3 && !rule.boundary; ++axis)
        if (axis != still) range = narrowed(range, row.line(axis), first_position(), end_position(rule.dims[axis]));
    range.end = std::max(range.begin, range.end);
    return range;
}

/// The part of it in which the interpolant looks at nothing beyond the volume.
XRange interior(XRange range, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    Reach const reach = reach_of(rule.interpolant);
    XRange part = range;
    for (int axis = 0; axis < 3; ++axis)
        if (axis != still)
            part = narrowed(part, row.line(axis), static_cast<double>(reach.before),
                            static_cast<double>(rule.dims[axis] - reach.after));
    return part.begin < part.end ? part : XRange{range.end, range.end};
}

struct RowRanges {
    XRange all, inside, interior;
};
RowRanges ranges_of(XRange all, PositionRow const& row, AffineSampling const& rule, int still = -1) {
    XRange const quick = interior(all, row, rule, still);
    if (quick.begin == all.begin && quick.end == all.end) return {all, all, all}; // nearly everywhere
    XRange const part = inside(all, row, rule, still);
    return {all, part, interior(part, row, rule, still)};
}

template <class F> void for_each_row(Box const& box, F const& f) {
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
        for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) f(y, z);
}

/// What became of the voxels of a tile.
struct Tally {
    Losses losses;
    std::int64_t outside = 0;
};

/// Calls f(tile, tally) for tiles of at most this extent that cover the box: what the samples of a tile look at lies
/// together, however the rows run through the volume.
template <class F>
void for_each_tile(Execution const& execution, Box const& box, Index3 extent, Losses& losses, std::int64_t& outside,
                   F const& f) {
    auto const pieces = [&](int axis) { return (box.dims()[axis] + extent[axis] - 1) / extent[axis]; };
    std::int64_t const nx = pieces(0), ny = pieces(1), nz = pieces(2);
    for_each_item(threads_for(execution, box.voxels()), nx * ny * nz, [&](std::int64_t begin, std::int64_t end) {
        Tally tally;
        for (std::int64_t item = begin; item < end; ++item) {
            tell_progress(execution, begin, item, end);
            Box tile;
            tile.lower = {box.lower.x + item % nx * extent.x, box.lower.y + item / nx % ny * extent.y,
                          box.lower.z + item / nx / ny * extent.z};
            tile.upper = tile.lower + extent;
            f(intersect(tile, box), tally);
        }
        stream_fence();
        driver::add(losses, tally.losses);
#pragma omp atomic
        outside += tally.outside;
    });
}

/// Where the samples of a row look, if all the voxels lie in the view.
struct Places {
    double lower_x, lower_y, lower_z, row_length, slice_length;
    PositionRow at;

    Places(ConstView const& in, PositionRow const& positions)
        : lower_x(static_cast<double>(in.box.lower.x)), lower_y(static_cast<double>(in.box.lower.y)),
          lower_z(static_cast<double>(in.box.lower.z)), row_length(static_cast<double>(in.row)),
          slice_length(static_cast<double>(in.slice)), at(positions) {}

    /// Where the voxel at the floor of the position of x lies, and the fractions beyond it.
    VKT_HD std::int64_t of(double x, double& fx, double& fy, double& fz) const {
        double const wx = at.x.floor(x, fx), wy = at.y.floor(x, fy), wz = at.z.floor(x, fz);
        return integer_of((wx - lower_x) + (wy - lower_y) * row_length + (wz - lower_z) * slice_length);
    }
};

constexpr std::int32_t strip = 64; ///< samples worked on together

/// The same of a strip of samples.
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

std::int64_t whole_of(double whole) {
    double const limit = 0x1p60; // positions may be anything that a header can say
    return static_cast<std::int64_t>(std::clamp(whole, -limit, limit));
}

/// What a view that begins at `first` has for a voxel anywhere, -1 if that is the border. A wrapped volume's may begin
/// and end outside.
std::int64_t place_of(std::int64_t at, std::int64_t n, Boundary boundary, std::int64_t first) {
    return boundary == Boundary::wrap ? first + fold(at - first, n, boundary) : fold(at, n, boundary);
}

/// A sample anywhere: what lies outside the volume is folded back or is the border.
template <class Kernel>
double sample_anywhere(ConstView const& in, PositionRow const& at, double x, AffineSampling const& rule) {
    constexpr int before = static_cast<int>(reach_of(Kernel::kind).before),
                  n = before + 1 + static_cast<int>(reach_of(Kernel::kind).after);
    Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
    bool const continued =
        spline_degree(Kernel::kind) > 0 && boundary != Boundary::mirror && boundary != Boundary::wrap;
    std::int64_t const stride[3] = {1, in.row, in.slice};
    std::int64_t place[3][n]; // voxels from the view's first
    bool border[3][n];
    double fraction[3];
    for (int axis = 0; axis < 3; ++axis) {
        double const p = at.line(axis)(x), whole = std::floor(p);
        fraction[axis] = p - whole;
        std::int64_t const first = whole_of(whole) - before, dims = rule.dims[axis], lower = in.box.lower[axis];
        std::int64_t const beyond = beyond_along(dims, rule.beyond, boundary);
        for (int i = 0; i < n; ++i) {
            std::int64_t const index = continued ? std::clamp(first + i, -beyond, dims - 1 + beyond)
                                                 : place_of(first + i, dims, boundary, lower);
            border[axis][i] = !continued && boundary == Boundary::border && index < 0;
            place[axis][i] = (index - lower) * stride[axis];
        }
    }
    double value[n][n][n];
    with_type(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data);
        for (int k = 0; k < n; ++k)
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i)
                    value[k][j][i] = border[0][i] || border[1][j] || border[2][k]
                                         ? rule.border
                                         : static_cast<double>(data[place[0][i] + place[1][j] + place[2][k]]);
    });
    return Kernel::value([&](int i, int j, int k) { return value[k + before][j + before][i + before]; }, fraction[0],
                         fraction[1], fraction[2]);
}

/// Samples of a strip by kernels of N^3 voxels, in the order of weighted(): the columns are the lanes of vectors.
template <class Kernel, int N> struct StripConvolution {
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        double wx[N][strip], wy[N][strip], wz[N][strip];
        weights(places.fx, n, wx);
        bool zeros = weights(places.fy, n, wy);
        zeros = weights(places.fz, n, wz) || zeros;
        with_type(in.type, [&]<class T>(T) {
            constexpr int first = 1 - N / 2;
            T const* const data = reinterpret_cast<T const*>(in.data) + first * (1 + in.row + in.slice);
            for (std::int32_t s = 0; s < n; ++s) {
                T const* const corner = data + places.index[s];
                to[s] = zeros ? sum<true>(corner, in.row, in.slice, s, wx, wy, wz)
                              : sum<false>(corner, in.row, in.slice, s, wx, wy, wz);
            }
        });
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
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        double v[8][strip];
        for (int corner = 0; corner < 8; ++corner)
            gather(in, places.index, (corner & 1) + (corner >> 1 & 1) * in.row + (corner >> 2) * in.slice, n,
                   v[corner]);
        double const *const fx = places.fx, *const fy = places.fy, *const fz = places.fz;
#pragma omp simd
        for (std::int32_t i = 0; i < n; ++i)
            to[i] = between(between(between(v[0][i], v[1][i], fx[i]), between(v[2][i], v[3][i], fx[i]), fy[i]),
                            between(between(v[4][i], v[5][i], fx[i]), between(v[6][i], v[7][i], fx[i]), fy[i]), fz[i]);
    }
};

struct StripNearest {
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

/// Samples of a row for x in `range`; to[0] belongs to its first.
template <class Kernel, class Strip>
void sample_row(ConstView const& in, PositionRow const& at, XRange range, AffineSampling const& rule, double* to) {
    XRange const quick = interior(range, at, rule);
    auto const slowly = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t x = begin; x < end; ++x)
            to[x - range.begin] = sample_anywhere<Kernel>(in, at, static_cast<double>(x), rule);
    };
    slowly(range.begin, quick.begin);
    if (quick.begin < quick.end) sample_run<Strip>(in, Places(in, at), quick, to + (quick.begin - range.begin));
    slowly(quick.end, range.end);
}

/// Calls f(T{}) with the storage type, which float holds.
template <class F> void for_each_single_type(DataType type, F&& f) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) <= 2 || std::is_same_v<T, float>) f(T{});
    });
}

/// The same places, for samples in float32.
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

/// Linear in float32 the same way; neighbours along x are loaded together. Rows counts those that are looked at: 4, or
/// the 2 of a plane, `across` and `along` voxels from one another; `f` has the fractions across.
template <int Rows, class T>
void sample_strip_single(T const* data, std::int64_t across, std::int64_t along, SinglePlaces const& at, float const* f,
                         std::int32_t n, float* to) {
    T pair[Rows][2 * strip];
    for (std::int32_t i = 0; i < n; ++i) {
        T const* const c = data + at.index[i];
        for (int r = 0; r < Rows; ++r)
            std::memcpy(pair[r] + 2 * i, c + (r & 1) * across + (r >> 1) * along, 2 * sizeof(T));
    }
#pragma omp simd
    for (std::int32_t i = 0; i < n; ++i) {
        auto const along_x = [&](int k) {
            return between(static_cast<float>(pair[k][2 * i]), static_cast<float>(pair[k][2 * i + 1]), at.fx[i]);
        };
        float value = between(along_x(0), along_x(1), f[i]);
        if constexpr (Rows == 4) value = between(value, between(along_x(2), along_x(3), f[i]), at.fz[i]);
        to[i] = value;
    }
}

/// Rows that stay rows: weights that all voxels share.
template <class T>
void sample_parallel_single(T const* from, std::int64_t row, std::int64_t slice, std::int64_t n, float fy, float fz,
                            float* to) {
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) {
        auto const v = [&](std::int64_t at) { return static_cast<float>(from[i + at]); };
        to[i] = between(between(v(0), v(row), fy), between(v(slice), v(slice + row), fy), fz);
    }
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
    auto const slowly = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t x = begin; x < end; ++x)
            values[x - first] = static_cast<float>(sample_anywhere<Linear>(in, at, static_cast<double>(x), rule));
    };
    slowly(in_it.begin, quick.begin);
    if (quick.begin < quick.end) run(values + (quick.begin - first));
    slowly(quick.end, in_it.end);
    tally.losses += result.store(n);
}

/// Rows of a box that lie along those of the volume, on its voxels: only y and z have fractions.
bool lies_along_rows(Affine const& map) {
    Vec3 const step = map.column[0];
    return step.x == 1 && step.y == 0 && step.z == 0 && map.offset.x == nearest_whole(map.offset.x) &&
           map.column[1].x == nearest_whole(map.column[1].x) && map.column[2].x == nearest_whole(map.column[2].x);
}

void sample_rows_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
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

void sample_box_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
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
        : in_(in), out_(out), rule_(rule), still_(still), plane_(still.axis == 2 ? 1 : 2),
          across_(still.axis == 2 ? in.row : in.slice), along_(still.axis == 2 ? in.slice : in.row),
          stream_(driver::is_large(out)) {}

    void run(Losses& losses, std::int64_t& outside, Execution const& execution) const {
        for_each_single_type(in_.type, [&]<class T>(T) {
            for_each_tile(execution, out_.box, affine_tile, losses, outside,
                          [&](Box const& tile, Tally& tally) { sample<T>(tile, tally); });
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
    float const* fractions(SinglePlaces const& places) const { return plane_ == 1 ? places.fy : places.fz; }
    PositionRow positions(std::int64_t row, std::int64_t slice) const {
        return plane_ == 1 ? row_of(rule_.map, {}, row, slice) : row_of(rule_.map, {}, slice, row);
    }

    template <class T> void sample(Box const& tile, Tally& tally) const {
        Shared shared;
        std::int64_t const first = tile.lower[still_.axis];
        for (std::int64_t row = 0; row < tile.dims()[plane_]; ++row) {
            PositionRow const at = positions(tile.lower[plane_] + row, first);
            shared.ranges[row] = ranges_of({tile.lower.x, tile.upper.x}, at, rule_, still_.axis);
            shared.places[row].find(Places(in_, at), static_cast<double>(shared.ranges[row].interior.begin),
                                    shared.count(row));
        }
        if (tile.dims()[still_.axis] == slices_at_once) {
            thread_local Interleaved<T, slices_at_once> voxels;
            if (voxels.prepare(outline(tile), in_.box.dims().x, in_.box.dims()[plane_]))
                return sample_interleaved(tile, shared, voxels, tally);
        }
        sample_gathered<T>(tile, shared, tally);
    }
    Outline outline(Box const& tile) const {
        auto const corner = [&](std::int64_t x, std::int64_t row) {
            PositionRow const at = positions(row, tile.lower[still_.axis]);
            return PlanePosition{at.x(static_cast<double>(x)) - static_cast<double>(in_.box.lower.x),
                                 at.line(plane_)(static_cast<double>(x)) - static_cast<double>(in_.box.lower[plane_])};
        };
        std::int64_t const x = tile.upper.x - 1, row = tile.upper[plane_] - 1;
        return Outline({corner(tile.lower.x, tile.lower[plane_]), corner(x, tile.lower[plane_]), corner(x, row),
                        corner(tile.lower.x, row)});
    }
    /// run(to) gives what looks at nothing beyond the volume.
    template <class Run>
    void sample_row(Box const& tile, Shared const& shared, std::int64_t row, std::int64_t slice, Run const& run,
                    Tally& tally) const {
        std::int64_t const y = tile.lower[plane_] + row, z = tile.lower[still_.axis] + slice;
        sample_row_single(in_, out_, rule_, shared.ranges[row], plane_ == 1 ? y : z, plane_ == 1 ? z : y, stream_, run,
                          tally);
    }

    template <class T>
    void sample_interleaved(Box const& tile, Shared const& shared, Interleaved<T, slices_at_once>& voxels,
                            Tally& tally) const {
        std::int64_t const first = tile.lower[still_.axis] + still_.shift - in_.box.lower[still_.axis];
        voxels.fill(reinterpret_cast<T const*>(in_.data) + first * along_, in_.box.dims().x, across_, along_);
        alignas(64) float samples[strip * slices_at_once] = {}, by_slice[slices_at_once * strip];
        for (std::int64_t row = 0; row < tile.dims()[plane_]; ++row) {
            SinglePlaces const& at = shared.places[row];
            std::int32_t const n = shared.count(row);
            float const* const f = fractions(at);
            for (std::int32_t i = 0; i < n; ++i) {
                std::int64_t const in_plane = at.index[i] - first * along_, y = in_plane / across_;
                voxels.sample(voxels.place(in_plane - y * across_, y), at.fx[i], f[i], samples + i * slices_at_once);
            }
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
            for (std::int64_t row = 0; row < tile.dims()[plane_]; ++row) {
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
    int plane_; ///< the axis of the plane beside x
    std::int64_t across_, along_;
    bool stream_;
};

/// Linear in float32, each part of the box in the way that suits it; which one that is depends on no cut.
void sample_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const& execution) {
    StillAxis const still = still_axis(rule.map);
    Box part = out.box;
    if (still.axis >= 0) {
        part.lower[still.axis] = std::clamp(-still.shift, out.box.lower[still.axis], out.box.upper[still.axis]);
        part.upper[still.axis] =
            std::clamp(rule.dims[still.axis] - still.shift, part.lower[still.axis], out.box.upper[still.axis]);
    }
    if (still.axis < 0 || part.empty()) return sample_box_single(in, out, rule, losses, outside, execution);
    SlicesTogether(in, out.part(part), rule, still).run(losses, outside, execution);
    for (bool const above : {false, true}) { // slices beside the volume
        Box beside = out.box;
        (above ? beside.lower : beside.upper)[still.axis] = (above ? part.upper : part.lower)[still.axis];
        if (!beside.empty()) sample_box_single(in, out.part(beside), rule, losses, outside, execution);
    }
}

/// to becomes the mean of `count` samples, of which `sample` is the last: by steps that neither overflow nor leave the
/// range of the samples.
void join_mean(double const* sample, double* to, std::int64_t n, std::int64_t count) {
    double const share = 1 / static_cast<double>(count);
#pragma omp simd
    for (std::int64_t i = 0; i < n; ++i) to[i] = between(to[i], sample[i], share);
}

template <class Kernel, class Strip>
void sample_box(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                Execution const& execution) {
    Index3 const k = rule.samples;
    auto const aside = [](std::int64_t i, std::int64_t n) {
        return (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 0.5;
    };
    for_each_tile(execution, out.box, affine_tile, losses, outside, [&](Box const& tile, Tally& tally) {
        alignas(64) double values[affine_tile.x], sample[affine_tile.x];
        for_each_row(tile, [&](std::int64_t y, std::int64_t z) {
            XRange const all{tile.lower.x, tile.upper.x};
            XRange const in_it = inside(all, row_of(rule.map, {}, y, z), rule);
            std::int64_t const n = all.end - all.begin, m = in_it.end - in_it.begin;
            double* const there = values + (m > 0 ? in_it.begin - all.begin : 0);
            if (m < n) std::fill_n(values, n, rule.background);
            tally.outside += n - m;
            std::int64_t count = 0;
            for (std::int64_t sub = 0; m > 0 && sub < k.x * k.y * k.z; ++sub) {
                Vec3 const shift = rule.map.column[0] * aside(sub % k.x, k.x) +
                                   rule.map.column[1] * aside(sub / k.x % k.y, k.y) +
                                   rule.map.column[2] * aside(sub / k.x / k.y, k.z);
                PositionRow const at = row_of(rule.map, shift, y, z);
                sample_row<Kernel, Strip>(in, at, in_it, rule, ++count == 1 ? there : sample);
                if (count > 1) join_mean(sample, there, m, count);
            }
            if (rule.scale != 1 || rule.offset != 0)
                for (std::int64_t i = 0; i < m; ++i) there[i] = there[i] * rule.scale + rule.offset;
            tally.losses += store_row(out.type, static_cast<double const*>(values), out.at(all.begin, y, z), n);
        });
    });
}

template <class U>
void nearest_bytes(View<U const> const& in, View<U> const& out, Box const& box, U background,
                   AffineSampling const& rule, std::int64_t& outside, Execution const& execution) {
    Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
    auto const index = [&](double p, std::int64_t n, std::int64_t first) {
        return place_of(whole_of(std::floor(p + (0.5 + face_slack))), n, boundary, first);
    };
    for_each_segment(execution, box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t n) {
        PositionRow const at = row_of(rule.map, {}, y, z);
        XRange const in_it = inside({x0, x0 + n}, at, rule);
        std::int64_t const m = in_it.end - in_it.begin;
        U* const to = &out(x0, y, z);
        if (m < n) std::fill_n(to, n, background);
        for (std::int64_t x = in_it.begin; x < in_it.end; ++x) {
            auto const fx = static_cast<double>(x);
            std::int64_t const vx = index(at.x(fx), rule.dims.x, in.lower.x),
                               vy = index(at.y(fx), rule.dims.y, in.lower.y),
                               vz = index(at.z(fx), rule.dims.z, in.lower.z);
            bool const border = boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0);
            to[x - x0] = border ? background : in(vx, vy, vz);
        }
        if (m == n) return;
#pragma omp atomic
        outside += n - m;
    });
}

} // namespace

void affine_sample(ConstView in, AnyView out, AffineSampling const& rule, Losses& losses, std::int64_t& outside,
                   Execution const& execution) {
    auto const sample = [&]<class Kernel, class Strip>() {
        sample_box<Kernel, Strip>(in, out, rule, losses, outside, execution);
    };
    if (rule.single) return sample_single(in, out, rule, losses, outside, execution);
    switch (rule.interpolant) {
    case Interpolant::nearest:
        return sample.template operator()<Nearest, StripNearest>();
    case Interpolant::linear:
        return sample.template operator()<Linear, StripLinear>();
    case Interpolant::cubic:
        return sample.template operator()<Cubic, StripConvolution<Cubic, 4>>();
    case Interpolant::lanczos3:
        return sample.template operator()<Lanczos3, StripConvolution<Lanczos3, 6>>();
    case Interpolant::bspline3:
        return sample.template operator()<BSpline3, StripConvolution<BSpline3, 4>>();
    case Interpolant::bspline5:
        return sample.template operator()<BSpline5, StripConvolution<BSpline5, 6>>();
    }
}

void affine_nearest(ConstView in, AnyView out, AffineSampling const& rule, std::int64_t& outside,
                    Execution const& execution) {
    VoxelBytes const voxel = voxel_bytes(out.type, rule.boundary ? rule.border : rule.background);
    for_each_size(size_of(in.type), [&]<class U>(U) {
        U background;
        std::memcpy(&background, voxel.data(), sizeof background);
        nearest_bytes<U>(in.as<U>(), out.as<U>(), out.box, background, rule, outside, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
