// Medians of lines of voxels: keys that are integers in the order of the values, found byte by byte, for many lines at
// once.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/median_lines.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/median_keys.h"
#include "libvkt/operations/voxels/kernels/projected_lines.h"

#include <cstring>
#include <limits>
#include <memory>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// The key of infinity, above which all are NaN; the highest of all for integers.
template <class K> K highest_number(DataType type) {
    K key = std::numeric_limits<K>::max();
    if (is_integer(type)) return key;
    VoxelBytes const infinity = voxel_bytes(type, std::numeric_limits<double>::infinity());
    load_keys(type, infinity.data(), &key, 1);
    return key;
}

/// The pixel of the two keys in the middle.
template <class K> void store_median(DataType type, K lower, K upper, bool odd, std::byte* to) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) == sizeof(K)) {
            T const result = median_of<T>(lower, upper, odd);
            std::memcpy(to, &result, sizeof result);
        }
    });
}

constexpr std::int64_t median_lines_together = 64; ///< next to one another: cache lines, and registers full of bytes

/// The keys in the middle of lines side by side: keys[k * median_lines_together + i], `count[i]` of which are numbers,
/// the least. Byte by byte, from the highest on, and of those bit by bit, by counting how many are less: the same steps
/// for all lines.
template <class U> class MiddleKeys {
public:
    /// `bytes` has room for as many as there are keys.
    MiddleKeys(U const* keys, std::int64_t n, std::int8_t* bytes) : keys_(keys), n_(n), bytes_(bytes) {}

    void find(std::uint32_t const* count, U* lower, U* upper) const {
        std::uint32_t rank[lines];
        alignas(64) U before[lines];
        for (std::int64_t i = 0; i < lines; ++i) rank[i] = count[i] / 2;
        std::fill_n(upper, lines, U{0});
        for (int shift = static_cast<int>(8 * sizeof(U)) - 8; shift >= 0; shift -= 8) {
            take_bytes(upper, shift);
            std::uint8_t byte[lines];
            find_bytes(rank, byte);
            for (std::int64_t i = 0; i < lines; ++i)
                upper[i] = static_cast<U>(upper[i] | static_cast<U>(static_cast<U>(byte[i]) << shift));
        }
        // Of the keys that are equal to it, there are now `rank` before that in the middle.
        largest_below(upper, before);
        for (std::int64_t i = 0; i < lines; ++i) lower[i] = count[i] % 2 != 0 || rank[i] > 0 ? upper[i] : before[i];
    }

private:
    static constexpr std::int64_t lines = median_lines_together;
    using Bytes = Vector<std::int8_t>;
    static constexpr int registers = static_cast<int>(lines / Bytes::lanes);
    static_assert(lines % Bytes::lanes == 0);

    /// One byte of every key, less 128 since bytes with a sign are compared faster; the greatest of keys whose higher
    /// bytes are others.
    void take_bytes(U const* found, int shift) const {
        for (std::int64_t k = 0; k < n_; ++k) {
            U const* const from = keys_ + k * lines;
            std::int8_t* const to = bytes_ + k * lines;
#pragma omp simd
            for (std::int64_t i = 0; i < lines; ++i) {
                U const others = static_cast<U>(static_cast<U>(from[i] ^ found[i]) >> shift >> 7 >> 1); // may be all
                U const byte = static_cast<U>(from[i] >> shift ^ 0x80);
                to[i] = static_cast<std::int8_t>(others == 0 ? byte : U{127});
            }
        }
    }

    /// The bytes of which `rank` are less or equal and come before; the rank becomes that among equal ones.
    void find_bytes(std::uint32_t* rank, std::uint8_t* found) const {
        std::uint32_t less[lines], below[lines] = {};
        std::fill_n(found, lines, std::uint8_t{0});
        for (int bit = 7; bit >= 0; --bit) {
            alignas(64) std::int8_t tried[lines];
            for (std::int64_t i = 0; i < lines; ++i) tried[i] = static_cast<std::int8_t>((found[i] | 1 << bit) ^ 0x80);
            count_less(tried, less);
            for (std::int64_t i = 0; i < lines; ++i) {
                bool const reached = less[i] <= rank[i];
                found[i] = static_cast<std::uint8_t>(found[i] | (reached ? 1 << bit : 0));
                below[i] = reached ? less[i] : below[i];
            }
        }
        for (std::int64_t i = 0; i < lines; ++i) rank[i] -= below[i];
    }

    /// Of each line, how many bytes are less than its bound.
    void count_less(std::int8_t const* than, std::uint32_t* less) const {
        Bytes::type bound[registers];
#pragma GCC unroll 4
        for (int r = 0; r < registers; ++r) bound[r] = Bytes::load(than + r * Bytes::lanes);
        std::fill_n(less, lines, 0u);
        for (std::int64_t begin = 0; begin < n_; begin += 127) { // that a byte counts
            std::int64_t const end = std::min(n_, begin + 127);
            Bytes::type sum[registers] = {};
            for (std::int64_t k = begin; k < end; ++k)
#pragma GCC unroll 4
                for (int r = 0; r < registers; ++r) {
                    auto const is_less = Bytes::load(bytes_ + k * lines + r * Bytes::lanes) < bound[r];
                    if constexpr (register_bytes == 64)
                        sum[r] = is_less ? sum[r] + 1 : sum[r];
                    else
                        sum[r] -= is_less; // which is -1
                }
            std::int8_t counts[lines];
            std::memcpy(counts, sum, sizeof counts);
            for (std::int64_t i = 0; i < lines; ++i) less[i] += static_cast<std::uint32_t>(counts[i]);
        }
    }

    void largest_below(U const* than, U* largest) const {
        using Keys = Vector<U>;
        for (std::int64_t i = 0; i < lines; i += Keys::lanes) {
            typename Keys::type const bound = Keys::load(than + i);
            typename Keys::type most = {};
            for (std::int64_t k = 0; k < n_; ++k) {
                typename Keys::type const key = Keys::load(keys_ + k * lines + i);
                typename Keys::type const candidate = key < bound ? key : typename Keys::type{};
                most = candidate > most ? candidate : most;
            }
            std::memcpy(largest + i, &most, sizeof most);
        }
    }

    U const* keys_;
    std::int64_t n_;
    std::int8_t* bytes_;
};

