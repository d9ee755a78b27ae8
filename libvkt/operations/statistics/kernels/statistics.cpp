// Statistics of bands of rows: 16 lanes on every back end, whatever its registers hold.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/statistics/kernels/statistics.h"

#include "libvkt/core/device.h"
#include "libvkt/kernel/integer_sums.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/lanes.h"
#include "libvkt/operations/statistics/kernels/statistics_bands.h"

#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

// The register width is the back end's, the number of lanes is not: lane j sums voxels j, j + 16, … of a row on every
// machine.
constexpr int lanes = 16;
constexpr int doubles = static_cast<int>(register_bytes / 8);
constexpr int registers = lanes / doubles;
constexpr std::int64_t ahead = 1024; ///< voxels that are asked for before they are added
constexpr std::int64_t chunk = 2048; // stays in the first cache between the two loops; a multiple of the lanes

typedef double DoubleRegister __attribute__((vector_size(register_bytes)));
typedef std::int64_t LongRegister __attribute__((vector_size(register_bytes)));
typedef DoubleRegister UnalignedRegister __attribute__((aligned(8), may_alias));
template <class T> struct Loads {
    typedef T full __attribute__((vector_size(register_bytes)));
    typedef T unaligned __attribute__((vector_size(register_bytes), aligned(sizeof(T)), may_alias));
};

/// Products of numbers in 16 lanes, as mantissas and exponents. Zeros stay zeros; all else must be finite.
class LaneProducts {
public:
    /// So many numbers of a type, or of products of integers of up to 64 bits, can be multiplied before split().
    template <class T> static constexpr std::int64_t together = 1000 / (std::is_integral_v<T> ? 64 : 149) * lanes;

    LaneProducts() {
        for (auto& m : mantissa_) m += 1;
    }

    void multiply_lanes(int r, DoubleRegister factors) { mantissa_[r] *= factors; }
    void multiply_lane(int lane, double factor) {
        DoubleRegister factors = DoubleRegister{} + 1;
        factors[lane % doubles] = factor;
        multiply_lanes(lane / doubles, factors);
        split(mantissa_[lane / doubles], exponent_[lane / doubles]);
    }
    void split() {
#pragma GCC unroll 8
        for (int r = 0; r < registers; ++r) split(mantissa_[r], exponent_[r]);
    }

    /// Numbers of type T, or of as many digits. Some more places are written to.
    template <class T> void multiply_moderate(double* v, std::int64_t n) {
        while (n % lanes != 0) v[n++] = 1;
        for (std::int64_t i = 0; i < n; i += together<T>) {
            for (std::int64_t j = i; j < std::min(n, i + together<T>); j += lanes)
                for (int r = 0; r < registers; ++r) multiply_lanes(r, load_doubles(v + j + r * doubles));
            split();
        }
    }
    /// Any numbers.
    void multiply(double* v, std::int64_t n) {
        while (n % lanes != 0) v[n++] = 1;
        for (std::int64_t i = 0; i < n; i += lanes)
            for (int r = 0; r < registers; ++r) {
                DoubleRegister factor = load_doubles(v + i + r * doubles);
                DoubleRegister const size = factor < 0 ? -factor : factor;
                LongRegister const small = size < 0x1p-900; // perhaps subnormal
                factor = small ? factor * 0x1p200 : factor;
                exponent_[r] += small & -200;
                split(factor, exponent_[r]);
                mantissa_[r] *= factor;
                split(mantissa_[r], exponent_[r]);
            }
    }
    /// 0 if any number was.
    Product product() const {
        if (zero()) return {0, 0};
        long double mantissa = 1; // there is room for that many without normalising each
        std::int64_t exponent = 0;
        for (int j = 0; j < lanes; ++j) {
            mantissa *= mantissa_[j / doubles][j % doubles];
            exponent += exponent_[j / doubles][j % doubles];
        }
        Product all;
        all.multiply({mantissa, exponent});
        return all;
    }
    bool zero() const {
        bool any = false;
        for (int j = 0; j < lanes; ++j) any = any || mantissa_[j / doubles][j % doubles] == 0;
        return any;
    }

private:
    /// Moves the exponent of a normal number, or of what is 0, from the one to the other.
    static void split(DoubleRegister& number, LongRegister& exponent) {
        LongRegister const bits = reinterpret_cast<LongRegister>(number);
        exponent += ((bits >> 52) & 0x7ff) - 1023;
        LongRegister const one = (bits & ~(std::int64_t{0x7ff} << 52)) | (std::int64_t{1023} << 52);
        number = number == 0 ? number : reinterpret_cast<DoubleRegister>(one);
    }

