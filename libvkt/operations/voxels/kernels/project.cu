// Projections on GPUs: a thread a line where neighbouring threads read neighbouring voxels, sixteen of them a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/project.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <limits>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int block = 128;
constexpr int lanes = 16;    ///< that take turns along a row, as on CPUs
constexpr int together = 16; ///< loads of a thread that do not wait for each other

/// The accumulators of an image, see ProjectionState.
struct Image {
    std::byte* extremes;
    std::int64_t* whole;
    Int128* wide;
    double *value, *extra, *count, *scale;
};

/// What adding a voxel needs besides.
struct Added {
    double const* share; ///< 1 / (i + 1)
    driver::LossCounts counts;
};

template <class T, bool greatest> struct Extreme {
    using A = std::conditional_t<std::is_same_v<T, Half>, float, T>;
    static constexpr bool numbers = std::is_integral_v<T>;
    A best = !numbers   ? std::numeric_limits<A>::quiet_NaN()
             : greatest ? std::numeric_limits<A>::lowest()
                        : std::numeric_limits<A>::max();

    __device__ void take(A v) {
        bool const first = best != best; // NaN is no value, but what there is at first
        if ((greatest ? v > best : v < best) || first) best = v;
    }
    __device__ void add(T voxel, Added& added) {
        A const v = static_cast<A>(voxel);
        if constexpr (!numbers) added.counts.nan += v != v ? 1 : 0;
        take(v);
    }
    __device__ void merge(Extreme const& other) { take(other.best); }
    __device__ void load(Image const& image, std::int64_t at) { best = reinterpret_cast<A const*>(image.extremes)[at]; }
    __device__ void store(Image const& image, std::int64_t at) const {
        reinterpret_cast<A*>(image.extremes)[at] = best;
    }
};

/// Int64 or Int128.
template <class T, class A> struct Whole {
    A sum = 0;

    __device__ void add(T voxel, Added&) { sum += static_cast<A>(voxel); }
    __device__ void merge(Whole const& other) { sum += other.sum; }
    __device__ static A& place(Image const& image, std::int64_t at) {
        if constexpr (sizeof(A) == 16)
            return image.wide[at];
        else
            return image.whole[at];
    }
    __device__ void load(Image const& image, std::int64_t at) { sum = place(image, at); }
    __device__ void store(Image const& image, std::int64_t at) const { place(image, at) = sum; }
};

/// Sums of floats; those of float64 with what each addition lost (Neumaier), and of voxels times a power of two from
/// where they would overflow on.
template <class T> struct Real {
    static constexpr bool compensated = std::is_same_v<T, double>;
    double sum = 0, lost = 0;
    double scale = 1;
    std::int64_t count = 0;

    __device__ void rescale() {
        sum *= scale_of_sums;
        lost *= scale_of_sums;
        scale = scale_of_sums;
    }
    /// A voxel times the scale.
    __device__ void take(double w) {
        double s = sum + w;
        if constexpr (compensated) {
            if (isinf(s) && isfinite(sum) && isfinite(w)) {
                rescale();
                w *= scale_of_sums;
                s = sum + w;
            }
            bool const first = fabs(sum) >= fabs(w);
            double const rest = ((first ? sum : w) - s) + (first ? w : sum);
            lost += rest - rest == 0 ? rest : 0; // infinities have none
        }
        sum = s;
    }
    __device__ void add(T voxel, Added& added) {
        using C = std::conditional_t<std::is_same_v<T, Half>, float, T>;
        C const v = static_cast<C>(voxel);
        bool const number = v == v;
        double const w = static_cast<double>(number ? v : C(0));
        take(compensated ? w * scale : w);
        added.counts.nan += number ? 0 : 1;
    }
    /// Of so many voxels, of which so many were no numbers.
    __device__ void added(std::int64_t n, unsigned nan) { count += n - nan; }
    __device__ void merge(Real other) {
        if constexpr (compensated) {
            if (other.scale < scale) rescale();
            if (scale < other.scale) other.rescale();
            double const before = scale;
            take(other.sum);
            if (scale < before) other.lost *= scale_of_sums;
        } else {
            take(other.sum);
        }
        lost += other.lost;
        count += other.count;
    }
    __device__ void load(Image const& image, std::int64_t at) {
        sum = image.value[at];
        if constexpr (compensated) {
            lost = image.extra[at];
            scale = image.scale[at] == 0 ? 1 : image.scale[at];
        }
        count = static_cast<std::int64_t>(image.count[at]);
    }
    __device__ void store(Image const& image, std::int64_t at) const {
        image.value[at] = sum;
        if constexpr (compensated) {
            image.extra[at] = lost;
            image.scale[at] = scale == 1 ? 0 : scale;
        }
        image.count[at] = static_cast<double>(count);
    }
};

