// Affine: a volume moved by a matrix, or by what a registration found.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/read_once.h"
#include "libvkt/operations/filter/gaussian.h"
#include "libvkt/operations/resample/affine_transform.h"
#include "libvkt/operations/resample/transform_file.h"

namespace vkt {

/// The voxel of the result at point p is that of the input at T(p), which is how ITK and SciPy mean it; --inverse turns
/// it round: content at p moves to T(p). World coordinates are those of the volume, of ITK's files left-posterior-
/// superior, which volumes in another anatomical frame are seen from.
class AffineOperation : public AffineTransform {
public:
    std::string_view name() const override { return "affine"; }
    Texts texts() const override;
    void parameters(Parameters& p) override;
    void check() const override;

protected:
    Affine source_map(Moved const& moved) const override;

private:
    /// As it is given, or its inverse.
    TransformText transform() const;

    std::string matrix_;
    LengthUnit unit_ = LengthUnit::world;
    bool inverse_ = false;
    ReadOnce<std::string> text_; ///< of the file
};

} // namespace vkt