    DoubleRegister mantissa_[registers] = {};
    LongRegister exponent_[registers] = {};
};

/// Sums and extremes of rows of floats, fed chunk by chunk, and their products if `products` is there. Values are
/// summed times a power of two, if Scaled.
template <class T, bool Scaled = false> class FloatRows {
public:
    explicit FloatRows(double shift, double scale = 1, LaneProducts* products = nullptr)
        : shift_(shift * scale), scale_(scale), nothing_(shift), products_(products) {}

    void add(T const* p, std::int64_t n) {
        count_ += n;
        if (products_ != nullptr ? add_finite<true>(p, n) : add_finite<false>(p, n)) return;
        T replaced[chunk];
        alignas(64) double factors[chunk + lanes];
        for (std::int64_t i = 0; i < n; ++i) {
            bool const finite = p[i] - p[i] == T(0); // NOLINT(misc-redundant-expression): NaN, and what is not finite
            nan_ += p[i] != p[i];                    // NOLINT(misc-redundant-expression): NaN, and what is not finite
            above_ += p[i] == infinity;
            below_ += p[i] == -infinity;
            replaced[i] = finite ? p[i] : static_cast<T>(nothing_); // contributes nothing
            factors[i] = finite ? static_cast<double>(p[i]) : 1;
        }
        add_sums(replaced, n);
        if (products_ != nullptr) products_->template multiply_moderate<float>(factors, n);
    }

    void finish(double origin, BandStatistics& out) const {
        double s[lanes], q[lanes];
        for (int j = 0; j < lanes; ++j) {
            s[j] = s_[j / doubles][j % doubles] + tail_s_[j];
            q[j] = q_[j / doubles][j % doubles] + tail_q_[j];
        }
        for (int half = lanes / 2; half > 0; half /= 2)
            for (int j = 0; j < half; ++j) {
                s[j] += s[j + half];
                q[j] += q[j + half];
            }
        T low = low_, high = high_;
        for (int j = 0; j < width; ++j) {
            low = lows_[j] < low ? lows_[j] : low;
            high = highs_[j] > high ? highs_[j] : high;
        }
        FloatBand const band{count_,
                             nan_,
                             above_,
                             below_,
                             s[0],
                             q[0],
                             nothing_,
                             scale_,
                             static_cast<double>(low),
                             static_cast<double>(high)};
        finish_band(band, std::is_same_v<T, double>, origin, out);
    }

    /// True if a sum, a difference or a square was too large for double, or all differences so small that squares may
    /// be lost.
    bool out_of_range() const {
        double s = static_cast<double>(count_) * shift_, q = 0;
        for (int j = 0; j < lanes; ++j) {
            s += s_[j / doubles][j % doubles] + tail_s_[j];
            q += q_[j / doubles][j % doubles] + tail_q_[j];
        }
        return s - s != 0 || q - q != 0 || (q < 0x1p-900 && !constant());
    }

private:
    using Full = typename Loads<T>::full;
    static constexpr int width = static_cast<int>(register_bytes / sizeof(T));
    static constexpr T infinity = std::numeric_limits<T>::infinity();

    /// Adds to extremes and sums in one pass; false, and nothing added to the sums and products, if a voxel is infinite
    /// or NaN: such a one leaves a sum that is no number. So do finite doubles whose sum is too large, which then are
    /// added the slow way.
    template <bool Multiplies> bool add_finite(T const* p, std::int64_t n) {
        using Unaligned = typename Loads<T>::unaligned;
        Full low = lows_, high = highs_;
        DoubleRegister s[registers], q[registers];
        LaneProducts m = Multiplies ? *products_ : LaneProducts{};
        for (int r = 0; r < registers; ++r) {
            s[r] = s_[r];
            q[r] = q_[r];
        }
        std::int64_t const whole = n / lanes * lanes;
        for (std::int64_t begin = 0; begin < whole; begin += LaneProducts::together<float>) {
            std::int64_t const end = std::min(whole, begin + LaneProducts::together<float>);
            for (std::int64_t i = begin; i < end; i += lanes) {
                __builtin_prefetch(p + i + ahead);
#pragma GCC unroll 8
                for (int f = 0; f < lanes; f += width) { // NaN never compares less
                    Full const v = *reinterpret_cast<Unaligned const*>(p + i + f);
                    low = v < low ? v : low;
                    high = v > high ? v : high;
                }
#pragma GCC unroll 8
                for (int r = 0; r < registers; ++r) {
                    DoubleRegister const v = load_doubles(p + i + r * doubles);
                    add_register(v, s[r], q[r]);
                    if constexpr (Multiplies) m.multiply_lanes(r, v);
                }
            }
            if constexpr (Multiplies) m.split();
        }
        lows_ = low;
        highs_ = high;
        T odd = T(0);
        for (std::int64_t i = whole; i < n; ++i) {
            low_ = p[i] < low_ ? p[i] : low_;
            high_ = p[i] > high_ ? p[i] : high_;
            odd += p[i] - p[i]; // NOLINT(misc-redundant-expression): NaN, and what is not finite
        }
        DoubleRegister odds = DoubleRegister{};
        for (int r = 0; r < registers; ++r) odds += s[r] - s[r]; // NOLINT(misc-redundant-expression): as well
        for (int j = 0; j < doubles; ++j) odd += static_cast<T>(odds[j]);
        if (odd != T(0)) return false;
        keep(s, q);
        add_tail(p + whole, n - whole);
        if constexpr (Multiplies) {
            for (std::int64_t i = whole; i < n; ++i)
                m.multiply_lane(static_cast<int>(i - whole), static_cast<double>(p[i]));
            *products_ = m;
        }
        return true;
    }

    void add_sums(T const* p, std::int64_t n) {
        std::int64_t i = 0;
        DoubleRegister s[registers], q[registers];
        for (int r = 0; r < registers; ++r) {
            s[r] = s_[r];
            q[r] = q_[r];
        }
        for (; i + lanes <= n; i += lanes) add_lanes(p + i, s, q);
        keep(s, q);
        add_tail(p + i, n - i);
    }

    void add_lanes(T const* p, DoubleRegister* s, DoubleRegister* q) const {
#pragma GCC unroll 8
        for (int r = 0; r < registers; ++r) add_register(load_doubles(p + r * doubles), s[r], q[r]);
    }
    void add_register(DoubleRegister v, DoubleRegister& s, DoubleRegister& q) const {
        if constexpr (Scaled) v *= scale_;
        DoubleRegister const d = v - shift_;
        s += d;
        q += d * d;
    }
    void keep(DoubleRegister const* s, DoubleRegister const* q) {
        for (int r = 0; r < registers; ++r) {
            s_[r] = s[r];
            q_[r] = q[r];
        }
    }
    void add_tail(T const* p, std::int64_t n) { // only the last chunk of a row has one
        for (std::int64_t j = 0; j < n; ++j) {
            double const d = static_cast<double>(p[j]) * (Scaled ? scale_ : 1) - shift_;
            tail_s_[j] += d;
            tail_q_[j] += d * d;
        }
    }

    /// True if all finite values are the same.
    bool constant() const {
        bool same = !(low_ < nothing_) && !(high_ > nothing_);
        for (int j = 0; j < width; ++j) same = same && !(lows_[j] < nothing_) && !(highs_[j] > nothing_);
        return same;
    }

    double shift_, scale_, nothing_; ///< nothing: the shift, unscaled
    LaneProducts* products_;
    DoubleRegister s_[registers] = {}, q_[registers] = {};
    double tail_s_[lanes] = {}, tail_q_[lanes] = {};
    Full lows_ = Full{} + infinity, highs_ = Full{} - infinity;
    T low_ = infinity, high_ = -infinity; ///< of tails
    std::int64_t count_ = 0, nan_ = 0, above_ = 0, below_ = 0;
};

