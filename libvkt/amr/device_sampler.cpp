// Uploading trees.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/device_sampler.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"

#include <cstring>
#include <span>

namespace vkt {

#ifdef VKT_CUDA
/// See libvkt/cuda/tree_samples.cu. The view's pointers are of device memory; cells are of out.type.
void sample_tree_on_device(SamplerView<std::byte> const& tree, SampleGrid const& grid, TileRule const& rule,
                           AnyView out);
#endif

namespace {

template <class T> Buffer uploaded(std::span<T const> list) {
    Buffer buffer(list.size_bytes());
    if (!list.empty()) copy_to_device(buffer.write(Space::device), list.data(), list.size_bytes());
    return buffer;
}

} // namespace

bool DeviceSampler::computes(Reconstruction method, DataType type) {
    bool const of_cells = method == Reconstruction::nearest || method == Reconstruction::average;
    return of_cells || !computes_in_double(type);
}

DeviceSampler::DeviceSampler(Volume const& volume)
    : host_(volume), nodes_(uploaded(host_.index().nodes())), order_(uploaded(host_.index().order())),
      bricks_(uploaded(host_.bricks())) {}

void DeviceSampler::run([[maybe_unused]] SampleGrid const& grid, TileRule const& rule, AnyView out) {
    if (!computes(rule.method, out.type)) throw Error(ErrorKind::failure, "a reconstruction that no GPU computes");
#ifdef VKT_CUDA
    SamplerView<std::byte> const tree{reinterpret_cast<IndexNode const*>(nodes_.read(Space::device)),
                                      reinterpret_cast<std::int32_t const*>(order_.read(Space::device)),
                                      reinterpret_cast<SampledBrick const*>(bricks_.read(Space::device)),
                                      host_.volume().buffer().read(Space::device)};
    sample_tree_on_device(tree, grid, rule, out);
#else
    throw_without_cuda();
#endif
}

} // namespace vkt
