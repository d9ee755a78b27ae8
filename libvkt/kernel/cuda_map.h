// map and reduce on a GPU: one kernel a functor for all data types, in packs of 16 bytes of the widest type.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_drivers.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace vkt::VKT_BACKEND {

namespace driver {

/// A view as kernels get it: its first byte is that of the output's first voxel.
struct DeviceRows {
    std::byte* data = nullptr;
    DataType type = DataType::uint8;
    int size = 1;
    int size_log = 0;                ///< of the size, to base 2
    std::int64_t row = 0, slice = 0; ///< bytes

    __device__ __forceinline__ std::byte* at(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return data + x * size + y * row + z * slice;
    }
    /// A row of so many; there is nothing to multiply with if it is the only one.
    __device__ __forceinline__ std::byte* row_at(std::int64_t rows, std::int64_t y, std::int64_t z) const {
        return rows == 1 ? data : data + y * row + z * slice;
    }
};
inline DeviceRows device_rows(ConstView view, Box const& box) {
    auto const size = static_cast<std::int64_t>(size_of(view.type));
    return {const_cast<std::byte*>(view.at(box.lower.x, box.lower.y, box.lower.z)),
            view.type,
            static_cast<int>(size),
            std::countr_zero(static_cast<unsigned>(size)),
            view.row * size,
            view.slice * size};
}

/// Calls f(T{}) with the storage type, on the device.
template <class F> __device__ __forceinline__ void with_type(DataType type, F&& f) {
    switch (type) {
    case DataType::uint8:
        return f(std::uint8_t{});
    case DataType::int8:
        return f(std::int8_t{});
    case DataType::uint16:
        return f(std::uint16_t{});
    case DataType::int16:
        return f(std::int16_t{});
    case DataType::uint32:
        return f(std::uint32_t{});
    case DataType::int32:
        return f(std::int32_t{});
    case DataType::uint64:
        return f(std::uint64_t{});
    case DataType::int64:
        return f(std::int64_t{});
    case DataType::float16:
        return f(Half{});
    case DataType::float32:
        return f(float{});
    case DataType::float64:
    default: // so that what is set here is set on every way
        return f(double{});
    }
}

/// A voxel as C; Int128 is made of integers only.
template <class C, class T> __device__ __forceinline__ C as_compute(T v) {
    if constexpr (std::is_same_v<C, Int128> && !std::is_integral_v<T>)
        return C(0);
    else
        return static_cast<C>(v);
}
template <class C> __device__ __forceinline__ C load_value(DataType type, std::byte const* from) {
    C value{};
    with_type(type, [&]<class T>(T) { value = as_compute<C>(*reinterpret_cast<T const*>(from)); });
    return value;
}

struct LossCounts {
    unsigned clipped = 0, nan = 0, undefined = 0;
};

template <class R> __device__ __forceinline__ void store_value(DataType type, std::byte* to, R v, LossCounts& counts) {
    with_type(type, [&]<class T>(T) {
        counts.clipped += is_clipped<T>(v) ? 1 : 0;
        counts.nan += is_lost_nan<T>(v) ? 1 : 0;
        *reinterpret_cast<T*>(to) = round_to<T>(v);
    });
}

/// The bytes of N voxels, 16 at most, in registers.
struct Words {
    unsigned w[4];
};

/// `count` words from an address that is aligned to no more than voxels are: those around it, shifted. Every word that
/// is touched holds at least one of the bytes wanted.
template <int count> __device__ __forceinline__ Words load_shifted(std::byte const* from) {
    auto const address = reinterpret_cast<std::uintptr_t>(from);
    auto const* const words = reinterpret_cast<unsigned const*>(address & ~std::uintptr_t{3});
    auto const shift = static_cast<unsigned>(address & 3) * 8;
    unsigned w[count + 1];
#pragma unroll
    for (int i = 0; i < count; ++i) w[i] = words[i];
    w[count] = shift != 0 ? words[count] : 0;
    Words result{};
#pragma unroll
    for (int i = 0; i < count; ++i) result.w[i] = __funnelshift_r(w[i], w[i + 1], shift);
    return result;
}

/// So many bytes, 2 to 16 and a power of two. `aligned` is the same for all threads.
template <int bytes> __device__ __forceinline__ Words load_words(std::byte const* from, bool aligned) {
    if constexpr (bytes == 2) {
        auto const* const each = reinterpret_cast<unsigned char const*>(from);
        return {aligned ? *reinterpret_cast<unsigned short const*>(from)
                        : each[0] | static_cast<unsigned>(each[1]) << 8};
    } else {
        if (!aligned) return load_shifted<bytes / 4>(from);
        if constexpr (bytes == 4) {
            return {*reinterpret_cast<unsigned const*>(from)};
        } else if constexpr (bytes == 8) {
            uint2 const v = *reinterpret_cast<uint2 const*>(from);
            return {v.x, v.y};
        } else {
            uint4 const v = *reinterpret_cast<uint4 const*>(from);
            return {v.x, v.y, v.z, v.w};
        }
    }
}

template <int bytes> __device__ __forceinline__ void store_words(std::byte* to, Words const& v) {
    if constexpr (bytes == 16)
        *reinterpret_cast<uint4*>(to) = make_uint4(v.w[0], v.w[1], v.w[2], v.w[3]);
    else if constexpr (bytes == 8)
        *reinterpret_cast<uint2*>(to) = make_uint2(v.w[0], v.w[1]);
    else if constexpr (bytes == 4)
        *reinterpret_cast<unsigned*>(to) = v.w[0];
    else
        *reinterpret_cast<unsigned short*>(to) = static_cast<unsigned short>(v.w[0]);
}

/// Voxel i of those in the words, and its way there; i is known when compiling.
template <class T> __device__ __forceinline__ T voxel_of(Words const& words, int i) {
    constexpr int each = sizeof(T) < 4 ? 4 / static_cast<int>(sizeof(T)) : 1;
    if constexpr (sizeof(T) == 8) {
        return detail::bits_as<T>(static_cast<std::uint64_t>(words.w[2 * i + 1]) << 32 | words.w[2 * i]);
    } else if constexpr (sizeof(T) == 4) {
        return detail::bits_as<T>(words.w[i]);
    } else if constexpr (sizeof(T) == 2) {
        return detail::bits_as<T>(static_cast<std::uint16_t>(words.w[i / each] >> (16 * (i % each))));
    } else {
        return detail::bits_as<T>(static_cast<std::uint8_t>(words.w[i / each] >> (8 * (i % each))));
    }
}
template <class T> __device__ __forceinline__ void put_voxel(Words& words, int i, T v) {
    constexpr int each = sizeof(T) < 4 ? 4 / static_cast<int>(sizeof(T)) : 1;
    if constexpr (sizeof(T) == 8) {
        auto const bits = detail::bits_as<std::uint64_t>(v);
        words.w[2 * i] = static_cast<unsigned>(bits);
        words.w[2 * i + 1] = static_cast<unsigned>(bits >> 32);
    } else if constexpr (sizeof(T) == 4) {
        words.w[i] = detail::bits_as<unsigned>(v);
    } else {
        unsigned bits = 0;
        if constexpr (sizeof(T) == 2)
            bits = detail::bits_as<std::uint16_t>(v);
        else
            bits = detail::bits_as<std::uint8_t>(v);
        words.w[i / each] |= bits << (8 * static_cast<int>(sizeof(T)) * (i % each));
    }
}

template <class T> inline constexpr bool is_small_integer = std::is_integral_v<T> && sizeof(T) <= 2;

/// 2^23 as a float: with the bits of an integer below 2^23 in place of its lowest it is their sum.
inline constexpr unsigned unit_bits = 0x4b000000u;
/// 1.5 * 2^23: what is added to it is rounded to an integer, halves to even, which its lowest bits then hold.
inline constexpr float rounding = 12582912.0f;
inline constexpr unsigned rounding_bits = 0x4b400000u;

/// Voxel i of a word of small integers as a float, in two operations: conversions of the hardware take four to eight
/// times as long as additions.
template <class T> __device__ __forceinline__ float small_as_float(unsigned word, int i) {
    constexpr float offset = std::is_signed_v<T> ? (sizeof(T) == 1 ? 128.0f : 32768.0f) : 0.0f;
    unsigned const bits = sizeof(T) == 1
                              ? __byte_perm(word, unit_bits, 0x7440u + static_cast<unsigned>(i)) // byte i, 0, 0, 0x4b
                              : __byte_perm(word, unit_bits, i == 0 ? 0x7410u : 0x7432u);
    return __uint_as_float(bits) - (8388608.0f + offset);
}
/// Signed voxels as unsigned ones that are larger by half of their range.
template <class T> __device__ __forceinline__ unsigned without_sign(unsigned word) {
    return std::is_signed_v<T> ? word ^ (sizeof(T) == 1 ? 0x80808080u : 0x80008000u) : word;
}

#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 800
inline constexpr bool converts_halves = true;
__device__ __forceinline__ float half_as_float(unsigned word, int i) {
    float value;
    asm("cvt.f32.f16 %0, %1;" : "=f"(value) : "h"(static_cast<unsigned short>(word >> (16 * i))));
    return value;
}
__device__ __forceinline__ unsigned halves_of(float low, float high) {
    unsigned word;
    asm("cvt.rn.f16x2.f32 %0, %1, %2;" : "=r"(word) : "f"(high), "f"(low));
    return word;
}
__device__ __forceinline__ unsigned halves_of(double low, double high) {
    unsigned short a, b;
    asm("cvt.rn.f16.f64 %0, %1;" : "=h"(a) : "d"(low));
    asm("cvt.rn.f16.f64 %0, %1;" : "=h"(b) : "d"(high));
    return a | static_cast<unsigned>(b) << 16;
}
#else
inline constexpr bool converts_halves = false;
__device__ __forceinline__ float half_as_float(unsigned, int) { return 0; }
template <class R> __device__ __forceinline__ unsigned halves_of(R, R) { return 0; }
#endif
/// Other than 0 if one of two halves is infinite or NaN.
__device__ __forceinline__ unsigned not_finite(unsigned word) {
    return ((word & 0x7c007c00u) + 0x04000400u) & 0x80008000u;
}

/// 2^52, and 1.5 * 2^52: the same for double.
inline constexpr int unit_bits_double = 0x43300000;
inline constexpr double rounding_double = 6755399441055744.0;
inline constexpr unsigned rounding_bits_double = 0x43380000u;

/// What is added to a signed integer of so many bytes so that it is none.
template <class T>
inline constexpr double sign_offset = std::is_signed_v<T> ? static_cast<double>(std::uint64_t{1} << (8 * sizeof(T) - 1))
                                                          : 0.0;
template <class T> __device__ __forceinline__ double integer_as_double(T v) {
    auto const bits = static_cast<unsigned>(static_cast<std::int64_t>(v) + static_cast<std::int64_t>(sign_offset<T>));
    return __hiloint2double(unit_bits_double, static_cast<int>(bits)) - (4503599627370496.0 + sign_offset<T>);
}

/// The voxels of one pack; a switch over the types is around K of them.
template <class T, int N, class C> __device__ __forceinline__ void widen_pack(Words const& words, C (&v)[N]) {
    if constexpr (is_small_integer<T> && std::is_same_v<C, float>) {
        constexpr int each = 4 / static_cast<int>(sizeof(T));
#pragma unroll
        for (int i = 0; i < N; ++i) v[i] = small_as_float<T>(without_sign<T>(words.w[i / each]), i % each);
    } else if constexpr (std::is_integral_v<T> && sizeof(T) <= 4 && std::is_same_v<C, double>) {
#pragma unroll
        for (int i = 0; i < N; ++i) v[i] = integer_as_double(voxel_of<T>(words, i));
    } else {
        unsigned special = 1; // the hardware has its own idea of NaN
        if constexpr (std::is_same_v<T, Half> && std::is_same_v<C, float> && converts_halves) {
            special = 0;
#pragma unroll
            for (int i = 0; i < N / 2; ++i) special |= not_finite(words.w[i]);
#pragma unroll
            for (int i = 0; i < N; ++i) v[i] = half_as_float(words.w[i / 2], i % 2);
        }
        if (special != 0) {
#pragma unroll
            for (int i = 0; i < N; ++i) v[i] = as_compute<C>(voxel_of<T>(words, i));
        }
    }
}
/// K packs of N voxels at from[k], which are loaded before the first of them is looked at.
template <int K, int N, class C>
__device__ __forceinline__ void load_packs(DataType type, bool aligned, std::byte const* row, int const (&at)[K],
                                           C (&v)[K][N]) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) * N <= 16) {
            Words raw[K];
#pragma unroll
            for (int k = 0; k < K; ++k)
                raw[k] =
                    load_words<static_cast<int>(sizeof(T)) * N>(row + at[k] * static_cast<int>(sizeof(T)), aligned);
#pragma unroll
            for (int k = 0; k < K; ++k) widen_pack<T>(raw[k], v[k]);
        } else {
#pragma unroll
            for (int k = 0; k < K; ++k)
#pragma unroll
                for (int i = 0; i < N; ++i) v[k][i] = C(0); // no pack is as wide
        }
    });
}

