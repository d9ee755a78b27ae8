// Light of an environment on what is marched and on surfaces: where they face it, and where nothing is a surface.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/scene.h"

namespace vkt::render {

/// Of the light of the environment what arrives, by colour, at a surface element with this gradient: the share
/// `surface` of it is one, whose normal is turned around where that faces away from the eye; `squared` as
/// squared_length() has it. The polynomial may be below 0 where small lights are behind a surface.
VKT_HD void arriving_from(IrradianceView const& around, Float3 g, float squared, float surface, bool away, float* out) {
    for (int c = 0; c < 3; ++c) out[c] = around.mean[c];
    if (!(squared > 0)) return;
    float const per = 1.0F / std::sqrt(squared), sign = away ? -per : per;
    for (int c = 0; c < 3; ++c) {
        float const* const q = around.quadratic[c];
        float const bent = q[0] * g.x * g.x + q[1] * g.y * g.y + q[2] * g.z * g.z + q[3] * g.x * g.y +
                           q[4] * g.x * g.z + q[5] * g.y * g.z;
        float const faced = around.constant[c] + sign * dot(g, around.linear[c]) + per * per * bent;
        out[c] += surface * ((faced > 0 ? faced : 0.0F) - around.mean[c]);
    }
}

} // namespace vkt::render
