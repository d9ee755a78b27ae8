// How bright what is lit by a light at the eye or by a lamp is, from the gradient there: of one point, or of as many as
// a register holds, with the same bits.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/occlusion.h"
#ifndef __CUDACC__
#include "libvkt/render/inner/wide.h"
#endif

namespace vkt::render {

/// One of two numbers; wide.h has it of registers.
VKT_HD float select(bool first, float a, float b) { return first ? a : b; }
VKT_HD float square_root(float a) { return std::sqrt(a); }

/// Brightness of a surface element seen with a light at the eye.
template <class F> struct Reflection { F diffuse, glint; };

/// Part of a lattice gradient in units of the reference, within what floats can hold the square of. NaN stays.
template <class F> VKT_HD F in_references(ShadeView const& shade, F g) {
    F const limit = F{} + 1e15F, scaled = g * shade.per_gradient;
    return select(scaled < -limit, -limit, select(scaled > limit, limit, scaled));
}

/// Of what is no surface.
VKT_HD float unshaded(ShadeView const& shade, Arriving const& light) {
    return 1.0F + shade.ambient * (light.ambient - 1.0F) + (1.0F - shade.ambient) * (light.lamp - 1.0F);
}

/// How much of a surface a gradient of this squared length is; one of `reference` is half of one.
template <class F> VKT_HD F surface_share(ShadeView const& shade, F squared, float reference) {
    return select(squared > 0.0F, shade.strength * squared / (squared + reference * reference), F{});
}

/// From a gradient in units of the reference and its part along the ray, per smallest spacing. A gradient of
/// `reference` is shaded half. Of the light from everywhere the share `open` arrives; `base`: brightness of what is no
/// surface.
template <class F>
VKT_HD Reflection<F> headlight(ShadeView const& shade, F gx, F gy, F gz, F along, float open, float base,
                               float reference) {
    F const one = F{} + 1.0F;
    F const squared = squared_length(shade, gx, gy, gz), surface = surface_share(shade, squared, reference);
    F const ratio = select(squared > 0.0F, along * along / squared, one); // squared cosine of the angle to the ray
    F const cosine2 = select(ratio < 1.0F, ratio, one);
    F const c4 = cosine2 * cosine2, c8 = c4 * c4, c16 = c8 * c8;
    F const lit = shade.ambient * open + (1.0F - shade.ambient) * square_root(cosine2);
    return {base + surface * (lit - base), surface * shade.specular * c16 * c16};
}

/// Parts of a gradient along unit vectors of the world: the ray's, towards the lamp, and halfway from that to the eye.
template <class F> struct LampParts { F ray, lamp, half; };
/// Lattice vectors that these parts are dot products with, per smallest spacing.
struct LampFrame {
    Float3 ray, lamp, half;
    template <class F> VKT_HD LampParts<F> of(F gx, F gy, F gz) const {
        return {gx * ray.x + gy * ray.y + gz * ray.z, gx * lamp.x + gy * lamp.y + gz * lamp.z,
                gx * half.x + gy * half.y + gz * half.z};
    }
};
VKT_HD LampFrame lamp_frame(SceneView const& scene, Double3 direction, double world_per_lattice) {
    double const spacing = scene.shade.spacing;
    Double3 const way = direction * (1 / world_per_lattice); // of unit length in the world
    double const cosine = -dot(scene.lamp.world, scene.to_world * way), squared = 2 + 2 * cosine;
    double const per = squared > 1e-12 ? spacing / std::sqrt(squared) : 0;
    return {to_float(way * spacing), to_float(scene.lamp.lattice * spacing),
            to_float((scene.lamp.lattice - way) * per)};
}

/// As headlight(), with a lamp. What faces the eye and not the lamp is dark.
template <class F>
VKT_HD Reflection<F> lamplight(ShadeView const& shade, F gx, F gy, F gz, LampParts<F> const& parts,
                               Arriving const& light, float base, float reference) {
    F const one = F{} + 1.0F;
    F const squared = squared_length(shade, gx, gy, gz), surface = surface_share(shade, squared, reference);
    F const per = select(squared > 0.0F, select(parts.ray * parts.lamp < 0.0F, 1.0F / squared, F{}), F{});
    F const ratio = parts.lamp * parts.lamp * per, glancing = parts.half * parts.half * per;
    F const cosine2 = select(ratio < 1.0F, ratio, one), half2 = select(glancing < 1.0F, glancing, one);
    F const c4 = half2 * half2, c8 = c4 * c4, c16 = c8 * c8;
    F const lit = shade.ambient * light.ambient + (1.0F - shade.ambient) * light.lamp * square_root(cosine2);
    return {base + surface * (lit - base), light.lamp * surface * shade.specular * c16 * c16};
}

} // namespace vkt::render