/// The lowest bytes, or pairs of bytes, of N integers side by side.
template <class T, int N> __device__ __forceinline__ Words packed(unsigned const (&bits)[N]) {
    Words words{};
#pragma unroll
    for (int i = 0; i + 1 < N; i += 2) {
        if constexpr (sizeof(T) == 2) {
            words.w[i / 2] = __byte_perm(bits[i], bits[i + 1], 0x5410u);
        } else {
            unsigned const pair = __byte_perm(bits[i], bits[i + 1], 0x0040u);
            words.w[i / 4] = i % 4 == 0 ? pair : __byte_perm(words.w[i / 4], pair, 0x5410u);
        }
    }
    return words;
}

/// Integers that are limited to the range of T, side by side.
template <class T, int N> __device__ __forceinline__ Words packed_within(int const (&v)[N]) {
    Words words{};
    if constexpr (sizeof(T) == 4) {
#pragma unroll
        for (int i = 0; i < N; ++i) words.w[i] = static_cast<unsigned>(v[i]);
    } else if constexpr (sizeof(T) == 2) {
#pragma unroll
        for (int i = 0; i + 1 < N; i += 2) {
            if constexpr (std::is_signed_v<T>)
                asm("cvt.pack.sat.s16.s32 %0, %1, %2;" : "=r"(words.w[i / 2]) : "r"(v[i + 1]), "r"(v[i]));
            else
                asm("cvt.pack.sat.u16.s32 %0, %1, %2;" : "=r"(words.w[i / 2]) : "r"(v[i + 1]), "r"(v[i]));
        }
    } else {
#pragma unroll
        for (int i = (N - 1) / 4 * 4; i >= 0; i -= 4) {
            unsigned upper = 0;
            if (i + 3 < N) {
                if constexpr (std::is_signed_v<T>)
                    asm("cvt.pack.sat.s8.s32.b32 %0, %1, %2, 0;"
                        : "=r"(upper)
                        : "r"(v[(i + 3) % N]), "r"(v[(i + 2) % N]));
                else
                    asm("cvt.pack.sat.u8.s32.b32 %0, %1, %2, 0;"
                        : "=r"(upper)
                        : "r"(v[(i + 3) % N]), "r"(v[(i + 2) % N]));
            }
            if constexpr (std::is_signed_v<T>)
                asm("cvt.pack.sat.s8.s32.b32 %0, %1, %2, %3;"
                    : "=r"(words.w[i / 4])
                    : "r"(v[i + 1]), "r"(v[i]), "r"(upper));
            else
                asm("cvt.pack.sat.u8.s32.b32 %0, %1, %2, %3;"
                    : "=r"(words.w[i / 4])
                    : "r"(v[i + 1]), "r"(v[i]), "r"(upper));
        }
    }
    return words;
}

