// What no volume can be rendered with.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/passes.h"
#include "libvkt/render/refuse.h"
#include "libvkt/render/render.h"

#include <algorithm>
#include <cmath>

namespace vkt::render {

namespace {

constexpr int largest_image = 16384;

} // namespace

PartRows rows_of_part(RenderSettings const& s) {
    std::int64_t const strips = (s.height + tile_side - 1) / tile_side;
    auto const row = [&](int parts) {
        return static_cast<int>(std::min<std::int64_t>(s.height, strips * parts / s.parts * tile_side));
    };
    return {row(s.part - 1), row(s.part)};
}

bool may_leave_out(RenderSettings const& s, Header const& header) {
    return s.shortcut > 0 && s.skip && !s.exact && !s.goal.any() && s.algorithm == Algorithm::ray_marching &&
           header.kind == Kind::structured && s.background.alpha >= 1;
}

bool smooths_edges(RenderSettings const& s) {
    return s.algorithm == Algorithm::implicit_iso && s.edge_rays > 1 && !s.goal.any();
}

void check(RenderSettings const& s) {
    auto const fits = [](int n) { return n >= 1 && n <= largest_image; };
    if (!fits(s.width) || !fits(s.height))
        refuse(text("the image size must be 1 to ", largest_image, " pixels each way"));
    if (!(s.step >= 1.0 / 256 && s.step <= 4))
        refuse(text("the step must be between 1/256 and 4 voxels, not ", s.step));
    if (!(s.opacity_scale >= 0) || !std::isfinite(s.opacity_scale)) refuse("the opacity scale must be 0 or greater");
    if (!(s.shade <= 1)) refuse("the shading strength must be between 0 and 1");
    if (s.samples < 1 || s.samples > 1 << 24) refuse("the samples per pixel must be 1 to 16777216");
    if (s.edge_rays < 1 || s.edge_rays > most_rays || (s.edge_rays & (s.edge_rays - 1)) != 0)
        refuse(
            text("the rays of a pixel at edges must be 1, 2, 4, 8 and so on up to ", most_rays, ", not ", s.edge_rays));
    if (s.first_sample < 0 || s.first_sample > 1 << 30) refuse("the number of the first sample must be 0 to 2^30");
    if (!(s.albedo >= 0 && s.albedo <= 1)) refuse("the albedo must be between 0 and 1");
    if (!(std::abs(s.anisotropy) <= 0.9999)) refuse("the anisotropy must be between -0.9999 and 0.9999");
    if (s.light_direction) {
        Vec3 const v = *s.light_direction;
        double const squared = v.x * v.x + v.y * v.y + v.z * v.z;
        if (!(squared > 0) || !std::isfinite(squared))
            refuse("the direction of the light must be finite and not 0,0,0");
    }
    if (!(s.ambient >= 0 && s.ambient <= 1)) refuse("the ambient light must be between 0 and 1");
    if (!(s.specular >= 0 && s.specular <= 1)) refuse("the specular light must be between 0 and 1");
    if (s.shadows && !s.light_direction)
        refuse("--shadows needs a light that is not at the camera, which throws none", "give --light-direction X,Y,Z");
    auto const positive = [](double v) { return v >= 0 && std::isfinite(v); };
    if (!positive(s.goal.noise) || !positive(s.goal.tolerance) || !positive(s.goal.seconds))
        refuse("errors to stop at and seconds must be positive");
    if (!positive(s.shortcut)) refuse("--leave-out must be a finite number, 0 or greater");
    if (s.parts < 1 || s.part < 1 || s.part > s.parts) refuse(text("there is no part ", s.part, " of ", s.parts));
    if (int const strips = (s.height + tile_side - 1) / tile_side; s.parts > strips)
        refuse(text("a picture of ", s.height, " rows has at most ", strips, strips == 1 ? " part, of " : " parts, of ",
                    tile_side, " rows each"));
    if (s.parts > 1 && (s.goal.tolerance > 0 || s.goal.seconds > 0))
        refuse("with --tolerance or --time pixels of all parts have to do with each other",
               "--noise and --step do not have that");
    if (s.ambient_occlusion != 0 && (s.ambient_occlusion < 6 || s.ambient_occlusion > most_ways))
        refuse(text("--ambient-occlusion looks in 6 to ", most_ways, " directions, or in 0"));
    if (!(s.occlusion_radius >= 0) || !std::isfinite(s.occlusion_radius))
        refuse("--occlusion-radius must be 0 or greater");
    if (s.exact && (s.shadows || s.ambient_occlusion > 0)) refuse("--exact has neither shadows nor ambient occlusion");
    if (!std::isfinite(s.environment_rotation)) refuse("--environment-rotation must be finite");
    if (!(s.environment_strength >= 0 && s.environment_strength <= 1e30))
        refuse("--environment-strength must be 0 or greater");
    if (s.clip_planes.size() % 4 != 0 || s.clip_planes.size() > 4 * std::size_t{most_planes})
        refuse(text("--clip-plane takes NX NY NZ D for each of at most ", most_planes, " planes, not ",
                    s.clip_planes.size(), " numbers"));
    for (std::size_t i = 0; i < s.clip_planes.size(); i += 4) {
        double const length = std::hypot(s.clip_planes[i], s.clip_planes[i + 1], s.clip_planes[i + 2]);
        if (!(length > 0) || !std::isfinite(length) || !std::isfinite(s.clip_planes[i + 3]))
            refuse("--clip-plane: a normal must be finite and not 0 0 0, and its distance finite");
    }
    if (s.bounces < 1) refuse("the number of bounces must be at least 1");
    if (s.isos.size() > most_isos) refuse(text("at most ", most_isos, " iso-values can be shown at once"));
    for (double const v : s.isos)
        if (!std::isfinite(v)) refuse("an iso-value is not finite");
    std::size_t const surfaces = std::max<std::size_t>(1, s.isos.size());
    auto const unit_range = [](std::vector<double> const& list) {
        return std::all_of(list.begin(), list.end(), [](double v) { return v >= 0 && v <= 1; });
    };
    if (!s.iso_colors.empty() && (s.iso_colors.size() != 3 * surfaces || !unit_range(s.iso_colors)))
        refuse("--iso-color takes R G B from 0 to 1 for each iso-value");
    if (!s.iso_opacities.empty() && (s.iso_opacities.size() != surfaces || !unit_range(s.iso_opacities)))
        refuse("--iso-opacity takes an opacity from 0 to 1 for each iso-value");
}

} // namespace vkt::render
