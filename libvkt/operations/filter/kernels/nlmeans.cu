// Non-local means on GPUs: a thread a voxel, patches summed along x, y and z from what lies in shared memory or, of
// far-reaching ones, in a copy of the volume.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/nlmeans.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_stencil.h"
#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"
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

/// The neighbours of a voxel in memory of any size.
template <class C> struct FarWindow {
    C const* centre;
    std::int64_t row, slice;
    __device__ __forceinline__ C operator()(int dx, int dy, int dz) const { return centre[dx + dy * row + dz * slice]; }
};

/// Voxels of a box as C, in one array.
template <class C> struct Widened {
    driver::DeviceRows in;
    Index3 n;
    C* to;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts&) const {
        to[(z * n.y + y) * n.x + x] = driver::load_neighbour<C>(in.type, in.at(x, y, z));
    }
};

/// The means of such voxels; `around` is the extent of all, `reach` how far they lie around the results.
template <class C> struct FarMeans {
    NlMeansAt<C> means;
    C const* values;
    Index3 around, reach;
    driver::DeviceRows out;

    __device__ __forceinline__ void operator()(std::int64_t x, std::int64_t y, std::int64_t z,
                                               driver::LossCounts& counts) const {
        std::int64_t const slice = around.x * around.y;
        C const* const centre = values + (z + reach.z) * slice + (y + reach.y) * around.x + x + reach.x;
        driver::store_result(out.type, out.at(x, y, z), means(FarWindow<C>{centre, around.x, slice}), counts);
    }
};

/// What lies too far away for shared memory.
template <class C> void far_means(ConstView in, AnyView out, Index3 reach, NlMeansAt<C> const& means, Losses& losses) {
    if (out.box.empty()) return;
    Box const around = grow(out.box, reach);
    Buffer memory(static_cast<std::size_t>(around.voxels()) * sizeof(C));
    auto* const values = reinterpret_cast<C*>(memory.write(Space::device));
    driver::for_each_voxel(around.dims(), Widened<C>{driver::device_rows(in, around), around.dims(), values}, nullptr,
                           "non-local means, copying");
    driver::DeviceLosses const counts;
    driver::for_each_voxel(
        out.dims(), FarMeans<C>{means, values, around.dims(), reach, driver::device_rows(ConstView(out), out.box)},
        counts.get(), "non-local means");
    counts.add_to(losses);
}

} // namespace

void nlmeans_box(ConstView in, AnyView out, NlMeansRule const& rule, Losses& losses, Execution const& execution) {
    with_compute_type(in.type, [&]<class C>(C) {
        NlMeansFactors<C> const factors = factors_of<C>(rule);
        auto const reach = [](std::int64_t r) { return static_cast<int>(r); };
        NlMeansAt<C> const at{reach(rule.patch.x),  reach(rule.patch.y),  reach(rule.patch.z), reach(rule.search.x),
                              reach(rule.search.y), reach(rule.search.z), factors.scale,       factors.free};
        Index3 const around = rule.patch + rule.search;
        if (driver::fits_stencil<C>(around))
            stencil<C>(execution, out, losses, around, at, in);
        else
            far_means<C>(in, out, around, at, losses);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
