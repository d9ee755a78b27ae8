// Samplers: what a ray may ask of a volume. Lattices answer by trilinear interpolation; others (AMR) plug in here.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/intrinsics.h"
#include "libvkt/render/inner/ray.h"
#include "libvkt/render/inner/voxel_type.h"

#include <concepts>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace vkt::render {

/// Samples that are taken together along a ray: on CPUs more than a register holds, because what is done with those of
/// one waits for itself most of the time; on GPUs, which have other rays to go on with, one, so that it stays in
/// registers. What is seen is the same.
#ifdef __CUDACC__
inline constexpr int chunk = 1;
#else
inline constexpr int chunk = 32;
#endif

/// value(): the stored value at a lattice position inside the box (NaN: no data),
/// gradient(): its derivative per lattice unit, values() and gradients(): `chunk` positions origin + t[k]*direction at
/// once, with the same bits as one by one; or, in both, the first few of them.
template <class S>
concept Sampler = requires(S const& s, Float3 p, float const* t, float* out) {
    { s.value(p) } -> std::same_as<float>;
    { s.gradient(p) } -> std::same_as<Float3>;
    s.values(p, p, t, out);
    s.gradients(p, p, t, out, out, out);
};

/// Segments whose light is added up together, of those of a chunk that show something: where gradients may be asked for
/// only some of these.
inline constexpr int group = chunk < 16 ? chunk : 16;
template <class S>
concept GroupSampler = requires(S const& s, Float3 p, float const* t, float* out) {
    s.template gradients<group>(p, p, t, out, out, out);
};

/// Samplers that know the points of a batch by their numbers, and the middles of its segments: the values at `count`
/// points from one on, gradients in n middles.
template <class S>
concept NumberedSampler = requires(S const& s, float* out) {
    s.values_of(0, chunk, out);
    s.template gradients_of<group>(0, out, out, out);
};

/// What rays that go anywhere may ask: the value at a position and its derivative, in the precision that positions
/// need; and the grid of macrocells.
template <class S>
concept ScalarField = requires(S const& s, typename S::Vector p) {
    typename S::Real;
    { s.value(p) } -> std::same_as<float>;
    { s.gradient(p) } -> std::same_as<Float3>;
    { S::place(Double3{}) } -> std::same_as<typename S::Vector>;
    { s.cell_origin() } -> std::same_as<typename S::Vector>;
    { s.cell_size() } -> std::same_as<typename S::Real>;
};

/// Base for samplers that have only value() and gradient(): asks them one by one.
template <class Derived> struct PointSampler {
    template <int n = chunk>
    VKT_HD void values(Float3 origin, Float3 direction, float const* t, float* out, int count = n) const {
        for (int k = 0; k < count; ++k) out[k] = static_cast<Derived const&>(*this).value(origin + direction * t[k]);
    }
    template <int n = chunk>
    VKT_HD void gradients(Float3 origin, Float3 direction, float const* t, float* gx, float* gy, float* gz) const {
        for (int k = 0; k < n; ++k) {
            Float3 const g = static_cast<Derived const&>(*this).gradient(origin + direction * t[k]);
            gx[k] = g.x, gy[k] = g.y, gz[k] = g.z;
        }
    }
};

