// Where a ray enters what is shown of a volume: a face of its box, or a plane, that cuts the medium.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/scene.h"

namespace vkt::render {

/// Smallest spacings behind a face within which light is shaded as that of the face. What shines from there is the more
/// of the light the more opaque the medium is: all of it where it is solid, next to nothing in fog.
inline constexpr double cut_depth = 1;

/// The face by which a ray enters.
struct CutFace {
    Float3 normal{0, 0, 0}; ///< as a gradient of the lattice
    float reach = 0;        ///< lattice units of the ray that are shaded as the face; 0: it begins within the medium

    /// Share of the light seen of a segment of this depth that comes from before `reach`: exact where the medium is the
    /// same along it, so that steps do not matter.
    VKT_HD float share(float begin, float end, float depth, float absorbed) const {
        if (!(begin < reach)) return 0;
        if (!(end > reach)) return 1;
        float const part = (reach - begin) / (end - begin);
        // Of what is thin all of it is seen alike, and floats tell no difference.
        if (!(absorbed > 1e-4F)) return part;
        float const seen = attenuation(depth * part).absorbed / absorbed;
        return seen < 1.0F ? seen : 1.0F;
    }
};

VKT_HD CutFace cut_face(SceneView const& scene, Ray const& ray) {
    CutFace face;
    if (!(ray.start > 0)) return face; // the eye is in there
    double nearest = -std::numeric_limits<double>::infinity(), rise = 0;
    Double3 normal{0, 0, 0};
    auto const try_out = [&](Double3 n, double offset) __attribute__((always_inline)) {
        double const up = dot(n, ray.direction);
        if (!(up > 0)) return; // the ray leaves by it
        double const at = (offset - dot(n, ray.entry)) / up;
        if (!(at > nearest)) return;
        nearest = at, rise = up, normal = n;
    };
    ShownPart const& shown = scene.shown;
    try_out({1, 0, 0}, shown.lower.x), try_out({-1, 0, 0}, -shown.upper.x);
    try_out({0, 1, 0}, shown.lower.y), try_out({0, -1, 0}, -shown.upper.y);
    try_out({0, 0, 1}, shown.lower.z), try_out({0, 0, -1}, -shown.upper.z);
    for (int i = 0; i < shown.plane_count; ++i) try_out(shown.planes[i].normal, shown.planes[i].offset);
    double const per_length = std::sqrt(dot(normal, normal));
    if (!(per_length > 0)) return face;
    normal = normal * (1 / per_length);
    rise /= per_length;
    face.normal = to_float(normal);
    float const squared = squared_length(scene.shade, face.normal);
    face.reach = static_cast<float>(cut_depth * std::sqrt(static_cast<double>(squared)) / rise);
    return face;
}

} // namespace vkt::render
