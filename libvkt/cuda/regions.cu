// Border fill and region copies where device memory takes part.
// SPDX-License-Identifier: MIT
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/kernel/border.h"
#include "libvkt/kernel/kernel.h"

#include <cuda_runtime.h>

namespace vkt {

namespace cuda {
namespace {

/// What stands for a coordinate: itself if it is inside, even beyond the volume, or one that is; -1 for none.
__device__ inline std::int64_t source_of(std::int64_t i, std::int64_t lower, std::int64_t upper, std::int64_t n,
                                         Boundary boundary) {
    return i >= lower && i < upper ? i - lower : fold(i, n, boundary) < 0 ? -1 : fold(i, n, boundary) - lower;
}

/// Fills `part` of a window from the voxels inside, or with the border value where there are none.
template <class T>
void fill_part(View<T> window, Box const& part, Box const& inside, Index3 dims, Boundary boundary, T value) {
    bool const empty = inside.empty();
    Index3 const a = inside.lower, b = inside.upper;
    gather(Execution{}, part, window, [=] VKT_DEVICE(std::int64_t x, std::int64_t y, std::int64_t z) {
        std::int64_t const i = source_of(x, a.x, b.x, dims.x, boundary), j = source_of(y, a.y, b.y, dims.y, boundary),
                           k = source_of(z, a.z, b.z, dims.z, boundary);
        return empty || i < 0 || j < 0 || k < 0 ? value : window(a.x + i, a.y + j, a.z + k);
    });
}

template <class T> void fill_around(AnyView window, Box const& inside, Index3 dims, Boundary boundary, T value) {
    View<T> const view = window.as<T>();
    Box rest = window.box;
    if (inside.empty()) return fill_part(view, rest, inside, dims, boundary, value);
    // Six slabs around the inside: below and above in z, then y, then x.
    for (int axis = 2; axis >= 0; --axis) {
        Box below = rest, above = rest;
        below.upper[axis] = inside.lower[axis];
        above.lower[axis] = inside.upper[axis];
        fill_part(view, below, inside, dims, boundary, value);
        fill_part(view, above, inside, dims, boundary, value);
        rest.lower[axis] = inside.lower[axis];
        rest.upper[axis] = inside.upper[axis];
    }
}

/// Every so many voxels along each axis, from the one that lands at `lower`.
template <class U> struct Strided {
    U const* first;
    Index3 stride, lower;
    __device__ __forceinline__ U operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
        return first[(x - lower.x) * stride.x + (y - lower.y) * stride.y + (z - lower.z) * stride.z];
    }
};

} // namespace
} // namespace cuda

void fill_border_on_device(AnyView window, Box const& inside, Index3 dims, Boundary boundary, double border_value) {
    with_type(window.type, [&]<class T>(T) {
        cuda::fill_around<T>(window, inside, dims, boundary, cuda::round_to<T>(border_value));
    });
}

namespace {

void must(cudaError_t status) {
    if (status == cudaSuccess) return;
    (void)cudaGetLastError();
    throw Error(ErrorKind::resources, std::string("GPU: copy failed: ") + cudaGetErrorString(status));
}

} // namespace

void copy_every_on_device(ConstView from, Index3 step, AnyView to) {
    cuda::for_each_size(size_of(to.type), [&]<class U>(U) {
        Index3 const stride{step.x, step.y * from.row, step.z * from.slice};
        cuda::gather(Execution{}, to.box, to.as<U>(),
                     cuda::Strided<U>{reinterpret_cast<U const*>(from.data), stride, to.box.lower});
    });
}

void copy_region_on_device(ConstView from, AnyView to) {
    if (to.box.empty()) return;
    if (from.space == Space::device && to.space == Space::device) return cuda::copy_box(Execution{}, from, to);
    auto const kind = to.space == Space::device ? cudaMemcpyHostToDevice : cudaMemcpyDeviceToHost;
    std::size_t const size = size_of(to.type);
    if (from.contiguous() && to.contiguous())
        return to.space == Space::device ? copy_to_device(to.data, from.data, to.bytes())
                                         : copy_to_host(to.data, from.data, to.bytes());
    Index3 const n = to.dims();
    auto bytes = [size](std::int64_t voxels) { return static_cast<std::size_t>(voxels) * size; };
    for (std::int64_t z = 0; z < n.z; ++z) {
        std::byte const* const source = from.data + static_cast<std::int64_t>(size) * z * from.slice;
        std::byte* const target = to.data + static_cast<std::int64_t>(size) * z * to.slice;
        must(cudaMemcpy2D(target, bytes(to.row), source, bytes(from.row), bytes(n.x), static_cast<std::size_t>(n.y),
                          kind));
    }
}

} // namespace vkt