/// A padded lattice of voxels of type T: voxel (i,j,k) of the padded array lies at lattice position (i,j,k).
/// The array is followed by at least 16 readable bytes, because lanes fetch four words at a time.
template <class T> struct LatticeSampler {
    using Real = float;
    using Vector = Float3;
    T const* data;
    std::int64_t row, slice;
    bool compact; ///< offsets within one chunk of a ray fit into 31 bits

    static constexpr bool skips_exactly = false; ///< the reference looks at every cell

    VKT_HD static Vector place(Double3 p) { return to_float(p); }
    VKT_HD static Vector cell_origin() { return {macrocell_origin, macrocell_origin, macrocell_origin}; }
    VKT_HD static Real cell_size() { return macrocell_size; }

    /// No voxel is NaN.
    VKT_HD bool all_there() const { return std::is_integral_v<T>; }
    VKT_HD static float mix(float a, float b, float f) { return a + (b - a) * f; }

    /// The voxel at an index of the padded array.
    VKT_HD float voxel(int x, int y, int z) const { return static_cast<float>(data[x + y * row + z * slice]); }
    VKT_HD float value(Float3 p) const {
        int const x = static_cast<int>(p.x), y = static_cast<int>(p.y), z = static_cast<int>(p.z);
        float const fx = p.x - static_cast<float>(x), fy = p.y - static_cast<float>(y),
                    fz = p.z - static_cast<float>(z);
        return cell_value(data + (x + y * row + z * slice), fx, fy, fz);
    }
    VKT_HD float cell_value(T const* v, float fx, float fy, float fz) const {
        T const* w = v + slice;
        float const a = mix(static_cast<float>(v[0]), static_cast<float>(v[1]), fx);
        float const b = mix(static_cast<float>(v[row]), static_cast<float>(v[row + 1]), fx);
        float const c = mix(static_cast<float>(w[0]), static_cast<float>(w[1]), fx);
        float const d = mix(static_cast<float>(w[row]), static_cast<float>(w[row + 1]), fx);
        return mix(mix(a, b, fy), mix(c, d, fy), fz);
    }
    /// Trilinear interpolation of central differences: continuous, second order.
    VKT_HD Float3 gradient(Float3 p) const {
        int const x = static_cast<int>(p.x), y = static_cast<int>(p.y), z = static_cast<int>(p.z);
        float const fx = p.x - static_cast<float>(x), fy = p.y - static_cast<float>(y),
                    fz = p.z - static_cast<float>(z);
        T const* v = data + (x + y * row + z * slice);
        return {0.5F * (cell_value(v + 1, fx, fy, fz) - cell_value(v - 1, fx, fy, fz)),
                0.5F * (cell_value(v + row, fx, fy, fz) - cell_value(v - row, fx, fy, fz)),
                0.5F * (cell_value(v + slice, fx, fy, fz) - cell_value(v - slice, fx, fy, fz))};
    }
    /// The eight corners of the lattice cell with lower corner (x,y,z), x fastest.
    VKT_HD void corners(int x, int y, int z, float* c) const {
        T const* v = data + (x + y * row + z * slice);
        T const* w = v + slice;
        put_four(c, v[0], v[1], v[row], v[row + 1]);
        put_four(c + 4, w[0], w[1], w[row], w[row + 1]);
    }

    /// On CPUs in one piece, as it is read again at once: of four they could not forward the stores.
    VKT_HD static void put_four(float* to, T a, T b, T c, T d) {
#ifdef __CUDACC__
        to[0] = static_cast<float>(a), to[1] = static_cast<float>(b);
        to[2] = static_cast<float>(c), to[3] = static_cast<float>(d);
#else
        using Whole = std::int32_t __attribute__((vector_size(16)));
        Quad four;
        if constexpr (std::is_integral_v<T>)
            four = __builtin_convertvector((Whole{a, b, c, d}), Quad);
        else
            four = Quad{a, b, c, d};
        std::memcpy(to, &four, sizeof four);
#endif
    }

    template <int n = chunk> VKT_HD void values(Float3 o, Float3 d, float const* t, float* out, int count = n) const;
    template <int n = chunk>
    VKT_HD void gradients(Float3 o, Float3 d, float const* t, float* gx, float* gy, float* gz) const;
};

/// The same of voxels of any type.
template <> struct LatticeSampler<AnyVoxel> {
    using Real = float;
    using Vector = Float3;
    void const* data;
    std::int64_t row, slice;
    bool compact;
    LatticeType type;

    static constexpr bool skips_exactly = false;

    VKT_HD static Vector place(Double3 p) { return to_float(p); }
    VKT_HD static Vector cell_origin() { return LatticeSampler<float>::cell_origin(); }
    VKT_HD static Real cell_size() { return LatticeSampler<float>::cell_size(); }

    /// Calls f(sampler) with that of the type.
    template <class F> VKT_HD decltype(auto) with(F&& f) const {
        return with_lattice_type(
            type, [&]<class T>(T) __attribute__((always_inline)) {
                return f(LatticeSampler<T>{static_cast<T const*>(data), row, slice, compact});
            });
    }
    VKT_HD bool all_there() const { return type != LatticeType::float32; }
    VKT_HD float voxel(int x, int y, int z) const {
        return with([&](auto const& s) __attribute__((always_inline)) { return s.voxel(x, y, z); });
    }
    VKT_HD float value(Float3 p) const {
        return with([&](auto const& s) __attribute__((always_inline)) { return s.value(p); });
    }
    VKT_HD Float3 gradient(Float3 p) const {
        return with([&](auto const& s) __attribute__((always_inline)) { return s.gradient(p); });
    }
    VKT_HD void corners(int x, int y, int z, float* c) const {
        with([&](auto const& s) __attribute__((always_inline)) { s.corners(x, y, z, c); });
    }
    template <int n = chunk> VKT_HD void values(Float3 o, Float3 d, float const* t, float* out, int count = n) const {
        with([&](auto const& s) __attribute__((always_inline)) { s.template values<n>(o, d, t, out, count); });
    }
    template <int n = chunk>
    VKT_HD void gradients(Float3 o, Float3 d, float const* t, float* gx, float* gy, float* gz) const {
        with([&](auto const& s) __attribute__((always_inline)) { s.template gradients<n>(o, d, t, gx, gy, gz); });
    }
};

