// Pad on GPUs: a copy of what is there, and around it every voxel from where the rule says.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/kernels/pad.h"

#include "libvkt/kernel/cuda_voxels.h"
#include "libvkt/kernel/kernel.h"

#include <array>
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

/// The parts of `all` outside of `inside`: below and above, in front and behind, left and right of it.
std::array<Box, 6> shell(Box const& all, Box const& inside) {
    std::array<Box, 6> parts;
    Box rest = all;
    for (int axis = 2, i = 0; axis >= 0; --axis) {
        Box below = rest, above = rest;
        below.upper[axis] = inside.lower[axis];
        above.lower[axis] = inside.upper[axis];
        rest.lower[axis] = inside.lower[axis];
        rest.upper[axis] = inside.upper[axis];
        parts[static_cast<std::size_t>(i++)] = below;
        parts[static_cast<std::size_t>(i++)] = above;
    }
    return parts;
}

/// For what lies beside rows: no lane without a voxel.
using Narrow = driver::BlockShape<8, 32, 1, 1>;

template <class U> void pad(ConstView in, AnyView out, PadRule const& rule, Box const& inside) {
    Padded<U> padded{in.as<U>(), out.as<U>(), {}, rule.below, rule.dims, rule.boundary, U{}};
    std::memcpy(&padded.border, rule.border.data(), sizeof padded.border);
    auto const fill = [&](Box const& box) {
        padded.lower = box.lower;
        if (box.dims().x <= Narrow::x)
            driver::for_each_voxel<Narrow>(box.dims(), padded, nullptr, "pad_box");
        else
            driver::for_each_voxel(box.dims(), padded, nullptr, "pad_box");
    };
    if (inside.empty()) return fill(out.box);
    for (Box const& part : shell(out.box, inside)) fill(part);
}

} // namespace

void pad_box(ConstView in, AnyView out, PadRule const& rule, Execution const& execution) {
    Box const inside = intersect(out.box, {rule.below, rule.below + rule.dims});
    if (!inside.empty())
        copy_box(execution, in.part({inside.lower - rule.below, inside.upper - rule.below}), out.part(inside));
    for_each_size(size_of(out.type), [&]<class U>(U) { pad<U>(in, out, rule, inside); });
}

} // namespace vkt::VKT_BACKEND
