// Median on GPUs: boxes without a network bit by bit.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/median.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/operations/filter/kernels/median_network.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// Any box: the median's bits from the highest down, by counting the neighbours below.
template <class K> struct MedianByBits {
    int rx, ry, rz, rank;

    template <class W> __device__ K operator()(W const& window) const {
        using U = std::make_unsigned_t<K>;
        constexpr U flip = std::is_signed_v<K> ? U(U(1) << (8 * sizeof(K) - 1)) : U(0);
        U found = 0;
        for (int bit = 8 * sizeof(K) - 1; bit >= 0; --bit) {
            U const candidate = U(found | U(U(1) << bit));
            int below = 0;
            for (int dz = -rz; dz <= rz; ++dz)
                for (int dy = -ry; dy <= ry; ++dy)
                    for (int dx = -rx; dx <= rx; ++dx) below += U(U(window(dx, dy, dz)) ^ flip) < candidate ? 1 : 0;
            if (below <= rank) found = candidate;
        }
        return K(found ^ flip);
    }
};

template <class K> void median_of_any(Execution const& execution, AnyView out, Index3 radius, ConstView in) {
    Losses none;
    std::int64_t const count = (2 * radius.x + 1) * (2 * radius.y + 1) * (2 * radius.z + 1);
    stencil<K>(execution, out, none, radius,
               MedianByBits<K>{static_cast<int>(radius.x), static_cast<int>(radius.y), static_cast<int>(radius.z),
                               static_cast<int>(count / 2)},
               in);
}

} // namespace

void median_of_boxes(ConstView in, AnyView out, Index3 radius, Execution const& execution) {
    median_by_network(in, out, radius, execution, [&]<class K>(K) { median_of_any<K>(execution, out, radius, in); });
}

} // namespace VKT_BACKEND

} // namespace vkt
