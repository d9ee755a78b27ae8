// Scale: the content of a volume made larger or smaller on the same grid.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/operations/resample/affine_transform.h"

namespace vkt {

/// Resizes the content of a volume about its middle, or another point, by a factor for each axis; voxels keep their
/// size. Another number of voxels for the same content is what resample gives.
class Scale : public AffineTransform {
public:
    std::string_view name() const override { return "scale"; }
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;

protected:
    Affine source_map(Moved const& moved) const override;

private:
    Vec3 factor_{1, 1, 1};
    std::optional<Vec3> about_;
};

} // namespace vkt