/// To the nearest integer, halves to even, limited to the range of int (of uint32, for it); anything for NaN.
template <class T> __device__ __forceinline__ int limited(float v) { return __float2int_rn(v); }
template <class T> __device__ __forceinline__ int limited(double v) {
    return std::is_same_v<T, std::uint32_t> ? static_cast<int>(__double2uint_rn(v)) : __double2int_rn(v);
}

/// A number plus 1.5 * 2^23 (double: 2^52), whose lowest bits are then the nearest integer, the sign taken off as if it
/// were of type T. What else differs from the bits of that constant, or'ed, says whether all were in range.
template <class T> struct Rounded {
    static constexpr unsigned most = sizeof(T) == 1 ? 0xffu : sizeof(T) == 2 ? 0xffffu : 0xffffffffu;
    unsigned bits, other;

    __device__ __forceinline__ explicit Rounded(float v) {
        bits = __float_as_uint(v + (rounding + static_cast<float>(sign_offset<T>)));
        other = bits ^ rounding_bits;
    }
    __device__ __forceinline__ explicit Rounded(double v) {
        double const sum = v + (rounding_double + sign_offset<T>);
        bits = static_cast<unsigned>(__double2loint(sum));
        other = static_cast<unsigned>(__double2hiint(sum)) ^ rounding_bits_double;
        if constexpr (sizeof(T) < 4) other |= bits & ~most;
    }
};
/// Of those of which this is true none was NaN: the bits of the exponent that differ where all of it is ones.
template <class R> __device__ __forceinline__ bool none_is_nan(unsigned other) {
    constexpr unsigned ones = std::is_same_v<R, float> ? 0x7f800000u ^ (rounding_bits & 0x7f800000u)
                                                       : 0x7ff00000u ^ (rounding_bits_double & 0x7ff00000u);
    return (other & ones) != ones;
}

