// Medians of lines of voxels: keys that are integers in the order of the values, found bit by bit, for many lines at
// once.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/median_lines.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/order.h"
#include "libvkt/operations/voxels/kernels/projected_lines.h"

#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class T> T middle(T a, T b) {
    if constexpr (std::is_integral_v<T>) {
        Int128 const sum = static_cast<Int128>(a) + static_cast<Int128>(b);
        Int128 const low = (sum - (sum & 1)) / 2; // towards the lower one
        return static_cast<T>((sum & 1) != 0 && (low & 1) != 0 ? low + 1 : low);
    } else if constexpr (std::is_same_v<T, double>) {
        return a == b ? a : std::midpoint(a, b);
    } else {
        return static_cast<T>((static_cast<double>(a) + static_cast<double>(b)) / 2);
    }
}

/// The key of infinity, above which all are NaN; the highest of all for integers.
template <class K> K highest_number(DataType type) {
    K key = std::numeric_limits<K>::max();
    if (is_integer(type)) return key;
    VoxelBytes const infinity = voxel_bytes(type, std::numeric_limits<double>::infinity());
    load_keys(type, infinity.data(), &key, 1);
    return key;
}

/// The pixel of the two keys in the middle, which are the same one of an odd number: their mean as the type has it.
template <class K> void store_median(DataType type, K lower, K upper, bool odd, std::byte* to) {
    K const keys[2] = {lower, upper};
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) == sizeof(K)) {
            K stored[2];
            T voxels[2];
            store_keys(type, static_cast<K const*>(keys), reinterpret_cast<std::byte*>(stored), 2);
            std::memcpy(voxels, stored, sizeof voxels);
            T const result = odd ? voxels[1] : middle(voxels[0], voxels[1]);
            std::memcpy(to, &result, sizeof result);
        }
    });
}

constexpr std::int64_t median_lines_together = 32; ///< next to one another, which share cache lines and registers

/// The keys in the middle of lines side by side: keys[k * median_lines_together + i], `count[i]` of which are numbers,
/// the least. Bit by bit, by counting how many are less: the same steps for all lines.
template <class W> class MiddleKeys {
public:
    MiddleKeys(W const* keys, std::int64_t n) : keys_(keys), n_(n) {}

    void find(W const* count, W* lower, W* upper) const {
        alignas(64) W rank[lines], found[lines] = {}, less[lines], tried[lines], before[lines];
        for (std::int64_t i = 0; i < lines; ++i) rank[i] = count[i] / 2;
        for (int bit = static_cast<int>(8 * sizeof(W)) - 1; bit >= 0; --bit) {
            for (std::int64_t i = 0; i < lines; ++i) tried[i] = static_cast<W>(found[i] | W(1) << bit);
            count_less(tried, less);
            for (std::int64_t i = 0; i < lines; ++i) found[i] = less[i] <= rank[i] ? tried[i] : found[i];
        }
        // The one before: the same if that many are equal, else the largest that is less.
        count_less(found, less);
        largest_below(found, before);
        for (std::int64_t i = 0; i < lines; ++i) {
            bool const odd = count[i] % 2 != 0;
            upper[i] = found[i];
            lower[i] = odd || less[i] < rank[i] ? found[i] : before[i];
        }
    }

    /// Of each line, how many keys are less than its bound.
    void count_less(W const* than, W* less) const {
        typename V::type bound[registers], sum[registers] = {};
#pragma GCC unroll 16
        for (int r = 0; r < registers; ++r) bound[r] = V::load(than + r * V::lanes);
        for (std::int64_t k = 0; k < n_; ++k)
#pragma GCC unroll 16
            for (int r = 0; r < registers; ++r)
                sum[r] = V::load(keys_ + k * lines + r * V::lanes) < bound[r] ? sum[r] + 1 : sum[r];
        std::memcpy(less, sum, sizeof sum);
    }

private:
    using V = Vector<W>;
    static constexpr std::int64_t lines = median_lines_together;
    static constexpr int registers = static_cast<int>(std::max<std::int64_t>(1, lines / V::lanes));
    static_assert(lines % V::lanes == 0);

    void largest_below(W const* than, W* largest) const {
        typename V::type bound[registers], most[registers] = {};
#pragma GCC unroll 16
        for (int r = 0; r < registers; ++r) bound[r] = V::load(than + r * V::lanes);
        for (std::int64_t k = 0; k < n_; ++k)
#pragma GCC unroll 16
            for (int r = 0; r < registers; ++r) {
                typename V::type const key = V::load(keys_ + k * lines + r * V::lanes);
                typename V::type const candidate = key < bound[r] ? key : typename V::type{};
                most[r] = candidate > most[r] ? candidate : most[r];
            }
        std::memcpy(largest, most, sizeof most);
    }

    W const* keys_;
    std::int64_t n_;
};

/// Keys as unsigned numbers in the same order.
template <class K> using UnsignedKey = std::make_unsigned_t<K>;
template <class K>
constexpr UnsignedKey<K> key_offset = std::is_signed_v<K>
                                          ? static_cast<UnsignedKey<K>>(UnsignedKey<K>(1) << (8 * sizeof(K) - 1))
                                          : UnsignedKey<K>(0);
template <class K> UnsignedKey<K> unsigned_key(K key) {
    return static_cast<UnsignedKey<K>>(static_cast<UnsignedKey<K>>(key) ^ key_offset<K>);
}

template <class K, class W> K key_of(W key) { return static_cast<K>(static_cast<UnsignedKey<K>>(key) ^ key_offset<K>); }

/// Medians of lines; W is unsigned, as wide as K or wider, and holds the length of a line.
template <class K, class W>
std::int64_t medians_of(Lines<K> const& lines, ConstView in, AnyView out, std::int64_t row, VoxelBytes const& none) {
    constexpr std::int64_t together = median_lines_together;
    W const highest = unsigned_key(highest_number<K>(in.type));
    std::vector<W> keys(static_cast<std::size_t>(lines.n * together));
    for (std::int64_t k = 0; k < lines.n; ++k) {
        alignas(64) K voxels[together] = {};
        for (std::int64_t i = 0; i < lines.pixels; ++i) voxels[i] = lines.first[k * lines.step + i * lines.pixel];
        load_keys(in.type, reinterpret_cast<std::byte const*>(voxels), voxels, together);
        W* const to = keys.data() + k * together;
        for (std::int64_t i = 0; i < together; ++i) to[i] = unsigned_key(voxels[i]);
    }
    MiddleKeys<W> const middle(keys.data(), lines.n);
    alignas(64) W count[together], lower[together], upper[together];
    std::fill_n(count, together, static_cast<W>(lines.n));
    if (!is_integer(in.type)) { // then there are keys above that of infinity
        std::fill_n(lower, together, static_cast<W>(highest + 1));
        middle.count_less(lower, count);
    }
    middle.find(count, lower, upper);
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
        using W = std::conditional_t<sizeof(K) == 1, std::uint16_t, UnsignedKey<K>>;
        for_each_lines<K>(image, from, median_lines_together, execution, [&](Lines<K> const& lines) {
            std::int64_t missing = 0;
            if (lines.n <= static_cast<std::int64_t>(std::min<std::uint64_t>(std::numeric_limits<W>::max(), 1u << 31)))
                missing = medians_of<K, W>(lines, in, out, image.row(), none);
            else
                missing = medians_of<K, std::uint64_t>(lines, in, out, image.row(), none);
            if (missing == 0) return;
#pragma omp atomic
            nan += missing;
        });
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