/// Rows of one slice, `pitch` voxels apart.
template <class T> struct Band {
    T const* voxels;
    std::int64_t length, rows, pitch;

    /// Calls f(p, n) for runs of at most `most` that together are all rows in order.
    template <class F> void for_each_run(F const& f, std::int64_t most = chunk) const {
        for (std::int64_t r = 0; r < rows; ++r)
            for (std::int64_t i = 0; i < length; i += most) f(voxels + r * pitch + i, std::min(most, length - i));
    }
};

/// The first finite value, 0 if there is none: sums of differences from it neither cancel nor stall.
template <class T> double shift_of(Band<T> const& band) {
    for (std::int64_t r = 0; r < band.rows; ++r)
        for (std::int64_t i = 0; i < band.length; ++i)
            if (auto const v = static_cast<double>(band.voxels[r * band.pitch + i]); v - v == 0) return v;
    return 0;
}

template <class T> void float_band(Band<T> band, double origin, LaneProducts* products, BandStatistics& out) {
    double const shift = shift_of(band);
    // Rows without a tail fill the lanes the same way when they are one long row.
    if (band.length == band.pitch && band.length % lanes == 0) band = {band.voxels, band.length * band.rows, 1, 0};
    if constexpr (std::is_same_v<T, Half>) {
        FloatRows<float> rows(shift, 1, products);
        float wide[chunk];
        band.for_each_run([&](T const* p, std::int64_t n) {
            for (std::int64_t j = 0; j < n; ++j) wide[j] = static_cast<float>(p[j]);
            rows.add(wide, n);
        });
        rows.finish(origin, out);
    } else {
        FloatRows<T> rows(shift, 1, products);
        band.for_each_run([&](T const* p, std::int64_t n) { rows.add(p, n); });
        rows.finish(origin, out);
        if constexpr (std::is_same_v<T, double>) {
            if (!rows.out_of_range()) return;
            double const size = std::max(std::abs(out.range.low), std::abs(out.range.high));
            FloatRows<double, true> scaled(shift, size > 1 ? 0x1p-600 : 0x1p600);
            band.for_each_run([&](T const* p, std::int64_t n) { scaled.add(p, n); });
            scaled.finish(origin, out);
        }
    }
}