/// Floating point as integers of up to 32 bits. Where all of a pack are in range an addition rounds and one comparison
/// says so; otherwise they are limited to the range, and those of valid packs that were not in it are counted.
template <class T, int N, class R>
__device__ __forceinline__ Words narrow_integers(R const (&v)[N], bool valid, LossCounts& counts) {
    constexpr unsigned mask = std::is_same_v<R, float> ? ~Rounded<T>::most : ~0u;
    unsigned bits[N], other = 0;
#pragma unroll
    for (int i = 0; i < N; ++i) {
        Rounded<T> const rounded(v[i]);
        bits[i] = rounded.bits;
        other |= rounded.other;
    }
    if ((other & mask) != 0) {
        int within[N];
        unsigned lost = 0, nan = 0;
#pragma unroll
        for (int i = 0; i < N; ++i) {
            if ((Rounded<T>(v[i]).other & mask) != 0) ++lost;
            within[i] = limited<T>(v[i]);
        }
        if (!none_is_nan<R>(other)) {
#pragma unroll
            for (int i = 0; i < N; ++i) {
                nan += v[i] != v[i] ? 1 : 0;
                within[i] = v[i] != v[i] ? 0 : within[i];
            }
        }
        counts.clipped += valid ? lost - nan : 0;
        counts.nan += valid ? nan : 0;
        return packed_within<T>(within);
    }
    if constexpr (sizeof(T) == 4) {
        Words words{};
#pragma unroll
        for (int i = 0; i < N; ++i) words.w[i] = std::is_signed_v<T> ? bits[i] ^ 0x80000000u : bits[i];
        return words;
    } else {
        Words words = packed<T>(bits);
#pragma unroll
        for (unsigned& word : words.w) word = without_sign<T>(word);
        return words;
    }
}

/// Integers of 128 bits as smaller ones: in range is what has nothing above, the sign taken off.
template <class T, int N>
__device__ __forceinline__ Words narrow_wide(Int128 const (&v)[N], bool valid, LossCounts& counts) {
    constexpr auto offset = std::is_signed_v<T> ? std::uint64_t{1} << (8 * sizeof(T) - 1) : std::uint64_t{0};
    Words words{};
#pragma unroll
    for (int i = 0; i < N; ++i) {
        auto const sum = static_cast<unsigned __int128>(v[i]) + offset;
        auto above = static_cast<std::uint64_t>(sum >> 64);
        if constexpr (sizeof(T) < 8) above |= static_cast<std::uint64_t>(sum) >> (8 * sizeof(T));
        T const limit = v[i] < 0 ? std::numeric_limits<T>::min() : std::numeric_limits<T>::max();
        put_voxel(words, i, above != 0 ? limit : static_cast<T>(v[i]));
        counts.clipped += valid && above != 0 ? 1 : 0;
    }
    return words;
}

