// Non-local means on GPUs: a thread a voxel, patches summed along x, y and z from what lies in shared memory or, of
// far-reaching ones, in a copy of the volume.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/filter/kernels/nlmeans.h"

#include "libvkt/core/buffer.h"
#include "libvkt/kernel/cuda_stencil.h"
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

constexpr int far_block = 256;

struct Place {
    std::int64_t x, y, z;
};
/// Of this thread's voxel in a box of that extent; z is beyond it if there is none.
__device__ inline Place this_place(Index3 n) {
    std::int64_t const i = static_cast<std::int64_t>(blockIdx.x) * far_block + threadIdx.x;
    std::int64_t const row = driver::quotient_of(i, n.x), z = driver::quotient_of(row, n.y);
    return {i - row * n.x, row - z * n.y, z};
}

template <class C> __global__ void __launch_bounds__(far_block) widen(driver::DeviceRows in, Index3 n, C* to) {
    Place const p = this_place(n);
    if (p.z < n.z) to[(p.z * n.y + p.y) * n.x + p.x] = driver::load_neighbour<C>(in.type, in.at(p.x, p.y, p.z));
}

template <class C>
__global__ void __launch_bounds__(far_block)
    far_means(C const* values, Index3 around, Index3 reach, driver::DeviceRows out, Index3 n, NlMeansAt<C> at,
              unsigned long long* totals) {
    Place const p = this_place(n);
    driver::LossCounts counts;
    if (p.z < n.z) {
        std::int64_t const slice = around.x * around.y;
        C const* const centre = values + (p.z + reach.z) * slice + (p.y + reach.y) * around.x + p.x + reach.x;
        driver::store_result(out.type, out.at(p.x, p.y, p.z), at(FarWindow<C>{centre, around.x, slice}), counts);
    }
    driver::add_counts(counts, totals);
}

unsigned far_blocks(Index3 n) {
    std::int64_t const blocks = (n.x * n.y * n.z + far_block - 1) / far_block;
    if (blocks > 0x7fffffff)
        throw Error(ErrorKind::resources, "the volume is too large for one GPU launch", "use --device cpu");
    return static_cast<unsigned>(blocks);
}

/// What lies too far away for shared memory: all values as C in one array.
template <class C> void far_stencil(ConstView in, AnyView out, Index3 reach, NlMeansAt<C> const& at, Losses& losses) {
    if (out.box.empty()) return;
    Box const around = grow(out.box, reach);
    Index3 const n = around.dims();
    Buffer memory(static_cast<std::size_t>(around.voxels()) * sizeof(C));
    auto* const values = reinterpret_cast<C*>(memory.write(Space::device));
    widen<C><<<far_blocks(n), far_block>>>(driver::device_rows(in, around), n, values);
    check_launch("non-local means, copying");
    driver::DeviceLosses const counts;
    far_means<C><<<far_blocks(out.dims()), far_block>>>(values, n, reach, driver::device_rows(ConstView(out), out.box),
                                                        out.dims(), at, counts.get());
    check_launch("non-local means");
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
            far_stencil<C>(in, out, around, at, losses);
    });
}

} // namespace VKT_BACKEND
} // namespace vkt