/// Means and sums of squared deviations from them (Welford). Float64 whose squares would overflow or lose bits are
/// multiplied by a power of two, which the largest magnitude so far says.
template <class T> struct Spread {
    static constexpr bool scales = std::is_same_v<T, double>;
    static constexpr double far_scale = 0x1p700;
    double mean = 0, squares = 0;
    double scale = scales ? far_scale : 1;
    int count = 0; ///< lines of 2^31 voxels have no image

    __device__ void add(T voxel, Added& added) {
        using C = std::conditional_t<std::is_same_v<T, Half>, float, T>;
        C const own = static_cast<C>(voxel);
        if constexpr (!std::is_integral_v<T>) {
            if (own != own) {
                ++added.counts.nan;
                return;
            }
        }
        auto v = static_cast<double>(own);
        if constexpr (scales) {
            double const size = fabs(v);
            if (size >= 0x1p-300 && scale > 1) rescale(1);
            if (size > 0x1p300 && scale > 1 / far_scale) rescale(1 / far_scale);
            v *= scale;
        }
        double const d = v - mean;
        mean += d * __ldg(added.share + count);
        squares += d * (v - mean);
        ++count;
    }
    /// Many at once, none of which is NaN: there is nothing to ask of each.
    template <class C> __device__ void add_numbers(C const (&v)[together], Added const& added) {
        double const* const share = added.share + count;
#pragma unroll
        for (int i = 0; i < together; ++i) {
            double const wide = static_cast<double>(v[i]), d = wide - mean;
            mean += d * __ldg(share + i);
            squares += d * (wide - mean);
        }
        count += together;
    }
    __device__ void rescale(double to) {
        double const factor = to / scale;
        mean *= factor;
        squares *= factor;
        squares *= factor;
        scale = to;
    }
    /// Of both together (Chan, Golub and LeVeque).
    __device__ void merge(Spread other) {
        if (other.count == 0) return;
        if constexpr (scales) {
            if (other.scale < scale) rescale(other.scale);
            if (scale < other.scale) other.rescale(scale);
        }
        auto const mine = static_cast<double>(count), others = static_cast<double>(other.count), n = mine + others;
        double const d = other.mean - mean;
        squares = (squares + other.squares) + d * d * (mine * others / n);
        mean += d * (others / n);
        count += other.count;
    }
    __device__ void load(Image const& image, std::int64_t at) {
        mean = image.value[at];
        squares = image.extra[at];
        count = static_cast<int>(image.count[at]);
        if constexpr (scales) scale = image.scale[at] == 0 ? 1 : image.scale[at];
    }
    __device__ void store(Image const& image, std::int64_t at) const {
        image.value[at] = mean;
        image.extra[at] = squares;
        image.count[at] = static_cast<double>(count);
        if constexpr (scales) image.scale[at] = scale == 1 ? 0 : scale;
    }
};

/// The lines of a slab that become pixels. Strides in voxels.
struct Lines {
    std::int64_t across, down; ///< pixels
    std::int64_t pixel_x, pixel_y, step, n;
    std::int64_t at, row; ///< the first pixel's place in the image, pixels in a row of it
    bool fresh;           ///< nothing was added before
};

template <class S, class T>
__device__ void add_line(S& sum, T const* first, std::int64_t step, std::int64_t n, Added& added) {
    std::int64_t k = 0;
    unsigned const nan = added.counts.nan;
    for (; k + together <= n; k += together) {
        T v[together];
#pragma unroll
        for (int i = 0; i < together; ++i) v[i] = first[(k + i) * step];
        if constexpr (requires { sum.add_numbers(v, added); } && sizeof(T) <= 4) {
            float odd = 0; // NaN if one of them is not finite
            if constexpr (!std::is_integral_v<T>)
#pragma unroll
                for (int i = 0; i < together; ++i) odd = fmaf(static_cast<float>(v[i]), 0.0F, odd);
            if (odd == 0) {
                sum.add_numbers(v, added);
                continue;
            }
        }
#pragma unroll
        for (int i = 0; i < together; ++i) sum.add(v[i], added);
    }
    for (; k < n; ++k) sum.add(first[k * step], added);
    if constexpr (requires { sum.added(n, nan); }) sum.added(n, added.counts.nan - nan);
}