/// Integers of 128 bits as floating point, rounded by the hardware if they have 64; to a half, 16.
template <class T> __device__ __forceinline__ T wide_as_float(Int128 v) {
    auto const low = static_cast<std::int64_t>(v);
    if (Int128(low) != v) return round_to<T>(v);
    if constexpr (std::is_same_v<T, float>)
        return __ll2float_rn(low);
    else if constexpr (std::is_same_v<T, double>)
        return __ll2double_rn(low);
    else if (converts_halves && low == static_cast<std::int16_t>(low))
        return detail::bits_as<Half>(static_cast<std::uint16_t>(halves_of(static_cast<float>(low), 0.0f)));
    else
        return round_to<T>(v);
}

template <class T, int N, class R>
__device__ __forceinline__ Words narrow_pack(R const (&v)[N], bool valid, LossCounts& counts) {
    constexpr bool adds = std::is_same_v<R, double> ? sizeof(T) <= 4 : std::is_same_v<R, float> && sizeof(T) <= 2;
    if constexpr (std::is_integral_v<T> && adds) {
        return narrow_integers<T>(v, valid, counts);
    } else if constexpr (std::is_integral_v<T> && std::is_same_v<R, Int128>) {
        return narrow_wide<T>(v, valid, counts);
    } else if constexpr (std::is_same_v<R, Int128>) {
        Words words{};
#pragma unroll
        for (int i = 0; i < N; ++i) {
            put_voxel(words, i, wide_as_float<T>(v[i]));
            counts.clipped += valid && is_clipped<T>(v[i]) ? 1 : 0;
        }
        return words;
    } else {
        Words words{};
        unsigned special = 1;
        if constexpr (std::is_same_v<T, Half> && std::is_floating_point_v<R> && converts_halves) {
            special = 0;
#pragma unroll
            for (int i = 0; i < N / 2; ++i) {
                words.w[i] = halves_of(v[2 * i], v[2 * i + 1]);
                special |= not_finite(words.w[i]);
            }
        }
        if (special != 0) {
            words = {};
#pragma unroll
            for (int i = 0; i < N; ++i) {
                counts.clipped += valid && is_clipped<T>(v[i]) ? 1 : 0;
                counts.nan += valid && is_lost_nan<T>(v[i]) ? 1 : 0;
                put_voxel(words, i, round_to<T>(v[i]));
            }
        }
        return words;
    }
}

/// What load_packs() undoes. Packs that are not valid are neither stored nor counted.
template <int K, int N, class R>
__device__ __forceinline__ void store_packs(DataType type, std::byte* row, int const (&at)[K], bool const (&valid)[K],
                                            R const (&v)[K][N], LossCounts& counts) {
    with_type(type, [&]<class T>(T) {
        if constexpr (sizeof(T) * N <= 16) {
#pragma unroll
            for (int k = 0; k < K; ++k) {
                Words const words = narrow_pack<T>(v[k], valid[k], counts);
                if (valid[k])
                    store_words<static_cast<int>(sizeof(T)) * N>(row + at[k] * static_cast<int>(sizeof(T)), words);
            }
        }
    });
}

template <class F, class... C>
concept CountsUndefined = requires(F const& f, C... values) {
    f.undefined(values...);
};

/// Counts of a block into three counters in global memory: one atomic each, if there is anything.
__device__ __forceinline__ void add_counts(LossCounts const& counts, unsigned long long* totals) {
    if (__syncthreads_or(static_cast<int>(counts.clipped | counts.nan | counts.undefined)) == 0) return;
    __shared__ unsigned sums[3];
    unsigned const thread = (threadIdx.z * blockDim.y + threadIdx.y) * blockDim.x + threadIdx.x;
    if (thread < 3) sums[thread] = 0;
    __syncthreads();
    unsigned const own[3] = {__reduce_add_sync(~0u, counts.clipped), __reduce_add_sync(~0u, counts.nan),
                             __reduce_add_sync(~0u, counts.undefined)};
    for (int i = 0; i < 3; ++i)
        if (thread % 32 == 0 && own[i] != 0) atomicAdd(&sums[i], own[i]);
    __syncthreads();
    if (thread < 3 && sums[thread] != 0) atomicAdd(totals + thread, static_cast<unsigned long long>(sums[thread]));
}

template <int inputs> struct Inputs { DeviceRows rows[inputs > 0 ? inputs : 1]; };

/// A functor whose code is long, by its own word: `static constexpr bool is_long = true`.
template <class F>
concept IsLong = requires {
    requires F::is_long;
};

/// There is one copy of a long functor in a kernel, not one for each of the thread's voxels.
template <class F, class... V> __device__ __noinline__ auto called(F const& f, V... v) { return f(v...); }

