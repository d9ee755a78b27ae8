// Point sampling of hierarchical volumes: the owning side.
// SPDX-License-Identifier: MIT
#include "libvkt/amr/sampler.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"

#include <limits>

namespace vkt {

TreeSampler::TreeSampler(Volume volume) : volume_(std::move(volume)) {
    Header const& header = volume_.header();
    if (header.kind != Kind::hierarchical)
        throw Error(ErrorKind::failure, "point sampling needs a hierarchical volume");
    if (volume_.bricks().empty()) throw Error(ErrorKind::failure, "point sampling needs a volume with bricks");
    index_ = BrickIndex(header.dims, volume_.bricks());
    cells_ = volume_.buffer().read(Space::host);
    bricks_.reserve(volume_.bricks().size());
    for (std::size_t b = 0; b < volume_.bricks().size(); ++b) {
        Brick const& brick = volume_.bricks()[b];
        SampledBrick record{};
        Index3 const w = cell_width(header.dims, brick.level);
        for (int a = 0; a < 3; ++a) {
            if (brick.dims[a] >= std::numeric_limits<std::int32_t>::max())
                throw Error(ErrorKind::resources, "a brick of more than 2^31 cells along an axis cannot be sampled");
            record.lower[a] = static_cast<double>(brick.lower[a]);
            record.inverse_width[a] = static_cast<float>(1.0 / static_cast<double>(w[a]));
            record.dims[a] = static_cast<std::int32_t>(brick.dims[a]);
        }
        record.offset = volume_.brick_offset(b);
        bricks_.push_back(record);
    }
}

TreeSample TreeSampler::sample(Vec3 position) const {
    return with_type(volume_.header().dtype,
                     [&]<class T>(T) { return vkt::sample(view<T>(), position.x, position.y, position.z); });
}

TreeGradientSample TreeSampler::sample_gradient(Vec3 position) const {
    return with_type(volume_.header().dtype,
                     [&]<class T>(T) { return vkt::sample_gradient(view<T>(), position.x, position.y, position.z); });
}

} // namespace vkt