/// Adds what at most `chunk` integers of up to 32 bits are exactly.
template <class T> void exact_sums(T const* p, std::int64_t n, T& least, T& most, Moments& m) {
    if constexpr (sizeof(T) <= 2) {
        IntegerSums<T> const sums = integer_sums(p, n);
        least = std::min(least, sums.low);
        most = std::max(most, sums.high);
        m.integer_sum += sums.sum;
        m.squares += sums.squares;
    } else {
        T lowest = least, highest = most;
        std::int64_t sum = 0;
        std::uint64_t low = 0, high = 0;
        for (std::int64_t i = 0; i < n; ++i) {
            auto const v = static_cast<std::int64_t>(p[i]);
            auto const size = static_cast<std::uint64_t>(v < 0 ? -v : v);
            std::uint64_t const square = size * size;
            lowest = p[i] < lowest ? p[i] : lowest;
            highest = p[i] > highest ? p[i] : highest;
            sum += v;
            low += square & 0xffffffffu;
            high += square >> 32;
        }
        least = lowest;
        most = highest;
        m.integer_sum += sum;
        m.squares += (static_cast<Unsigned128>(high) << 32) + low;
    }
}

template <class T> void integer_band(Band<T> band, Int128 origin, BandStatistics& out) {
    T const first = band.voxels[0];
    T low = first, high = first;
    Moments m;
    m.finite = band.length * band.rows;
    if (band.length == band.pitch) band = {band.voxels, m.finite, 1, 0};
    double s = 0, q = 0;
    auto const add = [&](T const* p, std::int64_t n) {
        if constexpr (sizeof(T) <= 4) {
            exact_sums(p, n, low, high, m);
        } else {
            for (std::int64_t i = 0; i < n; ++i) {
                low = p[i] < low ? p[i] : low;
                high = p[i] > high ? p[i] : high;
                Int128 const difference = static_cast<Int128>(p[i]) - static_cast<Int128>(first);
                auto const d = static_cast<double>(difference);
                m.integer_sum += static_cast<Int128>(p[i]);
                s += d;
                q += d * d;
            }
        }
    };
    band.for_each_run(add, sizeof(T) <= 2 ? most_integers : chunk);
    if constexpr (sizeof(T) > 4) {
        auto const count = static_cast<double>(m.finite);
        m.mean = static_cast<double>(static_cast<Int128>(first) - origin) + s / count;
        m.deviations = std::max(0.0, q - s * s / count);
    }
    out.moments = m;
    out.range = {true, static_cast<double>(low), static_cast<double>(high), low, high};
}