/// What a functor makes of one voxel at (x, y, z), whose values are v.
template <class C, bool At, class F, std::size_t... k>
__device__ __forceinline__ auto evaluate(F const& f, double x, double y, double z, C const* v, LossCounts& counts,
                                         std::index_sequence<k...>) {
    if constexpr (CountsUndefined<F, decltype(v[k])...>) counts.undefined += f.undefined(v[k]...) ? 1 : 0;
    if constexpr (IsLong<F> && At)
        return called(f, x, y, z, v[k]...);
    else if constexpr (IsLong<F>)
        return called(f, v[k]...);
    else if constexpr (At)
        return f(x, y, z, v[k]...);
    else
        return f(v[k]...);
}
template <class C, bool At, int inputs, class F>
using ResultOf = decltype(evaluate<C, At>(std::declval<F const&>(), 0.0, 0.0, 0.0, std::declval<C const*>(),
                                          std::declval<LossCounts&>(), std::make_index_sequence<inputs>{}));

/// a / b for 0 <= a: in 32 bits where that will do, a fifth of the time.
__device__ __forceinline__ std::int64_t quotient_of(std::int64_t a, std::int64_t b) {
    if (((a | b) >> 32) == 0) return static_cast<unsigned>(a) / static_cast<unsigned>(b);
    return a / b;
}

/// Packs that a thread has in registers at once: the switches over the types and the arithmetic of addresses are paid
/// by many voxels.
template <class C, int N, int inputs> constexpr int packs_at_once() {
    int const voxels = (sizeof(C) == 4 ? 32 : sizeof(C) == 8 ? 16 : 8) / (inputs > 1 ? 2 : 1);
    return std::clamp(voxels / N, 1, 4);
}

/// Voxels of a row before its first pack, which is aligned on the output.
__device__ __forceinline__ int head_of(std::byte const* to, int size_log, int N, std::int64_t nx) {
    int const phase = static_cast<int>(reinterpret_cast<std::uintptr_t>(to) >> size_log) & (N - 1);
    int const head = -phase & (N - 1);
    return head < nx ? head : static_cast<int>(nx);
}

/// Rounds of a thread: what comes before the first voxel, some hundred instructions, is paid by more of them. With 16
/// voxels a pack there are not enough registers for a loop.
template <int N> inline constexpr int most_rounds = N == 16 ? 1 : 4;

/// The whole packs of rows: N consecutive voxels each, those of a thread the block's width apart, and so in each round.
/// `aligned` are the inputs if their packs are where those of the output are.
template <class C, int N, int inputs, bool At, class F>
__global__ void __launch_bounds__(block_threads, sizeof(C) == 4 ? 4 : 3)
    map_packs(Rows rows, int rounds, bool aligned, Index3 lower, DeviceRows out, Inputs<inputs> in,
              __grid_constant__ F const f, unsigned long long* totals) {
    using Result = ResultOf<C, At, inputs, F>;
    constexpr int K = packs_at_once<C, N, inputs>();
    constexpr auto all = std::make_index_sequence<inputs>{};
    std::int64_t const row =
        (static_cast<std::int64_t>(blockIdx.z) * gridDim.y + blockIdx.y) * blockDim.y + threadIdx.y;
    LossCounts counts;
    if (row < rows.rows) {
        std::int64_t const z = rows.rows == rows.ny ? 0 : quotient_of(row, rows.ny), y = row - z * rows.ny;
        std::byte* const to = out.row_at(rows.rows, y, z);
        int const step = static_cast<int>(blockDim.x) * K * N;
        int const passes = most_rounds<N> == 1 ? 1 : rounds;
        std::int64_t x = head_of(to, out.size_log, N, rows.nx) + static_cast<std::int64_t>(blockIdx.x) * passes * step;
#pragma unroll 1
        for (int pass = 0; pass < passes && x + N <= rows.nx; ++pass, x += step) {
            std::int64_t const left = rows.nx - x;
            int const last = left >= step ? step : static_cast<int>(left & ~std::int64_t{N - 1}) - N;
            int at[K];
            bool valid[K];
#pragma unroll
            for (int k = 0; k < K; ++k) {
                at[k] = static_cast<int>(threadIdx.x + k * blockDim.x) * N;
                valid[k] = at[k] <= last;
                at[k] = valid[k] ? at[k] : last;
            }
            C values[inputs + 1][K][N]; // one more, lest there is none
#pragma unroll
            for (int i = 0; i < inputs; ++i)
                load_packs(in.rows[i].type, aligned, in.rows[i].row_at(rows.rows, y, z) + x * in.rows[i].size, at,
                           values[i]);
            Result results[K][N];
#pragma unroll
            for (int k = 0; k < K; ++k) {
                auto const begin = static_cast<double>(lower.x + x + at[k]);
                LossCounts own;
#pragma unroll
                for (int n = 0; n < N; ++n) {
                    C voxel[inputs + 1];
#pragma unroll
                    for (int i = 0; i < inputs; ++i) voxel[i] = values[i][k][n];
                    results[k][n] = evaluate<C, At>(f, begin + n, static_cast<double>(lower.y + y),
                                                    static_cast<double>(lower.z + z), voxel, own, all);
                }
                counts.undefined += valid[k] ? own.undefined : 0;
            }
            store_packs(out.type, to + x * out.size, at, valid, results, counts);
        }
    }
    add_counts(counts, totals);
}

