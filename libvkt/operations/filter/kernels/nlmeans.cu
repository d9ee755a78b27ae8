// Non-local means on GPUs: a thread a voxel, patches summed along x, y and z.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/nlmeans.h"

#include "libvkt/kernel/kernel.h"
#include "libvkt/kernel/stencil.h"
#include "libvkt/operations/common/kernels/weights.h"

namespace vkt {

namespace VKT_BACKEND {
namespace {

/// The sums are those of CPUs, in their order.
template <class C> struct NlMeansAt {
    int px, py, pz, sx, sy, sz; ///< how far patches and the search reach
    C scale, free;

    template <class W> __device__ C operator()(W const& window) const {
        C const centre = window(0, 0, 0);
        C weights = 0, changes = 0, most = 0;
        for (int dz = -sz; dz <= sz; ++dz)
            for (int dy = -sy; dy <= sy; ++dy)
                for (int dx = -sx; dx <= sx; ++dx) {
                    if (dx == 0 && dy == 0 && dz == 0) continue;
                    C exponent = free - distance(window, dx, dy, dz);
                    exponent = exponent > C(0) ? C(0) : exponent;
                    if (!(exponent > C(weight_floor))) continue; // NaN, too
                    C const weight = exp2_of<C>(exponent);
                    changes = madd(weight, window(dx, dy, dz) - centre, changes);
                    weights += weight;
                    most = weight > most ? weight : most;
                }
        return weights > C(0) ? centre + changes / (weights + most) : centre;
    }

private:
    template <class W> __device__ __forceinline__ C distance(W const& window, int dx, int dy, int dz) const {
        C volume = 0;
        for (int z = -pz; z <= pz; ++z) {
            C plane = 0;
            for (int y = -py; y <= py; ++y) {
                C line = 0;
                for (int x = -px; x <= px; ++x) {
                    C const d = (window(x, y, z) - window(x + dx, y + dy, z + dz)) * scale;
                    line += d * d;
                }
                plane += line;
            }
            volume += plane;
        }
        return volume;
    }
};

} // namespace

void nlmeans_box(ConstView in, AnyView out, NlMeansRule const& rule, Losses& losses, Execution const& execution) {
    with_compute_type(in.type, [&]<class C>(C) {
        NlMeansFactors<C> const factors = factors_of<C>(rule);
        auto const reach = [](std::int64_t r) { return static_cast<int>(r); };
        NlMeansAt<C> const at{reach(rule.patch.x),  reach(rule.patch.y),  reach(rule.patch.z), reach(rule.search.x),
                              reach(rule.search.y), reach(rule.search.z), factors.scale,       factors.free};
        stencil<C>(execution, out, losses, rule.patch + rule.search, at, in);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