#if defined(__AVX512F__) && !defined(__CUDACC__)
#define VKT_LANES 16
/// Thin names for the sixteen-lane instructions that sampling needs.
struct Lanes {
    using F = __m512;
    using I = __m512i;
    static VKT_HD __m128 four(char const* p) { return _mm_loadu_ps(reinterpret_cast<float const*>(p)); }
    static VKT_HD F load(float const* p) { return _mm512_loadu_ps(p); }
    static VKT_HD void store(float* p, F a) { _mm512_storeu_ps(p, a); }
    static VKT_HD F set(float a) { return _mm512_set1_ps(a); }
    static VKT_HD I set(int a) { return _mm512_set1_epi32(a); }
    static VKT_HD F add(F a, F b) { return _mm512_add_ps(a, b); }
    static VKT_HD F sub(F a, F b) { return _mm512_sub_ps(a, b); }
    static VKT_HD F mul(F a, F b) { return _mm512_mul_ps(a, b); }
    static VKT_HD I add(I a, I b) { return _mm512_add_epi32(a, b); }
    static VKT_HD I sub(I a, I b) { return _mm512_sub_epi32(a, b); }
    static VKT_HD I mul(I a, I b) { return _mm512_mullo_epi32(a, b); }
    static VKT_HD I whole(F a) { return _mm512_cvttps_epi32(a); }
    static VKT_HD F real(I a) { return _mm512_cvtepi32_ps(a); }
    static VKT_HD I gather(void const* p, I i) { return _mm512_i32gather_epi32(i, p, 1); }
    static VKT_HD I least(I a, I b) { return _mm512_min_epi32(a, b); }
    static VKT_HD I load(std::int32_t const* p) { return _mm512_loadu_si512(p); }
    static VKT_HD F gather_floats(float const* p, I i) { return _mm512_i32gather_ps(i, p, 4); }
    /// a * b where a is positive, 0 elsewhere, whatever b is.
    static VKT_HD F positive_times(F a, F b) {
        return _mm512_maskz_mul_ps(_mm512_cmp_ps_mask(a, _mm512_setzero_ps(), _CMP_GT_OQ), a, b);
    }
    static VKT_HD I words(F a) { return _mm512_castps_si512(a); }
    static VKT_HD void store(std::int32_t* p, I a) { _mm512_storeu_si512(p, a); }
    /// The words at p + at[0], p + at[4], …, four of each.
    static VKT_HD F fours(char const* p, std::int32_t const* at) {
        __m512 const two = _mm512_insertf32x4(_mm512_castps128_ps512(four(p + at[0])), four(p + at[4]), 1);
        return _mm512_insertf32x4(_mm512_insertf32x4(two, four(p + at[8]), 2), four(p + at[12]), 3);
    }
    static VKT_HD F low(F a, F b) { return _mm512_unpacklo_ps(a, b); }
    static VKT_HD F high(F a, F b) { return _mm512_unpackhi_ps(a, b); }
    static VKT_HD F fronts(F a, F b) { return _mm512_shuffle_ps(a, b, 0x44); }
    static VKT_HD F backs(F a, F b) { return _mm512_shuffle_ps(a, b, 0xee); }
    static VKT_HD I mask(I a, int m) { return _mm512_and_si512(a, set(m)); }
    template <int n> static VKT_HD I right(I a) { return _mm512_srli_epi32(a, n); }
    template <int n> static VKT_HD I right_signed(I a) { return _mm512_srai_epi32(a, n); }
    template <int n> static VKT_HD I left(I a) { return _mm512_slli_epi32(a, n); }
    static VKT_HD I right(I a, I n) { return _mm512_srlv_epi32(a, n); }
};
#elif defined(__AVX2__) && !defined(__CUDACC__)
#define VKT_LANES 8
/// Thin names for the eight-lane instructions that sampling needs.
struct Lanes {
    using F = __m256;
    using I = __m256i;
    static VKT_HD __m128 four(char const* p) { return _mm_loadu_ps(reinterpret_cast<float const*>(p)); }
    static VKT_HD F load(float const* p) { return _mm256_loadu_ps(p); }
    static VKT_HD void store(float* p, F a) { _mm256_storeu_ps(p, a); }
    static VKT_HD F set(float a) { return _mm256_set1_ps(a); }
    static VKT_HD I set(int a) { return _mm256_set1_epi32(a); }
    static VKT_HD F add(F a, F b) { return _mm256_add_ps(a, b); }
    static VKT_HD F sub(F a, F b) { return _mm256_sub_ps(a, b); }
    static VKT_HD F mul(F a, F b) { return _mm256_mul_ps(a, b); }
    static VKT_HD I add(I a, I b) { return _mm256_add_epi32(a, b); }
    static VKT_HD I sub(I a, I b) { return _mm256_sub_epi32(a, b); }
    static VKT_HD I mul(I a, I b) { return _mm256_mullo_epi32(a, b); }
    static VKT_HD I whole(F a) { return _mm256_cvttps_epi32(a); }
    static VKT_HD F real(I a) { return _mm256_cvtepi32_ps(a); }
    static VKT_HD I gather(void const* p, I i) { return _mm256_i32gather_epi32(static_cast<int const*>(p), i, 1); }
    static VKT_HD I least(I a, I b) { return _mm256_min_epi32(a, b); }
    static VKT_HD I load(std::int32_t const* p) { return _mm256_loadu_si256(reinterpret_cast<__m256i const*>(p)); }
    static VKT_HD F gather_floats(float const* p, I i) { return _mm256_i32gather_ps(p, i, 4); }
    /// a * b where a is positive, 0 elsewhere, whatever b is.
    static VKT_HD F positive_times(F a, F b) {
        return _mm256_and_ps(_mm256_mul_ps(a, b), _mm256_cmp_ps(a, _mm256_setzero_ps(), _CMP_GT_OQ));
    }
    static VKT_HD I words(F a) { return _mm256_castps_si256(a); }
    static VKT_HD void store(std::int32_t* p, I a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a); }
    /// The words at p + at[0] and p + at[4], four of each.
    static VKT_HD F fours(char const* p, std::int32_t const* at) {
        return _mm256_insertf128_ps(_mm256_castps128_ps256(four(p + at[0])), four(p + at[4]), 1);
    }
    static VKT_HD F low(F a, F b) { return _mm256_unpacklo_ps(a, b); }
    static VKT_HD F high(F a, F b) { return _mm256_unpackhi_ps(a, b); }
    static VKT_HD F fronts(F a, F b) { return _mm256_shuffle_ps(a, b, 0x44); }
    static VKT_HD F backs(F a, F b) { return _mm256_shuffle_ps(a, b, 0xee); }
    static VKT_HD I mask(I a, int m) { return _mm256_and_si256(a, set(m)); }
    template <int n> static VKT_HD I right(I a) { return _mm256_srli_epi32(a, n); }
    template <int n> static VKT_HD I right_signed(I a) { return _mm256_srai_epi32(a, n); }
    template <int n> static VKT_HD I left(I a) { return _mm256_slli_epi32(a, n); }
    static VKT_HD I right(I a, I n) { return _mm256_srlv_epi32(a, n); }
};
#endif

