// Affine sampling: rows of output, in vectors where all that is looked at lies inside, voxel by voxel at the faces.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/affine.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/rows.h"
#include "libvkt/operations/kernels/interpolants.h"

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
    if (line.step >= 0) {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) >= low; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) >= high; });
    } else {
        range.begin = first_x(range, [&](std::int64_t x) { return at(x) < high; });
        range.end = first_x(range, [&](std::int64_t x) { return at(x) < low; });
    }
    return range;
}

XRange inside(XRange range, PositionRow const& row, Index3 dims) {
    for (int axis = 0; axis < 3; ++axis)
        range = narrowed(range, row.line(axis), first_position(), end_position(dims[axis]));
    return range;
}

/// Where the interpolant looks at nothing beyond the volume.
XRange interior(XRange range, PositionRow const& row, Index3 dims, Interpolant interpolant) {
    Reach const reach = reach_of(interpolant);
    for (int axis = 0; axis < 3; ++axis)
        range = narrowed(range, row.line(axis), static_cast<double>(reach.before),
                         static_cast<double>(dims[axis] - reach.after));
    return range;
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
        double const px = at.x(x), py = at.y(x), pz = at.z(x);
        double const wx = floor_of(px), wy = floor_of(py), wz = floor_of(pz);
        fx = px - wx, fy = py - wy, fz = pz - wz;
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
    for_each_type(in.type, [&]<class T>(T) {
        T const* const data = reinterpret_cast<T const*>(in.data) + offset;
        for (std::int32_t i = 0; i < n; ++i) to[i] = static_cast<double>(data[index[i]]);
    });
}

double voxel_at(ConstView const& in, std::int64_t x, std::int64_t y, std::int64_t z) {
    double value = 0;
    for_each_type(in.type,
                  [&]<class T>(T) { value = static_cast<double>(*reinterpret_cast<T const*>(in.at(x, y, z))); });
    return value;
}

/// What a view that begins at `first` has for the voxel i beyond a whole position, -1 if that is the border. A wrapped
/// volume's may begin and end outside.
std::int64_t place_of(double whole, int i, std::int64_t n, Boundary boundary, std::int64_t first) {
    double const limit = 0x1p60; // positions may be anything that a header can say
    std::int64_t const at = static_cast<std::int64_t>(std::clamp(whole, -limit, limit)) + i;
    return boundary == Boundary::wrap ? first + fold(at - first, n, boundary) : fold(at, n, boundary);
}

/// A sample anywhere: what lies outside the volume is folded back or is the border.
template <class Kernel>
double sample_anywhere(ConstView const& in, PositionRow const& at, double x, AffineSampling const& rule) {
    double const px = at.x(x), py = at.y(x), pz = at.z(x);
    double const wx = std::floor(px), wy = std::floor(py), wz = std::floor(pz);
    Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
    bool const continued =
        spline_degree(Kernel::kind) > 0 && boundary != Boundary::mirror && boundary != Boundary::wrap;
    auto const index = [&](double whole, int i, std::int64_t n, std::int64_t lower) {
        if (!continued) return place_of(whole, i, n, boundary, lower);
        double const limit = 0x1p60; // positions may be anything that a header can say
        std::int64_t const v = static_cast<std::int64_t>(std::clamp(whole, -limit, limit)) + i;
        return std::clamp(v, -rule.beyond, n - 1 + rule.beyond);
    };
    auto const voxel = [&](int i, int j, int k) {
        std::int64_t const vx = index(wx, i, rule.dims.x, in.box.lower.x),
                           vy = index(wy, j, rule.dims.y, in.box.lower.y),
                           vz = index(wz, k, rule.dims.z, in.box.lower.z);
        bool const border = !continued && boundary == Boundary::border && (vx < 0 || vy < 0 || vz < 0);
        return border ? rule.border : voxel_at(in, vx, vy, vz);
    };
    return Kernel::value(voxel, px - wx, py - wy, pz - wz);
}

