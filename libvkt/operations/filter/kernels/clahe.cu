// CLAHE on GPUs: every voxel blends the curves around it, in the order in which CPUs do.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/clahe.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/clahe_window.h"

#include <type_traits>

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// A voxel on its own. V is what it is given as.
template <class V, class C> struct Equalize {
    IntensityWindow<C> window;
    AxisBlend x, y, z;
    C const* curves;
    std::int32_t across, down; ///< bricks along x and y
    Int128 base;

    VKT_HD C share(double px, double py, double pz, C v) const {
        Place<C> const p = window.place(v);
        Between const bx = x.at(px), by = y.at(py), bz = z.at(pz);
        std::int64_t const points = window.bins + 1;
        auto const corner = [&](std::int32_t i, std::int32_t j, std::int32_t k) {
            return curves + ((static_cast<std::int64_t>(k) * down + j) * across + i) * points + p.bin;
        };
        auto const column = [&](std::int32_t i) {
            C ends[2];
            for (int e = 0; e < 2; ++e)
                ends[e] = blend(blend(corner(i, by.first, bz.first)[e], corner(i, by.first, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                blend(corner(i, by.second, bz.first)[e], corner(i, by.second, bz.second)[e],
                                      static_cast<C>(bz.weight)),
                                static_cast<C>(by.weight));
            return blend(ends[0], ends[1], p.rest);
        };
        return blend(column(bx.first), column(bx.second), static_cast<C>(bx.weight));
    }
    VKT_HD C own(V v) const {
        if constexpr (std::is_same_v<V, Int128>)
            return distance(v, base);
        else
            return v;
    }
    VKT_HD V operator()(double px, double py, double pz, V v) const {
        C const c = own(v), result = window.value(share(px, py, pz, c), c);
        if constexpr (std::is_same_v<V, Int128>)
            return from_distance(result, base);
        else
            return result;
    }
    VKT_HD bool undefined(V v) const { return window.outside(own(v)); }
};

template <class V, class C>
void map_all(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
             Execution const& execution) {
    BrickGrid const& grid = field.grid;
    Equalize<V, C> const equalize{IntensityWindow<C>(field),
                                  AxisBlend(grid, 0),
                                  AxisBlend(grid, 1),
                                  AxisBlend(grid, 2),
                                  reinterpret_cast<C const*>(curves.read(execution.space())),
                                  static_cast<std::int32_t>(grid.bricks.x),
                                  static_cast<std::int32_t>(grid.bricks.y),
                                  field.base};
    map_at<V>(execution, out, losses, equalize, in);
}

} // namespace

void clahe_map(ConstView in, AnyView out, ClaheField const& field, Buffer& curves, Losses& losses,
               Execution const& execution) {
    if (out.box.empty()) return;
    clahe_in_type(field, losses, [&]<class V, class C>(V, C, Losses& found) {
        map_all<V, C>(in, out, field, curves, found, execution);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
