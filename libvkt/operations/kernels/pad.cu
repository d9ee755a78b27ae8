// Pad on GPUs: every voxel from where the rule says.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/kernels/pad.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <cstring>

namespace vkt::VKT_BACKEND {
namespace {

template <class U> struct Padded {
    View<U const> in;
    View<U> out;
    Index3 lower, below, dims;
    Boundary boundary;
    U border;

    __device__ __forceinline__ void operator()(std::int64_t i, std::int64_t j, std::int64_t k,
                                               driver::LossCounts&) const {
        std::int64_t const x = lower.x + i, y = lower.y + j, z = lower.z + k;
        std::int64_t const sx = fold(x - below.x, dims.x, boundary), sy = fold(y - below.y, dims.y, boundary),
                           sz = fold(z - below.z, dims.z, boundary);
        out(x, y, z) = sx < 0 || sy < 0 || sz < 0 ? border : in(sx, sy, sz);
    }
};

template <class U> void pad(ConstView in, AnyView out, PadRule const& rule) {
    Padded<U> padded{in.as<U>(), out.as<U>(), out.box.lower, rule.below, rule.dims, rule.boundary, U{}};
    std::memcpy(&padded.border, rule.border.data(), sizeof padded.border);
    driver::for_each_voxel(out.dims(), padded, nullptr, "pad_box");
}

} // namespace

void pad_box(ConstView in, AnyView out, PadRule const& rule, Execution const&) {
    for_each_size(size_of(out.type), [&]<class U>(U) { pad<U>(in, out, rule); });
}

} // namespace vkt::VKT_BACKEND