#ifdef VKT_LANES
/// Positions of several samples at once: byte offsets of their cells from a base voxel, and fractions. The offsets lie
/// in memory: where processors gather slowly, a load of what each lane needs is several times as fast.
struct LaneCells {
    alignas(64) std::int32_t offset[VKT_LANES];
    Lanes::F fx, fy, fz;
};

/// Four words in a row of every lane, or the first two of them.
struct LaneWords {
    Lanes::F a, b, c, d;
};
VKT_HD LaneWords lane_words(char const* base, std::int32_t const* offset) {
    // A lane of 128 bits holds those of one sample first, and then the same word of four samples in a row.
    Lanes::F const s0 = Lanes::fours(base, offset), s1 = Lanes::fours(base, offset + 1),
                   s2 = Lanes::fours(base, offset + 2), s3 = Lanes::fours(base, offset + 3);
    Lanes::F const low01 = Lanes::low(s0, s1), low23 = Lanes::low(s2, s3), high01 = Lanes::high(s0, s1),
                   high23 = Lanes::high(s2, s3);
    return {Lanes::fronts(low01, low23), Lanes::backs(low01, low23), Lanes::fronts(high01, high23),
            Lanes::backs(high01, high23)};
}

/// Of two voxels of 16 bits in one word.
template <class T> VKT_HD Lanes::F lane_low(Lanes::I w) {
    if constexpr (std::is_signed_v<T>)
        return Lanes::real(Lanes::right_signed<16>(Lanes::left<16>(w)));
    else
        return Lanes::real(Lanes::mask(w, 65535));
}
template <class T> VKT_HD Lanes::F lane_high(Lanes::I w) {
    if constexpr (std::is_signed_v<T>)
        return Lanes::real(Lanes::right_signed<16>(w));
    else
        return Lanes::real(Lanes::right<16>(w));
}
VKT_HD Lanes::F lane_mix(Lanes::F a, Lanes::F b, Lanes::F f) { return Lanes::add(a, Lanes::mul(Lanes::sub(b, a), f)); }

