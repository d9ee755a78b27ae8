// What settings and finished pictures tell: the options that make the same, how good a picture is, which model drew it.
// SPDX-License-Identifier: MIT
#include "libvkt/render/settings.h"

#include "libvkt/core/collect.h"

#include <cmath>
#include <utility>

namespace vkt::render {

std::vector<OptionWords> options_of(RenderSettings const& s) {
    std::vector<OptionWords> options;
    RenderSettings const plain;
    auto const add = [&](char const* name, std::vector<std::string> values) {
        if (applies(name, s.algorithm)) options.push_back({name, std::move(values)});
    };
    auto const triple = [](Vec3 v) { return text(v.x, ",", v.y, ",", v.z); };
    auto const numbers = [](std::vector<double> const& list) {
        return collect(list, [](double v) { return to_text(v); });
    };
    if (s.algorithm != plain.algorithm) add("render-algo", {enum_name(s.algorithm)});
    if (s.width != plain.width || s.height != plain.height) add("size", {text(s.width, "x", s.height)});

    if (s.transfer) add("transfer", {transfer_to_json(*s.transfer)});
    if (!s.transfer && s.lut.empty() && s.preset) add("preset", {enum_name(*s.preset)});
    if (!s.transfer && !s.lut.empty()) add("rgba-lookup-table", numbers(s.lut));
    if (!s.transfer && s.lut.empty() && !s.colormap.empty()) add("colormap", {s.colormap});
    if (!s.transfer && s.lut.empty() && s.opacity != plain.opacity) add("opacity", {s.opacity});
    if (!s.transfer && s.domain != plain.domain) add("domain", {s.domain});
    if (!s.unit.empty()) add("unit-distance", {s.unit});
    if (s.opacity_scale != 1) add("opacity-scale", {to_text(s.opacity_scale)});
    if (s.labels != plain.labels) add("labels", {enum_name(s.labels)});
    if (s.tree != plain.tree) add("tree", {enum_name(s.tree)});

    CameraRequest const& c = s.camera;
    if (c.eye) add("eye", {triple(*c.eye)});
    if (!c.eye && c.view != plain.camera.view) add("view", {c.view});
    if (!c.eye && c.azimuth) add("azimuth", {to_text(*c.azimuth)});
    if (!c.eye && c.elevation) add("elevation", {to_text(*c.elevation)});
    if (c.target) add("target", {triple(*c.target)});
    if (c.up) add("up", {triple(*c.up)});
    bool const flat = c.projection == Projection::orthographic;
    if (!flat && (c.eye || c.fov != plain.camera.fov)) add("fov", {to_text(c.fov)});
    if (c.zoom != 1) add("zoom", {to_text(c.zoom)});
    if (flat) add("projection", {enum_name(c.projection)});
    if (flat && c.span) add("span", {to_text(*c.span)});
    if (!c.eye && c.fit != plain.camera.fit) add("fit", {enum_name(c.fit)});

    bool const exact = s.exact && s.algorithm == Algorithm::ray_marching;
    if (exact) add("exact", {});
    if (!exact && s.shade >= 0) add("shade", {s.shade == 0 ? "none" : s.shade == 1 ? "gradient" : to_text(s.shade)});
    if (!exact && s.light_direction) add("light-direction", {triple(*s.light_direction)});
    bool const divided = s.algorithm != Algorithm::multi_scattering || s.light_direction;
    if (!exact && divided && s.ambient != ambient_unless_given(s)) add("ambient", {to_text(s.ambient)});
    if (!exact && s.specular != specular_unless_given(s)) add("specular", {to_text(s.specular)});
    if (!exact && s.shadows) add("shadows", {});
    if (!exact && s.ambient_occlusion > 0) add("ambient-occlusion", {to_text(s.ambient_occlusion)});
    if (!exact && s.ambient_occlusion > 0 && s.occlusion_radius > 0)
        add("occlusion-radius", {to_text(s.occlusion_radius)});
    if (!exact && s.step != plain.step) add("step", {to_text(s.step)});
    if (s.goal.tolerance > 0) add("tolerance", {to_text(s.goal.tolerance)});
    if (!exact && s.shortcut != plain.shortcut) add("leave-out", {to_text(s.shortcut)});
    if (s.goal.noise > 0) add("noise", {to_text(s.goal.noise)});
    if (s.goal.seconds > 0) add("time", {to_text(s.goal.seconds)});
    if (!exact && !s.skip) add("no-skip", {});
    if (!s.isos.empty()) add("iso", numbers(s.isos));
    if (!s.iso_colors.empty()) add("iso-color", numbers(s.iso_colors));
    if (!s.iso_opacities.empty()) add("iso-opacity", numbers(s.iso_opacities));
    bool const surfaces = s.algorithm == Algorithm::implicit_iso;
    if (!surfaces && s.samples != plain.samples) add("spp", {to_text(s.samples)});
    if (surfaces && !s.goal.any() && s.edge_rays != plain.edge_rays) add("spp", {to_text(s.edge_rays)});
    if (s.first_sample != 0) add("first-sample", {to_text(s.first_sample)});
    if (s.seed != 0) add("seed", {text(s.seed)});
    if (s.albedo != 1) add("albedo", {to_text(s.albedo)});
    if (s.anisotropy != 0) add("anisotropy", {to_text(s.anisotropy)});
    if (!(s.light == plain.light)) add("light", {text(s.light.red, ",", s.light.green, ",", s.light.blue)});
    if (!exact && !s.environment_file.empty()) {
        add("environment", {s.environment_file});
        if (s.environment_rotation != 0) add("environment-rotation", {to_text(s.environment_rotation)});
        if (s.environment_strength != 1) add("environment-strength", {to_text(s.environment_strength)});
    }
    if (s.emission) add("emission", {});
    if (!s.clip.empty()) add("clip-box", {s.clip.text});
    if (!s.clip_planes.empty()) add("clip-plane", numbers(s.clip_planes));
    return options;
}

std::string quality_text(RenderReport const& r, Goal const& goal) {
    Quality const& q = r.quality;
    std::string const asked = goal.noise > 0       ? text(" (asked ", goal.noise, ")")
                              : goal.tolerance > 0 ? text(" (asked ", goal.tolerance, ")")
                                                   : std::string();
    std::vector<std::string> parts;
    bool const paths = goal.noise > 0 || r.method.find("paths") != std::string::npos;
    if (q.error >= 0)
        parts.push_back(text(paths ? "noise " : "error ", two_digits(q.error), " of 255 levels, in the worst ",
                             paths ? "tile " : "pixel ", two_digits(q.worst), asked));
    if (q.above > 0 && (goal.noise > 0 || goal.tolerance > 0))
        parts.push_back(text(q.above, paths ? " tile" : " pixel", q.above == 1 ? "" : "s", " above"));
    if (goal.any() || (q.stopped && paths))
        parts.push_back(text(std::round(q.rays * 10) / 10, paths ? " paths" : " rays", " a pixel"));
    // Pictures that ended by themselves are the same whenever they are drawn, and say nothing that is not.
    if (goal.any() || q.stopped) parts.push_back(text(two_digits(r.render_seconds), " s"));
    if (q.stopped) parts.push_back("stopped before it was finished");
    if (q.late) parts.push_back("the time was up");
    if (q.undrawn > 0) parts.push_back(text(std::round(q.undrawn * 1000) / 10, "% of the pixels not drawn"));
    return join(parts, ", ");
}

std::vector<std::pair<std::string, std::string>> texts_of(RenderReport const& r, Goal const& goal) {
    std::vector<std::pair<std::string, std::string>> texts{{"Camera", camera_text(r.camera)},
                                                           {"Method", r.method},
                                                           {"Unit distance", to_text(r.unit)},
                                                           {"Transfer function", transfer_to_json(r.transfer)}};
    if (r.paths > 0) {
        texts.emplace_back(samples_keyword, to_text(r.paths));
        auto const last = r.first_path + static_cast<std::int64_t>(std::ceil(r.paths)) - 1;
        texts.emplace_back(paths_keyword, text(r.seed, ":", r.first_path, "-", last));
    }
    std::string quality = quality_text(r, goal);
    if (!quality.empty()) texts.emplace_back("Quality", std::move(quality));
    return texts;
}

std::vector<std::string> remarks_of(RenderReport const& r, Goal const& goal) {
    std::vector<std::string> lines;
    if (r.missing > 0) lines.push_back(text(r.missing, " voxels are not a number and show nothing"));
    if (r.infinite > 0) lines.push_back(text(r.infinite, " voxels are infinite and show as the nearest finite value"));
    lines.insert(lines.end(), r.lossy.begin(), r.lossy.end());
    if (r.quality.stopped)
        lines.push_back(text("interrupted: the picture is what there was: ", quality_text(r, goal)));
    else if (r.quality.above > 0 && !r.quality.late)
        lines.push_back(text("not as good as asked for: ", quality_text(r, goal)));
    return lines;
}

namespace {

/// Where the light on surfaces comes from.
std::string lit_from(RenderSettings const& s) {
    std::string const lamp = s.light_direction ? "from one direction" : "from the camera";
    return !s.environment ? lamp : s.ambient >= 1 ? "from an environment" : text(lamp, " and from an environment");
}

} // namespace

std::vector<std::string> model_text(RenderSettings const& s) {
    std::string model, why;
    switch (s.algorithm) {
    case Algorithm::ray_marching:
        model = s.shade == 0 ? "absorption and emission" : text("absorption and emission, surfaces lit ", lit_from(s));
        if (s.shadows) model += ", with shadows";
        if (s.ambient_occlusion > 0) model += ", with ambient occlusion";
        why = "light that is scattered once or more is not asked for (--render-algo multi-scattering)";
        break;
    case Algorithm::implicit_iso:
        model = text("surfaces, lit ", lit_from(s), s.shadows ? ", with shadows" : "");
        if (s.ambient_occlusion > 0) model += ", with ambient occlusion";
        why = "opacity of the volume itself is not asked for (--render-algo ray-marching)";
        break;
    case Algorithm::multi_scattering:
        model = text("multiple scattering, light ", s.light_direction ? "from one direction and " : "",
                     s.environment ? "from an environment" : "from all around");
        why = s.light_direction ? "one ray towards the light wherever a path is scattered, none where it is not"
              : s.environment
                  ? "one ray towards the light wherever a path is scattered, by the brightness of the picture"
                  : "the light has no direction, so that paths end in it by themselves and no shadow ray is needed";
        break;
    case Algorithm::maximum:
    case Algorithm::minimum:
    case Algorithm::mean:
        model = text(enum_name(s.algorithm), " of the values along each ray, as a colour");
        why = "opacity and light are not asked for (--render-algo ray-marching)";
        break;
    }
    std::string stops;
    if (s.algorithm == Algorithm::multi_scattering)
        stops = s.goal.noise > 0 ? text("paths until the noise is below ", s.goal.noise, " levels in every tile")
                : s.goal.any()   ? text("paths for ", s.goal.seconds, " s")
                                 : text(s.samples, " paths a pixel");
    else
        stops = s.goal.tolerance > 0
                    ? text("rays until the error is below ", s.goal.tolerance, " levels in every pixel")
                : s.goal.any()     ? text("rays for ", s.goal.seconds, " s")
                : smooths_edges(s) ? text("one ray a pixel, through its middle, and ", s.edge_rays,
                                          " at edges, since there is no ", "--tolerance")
                                   : "one ray a pixel, through its middle, since there is no --tolerance";
    return {text("model ", model), text("no heavier model: ", why), text("refinement ", stops)};
}

std::string report_text(RenderReport const& r) {
    auto const rounded = [](double v) { return std::round(v * 10) / 10; };
    return text(r.method, "; ", r.rays, " rays, ", r.samples, " samples, ", rounded(100 * r.skipped), "% of ", r.parts,
                " empty; prepared in ", rounded(1e3 * r.prepare_seconds), " ms, rendered in ",
                rounded(1e3 * r.render_seconds), " ms by ", r.drawn_by,
                r.quality.edges > 0 ? text("; edges in ", rounded(100 * r.quality.edges), "% of the pixels") : "",
                r.quality.error >= 0 ? "; " : "", r.quality.error >= 0 ? quality_text(r, {}) : std::string(),
                r.recognised.empty() ? "" : "; taken for ", r.recognised);
}

} // namespace vkt::render
