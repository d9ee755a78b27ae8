// Bits of voxels: comparisons make bytes, which the sign bits of vectors gather.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/bits.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/shuffle.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class T> using Comparable = std::conditional_t<std::is_same_v<T, Half>, float, T>;

template <class T> struct IsObject {
    Comparable<T> zero;
    bool any;
    bool operator()(T const* p) const {
        auto const v = static_cast<Comparable<T>>(*p);
        if constexpr (std::is_integral_v<T>)
            return !any | (v != zero);
        else
            return any ? (v < zero) | (v > zero) : v == v;
    }
};
template <class T> struct IsHole {
    Comparable<T> zero;
    bool any;
    bool operator()(T const* p) const { return any & (static_cast<Comparable<T>>(*p) == zero); }
};
template <class T> struct IsChanged {
    bool operator()(T const* p) const {
        return !(static_cast<Comparable<T>>(p[0]) == static_cast<Comparable<T>>(p[-1]));
    }
};
template <class T> struct IsNumber {
    bool operator()(T const* p) const { return static_cast<Comparable<T>>(*p) == static_cast<Comparable<T>>(*p); }
};

/// Bits from voxel `first` on; those before it are 1.
template <class T, class F>
void pack_row(T const* row, std::int64_t n, std::int64_t first, F const f, std::uint64_t* bits) {
    for (std::int64_t x = 0; x < n; x += 64) {
        alignas(64) std::uint8_t flags[64];
        if (x >= first && x + 64 <= n) {
#pragma omp simd
            for (int i = 0; i < 64; ++i) flags[i] = f(row + x + i) ? 1 : 0;
        } else {
            for (int i = 0; i < 64; ++i) flags[i] = x + i < n && (x + i < first || f(row + x + i)) ? 1 : 0;
        }
        *bits++ = gathered_bits(flags);
    }
}

} // namespace

void pack_bits(ConstView in, BitRule rule, std::optional<double> zero, std::uint64_t* bits,
               Execution const& execution) {
    if (in.box.empty()) return;
    Index3 const n = in.dims();
    std::int64_t const words = bit_words(n.x);
    with_type(in.type, [&]<class T>(T) {
        auto const stored = static_cast<Comparable<T>>(zero.value_or(0));
        View<T const> const view = in.as<T>();
        auto const pack = [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t r = begin; r < end; ++r) {
                T const* const row = view.data + r % n.y * view.row + r / n.y * view.slice;
                std::uint64_t* const to = bits + r * words;
                switch (rule) {
                case BitRule::object:
                    pack_row(row, n.x, 0, IsObject<T>{stored, zero.has_value()}, to);
                    break;
                case BitRule::hole:
                    pack_row(row, n.x, 0, IsHole<T>{stored, zero.has_value()}, to);
                    break;
                case BitRule::changed:
                    pack_row(row, n.x, 1, IsChanged<T>{}, to);
                    break;
                case BitRule::number:
                    pack_row(row, n.x, 0, IsNumber<T>{}, to);
                    break;
                }
            }
        };
        // Single rows are asked for as well: a parallel region for each would cost more than the row.
        int const threads = threads_for(execution, in.box.voxels());
        if (threads == 1)
            pack(0, n.y * n.z);
        else
            for_each_item(execution, threads, n.y * n.z, pack);
    });
}

} // namespace VKT_BACKEND

} // namespace vkt