/// Two neighbours along x, interpolated.
template <class T> VKT_HD Lanes::F lane_pair(char const* base, std::int32_t const* offset, Lanes::F f) {
    if constexpr (std::is_same_v<T, float>) {
        LaneWords const v = lane_words(base, offset);
        return lane_mix(v.a, v.b, f);
    }
    Lanes::I const w = Lanes::words(lane_words(base, offset).a);
    if constexpr (sizeof(T) == 1)
        return lane_mix(Lanes::real(Lanes::mask(w, 255)), Lanes::real(Lanes::mask(Lanes::right<8>(w), 255)), f);
    else
        return lane_mix(lane_low<T>(w), lane_high<T>(w), f);
}
/// The same of the pair before, the pair and the pair behind it.
struct LaneRow {
    Lanes::F back, here, ahead;
};
template <class T> VKT_HD LaneRow lane_row(char const* base, std::int32_t const* offset, Lanes::F f) {
    Lanes::F a, b, c, d;
    if constexpr (std::is_same_v<T, float>) {
        LaneWords const v = lane_words(base - 4, offset);
        a = v.a, b = v.b, c = v.c, d = v.d;
    } else if constexpr (sizeof(T) == 1) {
        Lanes::I const w = Lanes::words(lane_words(base - 1, offset).a);
        a = Lanes::real(Lanes::mask(w, 255)), b = Lanes::real(Lanes::mask(Lanes::right<8>(w), 255));
        c = Lanes::real(Lanes::mask(Lanes::right<16>(w), 255)), d = Lanes::real(Lanes::right<24>(w));
    } else {
        LaneWords const two = lane_words(base - 2, offset);
        Lanes::I const v = Lanes::words(two.a), w = Lanes::words(two.b);
        a = lane_low<T>(v), b = lane_high<T>(v), c = lane_low<T>(w), d = lane_high<T>(w);
    }
    return {lane_mix(a, b, f), lane_mix(b, c, f), lane_mix(c, d, f)};
}
template <class T>
VKT_HD Lanes::F lane_cell(char const* base, LaneCells const& c, std::int64_t row, std::int64_t slice) {
    Lanes::F const p = lane_pair<T>(base, c.offset, c.fx), q = lane_pair<T>(base + row, c.offset, c.fx);
    Lanes::F const r = lane_pair<T>(base + slice, c.offset, c.fx);
    Lanes::F const s = lane_pair<T>(base + row + slice, c.offset, c.fx);
    return lane_mix(lane_mix(p, q, c.fy), lane_mix(r, s, c.fy), c.fz);
}
/// Central differences of them. Twelve rows along x meet the six cells whose values are taken, four of them with all
/// three pairs.
template <class T>
VKT_HD void lane_gradients(char const* base, LaneCells const& c, std::int64_t row_bytes, std::int64_t slice_bytes,
                           float* gx, float* gy, float* gz) {
    Lanes::F const half = Lanes::set(0.5F);
    auto const row_of = [&](int dy, int dz) __attribute__((always_inline)) {
        return lane_row<T>(base + dy * row_bytes + dz * slice_bytes, c.offset, c.fx);
    };
    auto const pair = [&](int dy, int dz) __attribute__((always_inline)) {
        return lane_pair<T>(base + dy * row_bytes + dz * slice_bytes, c.offset, c.fx);
    };
    auto const cell = [&](Lanes::F p, Lanes::F q, Lanes::F r, Lanes::F s) __attribute__((always_inline)) {
        return lane_mix(lane_mix(p, q, c.fy), lane_mix(r, s, c.fy), c.fz);
    };
    LaneRow const p = row_of(0, 0), q = row_of(1, 0), r = row_of(0, 1), s = row_of(1, 1);
    Lanes::store(gx, Lanes::mul(half, Lanes::sub(cell(p.ahead, q.ahead, r.ahead, s.ahead),
                                                 cell(p.back, q.back, r.back, s.back))));
    Lanes::store(gy, Lanes::mul(half, Lanes::sub(cell(q.here, pair(2, 0), s.here, pair(2, 1)),
                                                 cell(pair(-1, 0), p.here, pair(-1, 1), r.here))));
    Lanes::store(gz, Lanes::mul(half, Lanes::sub(cell(r.here, s.here, pair(0, 2), pair(1, 2)),
                                                 cell(pair(0, -1), pair(1, -1), p.here, q.here))));
}
VKT_HD LaneCells lane_cells(Float3 o, Float3 d, float const* t, Float3 base, int width, int row, int slice) {
    Lanes::F const time = Lanes::load(t);
    Lanes::F const x = Lanes::add(Lanes::set(o.x), Lanes::mul(Lanes::set(d.x), time));
    Lanes::F const y = Lanes::add(Lanes::set(o.y), Lanes::mul(Lanes::set(d.y), time));
    Lanes::F const z = Lanes::add(Lanes::set(o.z), Lanes::mul(Lanes::set(d.z), time));
    Lanes::I const ix = Lanes::whole(x), iy = Lanes::whole(y), iz = Lanes::whole(z);
    Lanes::I const jx = Lanes::sub(ix, Lanes::set(static_cast<int>(base.x)));
    Lanes::I const jy = Lanes::sub(iy, Lanes::set(static_cast<int>(base.y)));
    Lanes::I const jz = Lanes::sub(iz, Lanes::set(static_cast<int>(base.z)));
    LaneCells cells;
    Lanes::store(cells.offset,
                 Lanes::add(Lanes::mul(jx, Lanes::set(width)),
                            Lanes::add(Lanes::mul(jy, Lanes::set(row)), Lanes::mul(jz, Lanes::set(slice)))));
    cells.fx = Lanes::sub(x, Lanes::real(ix)), cells.fy = Lanes::sub(y, Lanes::real(iy));
    cells.fz = Lanes::sub(z, Lanes::real(iz));
    return cells;
}
#endif

