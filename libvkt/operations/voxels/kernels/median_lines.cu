// Medians of lines of voxels on GPUs: keys found six bits at a time, by counting those that begin like the one in the
// middle; a thread a line, or a warp where a line is a row.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/median_lines.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/voxels/kernels/median_keys.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

constexpr int block = 128, digit_bits = 6, digits = 1 << digit_bits;
constexpr int together = 16; ///< loads of a thread that do not wait for each other

/// Lines that become the pixels of an image. Strides in voxels.
struct Lines {
    std::int64_t across, down; ///< pixels
    std::int64_t pixel_x, pixel_y, step, n;
};

/// The voxels of a line that a thread looks at: all of them, or those of a lane.
template <class T> struct Line {
    using K = OrderKey<T>;
    using U = UnsignedKey<K>;
    T const* first;
    std::int64_t step, n;

    template <class F> __device__ __forceinline__ void for_each(F const& f) const {
        std::int64_t k = 0;
        for (; k + together <= n; k += together) {
            T v[together];
#pragma unroll
            for (int i = 0; i < together; ++i) v[i] = first[(k + i) * step];
#pragma unroll
            for (int i = 0; i < together; ++i) f(key(v[i]));
        }
        for (; k < n; ++k) f(key(first[k * step]));
    }
    static __device__ __forceinline__ U key(T v) { return unsigned_key(to_key<T>(detail::bits_as<K>(v))); }
    /// Above it are all NaN.
    static __device__ __forceinline__ U highest_number() {
        if constexpr (std::is_same_v<T, Half>)
            return key(Half::from_bits(0x7c00));
        else if constexpr (std::is_floating_point_v<T>)
            return key(T(HUGE_VAL));
        else
            return U(~U(0));
    }
};

/// Where in order the wanted key lies among those that begin like it.
template <int lanes> __device__ __forceinline__ unsigned total(unsigned v) {
    if constexpr (lanes == 1) return v;
    return __reduce_add_sync(~0u, v);
}

/// The digit that `rank` falls on, which becomes the rank among keys of that digit. `mine` are this thread's counters,
/// a block apart; a line's lanes are a warp.
template <int lanes> __device__ __forceinline__ unsigned digit_of(unsigned const* mine, unsigned& rank) {
    if constexpr (lanes == 1) {
        unsigned digit = 0;
        for (; digit + 1 < digits; ++digit) {
            unsigned const count = mine[digit * block];
            if (rank < count) break;
            rank -= count;
        }
        return digit;
    } else {
        static_assert(lanes == 32 && digits == 2 * lanes);
        // A lane adds up two digits, those of the other lanes in turns: no two lanes read from a bank at once.
        unsigned const lane = threadIdx.x % lanes;
        unsigned const* const warp = mine - lane;
        unsigned even = 0, odd = 0;
        __syncwarp();
        for (unsigned i = 0; i < lanes; ++i) {
            even += warp[2 * lane * block + (i + lane) % lanes];
            odd += warp[(2 * lane + 1) * block + (i + lane) % lanes];
        }
        __syncwarp();
        unsigned end = even + odd;
        for (int step = 1; step < lanes; step *= 2) {
            unsigned const before = __shfl_up_sync(~0u, end, step);
            if (lane >= static_cast<unsigned>(step)) end += before;
        }
        unsigned const found = __ballot_sync(~0u, rank < end),
                       holder = found == 0 ? lanes - 1 : static_cast<unsigned>(__ffs(static_cast<int>(found)) - 1);
        rank -= __shfl_sync(~0u, end - even - odd, static_cast<int>(holder));
        unsigned const first = __shfl_sync(~0u, even, static_cast<int>(holder));
        bool const second = rank >= first;
        rank -= second ? first : 0;
        return 2 * holder + (second ? 1 : 0);
    }
}

