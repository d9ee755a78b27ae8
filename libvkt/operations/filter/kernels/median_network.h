// The median of cubes of 3^3 and 5^3 voxels by selection networks, and which sizes have one; the same on all back ends.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/network.h"
#include "libvkt/kernel/stencil.h"

namespace vkt::VKT_BACKEND {

/// (2 r + 1)^3: columns are sorted once, then the middle one of the sorted columns is selected.
template <int r> struct MedianNetwork {
    static constexpr int radius = r, edge = 2 * r + 1, columns = edge * edge;

    template <class W, class V> VKT_HD void column(W const& window, V* sorted) const {
        unrolled<columns>([&](int k) { sorted[k] = window(0, k % edge - r, k / edge - r); });
        apply_network<SortingNetwork<columns>>(sorted);
    }
    template <class W> VKT_HD typename W::Value combine(W const& sorted) const {
        using Median = MedianOfSorted<edge, columns>;
        typename W::Value values[edge * columns];
        unrolled<edge * columns>([&](int k) { values[k] = sorted(k / columns - r, k % columns); });
        apply_network<Median>(values);
        return values[Median::place];
    }
};

/// Medians of boxes: those of sizes without a network by median_of_any(), which takes what this does without the
/// network. `any` is called with a key of the type that is compared.
template <class Any>
void median_by_network(ConstView in, AnyView out, Index3 radius, Execution const& execution, Any const& any) {
    Losses none;
    with_order_key(in.type, [&]<class K>(K key) {
        if (radius == Index3{1, 1, 1})
            column_stencil<K>(execution, out, none, radius, MedianNetwork<1>{}, in);
        else if (radius == Index3{2, 2, 2})
            column_stencil<K>(execution, out, none, radius, MedianNetwork<2>{}, in);
        else
            any(key);
    });
}

} // namespace vkt::VKT_BACKEND