template <class T>
template <int n>
VKT_HD void LatticeSampler<T>::values(Float3 o, Float3 d, float const* t, float* out, int count) const {
#ifdef VKT_LANES
    if (compact) {
        Float3 const first = o + d * t[0];
        int const x = static_cast<int>(first.x), y = static_cast<int>(first.y), z = static_cast<int>(first.z);
        auto const base = reinterpret_cast<char const*>(data + (x + y * row + z * slice));
        auto const row_bytes = row * static_cast<std::int64_t>(sizeof(T));
        auto const slice_bytes = slice * static_cast<std::int64_t>(sizeof(T));
        for (int k = 0; k < count; k += VKT_LANES) {
            LaneCells const c = lane_cells(o, d, t + k, first, static_cast<int>(sizeof(T)), static_cast<int>(row_bytes),
                                           static_cast<int>(slice_bytes));
            Lanes::store(out + k, lane_cell<T>(base, c, row_bytes, slice_bytes));
        }
        return;
    }
#endif
    for (int k = 0; k < count; ++k) out[k] = value(o + d * t[k]);
}

template <class T>
template <int n>
VKT_HD void LatticeSampler<T>::gradients(Float3 o, Float3 d, float const* t, float* gx, float* gy, float* gz) const {
#ifdef VKT_LANES
    if (compact) {
        Float3 const first = o + d * t[0];
        int const x = static_cast<int>(first.x), y = static_cast<int>(first.y), z = static_cast<int>(first.z);
        auto const base = reinterpret_cast<char const*>(data + (x + y * row + z * slice));
        auto const width = static_cast<std::int64_t>(sizeof(T));
        auto const row_bytes = row * width, slice_bytes = slice * width;
        for (int k = 0; k < n; k += VKT_LANES) {
            LaneCells const c = lane_cells(o, d, t + k, first, static_cast<int>(width), static_cast<int>(row_bytes),
                                           static_cast<int>(slice_bytes));
            lane_gradients<T>(base, c, row_bytes, slice_bytes, gx + k, gy + k, gz + k);
        }
        return;
    }
#endif
    for (int k = 0; k < n; ++k) {
        Float3 const g = gradient(o + d * t[k]);
        gx[k] = g.x, gy[k] = g.y, gz[k] = g.z;
    }
}

} // namespace vkt::render