/// Medians of lines. Returns how many voxels are NaN.
template <class K>
std::int64_t medians_of(Lines<K> const& lines, ConstView in, AnyView out, std::int64_t row, VoxelBytes const& none) {
    constexpr std::int64_t together = median_lines_together;
    using U = UnsignedKey<K>;
    auto const size = static_cast<std::size_t>(lines.n * together);
    std::unique_ptr<K[]> const keys(new K[size]); // all that is read is written
    std::unique_ptr<std::int8_t[]> const bytes(new std::int8_t[size]);
    if (lines.pixels == together && lines.pixel != 1)
        turn(lines.first, lines.pixel, together, lines.n, keys.get());
    else
        for (std::int64_t k = 0; k < lines.n; ++k) {
            K* const to = keys.get() + k * together;
            std::int64_t const ahead = std::min(k + 16, lines.n - 1) * lines.step;
            for (std::size_t byte = 0; byte < together * sizeof(K); byte += 64) // no processor foresees these
                __builtin_prefetch(reinterpret_cast<std::byte const*>(lines.first + ahead) + byte);
            for (std::int64_t i = 0; i < lines.pixels; ++i) to[i] = lines.first[k * lines.step + i * lines.pixel];
            std::fill(to + lines.pixels, to + together, K{0});
        }
    load_keys(in.type, reinterpret_cast<std::byte const*>(keys.get()), keys.get(), lines.n * together);
    auto* const ordered = reinterpret_cast<U*>(keys.get());
    for (std::int64_t k = 0; k < lines.n * together; ++k) ordered[k] = unsigned_key(static_cast<K>(ordered[k]));
    U const highest = unsigned_key(highest_number<K>(in.type));
    alignas(64) std::uint32_t count[together] = {};
    if (is_integer(in.type)) // which are all numbers
        std::fill_n(count, together, static_cast<std::uint32_t>(lines.n));
    else
        for (std::int64_t k = 0; k < lines.n; ++k)
            for (std::int64_t i = 0; i < together; ++i) count[i] += ordered[k * together + i] <= highest ? 1 : 0;
    alignas(64) U lower[together], upper[together];
    MiddleKeys<U>(ordered, lines.n, bytes.get()).find(count, lower, upper);
    std::int64_t missing = 0;
    for (std::int64_t i = 0; i < lines.pixels; ++i) {
        auto const place = static_cast<std::int64_t>(lines.at) + i;
        std::byte* const pixel = out.at(out.box.lower.x + place % row, out.box.lower.y + place / row, out.box.lower.z);
        missing += lines.n - static_cast<std::int64_t>(count[i]);
        if (count[i] > 0)
            store_median(in.type, key_of<K>(lower[i]), key_of<K>(upper[i]), count[i] % 2 != 0, pixel);
        else
            std::memcpy(pixel, none.data(), sizeof(K));
    }
    return missing;
}

} // namespace

void median_lines(ConstView in, AnyView out, int axis, std::int64_t& nan, Execution const& execution) {
    ProjectionState image; // for its places
    image.axis = axis;
    image.dims = in.dims();
    ConstView const from = in.moved_to({});
    VoxelBytes const none = voxel_bytes(out.type, std::numeric_limits<double>::quiet_NaN());
    with_order_key(in.type, [&]<class K>(K) {
        for_each_lines<K>(image, from, median_lines_together, execution, [&](Lines<K> const& lines) {
            std::int64_t const missing = medians_of(lines, in, out, image.row(), none);
            if (missing == 0) return;
#pragma omp atomic
            nan += missing;
        });
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