/// The voxels of rows before and after their whole packs, one a thread: 2 * N threads a row.
template <class C, int inputs, bool At, class F>
__global__ void __launch_bounds__(block_threads)
    map_edges(Rows rows, int N, Index3 lower, DeviceRows out, Inputs<inputs> in, __grid_constant__ F const f,
              unsigned long long* totals) {
    std::int64_t const item = static_cast<std::int64_t>(blockIdx.x) * block_threads + threadIdx.x;
    std::int64_t const row = item / (2 * N);
    LossCounts counts;
    if (row < rows.rows) {
        std::int64_t const z = quotient_of(row, rows.ny), y = row - z * rows.ny;
        std::int64_t const head = head_of(out.at(0, y, z), out.size_log, N, rows.nx);
        std::int64_t const tail = head + (rows.nx - head) / N * N;
        std::int64_t const slot = item - row * (2 * N);
        std::int64_t const x = slot < N ? slot : tail + slot - N;
        if (slot < N ? x < head : x < rows.nx) {
            C voxel[inputs + 1];
#pragma unroll
            for (int i = 0; i < inputs; ++i) voxel[i] = load_value<C>(in.rows[i].type, in.rows[i].at(x, y, z));
            auto const result =
                evaluate<C, At>(f, static_cast<double>(lower.x + x), static_cast<double>(lower.y + y),
                                static_cast<double>(lower.z + z), voxel, counts, std::make_index_sequence<inputs>{});
            store_value(out.type, out.at(x, y, z), result, counts);
        }
    }
    add_counts(counts, totals);
}

/// Voxels between the rows of a view and another's, and from a place where a pack begins.
inline bool same_packs(DeviceRows const& a, DeviceRows const& b, int N) {
    auto const phase = [N](DeviceRows const& r) {
        return static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(r.data) / static_cast<unsigned>(r.size)) % N;
    };
    return phase(a) == phase(b) && (a.row / a.size - b.row / b.size) % N == 0 &&
           (a.slice / a.size - b.slice / b.size) % N == 0;
}

// Kernels are launched from function templates: those that only a generic lambda instantiates are not found.
template <class C, int N, bool At, int inputs, class F>
void launch_packs(Box const& box, AnyView out, Inputs<inputs> const& in, F const& f, unsigned long long* totals) {
    DeviceRows const to = device_rows(ConstView(out), out.box);
    bool aligned = true;
    for (int i = 0; i < inputs; ++i) aligned = aligned && same_packs(in.rows[i], to, N);
    Index3 const dims = box.dims();
    if (dims.x >= N) {
        constexpr int K = packs_at_once<C, N, inputs>();
        std::int64_t const packs = (dims.x + N - 1) / N;
        int const rounds = static_cast<int>(std::clamp<std::int64_t>(packs / (block_threads * K), 1, most_rounds<N>));
        Rows rows = rows_of(dims, packs, K * rounds);
        std::int64_t const row_blocks = rows.grid.x / rows.blocks_per_row;
        rows.grid.x = rows.blocks_per_row;
        rows.grid.y = static_cast<unsigned>(std::min<std::int64_t>(row_blocks, 32768));
        rows.grid.z = static_cast<unsigned>((row_blocks + rows.grid.y - 1) / rows.grid.y);
        map_packs<C, N, inputs, At, F>
            <<<rows.grid, rows.block>>>(rows, rounds, aligned, out.box.lower, to, in, f, totals);
    }
    bool const whole = dims.x % N == 0 && reinterpret_cast<std::uintptr_t>(to.data) % (N * to.size) == 0 &&
                       (dims.y * dims.z == 1 || (to.row % (N * to.size) == 0 && to.slice % (N * to.size) == 0));
    if (whole) return;
    Rows edges = rows_of({2 * N, dims.y, dims.z}, 1, 1);
    edges.nx = dims.x;
    std::int64_t const blocks = (edges.rows * 2 * N + block_threads - 1) / block_threads;
    if (blocks > 0x7fffffff)
        throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
    map_edges<C, inputs, At, F>
        <<<static_cast<unsigned>(blocks), block_threads>>>(edges, N, out.box.lower, to, in, f, totals);
}

template <class C, bool At, class F, class... In>
void launch_map_any(AnyView out, Losses& losses, F const& f, In const&... in) {
    if (out.box.empty()) return;
    Box const box = !At && dense(out.box, out, in...) ? as_one_row(out.box) : out.box;
    constexpr int count = static_cast<int>(sizeof...(In));
    Inputs<count> inputs;
    int i = 0;
    ((inputs.rows[i++] = device_rows(in, out.box)), ...);
    std::size_t widest = size_of(out.type);
    ((widest = std::max(widest, size_of(in.type))), ...);
    DeviceLosses const counts;
    if (widest == 8)
        launch_packs<C, 2, At, count>(box, out, inputs, f, counts.get());
    else if (widest == 4)
        launch_packs<C, 4, At, count>(box, out, inputs, f, counts.get());
    else if (widest == 2)
        launch_packs<C, 8, At, count>(box, out, inputs, f, counts.get());
    else
        launch_packs<C, 16, At, count>(box, out, inputs, f, counts.get());
    check_launch("map");
    counts.add_to(losses);
}

