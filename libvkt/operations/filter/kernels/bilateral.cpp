// Bilateral filter: one exponential a neighbour, sums row by row and slice by slice.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/bilateral.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/stencil.h"
#include "libvkt/operations/common/kernels/weights.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

template <class C> struct Bilateral {
    int rx, ry, rz;
    C per_value;                                ///< values times this, squared, are the exponent of 2 that they cost
    C space[3][most_bilateral_radius + 1] = {}; ///< the exponent that a distance along an axis costs, negative

    template <class W> VKT_HD typename W::Value operator()(W const& window) const {
        using V = typename W::Value;
        V const centre = window(0, 0, 0);
        V weights = V{}, changes = V{};
        for (int dz = -rz; dz <= rz; ++dz) {
            V slice_weights = V{}, slice_changes = V{};
            for (int dy = -ry; dy <= ry; ++dy) {
                C const base = space[2][dz < 0 ? -dz : dz] + space[1][dy < 0 ? -dy : dy];
                V row_weights = V{}, row_changes = V{};
                for (int dx = -rx; dx <= rx; ++dx) {
                    V const change = window(dx, dy, dz) - centre, scaled = change * per_value;
                    V const exponent = madd(V{} - scaled, scaled, V{} + (base + space[0][dx < 0 ? -dx : dx]));
                    auto const near = exponent > V{} + C(weight_floor); // false for NaN
                    V const weight = near ? exp2_of<C>(exponent) : V{};
                    row_weights = row_weights + weight;
                    row_changes = madd(weight, near ? change : V{}, row_changes);
                }
                slice_weights = slice_weights + row_weights;
                slice_changes = slice_changes + row_changes;
            }
            weights = weights + slice_weights;
            changes = changes + slice_changes;
        }
        auto const any = weights > V{};
        V const divisor = any ? weights : V{} + C(1);
        return any ? centre + changes / divisor : centre;
    }
};

} // namespace

void bilateral_box(ConstView in, AnyView out, BilateralRule const& rule, Losses& losses, Execution const& execution) {
    with_compute_type(in.type, [&]<class C>(C) {
        constexpr double per_exponent = 0.693147180559945309, largest = 1e37;
        Bilateral<C> f;
        f.rx = static_cast<int>(rule.radius.x);
        f.ry = static_cast<int>(rule.radius.y);
        f.rz = static_cast<int>(rule.radius.z);
        double const per_value = 1 / (rule.range_sigma * __builtin_sqrt(2 * per_exponent));
        f.per_value = static_cast<C>(per_value < largest ? per_value : largest);
        for (int axis = 0; axis < 3; ++axis)
            for (int d = 1; d <= rule.radius[axis]; ++d) {
                double const distance = d / rule.sigma[axis];
                f.space[axis][d] = static_cast<C>(-distance * distance / (2 * per_exponent));
            }
        stencil<C>(execution, out, losses, rule.radius, f, in);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