template <class T, int lanes>
__global__ void __launch_bounds__(block)
    medians_kernel(T const* in, Lines lines, __grid_constant__ driver::DeviceRows const out, T none,
                   unsigned long long* totals) {
    using U = typename Line<T>::U;
    constexpr int bits = 8 * sizeof(T);
    __shared__ unsigned counters[digits * block];
    std::int64_t const i = (static_cast<std::int64_t>(blockIdx.x) * block + threadIdx.x) / lanes;
    driver::LossCounts losses;
    if (i < lines.across * lines.down) { // whole warps where a line is one
        std::int64_t const y = driver::quotient_of(i, lines.across), x = i - y * lines.across,
                           lane = threadIdx.x % lanes;
        Line<T> const line{in + x * lines.pixel_x + y * lines.pixel_y + lane * lines.step, lines.step * lanes,
                           (lines.n - lane + lanes - 1) / lanes};
        unsigned* const mine = counters + threadIdx.x;
        unsigned count = 0, rank = 0;
        U upper = 0;
        for (int known = 0; known < bits; known += digit_bits) {
            int const left = max(bits - known - digit_bits, 0), step = min(digit_bits, bits - known);
            for (int d = 0; d < digits; ++d) mine[d * block] = 0;
            U const prefix = upper;
            unsigned numbers = 0;
            line.for_each([&](U key) {
                auto const rest = static_cast<U>(key >> left);
                numbers += key <= Line<T>::highest_number() ? 1 : 0;
                if (static_cast<U>(rest >> step) == prefix) ++mine[(rest & (digits - 1) & ((1U << step) - 1)) * block];
            });
            if (known == 0) {
                count = total<lanes>(numbers);
                rank = count / 2;
            }
            upper = static_cast<U>(static_cast<U>(upper << step) | static_cast<U>(digit_of<lanes>(mine, rank)));
        }
        // Of the keys that are equal to it, there are now `rank` before that in the middle.
        U lower = upper;
        bool const odd = count % 2 != 0;
        if (!odd && rank == 0) { // the whole line agrees
            U below = 0;
            line.for_each([&](U key) { below = key < upper && key > below ? key : below; });
            for (int half = lanes / 2; half > 0; half /= 2) {
                U const other = __shfl_xor_sync(~0u, below, half);
                below = other > below ? other : below;
            }
            lower = below;
        }
        if (lane == 0) {
            using K = typename Line<T>::K;
            *reinterpret_cast<T*>(out.at(x, y, 0)) =
                count > 0 ? median_of<T>(key_of<K>(lower), key_of<K>(upper), odd) : none;
            losses.nan = static_cast<unsigned>(lines.n) - count;
        }
    }
    driver::add_counts(losses, totals);
}

template <class T, int lanes>
void launch(ConstView in, Lines const& lines, driver::DeviceRows const& out, T none, unsigned long long* totals) {
    unsigned const blocks = launch_blocks((lines.across * lines.down * lanes + block - 1) / block);
    if (lines.n > 0xffffffffLL) refuse_launch();
    medians_kernel<T, lanes><<<blocks, block>>>(reinterpret_cast<T const*>(in.data), lines, out, none, totals);
    check_launch("medians of lines");
}

template <class T> void medians_of(ConstView in, AnyView out, int axis, unsigned long long* totals) {
    std::int64_t const strides[3] = {1, in.row, in.slice};
    int const across = axis == 0 ? 1 : 0, down = axis == 2 ? 1 : 2; // the image's x and y
    Index3 const n = in.dims();
    Lines const lines{n[across], n[down], strides[across], strides[down], strides[axis], n[axis]};
    VoxelBytes const bytes = voxel_bytes(out.type, std::numeric_limits<double>::quiet_NaN());
    T none;
    std::memcpy(&none, bytes.data(), sizeof none);
    driver::DeviceRows const to = driver::device_rows(ConstView(out), out.box);
    axis == 0 ? launch<T, 32>(in, lines, to, none, totals) : launch<T, 1>(in, lines, to, none, totals);
}

} // namespace

void median_lines(ConstView in, AnyView out, int axis, std::int64_t& nan, Execution const&) {
    if (out.box.empty()) return;
    driver::DeviceLosses const counts;
    with_type(in.type, [&]<class T>(T) { medians_of<T>(in, out, axis, counts.get()); });
    Losses found;
    counts.add_to(found);
    nan += found.nan;
}

} // namespace VKT_BACKEND
} // namespace vkt
