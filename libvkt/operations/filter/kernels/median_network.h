// The median of 3^3, 5^3, 3^2 and 5^2 voxels by selection networks, and which sizes have one; the same on all back
// ends.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/kernel/network.h"
#include "libvkt/kernel/stencil.h"

namespace vkt::VKT_BACKEND {

/// (2 r + 1)^2 (2 z + 1): columns are sorted once, then the middle one of the sorted columns is selected.
template <int r, int z> struct MedianNetwork {
    static constexpr int radius = r, radius_z = z, edge = 2 * r + 1, columns = edge * (2 * z + 1);

    template <class W, class V> VKT_HD void column(W const& window, V* sorted) const {
        unrolled<columns>([&](int k) { sorted[k] = window(0, k % edge - r, k / edge - z); });
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
            column_stencil<K>(execution, out, none, radius, MedianNetwork<1, 1>{}, in);
        else if (radius == Index3{2, 2, 2})
            column_stencil<K>(execution, out, none, radius, MedianNetwork<2, 2>{}, in);
        else if (radius == Index3{1, 1, 0})
            column_stencil<K>(execution, out, none, radius, MedianNetwork<1, 0>{}, in);
        else if (radius == Index3{2, 2, 0})
            column_stencil<K>(execution, out, none, radius, MedianNetwork<2, 0>{}, in);
        else
            any(key);
    });
}

} // namespace vkt::VKT_BACKEND
