// Hierarchical volumes on a GPU: bricks, their index and cells in device memory, and grids sampled from them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/amr/reconstruct.h"
#include "libvkt/amr/sampler.h"
#include "libvkt/core/buffer.h"

namespace vkt {

/// Uploads a hierarchical volume once, to the current device. Memory there: the cells, about 110 bytes a brick.
class DeviceSampler {
public:
    /// True if reconstructions by this method of cells of this type are computed there: nearest and averages, and those
    /// that may be by basis in float32.
    static bool computes(Reconstruction method, DataType type);

    explicit DeviceSampler(Volume const& volume);

    /// The samples of out.box, which lies in device memory: of nearest the same as on CPUs, of the others sums in
    /// another order. Throws Error{failure} for what it does not compute. O(log bricks) a sample.
    void run(SampleGrid const& grid, TileRule const& rule, AnyView out);

private:
    TreeSampler host_; ///< keeps the volume
    Buffer nodes_, order_, bricks_;
};

} // namespace vkt