template <class S, class T>
__global__ void __launch_bounds__(block)
    lines_kernel(T const* in, Lines lines, Image image, double const* share, unsigned long long* totals) {
    std::int64_t const i = static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x;
    Added added{share, {}};
    if (i < lines.across * lines.down) {
        std::int64_t const y = driver::quotient_of(i, lines.across), x = i - y * lines.across,
                           at = lines.at + y * lines.row + x;
        S sum;
        if (!lines.fresh) sum.load(image, at);
        add_line(sum, in + x * lines.pixel_x + y * lines.pixel_y, lines.step, lines.n, added);
        sum.store(image, at);
    }
    driver::add_counts(added.counts, totals);
}

/// What the lane so many above has.
template <class S> __device__ S from_above(unsigned mask, S const& mine, int by) {
    constexpr int words = (sizeof(S) + 3) / 4;
    unsigned w[words] = {};
    memcpy(w, &mine, sizeof mine);
#pragma unroll
    for (int i = 0; i < words; ++i) w[i] = __shfl_down_sync(mask, w[i], by, lanes);
    S other;
    memcpy(&other, w, sizeof other);
    return other;
}

/// Which of a row's zeros, 0 and -0, comes first: lanes do not know.
template <class T, class A> __device__ A first_zero(T const* row, std::int64_t n, int lane, unsigned mask) {
    for (std::int64_t begin = 0; begin < n; begin += lanes) {
        A const v = begin + lane < n ? static_cast<A>(row[begin + lane]) : A(1);
        unsigned const found = __ballot_sync(mask, v == A(0)) & mask;
        if (found != 0) return __shfl_sync(mask, v, (__ffs(static_cast<int>(found)) - 1) % lanes, lanes);
    }
    return A(0);
}