/// to[i]: products of integers of at most 16 bits, several at a time: 48 bits, which double has exactly. Returns how
/// many.
template <class T> std::int64_t multiply_together(T const* p, std::int64_t n, double* to) {
    constexpr std::int64_t factors = 6 / sizeof(T);
    std::int64_t const each = n / factors;
#pragma omp simd
    for (std::int64_t i = 0; i < each; ++i) {
        double product = static_cast<double>(static_cast<std::int32_t>(p[i]));
        for (std::int64_t k = 1; k < factors; ++k)
            product *= static_cast<double>(static_cast<std::int32_t>(p[i + k * each]));
        to[i] = product;
    }
    std::int64_t count = each;
    for (std::int64_t i = each * factors; i < n; ++i) to[count++] = static_cast<double>(p[i]);
    return count;
}

/// The product of a band's finite physical values. A zero ends it.
template <class T> Product product_of(Band<T> const& band, ValueMap const& map) {
    bool const mapped = !(map == ValueMap{});
    LaneProducts products;
    alignas(64) double factors[chunk + lanes];
    bool zero = false;
    band.for_each_run([&](T const* p, std::int64_t n) {
        if (zero) return;
        if (mapped) {
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) {
                double const stored = static_cast<double>(p[i]), value = map.slope * stored + map.intercept;
                // The product may be beyond double where the sum is not.
                double const physical = value - value == 0 ? value : __builtin_fma(map.slope, stored, map.intercept);
                factors[i] = physical - physical == 0 ? physical : 1;
            }
        } else if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
            n = multiply_together(p, n, factors);
        } else {
#pragma omp simd
            for (std::int64_t i = 0; i < n; ++i) {
                double const value = static_cast<double>(p[i]);
                factors[i] = value - value == 0 ? value : 1;
            }
        }
        if (mapped || !std::is_integral_v<T>)
            products.multiply(factors, n);
        else
            products.multiply_moderate<T>(factors, n);
        zero = products.zero();
    });
    return products.product();
}

template <class T>
void bands_of(ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
              int threads) {
    View<T const> const in = slab.as<T>();
    Index3 const n = slab.dims(), lower = slab.box.lower;
    std::int64_t const rows = rows_in_band(n, slab.type), per_slice = bands_in_slice(n, slab.type);
    bool const at_once = (std::is_same_v<T, float> || std::is_same_v<T, Half>)&&product_map != nullptr &&
                         *product_map == ValueMap{}; // products while voxels are added up
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
    for (std::int64_t b = 0; b < per_slice * n.z; ++b) {
        std::int64_t const y = b % per_slice * rows;
        Band<T> const band{&in(lower.x, lower.y + y, lower.z + b / per_slice), n.x, std::min(rows, n.y - y), in.row};
        LaneProducts products;
        if constexpr (std::is_integral_v<T>)
            integer_band(band, origin.integer, bands[b]);
        else
            float_band(band, origin.value, at_once ? &products : nullptr, bands[b]);
        bands[b].product = product_map == nullptr ? Product{}
                           : at_once              ? products.product()
                                                  : product_of(band, *product_map);
    }
}

} // namespace

void band_statistics(ConstView slab, MeanOrigin const& origin, ValueMap const* product_map, BandStatistics* bands,
                     Execution const& execution) {
    with_type(slab.type, [&]<class T>(T) { bands_of<T>(slab, origin, product_map, bands, execution.threads); });
}

void slice_statistics(ConstView, MeanOrigin const&, ValueMap const*, SliceStatistics*, Execution const&) {
    throw_without_cuda(); // CPUs merge bands on the host
}

} // namespace VKT_BACKEND

} // namespace vkt
