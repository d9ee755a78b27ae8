// Views as settings and as the words of a command line.
// SPDX-License-Identifier: MIT
#include "shell/viewer/view.h"

#include "libvkt/core/text.h"
#include "libvkt/render/categories.h"
#include "libvkt/render/colormap.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string_view>
#include <utility>

namespace vkt::shell::viewer {

using render::Algorithm;
using render::OptionWords;
using render::Projection;
using render::RenderSettings;

View initial_view(RenderSettings const& asked) {
    View view;
    view.width = asked.width, view.height = asked.height;
    Look& look = view.look;
    look.algorithm = asked.algorithm;
    look.colormap = asked.colormap;
    look.labels = asked.labels;
    look.step = asked.step, look.exact = asked.exact, look.shade = asked.exact ? -1 : asked.shade;
    look.samples = asked.samples, look.albedo = asked.albedo, look.emission = asked.emission;
    look.unit = asked.unit, look.opacity_scale = asked.opacity_scale;
    look.clip = asked.clip.text;
    look.clip_planes = asked.clip_planes;
    look.light_direction = asked.light_direction, look.shadows = asked.shadows;
    look.ambient = asked.ambient, look.specular = asked.specular;
    look.ambient_occlusion = asked.ambient_occlusion, look.occlusion_radius = asked.occlusion_radius;
    look.environment_rotation = asked.environment_rotation, look.environment_strength = asked.environment_strength;
    return view;
}

RenderSettings settings_of(RenderSettings const& asked, View const& view) {
    RenderSettings s = asked;
    Look const& look = view.look;
    s.width = view.width, s.height = view.height;
    s.algorithm = look.algorithm;
    s.colormap = look.colormap;
    s.labels = look.labels;
    s.exact = look.exact && look.algorithm == Algorithm::ray_marching;
    s.step = look.step;
    s.shade = s.exact ? 0 : look.shade;
    s.samples = look.samples, s.albedo = look.albedo, s.emission = look.emission;
    s.unit = look.unit, s.opacity_scale = look.opacity_scale;
    s.clip.text = look.clip;
    s.clip_planes = look.clip_planes;
    s.light_direction = look.light_direction, s.shadows = look.shadows && look.light_direction && !s.exact;
    s.ambient = look.ambient, s.specular = look.specular;
    s.ambient_occlusion = s.exact ? 0 : look.ambient_occlusion;
    s.occlusion_radius = look.occlusion_radius;
    s.environment_rotation = look.environment_rotation, s.environment_strength = look.environment_strength;
    if (look.transfer) apply(*look.transfer, s);
    if (!look.surfaces.empty()) {
        s.isos.clear(), s.iso_colors.clear(), s.iso_opacities.clear();
        for (Surface const& surface : look.surfaces) {
            s.isos.push_back(surface.value);
            s.iso_opacities.push_back(surface.opacity);
            for (double const c : {surface.color.red, surface.color.green, surface.color.blue})
                s.iso_colors.push_back(c);
        }
        bool const opaque =
            std::all_of(s.iso_opacities.begin(), s.iso_opacities.end(), [](double a) { return a == 1; });
        if (opaque) s.iso_opacities.clear();
    }
    // Whoever edits colours or takes another algorithm wants to see these.
    if (s.labels == render::LabelMode::always && !render::draws_labels(s, {})) s.labels = render::LabelMode::automatic;
    // What has no meaning for an algorithm is not to change its picture, as no option could say it.
    RenderSettings const plain;
    if (!render::applies("opacity", s.algorithm)) {
        s.opacity = plain.opacity, s.unit = plain.unit, s.opacity_scale = plain.opacity_scale;
    }
    if (!render::applies("shade", s.algorithm)) s.shade = plain.shade;
    if (s.algorithm == Algorithm::multi_scattering) {
        s.shadows = false, s.ambient_occlusion = 0, s.specular = plain.specular;
        if (!s.light_direction) s.ambient = plain.ambient;
    }
    if (render::is_projection(s.algorithm)) {
        s.light_direction.reset(), s.shadows = false, s.ambient_occlusion = 0;
        s.ambient = plain.ambient, s.specular = plain.specular;
    }
    if (s.shade == 0 && !render::holds_back_light(s, s.algorithm)) {
        s.light_direction.reset(), s.shadows = false;
        s.ambient = plain.ambient, s.specular = plain.specular;
        s.environment.reset(), s.environment_file.clear();
    }
    // As for options: whoever places a light wants to see it.
    bool const placed =
        s.light_direction || s.environment || s.ambient != plain.ambient || s.specular != plain.specular;
    if (placed && s.shade < 0 && render::applies("shade", s.algorithm)) s.shade = 1;
    if (!view.camera) return s;
    render::CameraRequest request;
    request.eye = view.camera->eye, request.target = view.camera->target, request.up = view.camera->up;
    request.projection = view.camera->projection;
    if (request.projection == Projection::perspective)
        request.fov = rounded_within(view.camera->fov, 1e-9 * view.camera->fov); // which comes from a tangent
    else
        request.span = view.camera->height;
    s.camera = request;
    return s;
}

namespace {

/// Options that exclude or depend on one another: where one changes, all are said anew.
std::vector<std::vector<std::string_view>> const& groups() {
    static std::vector<std::vector<std::string_view>> const all{
        {"size"},
        {"render-algo"},
        {"transfer", "rgba-lookup-table", "colormap", "opacity", "domain", "preset"},
        {"unit-distance"},
        {"opacity-scale"},
        {"labels"},
        {"tree"},
        {"eye", "view", "azimuth", "elevation", "target", "up", "fov", "zoom", "projection", "span", "fit"},
        {"exact", "shade", "step", "no-skip", "shadows", "light-direction", "ambient-occlusion", "occlusion-radius"},
        {"ambient"},
        {"specular"},
        {"iso", "iso-color", "iso-opacity"},
        {"spp"},
        {"first-sample"},
        {"seed"},
        {"albedo"},
        {"anisotropy"},
        {"light"},
        {"environment", "environment-rotation", "environment-strength"},
        {"emission"},
        {"clip-box"},
        {"clip-plane"}};
    return all;
}

bool takes_no_value(std::string_view name) {
    return name == "exact" || name == "no-skip" || name == "emission" || name == "shadows";
}
bool takes_numbers(std::string_view name) {
    return name == "iso" || name == "iso-color" || name == "iso-opacity" || name == "rgba-lookup-table" ||
           name == "clip-plane";
}

std::vector<OptionWords> in_group(std::vector<OptionWords> const& options, std::vector<std::string_view> const& group) {
    std::vector<OptionWords> found;
    for (OptionWords const& o : options)
        if (std::find(group.begin(), group.end(), o.name) != group.end()) found.push_back(o);
    return found;
}

} // namespace

std::vector<std::string> words_of(std::vector<std::string> const& asked_words, RenderSettings const& asked,
                                  View const& view) {
    if (asked_words.empty()) return {}; // no history is wanted
    RenderSettings const shown = settings_of(asked, view);
    std::vector<OptionWords> const before = options_of(asked), now = options_of(shown);
    std::vector<std::string_view> without;
    std::vector<std::string> with;
    for (auto const& group : groups()) {
        std::vector<OptionWords> const said = in_group(now, group);
        if (said == in_group(before, group)) {
            // Said although it is the default, it may still be refused.
            for (std::string_view const name : group)
                if (!render::applies(name, shown.algorithm)) without.push_back(name);
            continue;
        }
        without.insert(without.end(), group.begin(), group.end());
        for (OptionWords const& o : said) {
            with.push_back("--" + o.name);
            with.insert(with.end(), o.values.begin(), o.values.end());
        }
    }
    std::vector<std::string> words{asked_words.front()}, kept;
    for (std::size_t i = 1; i < asked_words.size(); ++i) {
        std::string const& word = asked_words[i];
        bool const option = word.starts_with("--");
        std::string_view const name = option ? std::string_view(word).substr(2) : std::string_view();
        if (!option || std::find(without.begin(), without.end(), name) == without.end()) {
            kept.push_back(word);
            continue;
        }
        if (takes_no_value(name)) continue;
        ++i;
        while (takes_numbers(name) && i + 1 < asked_words.size() && is_number(asked_words[i + 1])) ++i;
    }
    // Inputs come before what takes all numbers that follow; options that are kept stay behind theirs.
    bool const input_first = asked_words.size() > 1 && !asked_words[1].starts_with("--");
    if (input_first) {
        std::size_t inputs = 0;
        while (inputs < kept.size() && !kept[inputs].starts_with("--")) words.push_back(kept[inputs++]);
        kept.erase(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(inputs));
    }
    words.insert(words.end(), with.begin(), with.end());
    words.insert(words.end(), kept.begin(), kept.end());
    return words;
}

void draw_labels(Look& look, render::LabelMode when) {
    look.labels = when;
    if (when != render::LabelMode::always) return;
    look.transfer.reset();
    look.colormap.clear();
    look.surfaces.clear();
}

bool may_draw_labels(RenderSettings const& asked, Look const& look) {
    View view;
    view.width = asked.width, view.height = asked.height, view.look = look;
    draw_labels(view.look, render::LabelMode::always);
    return render::draws_labels(settings_of(asked, view), {});
}

render::ShownLabel const* label_at(std::vector<render::ShownLabel> const& labels, double value) {
    auto const at = std::lower_bound(labels.begin(), labels.end(), value, [](auto const& one, double number) {
        return static_cast<double>(one.label) < number;
    });
    return at != labels.end() && static_cast<double>(at->label) == value ? &*at : nullptr;
}

Algorithm next_projection(Algorithm algorithm) {
    return algorithm == Algorithm::maximum   ? Algorithm::minimum
           : algorithm == Algorithm::minimum ? Algorithm::mean
                                             : Algorithm::maximum;
}

bool has_colormap(RenderSettings const& asked) { return !asked.transfer && asked.lut.empty(); }

std::string next_colormap(std::string const& current, std::string const& asked) {
    std::vector<std::string> names{asked};
    for (std::string const& name : render::colormap_names())
        if (name != asked) names.push_back(name);
    auto const found = std::find(names.begin(), names.end(), current);
    return found == names.end() || found + 1 == names.end() ? names.front() : *(found + 1);
}

namespace {

/// Whether the colours of the edit are those of the function, as far as pictures can show.
bool shows_colors(TransferEdit const& edit, render::TransferFunction const& function) {
    return std::all_of(function.points.begin(), function.points.end(), [&](render::ControlPoint const& p) {
        render::Color const c = color_at(edit, p.value);
        return std::max({std::abs(c.red - p.color.red), std::abs(c.green - p.color.green),
                         std::abs(c.blue - p.color.blue)}) <= 0.5 / 255;
    });
}

} // namespace

TransferEdit editable_transfer(RenderSettings const& asked, Look const& look, render::RenderReport const& report) {
    if (look.transfer) return *look.transfer;
    if (!has_colormap(asked)) return edit_of(report.transfer, "");
    // Which map the renderer has chosen is seen in its colours.
    std::vector<std::string> maps{look.colormap};
    if (look.colormap.empty()) {
        maps = {"tissue", "grey"};
        for (std::string& name : render::colormap_names()) maps.push_back(std::move(name));
    }
    TransferEdit edit = edit_of(report.transfer, maps.front());
    bool found = false;
    for (std::size_t i = 0; i < maps.size() && !found; ++i)
        for (bool const logarithmic : {false, true}) {
            if (found || (logarithmic && !(edit.lower > 0))) continue;
            edit.colormap = maps[i], edit.logarithmic = logarithmic;
            found = shows_colors(edit, report.transfer);
        }
    if (!found) edit = edit_of(report.transfer, "");
    // A projection has no opacities: all of them 1 would hide the volume from whoever goes back to one that has.
    if (render::is_projection(look.algorithm)) edit.knots = {{edit.lower, 0}, {edit.upper, 0.3}};
    return edit;
}

std::vector<Surface> editable_surfaces(Look const& look, render::RenderReport const& report) {
    if (!look.surfaces.empty()) return look.surfaces;
    std::vector<Surface> surfaces;
    if (report.transfer.points.empty()) return surfaces;
    TransferEdit const colors = edit_of(report.transfer, "");
    for (double const value : report.isos) surfaces.push_back({value, color_at(colors, value), 1});
    return surfaces;
}

std::string clip_text(Shares const& shares, Index3 dims) {
    std::string text_of;
    bool all = true;
    for (int axis = 0; axis < 3; ++axis) {
        auto const extent = static_cast<double>(dims[axis]);
        auto const& share = shares[static_cast<std::size_t>(axis)];
        std::int64_t const lower =
            std::clamp<std::int64_t>(static_cast<std::int64_t>(std::lround(share[0] * extent)), 0, dims[axis] - 1);
        std::int64_t const upper =
            std::clamp<std::int64_t>(static_cast<std::int64_t>(std::lround(share[1] * extent)), lower + 1, dims[axis]);
        bool const whole = lower == 0 && upper == dims[axis];
        all = all && whole;
        text_of += text(axis == 0 ? "" : ",", whole ? ":" : text(lower, ":", upper));
    }
    return all ? "" : text_of;
}

Shares clip_shares(std::string const& clip, Index3 dims) {
    Shares shares{{{0, 1}, {0, 1}, {0, 1}}};
    if (clip.empty()) return shares;
    Box const box = Roi{clip, "--clip-box"}.resolve(dims);
    for (int axis = 0; axis < 3; ++axis)
        shares[static_cast<std::size_t>(axis)] = {
            static_cast<double>(box.lower[axis]) / static_cast<double>(dims[axis]),
            static_cast<double>(box.upper[axis]) / static_cast<double>(dims[axis])};
    return shares;
}

Angles angles_of(Vec3 v) {
    constexpr double degrees = 180 / std::numbers::pi;
    double const across = std::hypot(v.x, v.y);
    return {across > 0 ? std::atan2(v.x, -v.y) * degrees : 0, std::atan2(v.z, across) * degrees};
}

namespace {

/// So that commands stay short.
double rounded(double v) { return std::round(v * 1e6) / 1e6 + 0.0; }

} // namespace

Vec3 direction_of(Angles const& angles) {
    constexpr double radians = std::numbers::pi / 180;
    double const a = angles.azimuth * radians, e = angles.elevation * radians;
    return {rounded(std::sin(a) * std::cos(e)), rounded(-std::cos(a) * std::cos(e)), rounded(std::sin(e))};
}

std::array<double, 2> plane_distances(Vec3 normal, Header const& header) {
    std::array<double, 2> ends{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
    for (Vec3 const& corner : render::corners_of(header.geometry, box_of(header.dims))) {
        double const at = normal.x * corner.x + normal.y * corner.y + normal.z * corner.z;
        ends = {std::min(ends[0], at), std::max(ends[1], at)};
    }
    return ends;
}

double diagonal_of(Header const& header) {
    auto const corners = render::corners_of(header.geometry, box_of(header.dims));
    double longest = 0;
    for (Vec3 const& a : corners)
        for (Vec3 const& b : corners) {
            Vec3 const d = a - b;
            longest = std::max(longest, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
        }
    return longest;
}

std::array<double, 4> plane_facing(render::Camera const& camera, Header const& header) {
    Vec3 const normal = direction_of(angles_of(camera.target - camera.eye));
    auto const [least, greatest] = plane_distances(normal, header);
    // Six digits of what it may be: worlds may be as small as crystals.
    double const unit = std::pow(10.0, std::ceil(std::log10(greatest - least)));
    return {normal.x, normal.y, normal.z, rounded(std::midpoint(least, greatest) / unit) * unit};
}

} // namespace vkt::shell::viewer