template <class S, class T>
__global__ void __launch_bounds__(block)
    rows_kernel(T const* in, Lines lines, Image image, double const* share, unsigned long long* totals) {
    std::int64_t const i = (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / lanes;
    auto const lane = static_cast<int>(threadIdx.x % lanes);
    unsigned const mask = 0xffffu << (threadIdx.x % 32 / lanes * lanes);
    Added added{share, {}};
    if (i < lines.across * lines.down) {
        std::int64_t const y = driver::quotient_of(i, lines.across), x = i - y * lines.across;
        T const* const row = in + x * lines.pixel_x + y * lines.pixel_y;
        S sum;
        add_line(sum, row + lane, lanes, (lines.n - lane + lanes - 1) / lanes, added);
        for (int half = lanes / 2; half > 0; half /= 2) sum.merge(from_above(mask, sum, half));
        if constexpr (requires { sum.best; }) {
            if constexpr (!S::numbers) {
                bool const zero = __shfl_sync(mask, sum.best == 0 ? 1 : 0, 0, lanes) != 0;
                if (zero) sum.best = first_zero<T, typename S::A>(row, lines.n, lane, mask);
            }
        }
        if (lane == 0) sum.store(image, lines.at + y * lines.row + x);
    }
    driver::add_counts(added.counts, totals);
}

template <class S, class T> void add_lines(ProjectionState& state, ConstView in) {
    bool const rows = state.axis == 0;
    std::int64_t const strides[3] = {1, in.row, in.slice};
    int const across = rows ? 1 : 0, down = state.axis == 2 ? 1 : 2; // the image's x and y
    Index3 const n = in.dims();
    Lines const lines{n[across],
                      n[down],
                      strides[across],
                      strides[down],
                      strides[state.axis],
                      n[state.axis],
                      in.box.lower[down] * state.row() + in.box.lower[across],
                      state.row(),
                      in.box.lower[state.axis] == 0};
    std::vector<double> shares;
    if (state.kind == Projection::std)
        for (std::int64_t i = 0; i < state.dims[state.axis]; ++i) shares.push_back(1 / static_cast<double>(i + 1));
    driver::DeviceList<double> const share(shares);
    Image const image{state.extremes, state.whole, state.wide, state.value, state.extra, state.count, state.scale};
    driver::DeviceLosses const counts;
    std::int64_t const threads = lines.across * lines.down * (rows ? lanes : 1);
    unsigned const blocks = launch_blocks((threads + block - 1) / block);
    auto const* const voxels = reinterpret_cast<T const*>(in.data);
    if (rows)
        rows_kernel<S, T><<<blocks, block>>>(voxels, lines, image, share.get(), counts.get());
    else
        lines_kernel<S, T><<<blocks, block>>>(voxels, lines, image, share.get(), counts.get());
    check_launch("project");
    if constexpr (std::is_integral_v<T>) return; // no NaN to be told of
    Losses losses;
    counts.add_to(losses);
    state.nan += losses.nan;
}

/// The pixels of `out`, of the same bits as CPUs make of the same sums.
struct Finish {
    Image image;
    driver::DeviceRows out;
    Projection kind;
    std::int64_t at, row;
    double length;

    __device__ void operator()(std::int64_t x, std::int64_t y, std::int64_t, driver::LossCounts& counts) const {
        std::int64_t const p = at + y * row + x;
        std::byte* const to = out.at(x, y, 0);
        if (kind == Projection::max || kind == Projection::min) {
            if (out.type == DataType::float16)
                return driver::store_value(out.type, to, reinterpret_cast<float const*>(image.extremes)[p], counts);
            return with_type(out.type, [&]<class T>(T) {
                *reinterpret_cast<T*>(to) = reinterpret_cast<T const*>(image.extremes)[p];
            });
        }
        if (kind == Projection::sum && image.wide != nullptr)
            return driver::store_value(out.type, to, image.wide[p], counts);
        if (kind == Projection::sum && image.whole != nullptr) {
            *reinterpret_cast<std::int64_t*>(to) = image.whole[p]; // as int64 it is what uint64 holds as well
            return;
        }
        driver::store_value(out.type, to, value(p), counts);
    }
    __device__ double value(std::int64_t p) const {
        if (image.whole != nullptr) return static_cast<double>(image.whole[p]) / length;
        if (image.wide != nullptr) return driver::wide_as_float<double>(image.wide[p]) / length;
        double const n = image.count[p];
        double const scale = image.scale == nullptr || image.scale[p] == 0 ? 1 : image.scale[p];
        double const sum = image.value[p] + (image.extra == nullptr ? 0 : image.extra[p]);
        if (kind == Projection::sum) return sum / scale;
        return n > 0 ? (kind == Projection::std ? sqrt(image.extra[p] / n) : sum / n) / scale : nan("");
    }
};

} // namespace

void project_add(ProjectionState& state, ConstView slab, Execution const&) {
    if (slab.box.empty()) return;
    slab.box.lower == Index3{} ? state.begin(Space::device) : state.use(Space::device);
    with_type(slab.type, [&]<class T>(T) {
        switch (state.kind) {
        case Projection::max:
            return add_lines<Extreme<T, true>, T>(state, slab);
        case Projection::min:
            return add_lines<Extreme<T, false>, T>(state, slab);
        case Projection::std:
            return add_lines<Spread<T>, T>(state, slab);
        default:
            if constexpr (!std::is_integral_v<T>)
                return add_lines<Real<T>, T>(state, slab);
            else if (state.wide != nullptr)
                return add_lines<Whole<T, Int128>, T>(state, slab);
            else
                return add_lines<Whole<T, std::int64_t>, T>(state, slab);
        }
    });
}

void project_store(ProjectionState& state, AnyView out, Losses& losses, Execution const&) {
    if (out.box.empty()) return;
    state.use(Space::device);
    Finish const finish{{state.extremes, state.whole, state.wide, state.value, state.extra, state.count, state.scale},
                        driver::device_rows(out, out.box),
                        state.kind,
                        out.box.lower.y * state.row() + out.box.lower.x,
                        state.row(),
                        static_cast<double>(state.dims[state.axis])};
    driver::DeviceLosses const counts;
    driver::for_each_voxel(out.dims(), finish, counts.get(), "project");
    counts.add_to(losses);
}

} // namespace VKT_BACKEND
} // namespace vkt
