// Statistics of rows: 16 lanes on every back end, whatever its registers hold.
// SPDX-License-Identifier: MIT
#ifndef __CUDACC__
#include "libvkt/operations/statistics.h"

#include "libvkt/kernel/kernel.h"

#include <limits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

// The register width is the back end's, the number of lanes is not: lane j sums voxels j, j + 16, … on every machine.
constexpr int lanes = 16;
constexpr int doubles = static_cast<int>(register_bytes / 8);
constexpr int registers = lanes / doubles;
constexpr std::int64_t chunk = 2048; // stays in the first cache between the two loops; a multiple of the lanes

typedef double DoubleRegister __attribute__((vector_size(register_bytes)));
template <class T> struct Loads {
    typedef T part
        __attribute__((vector_size(doubles * sizeof(T)), aligned(sizeof(T)), may_alias)); // widens to doubles
    typedef T full __attribute__((vector_size(register_bytes)));
    typedef T unaligned __attribute__((vector_size(register_bytes), aligned(sizeof(T)), may_alias));
};

/// Sums and extremes of a row of floats, fed chunk by chunk.
template <class T> class FloatRow {
public:
    explicit FloatRow(double shift) : shift_(shift) {}

    void add(T const* p, std::int64_t n) {
        std::int64_t const bad = extremes(p, n);
        count_ += n;
        if (bad == 0) return sums(p, n);
        T replaced[chunk];
        for (std::int64_t i = 0; i < n; ++i) {
            bool const finite = p[i] - p[i] == T(0);
            nan_ += p[i] != p[i];
            above_ += p[i] == std::numeric_limits<T>::infinity();
            below_ += p[i] == -std::numeric_limits<T>::infinity();
            replaced[i] = finite ? p[i] : static_cast<T>(shift_); // contributes nothing
        }
        sums(replaced, n);
    }

    void finish(double origin, RowStatistics& out) const {
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
        Moments& m = out.moments;
        m = {};
        m.nan = nan_;
        m.positive_infinity = above_;
        m.negative_infinity = below_;
        m.finite = count_ - nan_ - above_ - below_;
        if (m.finite > 0) {
            auto const n = static_cast<double>(m.finite);
            double const product = n * shift_;
            m.sum = product + s[0];
            double const back = m.sum - product;
            m.sum_error = (product - (m.sum - back)) + (s[0] - back) + __builtin_fma(n, shift_, -product);
            m.mean = (shift_ - origin) + s[0] / n;
            double const deviations = q[0] - s[0] * s[0] / n;
            m.deviations = deviations > 0 || deviations != deviations ? deviations : 0;
        }
        out.range = {};
        out.range.valid = count_ > nan_;
        out.range.low = static_cast<double>(low_);
        out.range.high = static_cast<double>(high_);
    }

private:
    /// Returns how many voxels are not finite (or some positive number, if there are any).
    std::int64_t extremes(T const* p, std::int64_t n) {
        using Full = typename Loads<T>::full;
        using Unaligned = typename Loads<T>::unaligned;
        constexpr int width = static_cast<int>(register_bytes / sizeof(T));
        constexpr T infinity = std::numeric_limits<T>::infinity();
        Full low0 = Full{} + infinity, high0 = Full{} - infinity, odd0 = Full{};
        Full low1 = low0, high1 = high0, odd1 = odd0;
        std::int64_t i = 0;
        for (; i + 2 * width <= n; i += 2 * width) { // v - v is 0 unless v is infinite or NaN; NaN never compares less
            Full const v = *reinterpret_cast<Unaligned const*>(p + i);
            Full const w = *reinterpret_cast<Unaligned const*>(p + i + width);
            low0 = v < low0 ? v : low0;
            low1 = w < low1 ? w : low1;
            high0 = v > high0 ? v : high0;
            high1 = w > high1 ? w : high1;
            odd0 += v - v;
            odd1 += w - w;
        }
        odd0 += odd1;
        std::int64_t bad = 0;
        for (int j = 0; j < width; ++j) {
            low_ = low0[j] < low_ ? low0[j] : low_;
            low_ = low1[j] < low_ ? low1[j] : low_;
            high_ = high0[j] > high_ ? high0[j] : high_;
            high_ = high1[j] > high_ ? high1[j] : high_;
            bad += !(odd0[j] == T(0));
        }
        for (; i < n; ++i) {
            low_ = p[i] < low_ ? p[i] : low_;
            high_ = p[i] > high_ ? p[i] : high_;
            bad += !(p[i] - p[i] == T(0));
        }
        return bad;
    }

    void sums(T const* p, std::int64_t n) {
        using Part = typename Loads<T>::part;
        std::int64_t i = 0;
        DoubleRegister s[registers], q[registers];
        for (int r = 0; r < registers; ++r) {
            s[r] = s_[r];
            q[r] = q_[r];
        }
        for (; i + lanes <= n; i += lanes) {
#pragma GCC unroll 8
            for (int r = 0; r < registers; ++r) {
                DoubleRegister const d =
                    __builtin_convertvector(*reinterpret_cast<Part const*>(p + i + r * doubles), DoubleRegister) -
                    shift_;
                s[r] += d;
                q[r] += d * d;
            }
        }
        for (int r = 0; r < registers; ++r) {
            s_[r] = s[r];
            q_[r] = q[r];
        }
        for (int j = 0; i < n; ++i, ++j) { // only the last chunk has such a tail
            double const d = static_cast<double>(p[i]) - shift_;
            tail_s_[j] += d;
            tail_q_[j] += d * d;
        }
    }

    double shift_;
    DoubleRegister s_[registers] = {}, q_[registers] = {};
    double tail_s_[lanes] = {}, tail_q_[lanes] = {};
    T low_ = std::numeric_limits<T>::infinity(), high_ = -std::numeric_limits<T>::infinity();
    std::int64_t count_ = 0, nan_ = 0, above_ = 0, below_ = 0;
};