/// Samples of a strip by kernels of N^3 voxels, in the order of weighted().
template <class Kernel, int N> struct StripConvolution {
    static void sample(ConstView const& in, StripPlaces const& places, std::int32_t n, double* to) {
        double wx[N][strip], wy[N][strip], wz[N][strip], v[N][strip], slice[strip];
        weights(places.fx, n, wx);
        weights(places.fy, n, wy);
        weights(places.fz, n, wz);
        auto const term = [](double w, double value) { return w == 0 ? 0 : w * value; };
        std::fill_n(to, n, 0.0);
        for (int k = 0; k < N; ++k) {
            std::fill_n(slice, n, 0.0);
            for (int j = 0; j < N; ++j) {
                constexpr int first = 1 - N / 2;
                for (int i = 0; i < N; ++i)
                    gather(in, places.index, (first + i) + (first + j) * in.row + (first + k) * in.slice, n, v[i]);
#pragma omp simd
                for (std::int32_t s = 0; s < n; ++s) {
                    double row = 0;
                    for (int i = 0; i < N; i += 2) row += term(wx[i][s], v[i][s]) + term(wx[i + 1][s], v[i + 1][s]);
                    slice[s] += term(wy[j][s], row);
                }
            }
#pragma omp simd
            for (std::int32_t s = 0; s < n; ++s) to[s] += term(wz[k][s], slice[s]);
        }
    }

private:
    static void weights(double const* fraction, std::int32_t n, double (*w)[strip]) {
#pragma omp simd
        for (std::int32_t s = 0; s < n; ++s) {
            double each[N];
            Kernel::weights(fraction[s], each);
            for (int i = 0; i < N; ++i) w[i][s] = each[i];
        }
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
    XRange const quick = interior(range, at, rule.dims, Kernel::kind);
    auto const slowly = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t x = begin; x < end; ++x)
            to[x - range.begin] = sample_anywhere<Kernel>(in, at, static_cast<double>(x), rule);
    };
    if (quick.begin >= quick.end) return slowly(range.begin, range.end);
    slowly(range.begin, quick.begin);
    sample_run<Strip>(in, Places(in, at), quick, to + (quick.begin - range.begin));
    slowly(quick.end, range.end);
}

/// Calls f(T{}) with the storage type, which float holds.
template <class F> void for_each_single_type(DataType type, F&& f) {
    for_each_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) <= 2 || std::is_same_v<T, float>) f(T{});
    });
}