inline constexpr std::int64_t segment_voxels = 16384;

/// One partial result a block: every gridDim.x-th segment of the rows, in packs of N voxels; merged in order on the
/// host. How voxels meet depends on nothing but the dims.
template <class C, int N, class R>
__global__ void __launch_bounds__(block_threads)
    reduce_any(DeviceRows in, Index3 dims, std::int64_t segments, R zero, R* parts) {
    constexpr int K = packs_at_once<C, N, 1>();
    R mine = zero;
    for (std::int64_t item = blockIdx.x; item < dims.y * dims.z * segments; item += gridDim.x) {
        std::int64_t const row = quotient_of(item, segments), begin = (item - row * segments) * segment_voxels;
        std::int64_t const z = quotient_of(row, dims.y), y = row - z * dims.y;
        int const n = static_cast<int>(dims.x - begin < segment_voxels ? dims.x - begin : segment_voxels);
        std::byte const* const from = in.at(begin, y, z);
        bool const aligned = reinterpret_cast<std::uintptr_t>(from) % static_cast<unsigned>(N * in.size) == 0;
        for (int x = static_cast<int>(threadIdx.x) * N; x < n; x += K * block_threads * N) {
            int const last = n / N * N - N;
            int at[K];
#pragma unroll
            for (int k = 0; k < K; ++k) at[k] = min(x + k * block_threads * N, last);
            C values[K][N];
            if (last >= 0) load_packs(in.type, aligned, from, at, values);
#pragma unroll
            for (int k = 0; k < K; ++k) {
                int const first = x + k * block_threads * N;
                if (first <= last) {
#pragma unroll
                    for (int i = 0; i < N; ++i) mine.add(values[k][i]);
                } else {
                    for (int i = first; i < n; ++i) mine.add(load_value<C>(in.type, from + i * in.size));
                }
            }
        }
    }
    extern __shared__ __align__(16) unsigned char memory[];
    R* const all = reinterpret_cast<R*>(memory);
    all[threadIdx.x] = mine;
    for (unsigned half = block_threads / 2; half > 0; half /= 2) {
        __syncthreads();
        if (threadIdx.x < half) all[threadIdx.x].merge(all[threadIdx.x + half]);
    }
    if (threadIdx.x == 0) parts[blockIdx.x] = all[0];
}

/// Device memory for the time of one call.
class DeviceScratch {
public:
    explicit DeviceScratch(std::size_t bytes) : data_(device_allocate(bytes)) {}
    ~DeviceScratch() { device_free(data_); }
    DeviceScratch(DeviceScratch const&) = delete;
    DeviceScratch& operator=(DeviceScratch const&) = delete;
    std::byte* get() const { return data_; }

private:
    std::byte* data_;
};

template <class C, int N, class R>
void launch_reduce(DeviceRows in, Index3 dims, unsigned blocks, std::int64_t segments, R const& zero, R* parts) {
    reduce_any<C, N><<<blocks, block_threads, block_threads * sizeof(R)>>>(in, dims, segments, zero, parts);
    check_launch("reduce");
}

} // namespace driver

template <class C, class F, class... In>
void map(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, false>(out, losses, f, in...);
}

template <class C, class F, class... In>
void map_at(Execution const&, AnyView out, Losses& losses, F const& f, In const&... in) {
    driver::launch_map_any<C, true>(out, losses, f, in...);
}

template <class C, class R> R reduce(Execution const&, ConstView in, R const& zero) {
    static_assert(std::is_trivially_copyable_v<R>);
    R result = zero;
    if (in.box.empty()) return result;
    Index3 const dims = in.contiguous() ? Index3{in.box.voxels(), 1, 1} : in.dims();
    std::int64_t const segments = (dims.x + driver::segment_voxels - 1) / driver::segment_voxels;
    auto const blocks = static_cast<unsigned>(std::min<std::int64_t>(dims.y * dims.z * segments, 2048));
    driver::DeviceScratch const scratch(blocks * sizeof(R));
    R* const parts = reinterpret_cast<R*>(scratch.get());
    driver::DeviceRows const rows = driver::device_rows(in, in.box);
    switch (rows.size) {
    case 1:
        driver::launch_reduce<C, 16>(rows, dims, blocks, segments, zero, parts);
        break;
    case 2:
        driver::launch_reduce<C, 8>(rows, dims, blocks, segments, zero, parts);
        break;
    case 4:
        driver::launch_reduce<C, 4>(rows, dims, blocks, segments, zero, parts);
        break;
    default:
        driver::launch_reduce<C, 2>(rows, dims, blocks, segments, zero, parts);
    }
    std::vector<R> host(blocks, zero);
    copy_to_host(host.data(), parts, blocks * sizeof(R));
    for (R const& part : host) result.merge(part);
    return result;
}

} // namespace vkt::VKT_BACKEND