/// The first finite value of a row, 0 if there is none: sums of differences from it neither cancel nor stall.
template <class T> double shift_of(T const* p, std::int64_t n) {
    for (std::int64_t i = 0; i < n; ++i)
        if (auto const v = static_cast<double>(p[i]); v - v == 0) return v;
    return 0;
}

template <class T> void float_row(T const* p, std::int64_t n, double origin, RowStatistics& out) {
    if constexpr (std::is_same_v<T, Half>) {
        FloatRow<float> row(shift_of(p, n));
        float wide[chunk];
        for (std::int64_t i = 0; i < n; i += chunk) {
            std::int64_t const m = std::min(chunk, n - i);
            for (std::int64_t j = 0; j < m; ++j) wide[j] = static_cast<float>(p[i + j]);
            row.add(wide, m);
        }
        row.finish(origin, out);
    } else {
        FloatRow<T> row(shift_of(p, n));
        for (std::int64_t i = 0; i < n; i += chunk) row.add(p + i, std::min(chunk, n - i));
        row.finish(origin, out);
    }
}

/// Exact sum and sum of squares of at most `chunk` integers of up to 32 bits.
template <class T> void exact_sums(T const* p, std::int64_t n, Moments& m) {
    if constexpr (sizeof(T) == 1) {
        std::int32_t sum = 0, squares = 0;
        for (std::int64_t i = 0; i < n; ++i) {
            auto const v = static_cast<std::int16_t>(p[i]);
            sum += v;
            squares += v * v;
        }
        m.integer_sum += sum;
        m.squares += static_cast<std::uint32_t>(squares);
    } else if constexpr (sizeof(T) == 2) {
        std::int32_t sum = 0;
        std::uint64_t squares = 0;
        for (std::int64_t i = 0; i < n; ++i) {
            auto const v = static_cast<std::int32_t>(p[i]);
            auto const size = static_cast<std::uint32_t>(v < 0 ? -v : v);
            sum += v;
            squares += static_cast<std::uint64_t>(size * size);
        }
        m.integer_sum += sum;
        m.squares += squares;
    } else {
        std::int64_t sum = 0;
        std::uint64_t low = 0, high = 0;
        for (std::int64_t i = 0; i < n; ++i) {
            auto const v = static_cast<std::int64_t>(p[i]);
            auto const size = static_cast<std::uint64_t>(v < 0 ? -v : v);
            std::uint64_t const square = size * size;
            sum += v;
            low += square & 0xffffffffu;
            high += square >> 32;
        }
        m.integer_sum += sum;
        m.squares += (static_cast<Unsigned128>(high) << 32) + low;
    }
}

template <class T> void integer_row(T const* p, std::int64_t n, Int128 origin, RowStatistics& out) {
    T low = p[0], high = p[0];
    Moments m;
    m.finite = n;
    if constexpr (sizeof(T) <= 4) {
        for (std::int64_t i = 0; i < n; i += chunk) {
            std::int64_t const end = std::min(i + chunk, n);
            for (std::int64_t j = i; j < end; ++j) {
                low = p[j] < low ? p[j] : low;
                high = p[j] > high ? p[j] : high;
            }
            exact_sums(p + i, end - i, m);
        }
    } else {
        double s = 0, q = 0;
        for (std::int64_t i = 0; i < n; ++i) {
            low = p[i] < low ? p[i] : low;
            high = p[i] > high ? p[i] : high;
            Int128 const difference = static_cast<Int128>(p[i]) - static_cast<Int128>(p[0]);
            auto const d = static_cast<double>(difference);
            m.integer_sum += static_cast<Int128>(p[i]);
            s += d;
            q += d * d;
        }
        auto const count = static_cast<double>(n);
        m.mean = static_cast<double>(static_cast<Int128>(p[0]) - origin) + s / count;
        m.deviations = std::max(0.0, q - s * s / count);
    }
    out.moments = m;
    out.range = {true, static_cast<double>(low), static_cast<double>(high), low, high};
}

template <class T> void rows_of(ConstView slab, MeanOrigin const& origin, RowStatistics* rows, int threads) {
    View<T const> const in = slab.as<T>();
    Index3 const n = slab.dims();
    Box const box = slab.box;
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
    for (std::int64_t r = 0; r < n.y * n.z; ++r) {
        T const* const p = &in(box.lower.x, box.lower.y + r % n.y, box.lower.z + r / n.y);
        if constexpr (std::is_integral_v<T>)
            integer_row(p, n.x, origin.integer, rows[r]);
        else
            float_row(p, n.x, origin.value, rows[r]);
    }
}

} // namespace

void row_statistics(ConstView slab, MeanOrigin const& origin, RowStatistics* rows, Execution const& execution) {
    for_each_type(slab.type, [&]<class T>(T) { rows_of<T>(slab, origin, rows, execution.threads); });
}

} // namespace VKT_BACKEND

} // namespace vkt
#endif
