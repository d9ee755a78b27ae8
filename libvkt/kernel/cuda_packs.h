// Packs of voxels on GPUs: a few that lie side by side, loaded, widened, rounded and stored together.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/cuda_rows.h"

#include <limits>
#include <type_traits>

namespace vkt::VKT_BACKEND {

namespace driver {

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

} // namespace driver

} // namespace vkt::VKT_BACKEND