/// Linear in float32 the same way; neighbours along x are loaded together.
template <class T>
void sample_run_single(T const* data, std::int64_t row, std::int64_t slice, Places const f, std::int64_t x,
                       std::int64_t n, float* to) {
    float fx[strip], fy[strip], fz[strip];
    T pair[4][2 * strip];
    std::int64_t index[strip];
    for (std::int64_t begin = 0; begin < n; begin += strip) {
        auto const m = static_cast<std::int32_t>(std::min<std::int64_t>(strip, n - begin));
        auto const first = static_cast<double>(x + begin);
#pragma omp simd
        for (std::int32_t i = 0; i < m; ++i) {
            double dx, dy, dz;
            index[i] = f.of(first + i, dx, dy, dz);
            fx[i] = static_cast<float>(dx), fy[i] = static_cast<float>(dy), fz[i] = static_cast<float>(dz);
        }
        for (std::int32_t i = 0; i < m; ++i) {
            T const* const c = data + index[i];
            std::memcpy(pair[0] + 2 * i, c, 2 * sizeof(T));
            std::memcpy(pair[1] + 2 * i, c + row, 2 * sizeof(T));
            std::memcpy(pair[2] + 2 * i, c + slice, 2 * sizeof(T));
            std::memcpy(pair[3] + 2 * i, c + slice + row, 2 * sizeof(T));
        }
        float* const result = to + begin;
#pragma omp simd
        for (std::int32_t i = 0; i < m; ++i) {
            auto const along_x = [&](int k) {
                return between(static_cast<float>(pair[k][2 * i]), static_cast<float>(pair[k][2 * i + 1]), fx[i]);
            };
            result[i] = between(between(along_x(0), along_x(1), fy[i]), between(along_x(2), along_x(3), fy[i]), fz[i]);
        }
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

void sample_box_single(ConstView const& in, AnyView out, AffineSampling const& rule, Losses& losses,
                       std::int64_t& outside, Execution const& execution) {
    for_each_segment(execution, out.box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t length) {
        alignas(64) float values[row_piece];
        Losses mine;
        std::int64_t beyond = 0;
        PositionRow const at = row_of(rule.map, {}, y, z);
        bool const parallel =
            at.y.step == 0 && at.z.step == 0 && at.x.step == 1 && at.x.base == nearest_whole(at.x.base);
        for (std::int64_t x = x0; x < x0 + length; x += row_piece) {
            XRange const piece{x, std::min(x + row_piece, x0 + length)};
            std::int64_t const n = piece.end - piece.begin;
            XRange const in_it = rule.boundary ? piece : inside(piece, at, rule.dims);
            if (in_it.end - in_it.begin < n) std::fill_n(values, n, static_cast<float>(rule.background));
            beyond += n - std::max<std::int64_t>(in_it.end - in_it.begin, 0);
            auto const slowly = [&](std::int64_t begin, std::int64_t end) {
                for (std::int64_t i = begin; i < end; ++i)
                    values[i - piece.begin] =
                        static_cast<float>(sample_anywhere<Linear>(in, at, static_cast<double>(i), rule));
            };
            XRange const quick = interior(in_it, at, rule.dims, Interpolant::linear);
            if (quick.begin >= quick.end) {
                slowly(in_it.begin, in_it.end);
            } else {
                slowly(in_it.begin, quick.begin);
                Places const places(in, at);
                std::int64_t const m = quick.end - quick.begin;
                float* const to = values + (quick.begin - piece.begin);
                for_each_single_type(in.type, [&]<class T>(T) {
                    T const* const data = reinterpret_cast<T const*>(in.data);
                    if (!parallel) return sample_run_single(data, in.row, in.slice, places, quick.begin, m, to);
                    double fx, fy, fz;
                    std::int64_t const index = places.of(static_cast<double>(quick.begin), fx, fy, fz);
                    sample_parallel_single(data + index, in.row, in.slice, m, static_cast<float>(fy),
                                           static_cast<float>(fz), to);
                });
                slowly(quick.end, in_it.end);
            }
            mine += store_row(out.type, static_cast<float const*>(values), out.at(x, y, z), n);
        }
        driver::add(losses, mine);
        if (beyond == 0) return;
#pragma omp atomic
        outside += beyond;
    });
}

/// An axis of the output, y or z, along which nothing happens: its voxels are so many voxels of the input further.
struct StillAxis {
    int axis = -1; ///< -1: there is none
    std::int64_t shift = 0;
};
StillAxis still_axis(Affine const& map) {
    for (int axis = 2; axis >= 1; --axis) {
        bool still = map.offset[axis] == nearest_whole(map.offset[axis]) && std::abs(map.offset[axis]) < 0x1p50;
        double reach = 0; // of a voxel in the plane
        for (int a = 0; a < 3; ++a) {
            double const along = map.column[static_cast<std::size_t>(a)][axis];
            still = still && along == (a == axis ? 1 : 0);
            still = still && (a == axis || map.column[static_cast<std::size_t>(axis)][a] == 0);
        }
        for (int b = 0; b < 3; ++b) {
            double sum = 0;
            for (int a = 0; a < 3; ++a) sum += a == axis ? 0 : std::abs(map.column[static_cast<std::size_t>(a)][b]);
            if (b != axis) reach = std::max(reach, sum);
        }
        if (still && reach <= 2) return {axis, static_cast<std::int64_t>(map.offset[axis])};
    }
    return {};
}

/// Linear where an axis stays: tiles of the plane, of several slices at once. The slices are the lanes of the vectors:
/// the tile's source is turned so that they lie side by side, and weights are the same for all of them.
class SlicesTogether {
public:
    SlicesTogether(ConstView const& in, AnyView out, AffineSampling const& rule, StillAxis still)
        : in_(in), out_(out), rule_(rule), still_(still), across_(still.axis == 2 ? 1 : 2),
          source_(static_cast<std::size_t>(most_ * most_ * lanes_)),
          result_(static_cast<std::size_t>(tile_ * tile_ * lanes_)) {}

    /// The tile at voxel (x, v) of the plane, of `n` slices from `slice` on.
    void run(std::int64_t x, std::int64_t v, std::int64_t slice, std::int64_t n) {
        std::int64_t const x_end = std::min(x + tile_, out_.box.upper.x),
                           v_end = std::min(v + tile_, out_.box.upper[across_]);
        place(x, x_end, v, v_end);
        if (high_x_ >= low_x_) {
            load(slice, n);
            for (std::int64_t row = v; row < v_end; ++row)
                for (std::int64_t i = quick_[row - v].begin; i < quick_[row - v].end; ++i) compute(i - x, row - v);
        }
        for (std::int64_t row = v; row < v_end; ++row) at_the_faces(x, x_end, row, row - v, slice, n);
        store(x, x_end, v, v_end, slice, n);
    }

    static constexpr std::int64_t tile_ = 32, lanes_ = 16, most_ = 2 * tile_ + 2;
    Losses losses;
    std::int64_t beyond = 0;

private:
    PositionRow row_at(std::int64_t v) const {
        return still_.axis == 2 ? row_of(rule_.map, {}, v, 0) : row_of(rule_.map, {}, 0, v);
    }
    std::int64_t stride_across() const { return across_ == 1 ? in_.row : in_.slice; }
    std::int64_t stride_along() const { return still_.axis == 2 ? in_.slice : in_.row; }

    XRange in_plane(XRange range, PositionRow const& row, double before, double after, double slack) const {
        for (int axis : {0, across_}) {
            auto const n = static_cast<double>(rule_.dims[axis]);
            range = narrowed(range, row.line(axis), before - slack, n - after - slack);
        }
        return range;
    }

    /// Where the voxels of the tile come from, and which of them look at voxels of the volume only.
    void place(std::int64_t x, std::int64_t x_end, std::int64_t v, std::int64_t v_end) {
        low_x_ = low_v_ = std::int64_t{1} << 60;
        high_x_ = high_v_ = -low_x_;
        for (std::int64_t row = v; row < v_end; ++row) {
            PositionRow const at = row_at(row);
            std::int64_t const r = row - v;
            XRange const piece{x, x_end};
            inside_[r] = rule_.boundary ? piece : in_plane(piece, at, -0.5, 0.5, face_slack);
            if (inside_[r].begin > inside_[r].end) inside_[r].end = inside_[r].begin;
            quick_[r] = in_plane(inside_[r], at, 0, 1, 0);
            PositionLine const along = at.line(0), across = at.line(across_);
            for (std::int64_t i = quick_[r].begin; i < quick_[r].end; ++i) {
                double const px = along(static_cast<double>(i)), pv = across(static_cast<double>(i));
                double const wx = floor_of(px), wv = floor_of(pv);
                Source& s = sources_[r][i - x];
                s = {static_cast<std::int32_t>(wx), static_cast<std::int32_t>(wv), static_cast<float>(px - wx),
                     static_cast<float>(pv - wv)};
                low_x_ = std::min<std::int64_t>(low_x_, s.x), high_x_ = std::max<std::int64_t>(high_x_, s.x + 1);
                low_v_ = std::min<std::int64_t>(low_v_, s.v), high_v_ = std::max<std::int64_t>(high_v_, s.v + 1);
            }
        }
        width_ = high_x_ - low_x_ + 1;
    }

    void load(std::int64_t slice, std::int64_t n) {
        std::int64_t const along = stride_along(), across = stride_across();
        Index3 const lower = in_.box.lower;
        for_each_single_type(in_.type, [&]<class T>(T) {
            for (std::int64_t v = low_v_; v <= high_v_; ++v) {
                T const* const from = reinterpret_cast<T const*>(in_.data) + (low_x_ - lower.x) +
                                      (v - lower[across_]) * across +
                                      (slice + still_.shift - lower[still_.axis]) * along;
                float* const to = source_.data() + (v - low_v_) * width_ * lanes_;
                for (std::int64_t k = 0; k < n; ++k) {
                    T const* const row = from + k * along;
                    for (std::int64_t i = 0; i < width_; ++i) to[i * lanes_ + k] = static_cast<float>(row[i]);
                }
            }
        });
    }

    void compute(std::int64_t x, std::int64_t row) {
        Source const s = sources_[row][x];
        float const* const a = source_.data() + ((s.v - low_v_) * width_ + (s.x - low_x_)) * lanes_;
        float const* const b = a + width_ * lanes_;
        float* const to = result_.data() + (row * tile_ + x) * lanes_;
        float const fx = s.fraction_x, fv = s.fraction_v;
#pragma omp simd
        for (std::int64_t k = 0; k < lanes_; ++k)
            to[k] = between(between(a[k], a[k + lanes_], fx), between(b[k], b[k + lanes_], fx), fv);
    }

    void at_the_faces(std::int64_t x, std::int64_t x_end, std::int64_t v, std::int64_t row, std::int64_t slice,
                      std::int64_t n) {
        XRange const in_it = inside_[row], quick = quick_[row];
        bool const none = quick.begin >= quick.end;
        for (std::int64_t i = x; i < x_end; ++i) {
            if (!none && i >= quick.begin && i < quick.end) {
                i = quick.end - 1;
                continue;
            }
            float* const to = result_.data() + (row * tile_ + i - x) * lanes_;
            if (i < in_it.begin || i >= in_it.end) {
                std::fill_n(to, n, static_cast<float>(rule_.background));
                beyond += n;
                continue;
            }
            for (std::int64_t k = 0; k < n; ++k) {
                PositionRow const at =
                    still_.axis == 2 ? row_of(rule_.map, {}, v, slice + k) : row_of(rule_.map, {}, slice + k, v);
                to[k] = static_cast<float>(sample_anywhere<Linear>(in_, at, static_cast<double>(i), rule_));
            }
        }
    }

    void store(std::int64_t x, std::int64_t x_end, std::int64_t v, std::int64_t v_end, std::int64_t slice,
               std::int64_t n) {
        alignas(64) float values[tile_];
        for (std::int64_t k = 0; k < n; ++k)
            for (std::int64_t row = v; row < v_end; ++row) {
                float const* const from = result_.data() + (row - v) * tile_ * lanes_ + k;
                for (std::int64_t i = 0; i < x_end - x; ++i) values[i] = from[i * lanes_];
                std::byte* const to = still_.axis == 2 ? out_.at(x, row, slice + k) : out_.at(x, slice + k, row);
                losses += store_row(out_.type, static_cast<float const*>(values), to, x_end - x);
            }
    }

    struct Source {
        std::int32_t x, v;
        float fraction_x, fraction_v;
    };

    ConstView in_;
    AnyView out_;
    AffineSampling const& rule_;
    StillAxis still_;
    int across_; ///< the other axis of the plane, beside x
    std::vector<float> source_, result_;
    XRange inside_[tile_], quick_[tile_];
    Source sources_[tile_][tile_];
    std::int64_t low_x_ = 0, high_x_ = 0, low_v_ = 0, high_v_ = 0, width_ = 0;
};

void sample_slices_together(ConstView const& in, AnyView out, AffineSampling const& rule, StillAxis still,
                            Losses& losses, std::int64_t& outside, Execution const& execution) {
    using Tiles = SlicesTogether;
    int const across = still.axis == 2 ? 1 : 2;
    Index3 const n = out.dims();
    auto const pieces = [](std::int64_t extent, std::int64_t size) { return (extent + size - 1) / size; };
    std::int64_t const nx = pieces(n.x, Tiles::tile_), nv = pieces(n[across], Tiles::tile_),
                       nk = pieces(n[still.axis], Tiles::lanes_);
    for_each_item(threads_for(execution, out.box.voxels()), nx * nv * nk, [&](std::int64_t begin, std::int64_t end) {
        if (begin >= end) return;
        Tiles tiles(in, out, rule, still);
        for (std::int64_t item = begin; item < end; ++item) {
            std::int64_t const slice = out.box.lower[still.axis] + item / nx / nv * Tiles::lanes_;
            tiles.run(out.box.lower.x + item % nx * Tiles::tile_, out.box.lower[across] + item / nx % nv * Tiles::tile_,
                      slice, std::min(Tiles::lanes_, out.box.upper[still.axis] - slice));
        }
        driver::add(losses, tiles.losses);
#pragma omp atomic
        outside += tiles.beyond;
    });
}

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
    sample_slices_together(in, out.part(part), rule, still, losses, outside, execution);
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
    for_each_segment(execution, out.box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t length) {
        alignas(64) double values[row_piece], sample[row_piece];
        Losses mine;
        std::int64_t beyond = 0;
        for (std::int64_t x = x0; x < x0 + length; x += row_piece) {
            XRange const piece{x, std::min(x + row_piece, x0 + length)};
            std::int64_t const n = piece.end - piece.begin;
            PositionRow const centres = row_of(rule.map, {}, y, z);
            XRange const in_it = rule.boundary ? piece : inside(piece, centres, rule.dims);
            std::int64_t const m = std::max<std::int64_t>(in_it.end - in_it.begin, 0);
            double* const there = values + (m > 0 ? in_it.begin - piece.begin : 0);
            if (m < n) std::fill_n(values, n, rule.background);
            beyond += n - m;
            if (m > 0) {
                std::int64_t count = 0;
                for (std::int64_t kz = 0; kz < k.z; ++kz)
                    for (std::int64_t ky = 0; ky < k.y; ++ky)
                        for (std::int64_t kx = 0; kx < k.x; ++kx) {
                            Vec3 const shift = rule.map.column[0] * aside(kx, k.x) +
                                               rule.map.column[1] * aside(ky, k.y) +
                                               rule.map.column[2] * aside(kz, k.z);
                            PositionRow const at = row_of(rule.map, shift, y, z);
                            sample_row<Kernel, Strip>(in, at, in_it, rule, ++count == 1 ? there : sample);
                            if (count > 1) join_mean(sample, there, m, count);
                        }
                if (rule.scale != 1 || rule.offset != 0)
                    for (std::int64_t i = 0; i < m; ++i) there[i] = there[i] * rule.scale + rule.offset;
            }
            mine += store_row(out.type, static_cast<double const*>(values), out.at(x, y, z), n);
        }
        driver::add(losses, mine);
        if (beyond == 0) return;
#pragma omp atomic
        outside += beyond;
    });
}

template <class U>
void nearest_bytes(View<U const> const& in, View<U> const& out, Box const& box, U background,
                   AffineSampling const& rule, std::int64_t& outside, Execution const& execution) {
    Boundary const boundary = rule.boundary.value_or(Boundary::clamp);
    auto const index = [&](double p, std::int64_t n, std::int64_t first) {
        return place_of(std::floor(p + (0.5 + face_slack)), 0, n, boundary, first);
    };
    for_each_segment(execution, box, [&](std::int64_t x0, std::int64_t y, std::int64_t z, std::int64_t n) {
        PositionRow const at = row_of(rule.map, {}, y, z);
        XRange const all{x0, x0 + n}, in_it = rule.boundary ? all : inside(all, at, rule.dims);
        std::int64_t const m = std::max<std::int64_t>(in_it.end - in_it.begin, 0);
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
